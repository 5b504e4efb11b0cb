//! What a network must be, and how it is loaded and checked.

use std::borrow::Cow;
use std::path::PathBuf;

use super::builtin;
use crate::error::NetworkError;
use crate::features::FeatureMap;
use crate::file::{self, FileError};
use crate::params::{ChannelOrder, Inference, LcmhtCnn};

/// The embedded network: see `assets/make_lite0.py`.
pub(super) const EMBEDDED: &[u8] = include_bytes!("../../../assets/lite0.onnx");

/// What a network is loaded by.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The ONNX file; `None` is the embedded network.
    pub file: Option<PathBuf>,
    /// Bytes that the file may have.
    pub most: u64,
    /// Rows and columns of the input.
    pub side: usize,
    /// What is taken from the intensities (0 to 255), by input channel.
    pub mean: [f32; 3],
    /// What they are divided by then.
    pub scale: [f32; 3],
    /// Whether the input's channels are blue, green, red instead of red, green, blue.
    pub bgr: bool,
    /// Names of the outputs to use.
    pub outputs: Vec<String>,
    /// What runs it.
    pub inference: Inference,
    /// ONNX Runtime's library; `None` looks where [`Inference`] says.
    pub library: Option<PathBuf>,
    /// Threads of a run.
    pub threads: usize,
}

impl Settings {
    /// Of the parameters, which have been checked to fit each other, with a file of `most` bytes.
    pub fn new(params: &LcmhtCnn, most: u64) -> Self {
        let path = |text: &str| (!text.is_empty()).then(|| PathBuf::from(text));
        let three = |values: &[f64]| std::array::from_fn(|i| values[i] as f32);
        Self {
            file: path(&params.file),
            most,
            side: params.side as usize,
            mean: three(&params.mean),
            scale: three(&params.scale),
            bgr: params.order == ChannelOrder::Bgr,
            outputs: params.outputs.clone(),
            inference: params.inference,
            library: path(&params.library),
            threads: params.threads as usize,
        }
    }

    /// The network's name in messages.
    pub fn name(&self) -> String {
        self.file.as_ref().map_or("embedded".to_owned(), |file| file.display().to_string())
    }
}

/// A network that a back end has loaded.
pub(super) trait Network: Send {
    /// The declared shape of the input; `None` for a side that is free. Empty where nothing is declared.
    fn input(&self) -> Vec<Option<usize>>;

    /// Runs an image, `1 x 3 x side x side`, and fills the map of each output that was asked for; or says why not.
    fn run(&mut self, image: &[f32], side: usize, maps: &mut [FeatureMap]) -> Result<(), String>;
}

/// The bytes of a file.
pub(super) type Model = Cow<'static, [u8]>;
pub(super) type Loaded = Box<dyn Network>;

/// Why a back end does not load a network.
pub(super) enum Refusal {
    /// The back end itself is not to be had.
    Runtime(String),
    /// It is no network it can run.
    Format(String),
    /// It has no such output, but these.
    Output { name: String, known: Vec<String> },
    /// It takes so many inputs.
    Inputs(usize),
}

/// Loads the network, checks its input and outputs, and runs it once on `image`.
pub(super) fn load(settings: &Settings, image: &[f32], maps: &mut [FeatureMap]) -> Result<Loaded, NetworkError> {
    let name = settings.name();
    let model = match &settings.file {
        Some(path) => match file::read(path, settings.most) {
            Ok(bytes) => bytes.into(),
            Err(FileError::TooLarge { len, most }) => return Err(NetworkError::TooLarge { file: name, len, most }),
            Err(error) => return Err(NetworkError::Unreadable { file: name, why: error.to_string() }),
        },
        None => EMBEDDED.into(),
    };
    let mut network = run_by(settings, model).map_err(|refusal| refused(refusal, &name, settings.side))?;
    let declared = network.input();
    let wanted = [1, 3, settings.side, settings.side];
    let fits = declared.is_empty()
        || declared.len() == wanted.len() && declared.iter().zip(wanted).all(|(d, w)| d.is_none_or(|d| d == w));
    if !fits {
        let side = |d: &Option<usize>| d.map_or("?".to_owned(), |d| d.to_string());
        let got = declared.iter().map(side).collect::<Vec<_>>().join(" x ");
        return Err(NetworkError::Input { file: name, got, side: settings.side });
    }
    network.run(image, settings.side, maps).map_err(|why| refused(Refusal::Format(why), &name, settings.side))?;
    for (output, map) in settings.outputs.iter().zip(maps) {
        if map.data.iter().any(|v| !v.is_finite()) {
            return Err(NetworkError::NotFinite { file: name, name: output.clone() });
        }
    }
    Ok(network)
}

/// Lets a back end load the model, and says which in one log line.
fn run_by(settings: &Settings, model: Model) -> Result<Loaded, Refusal> {
    let Settings { outputs, threads, side, .. } = settings;
    let say = |by: &str| log::info!("network {} at {side} x {side} runs by {by}", settings.name());
    #[cfg(feature = "onnxruntime")]
    match super::onnxruntime::find(settings).map_err(Refusal::Runtime)? {
        Ok(runtime) => {
            say(&runtime.name());
            return runtime.load(&model, outputs, *threads);
        }
        Err(why) => say(&format!("{}, {why}", builtin::NAME)),
    }
    #[cfg(not(feature = "onnxruntime"))]
    if settings.inference == Inference::OnnxRuntime {
        return Err(Refusal::Runtime("this program was built without it".to_owned()));
    } else {
        say(builtin::NAME);
    }
    builtin::load(model, outputs, *threads)
}

fn refused(refusal: Refusal, file: &str, side: usize) -> NetworkError {
    let file = file.to_owned();
    match refusal {
        Refusal::Runtime(why) => NetworkError::Runtime { why },
        Refusal::Format(why) => NetworkError::Format { file, why: why.replace('\n', " ") },
        Refusal::Output { name, known } => NetworkError::Output { file, name, known: known.join(", ") },
        Refusal::Inputs(count) => NetworkError::Input { file, got: format!("{count} inputs"), side },
    }
}

/// Takes on what an output of shape `1 x channels x rows x columns` holds, or says what is wrong with its shape.
pub(super) fn fill(
    map: &mut FeatureMap,
    shape: impl ExactSizeIterator<Item = usize>,
    data: &[f32],
) -> Result<(), String> {
    let (sides, mut known) = (shape.len(), [0; 4]);
    known.iter_mut().zip(shape).for_each(|(known, side)| *known = side);
    match known {
        [1, channels, rows, cols] if sides == known.len() && !data.is_empty() => {
            map.resize(rows, cols, channels);
            map.data.copy_from_slice(data);
            Ok(())
        }
        _ => Err(format!("an output has {sides} sides, {known:?}, expected [1, channels, rows, columns]")),
    }
}
