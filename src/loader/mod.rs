//! Networks as the parameters ask for them: read from their files, given to the library that is to run them, checked,
//! and told to the log. Whoever drives a [`Session`] loads here and hands the network in; loading takes up to seconds.
//!
//! | file | what it holds |
//! |---|---|
//! | `onnxruntime.rs` | where ONNX Runtime's shared library is, and its opening |

#[cfg(feature = "onnxruntime")]
mod onnxruntime;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use log::{error, info};
#[cfg(feature = "onnxruntime")]
use onnxruntime::Found;

use crate::error::NetworkError;
use crate::file::{self, FileError};
use crate::network::{
    Cnn, Engine, MatchingNetwork, Model, NetworkSettings, Networks, SharedCnn, TRUNK_OUTPUTS, TRUNK_SIDE,
};
use crate::params::{Algorithm, ChannelOrder, Inference, LcmhtCnn, Params};
use crate::session::Session;

/// The embedded network: see `assets/make_lite0.py`.
pub(crate) const EMBEDDED: &[u8] = include_bytes!("../../assets/lite0.onnx");
/// The embedded head that finds a template in a window: see `assets/train_matching.py`.
const HEAD: &[u8] = include_bytes!("../../assets/matching.onnx");
/// What messages call both.
const EMBEDDED_NAME: &str = "embedded";
/// What is taken from the intensities of the embedded network's input, and what they are divided by.
const EMBEDDED_MEAN: [f32; 3] = [127.0; 3];
const EMBEDDED_SCALE: [f32; 3] = [128.0; 3];
/// The built-in library's name in log lines.
const BUILTIN: &str = "RTen";

/// What runs a network, as it is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Runner {
    /// Which library.
    pub inference: Inference,
    /// ONNX Runtime's library; `None` looks where [`Inference`] says.
    pub library: Option<PathBuf>,
}

/// What a network whose outputs become layers is loaded by.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// The ONNX file; `None` is the embedded network.
    pub file: Option<PathBuf>,
    /// Bytes that the file may have.
    pub most: u64,
    /// What runs it.
    pub runner: Runner,
    /// What it is given, and what is wanted of it.
    pub settings: NetworkSettings,
}

/// What the pair of networks that finds the marked target is loaded by.
#[derive(Clone, Debug, PartialEq)]
pub struct MatchingRequest {
    /// The ONNX files of backbone and head; `None` is the embedded head on the embedded network.
    pub files: Option<[PathBuf; 2]>,
    /// Bytes that each file may have.
    pub most: u64,
    /// What runs them.
    pub runner: Runner,
    /// Threads of a run.
    pub threads: usize,
}

