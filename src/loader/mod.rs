//! Networks as the parameters ask for them: read from their files, given to the library that is to run them, checked,
//! and told to the log. Whoever drives a [`Session`] loads here and hands the network in; loading takes up to seconds.
//!
//! | file | what it holds |
//! |---|---|
//! | `onnxruntime.rs` | where ONNX Runtime's shared library is, and its opening |

#[cfg(feature = "onnxruntime")]
mod onnxruntime;

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use log::{error, info};
#[cfg(feature = "onnxruntime")]
use onnxruntime::Found;

use crate::error::NetworkError;
use crate::file::{self, FileError};
use crate::network::{Cnn, Engine, Model, NetworkSettings, SharedCnn};
use crate::params::{Algorithm, ChannelOrder, Inference, LcmhtCnn, Params};
use crate::session::Session;

/// The embedded network: see `assets/make_lite0.py`.
pub(crate) const EMBEDDED: &[u8] = include_bytes!("../../assets/lite0.onnx");
/// The built-in library's name in log lines.
const BUILTIN: &str = "tract";

/// What a network is loaded by.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// The ONNX file; `None` is the embedded network.
    pub file: Option<PathBuf>,
    /// Bytes that the file may have.
    pub most: u64,
    /// What runs it.
    pub inference: Inference,
    /// ONNX Runtime's library; `None` looks where [`Inference`] says.
    pub library: Option<PathBuf>,
    /// What it is given, and what is wanted of it.
    pub settings: NetworkSettings,
}

impl Request {
    /// For the network of these parameters, which have been checked to fit each other, with a file of `most` bytes.
    pub fn new(params: &LcmhtCnn, most: u64) -> Self {
        let path = |text: &str| (!text.is_empty()).then(|| PathBuf::from(text));
        let three = |values: &[f64]| std::array::from_fn(|i| values[i] as f32);
        Self {
            file: path(&params.file),
            most,
            inference: params.inference,
            library: path(&params.library),
            settings: NetworkSettings {
                side: params.side as usize,
                mean: three(&params.mean),
                scale: three(&params.scale),
                bgr: params.order == ChannelOrder::Bgr,
                outputs: params.outputs.clone(),
                threads: params.threads as usize,
            },
        }
    }

    /// For the network that the parameters ask for, if they do.
    pub fn of(params: &Params) -> Option<Self> {
        let is_wanted = params.general.algorithm == Algorithm::Lcmht && params.lcmht.cnn.enabled;
        is_wanted.then(|| Self::new(&params.lcmht.cnn, params.limits.file_bytes()))
    }

    /// Loads the network and tries it out; one log line says what runs it.
    ///
    /// # Errors
    /// The file cannot be read, is no such network, or what is to run it is not to be had.
    pub fn load(&self) -> Result<Cnn, NetworkError> {
        let name = self.name();
        let model = self.model(&name)?;
        let (engine, by) = self.engine()?;
        let side = self.settings.side;
        info!("network {name} at {side} x {side} runs by {by}");
        Cnn::new(&name, model, self.settings.clone(), &engine)
    }

    /// The network's name in messages.
    fn name(&self) -> String {
        self.file.as_ref().map_or("embedded".to_owned(), |file| file.display().to_string())
    }

    fn model(&self, name: &str) -> Result<Model, NetworkError> {
        let Some(path) = &self.file else { return Ok(EMBEDDED.into()) };
        let file = name.to_owned();
        file::read(path, self.most).map(Model::from).map_err(|error| match error {
            FileError::TooLarge { len, most } => NetworkError::TooLarge { file, len, most },
            error => NetworkError::Unreadable { file, why: error.to_string() },
        })
    }

    /// What is to run it, and its name in log lines.
    fn engine(&self) -> Result<(Engine, String), NetworkError> {
        #[cfg(feature = "onnxruntime")]
        {
            let found = onnxruntime::find(self.inference, self.library.as_deref());
            Ok(match found.map_err(|error| NetworkError::Runtime { why: error.to_string() })? {
                Found::Library { runtime, path } => {
                    (Engine::OnnxRuntime(runtime), format!("ONNX Runtime, {}", path.display()))
                }
                Found::Unwanted => (Engine::Builtin, format!("{BUILTIN}, as asked for")),
                Found::Nothing => (Engine::Builtin, format!("{BUILTIN}, no ONNX Runtime was found")),
            })
        }
        #[cfg(not(feature = "onnxruntime"))]
        if self.inference == Inference::OnnxRuntime {
            Err(NetworkError::Runtime { why: "this program was built without it".to_owned() })
        } else {
            Ok((Engine::Builtin, BUILTIN.to_owned()))
        }
    }
}

/// The network that a set of parameters asks for, ready to run; none where they ask for none.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    request: Option<Request>,
    network: Option<SharedCnn>,
}

impl Loaded {
    /// Loads what the parameters ask for.
    ///
    /// # Errors
    /// As [`Request::load`].
    pub fn new(params: &Params) -> Result<Self, NetworkError> {
        let request = Request::of(params);
        let network = request.as_ref().map(Request::load).transpose()?;
        Ok(Self { request, network: network.map(|cnn| Arc::new(Mutex::new(cnn))) })
    }

    /// Whether it is what these parameters ask for.
    pub fn suits(&self, params: &Params) -> bool {
        self.request == Request::of(params)
    }

    /// The network, to be handed to a session.
    pub fn network(&self) -> Option<SharedCnn> {
        self.network.clone()
    }
}

/// A session with the network that its parameters ask for, loaded here.
impl Session {
    /// A session that waits for a mark or, where the tracker finds targets by itself, for frames; or why a file that
    /// the parameters name cannot be used.
    ///
    /// # Errors
    /// As [`Request::load`].
    pub fn new(params: Params) -> Result<Self, NetworkError> {
        let loaded = Loaded::new(&params)?;
        Ok(Self::with_network(params, loaded.network()))
    }
}

/// Tells the log of runs of a session's network that fail: the first of several in a row.
#[derive(Debug, Default)]
pub struct FailureLog {
    is_failing: bool,
}

impl FailureLog {
    /// To be called after each step.
    pub fn watch(&mut self, session: &Session) {
        let failure = session.network_failure();
        let was_failing = std::mem::replace(&mut self.is_failing, failure.is_some());
        if let Some(failure) = failure.filter(|_| !was_failing) {
            error!("{failure}");
        }
    }
}
