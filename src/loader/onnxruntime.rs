//! Where ONNX Runtime's shared library is, and its opening: once, for the whole program.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::network::Runtime;
use crate::params::Inference;

/// The environment variable that names the library.
const LIBRARY_VARIABLE: &str = "ORT_DYLIB_PATH";

/// The library in use. Another one can be only after a restart: the first stays in the process.
static IN_USE: Mutex<Option<(PathBuf, Runtime)>> = Mutex::new(None);

/// What there is to run networks.
pub(super) enum Found {
    /// ONNX Runtime, by its library.
    Library { runtime: Runtime, path: PathBuf },
    /// The built-in library is asked for, and nothing was looked for.
    Unwanted,
    /// No ONNX Runtime, nor was one named.
    Nothing,
}

/// Why a library that was asked for cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum OpenError {
    /// Another one was opened before.
    #[error("{} is already in use, {} can be used only after a restart", used.display(), wanted.display())]
    InUse { used: PathBuf, wanted: PathBuf },
    /// It is not there, or not ONNX Runtime.
    #[error(transparent)]
    Load(#[from] ort::LoadDynamicError),
    /// It does not start.
    #[error(transparent)]
    Start(#[from] ort::Error),
}

/// The runtime that is asked for, or why there is none. An error where one is named, by parameter or environment, that
/// cannot be used.
pub(super) fn find(inference: Inference, library: Option<&Path>) -> Result<Found, OpenError> {
    if inference == Inference::Builtin {
        return Ok(Found::Unwanted);
    }
    let variable = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
    let named = library.map(Path::to_owned).or(variable);
    let must = named.is_some() || inference == Inference::OnnxRuntime;
    let path = named.unwrap_or_else(|| system_name().into());
    match open(&path) {
        Ok(runtime) => Ok(Found::Library { runtime, path }),
        Err(why) if must => Err(why),
        Err(_) => Ok(Found::Nothing),
    }
}

/// What the system's linker knows the library by.
fn system_name() -> String {
    format!("{}onnxruntime{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX)
}

fn open(library: &Path) -> Result<Runtime, OpenError> {
    let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((path, runtime)) = &*in_use {
        return if path == library {
            Ok(runtime.clone())
        } else {
            Err(OpenError::InUse { used: path.clone(), wanted: library.to_owned() })
        };
    }
    let environment = ort::init_from(library)?.with_telemetry(false).build()?;
    let runtime = Runtime::new(environment);
    *in_use = Some((library.to_owned(), runtime.clone()));
    Ok(runtime)
}