impl Runner {
    fn new(params: &LcmhtCnn) -> Self {
        Self { inference: params.inference, library: path(&params.library) }
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
                Found::Unwanted => (Engine::Builtin, format!("{BUILTIN}, as configured")),
                Found::Nothing => (Engine::Builtin, format!("{BUILTIN}, ONNX Runtime was not found")),
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

impl Request {
    /// For the network of these parameters, which have been checked to fit each other, with a file of `most` bytes.
    pub fn new(params: &LcmhtCnn, most: u64) -> Self {
        let three = |values: &[f64]| std::array::from_fn(|i| values[i] as f32);
        Self {
            file: path(&params.file),
            most,
            runner: Runner::new(params),
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
        let name = self.file.as_ref().map_or(EMBEDDED_NAME.to_owned(), |file| file.display().to_string());
        let model = match &self.file {
            Some(path) => read(path, self.most)?,
            None => EMBEDDED.into(),
        };
        let (engine, by) = self.runner.engine()?;
        let side = self.settings.side;
        info!("network {name} at {side} x {side} runs on {by}");
        Cnn::new(&name, model, self.settings.clone(), &engine)
    }

    /// Whether the embedded head can work on the maps of this network.
    fn suits_head(&self) -> bool {
        let NetworkSettings { side, mean, scale, bgr, outputs, .. } = &self.settings;
        let has = |output: &&str| outputs.iter().any(|known| known == output);
        self.file.is_none()
            && (*side, *mean, *scale, *bgr) == (TRUNK_SIDE, EMBEDDED_MEAN, EMBEDDED_SCALE, false)
            && TRUNK_OUTPUTS.iter().all(has)
    }
}

impl MatchingRequest {
    /// For the networks that the parameters ask for, if they do.
    pub fn of(params: &Params) -> Option<Self> {
        let matching = &params.lcmht.matching;
        let is_wanted = params.general.algorithm == Algorithm::Lcmht && matching.enabled;
        let files = [&matching.backbone, &matching.head].map(PathBuf::from);
        is_wanted.then(|| Self {
            files: files.iter().any(|file| !file.as_os_str().is_empty()).then_some(files),
            most: params.limits.file_bytes(),
            runner: Runner::new(&params.lcmht.cnn),
            threads: params.lcmht.cnn.threads as usize,
        })
    }

    /// Loads the networks and tries them out; one log line says what runs them. The embedded head works on `cnn` where
    /// that was loaded by a request that suits it.
    ///
    /// # Errors
    /// A file cannot be read, they are no such networks, or what is to run them is not to be had.
    pub fn load(&self, cnn: Option<(&Request, &SharedCnn)>) -> Result<MatchingNetwork, NetworkError> {
        match &self.files {
            Some(files) => self.load_pair(files),
            None => self.load_head(cnn),
        }
    }

    fn load_pair(&self, files: &[PathBuf; 2]) -> Result<MatchingNetwork, NetworkError> {
        if let Some(part) = ["backbone", "head"].iter().zip(files).find(|(_, file)| file.as_os_str().is_empty()) {
            return Err(NetworkError::Unnamed { parameter: format!("lcmht.matching.{}", part.0) });
        }
        let [backbone, head] = files.each_ref().map(|file| file.display().to_string());
        let models = [read(&files[0], self.most)?, read(&files[1], self.most)?];
        let (engine, by) = self.runner.engine()?;
        let network = MatchingNetwork::new([&backbone, &head], models, self.threads, &engine)?;
        let side = network.form().window;
        info!("matching networks {backbone} and {head} at {side} x {side} run on {by}");
        Ok(network)
    }

    fn load_head(&self, cnn: Option<(&Request, &SharedCnn)>) -> Result<MatchingNetwork, NetworkError> {
        let trunk = match cnn {
            Some((request, cnn)) if request.suits_head() => cnn.clone(),
            _ => Arc::new(Mutex::new(self.trunk().load()?)),
        };
        let (engine, by) = self.runner.engine()?;
        info!("matching head {EMBEDDED_NAME} runs on {by}");
        MatchingNetwork::on_trunk(EMBEDDED_NAME, trunk, HEAD.into(), self.threads, &engine)
    }

    /// The embedded network for the head alone.
    fn trunk(&self) -> Request {
        Request {
            file: None,
            most: self.most,
            runner: self.runner.clone(),
            settings: NetworkSettings {
                side: TRUNK_SIDE,
                mean: EMBEDDED_MEAN,
                scale: EMBEDDED_SCALE,
                bgr: false,
                outputs: TRUNK_OUTPUTS.map(str::to_owned).to_vec(),
                threads: self.threads,
            },
        }
    }
}

fn path(text: &str) -> Option<PathBuf> {
    (!text.is_empty()).then(|| PathBuf::from(text))
}

fn read(path: &Path, most: u64) -> Result<Model, NetworkError> {
    let file = path.display().to_string();
    file::read(path, most).map(Model::from).map_err(|error| match error {
        FileError::TooLarge { len, most } => NetworkError::TooLarge { file, len, most },
        error => NetworkError::Unreadable { file, why: error.to_string() },
    })
}

/// The networks that a set of parameters asks for, ready to run.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    cnn: Option<Request>,
    matching: Option<MatchingRequest>,
    networks: Networks,
}

impl Loaded {
    /// Loads what the parameters ask for.
    ///
    /// # Errors
    /// As [`Request::load`] and [`MatchingRequest::load`].
    pub fn new(params: &Params) -> Result<Self, NetworkError> {
        let (cnn, matching) = (Request::of(params), MatchingRequest::of(params));
        let shared_cnn = cnn.as_ref().map(Request::load).transpose()?.map(|cnn| Arc::new(Mutex::new(cnn)));
        let found = matching.as_ref().map(|matching| matching.load(cnn.as_ref().zip(shared_cnn.as_ref())));
        let networks =
            Networks { cnn: shared_cnn, matching: found.transpose()?.map(|found| Arc::new(Mutex::new(found))) };
        Ok(Self { cnn, matching, networks })
    }

    /// Whether it is what these parameters ask for.
    pub fn suits(&self, params: &Params) -> bool {
        self.cnn == Request::of(params) && self.matching == MatchingRequest::of(params)
    }

    /// The networks, to be handed to a session.
    pub fn networks(&self) -> Networks {
        self.networks.clone()
    }
}

/// A session with the networks that its parameters ask for, loaded here.
impl Session {
    /// A session that waits for a mark or, where the tracker finds targets by itself, for frames; or why a file that
    /// the parameters name cannot be used.
    ///
    /// # Errors
    /// As [`Loaded::new`].
    pub fn new(params: Params) -> Result<Self, NetworkError> {
        let loaded = Loaded::new(&params)?;
        Ok(Self::with_networks(params, loaded.networks()))
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
