//! Inference by ONNX Runtime, whose shared library is loaded while the program runs.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use ort::environment::Environment;
use ort::session::{HasSelectedOutputs, OutputSelector, RunOptions, Session};
use ort::value::{TensorRef, ValueType};

use super::network::{Loaded, Network, Refusal, Settings, fill};
use crate::features::FeatureMap;
use crate::params::Inference;

/// The environment variable that names the library.
const LIBRARY_VARIABLE: &str = "ORT_DYLIB_PATH";

/// The library, loaded once for the whole program.
#[derive(Clone)]
pub(super) struct Runtime {
    library: PathBuf,
    environment: Environment,
}

static RUNTIME: Mutex<Option<Runtime>> = Mutex::new(None);

/// The runtime that the settings ask for; or why the built-in library does the work. An error where one is named, by
/// parameter or environment, that cannot be used.
pub(super) fn find(settings: &Settings) -> Result<Result<Runtime, String>, String> {
    if settings.inference == Inference::Builtin {
        return Ok(Err("as asked for".to_owned()));
    }
    let variable = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
    let named = settings.library.clone().or(variable);
    let must = named.is_some() || settings.inference == Inference::OnnxRuntime;
    let library = named.unwrap_or_else(|| system_name().into());
    match open(&library) {
        Ok(runtime) => Ok(Ok(runtime)),
        Err(why) if must => Err(why),
        Err(_) => Ok(Err("no ONNX Runtime was found".to_owned())),
    }
}

/// What the system's linker knows the library by.
fn system_name() -> String {
    format!("{}onnxruntime{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX)
}

fn open(library: &Path) -> Result<Runtime, String> {
    let mut runtime = RUNTIME.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(runtime) = &*runtime {
        return if runtime.library == library {
            Ok(runtime.clone())
        } else {
            Err(format!(
                "{} is in use already, {} can be only after a restart",
                runtime.library.display(),
                library.display()
            ))
        };
    }
    let builder = ort::init_from(library).map_err(|error| error.to_string())?;
    let environment = builder.with_telemetry(false).build().map_err(|error| error.to_string())?;
    Ok(runtime.insert(Runtime { library: library.to_owned(), environment }).clone())
}

struct OnnxRuntime {
    session: Session,
    input: Vec<Option<usize>>,
    outputs: Vec<String>,
    options: RunOptions<HasSelectedOutputs>,
}

impl Runtime {
    /// Its name in log lines.
    pub(super) fn name(&self) -> String {
        format!("ONNX Runtime, {}", self.library.display())
    }

    /// Loads a model.
    pub(super) fn load(&self, model: &[u8], outputs: &[String], threads: usize) -> Result<Loaded, Refusal> {
        let format = |error: ort::Error| Refusal::Format(error.to_string());
        let session = Session::builder(&self.environment)
            .and_then(|builder| Ok(builder.with_intra_threads(threads)?))
            .and_then(|mut builder| builder.commit_from_memory(model))
            .map_err(format)?;
        let [input] = session.inputs() else { return Err(Refusal::Inputs(session.inputs().len())) };
        let input = match input.dtype() {
            ValueType::Tensor { shape, .. } => shape.iter().map(|&side| usize::try_from(side).ok()).collect(),
            _ => Vec::new(),
        };
        let known: Vec<String> = session.outputs().iter().map(|output| output.name().to_owned()).collect();
        if let Some(name) = outputs.iter().find(|name| !known.contains(name)) {
            return Err(Refusal::Output { name: name.clone(), known });
        }
        let selector = outputs.iter().fold(OutputSelector::no_default(), |selector, name| selector.with(name));
        let options = RunOptions::new().map_err(format)?.with_outputs(selector);
        Ok(Box::new(OnnxRuntime { session, input, outputs: outputs.to_vec(), options }))
    }
}

impl Network for OnnxRuntime {
    fn input(&self) -> Vec<Option<usize>> {
        self.input.clone()
    }

    fn run(&mut self, image: &[f32], side: usize, maps: &mut [FeatureMap]) -> Result<(), String> {
        let image = TensorRef::from_array_view(([1, 3, side, side], image)).map_err(|error| error.to_string())?;
        let values =
            self.session.run_with_options(ort::inputs![image], &self.options).map_err(|error| error.to_string())?;
        for (name, map) in self.outputs.iter().zip(maps) {
            let (shape, data) = values[name.as_str()].try_extract_tensor::<f32>().map_err(|error| error.to_string())?;
            fill(map, shape.iter().map(|&side| side as usize), data)?;
        }
        Ok(())
    }
}
