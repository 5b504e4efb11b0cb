//! Where ONNX Runtime's shared library is, and its opening: once, for the whole program.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::network::Runtime;
use crate::params::Inference;

/// The environment variable that names the library.
const LIBRARY_VARIABLE: &str = "ORT_DYLIB_PATH";

/// The library in use. Another one can be only after a restart: the first stays in the process.
static IN_USE: Mutex<Option<(PathBuf, Runtime)>> = Mutex::new(None);

/// The runtime that is asked for, with its name in log lines; or why the built-in library does the work. An error where
/// one is named, by parameter or environment, that cannot be used.
pub(super) fn find(inference: Inference, library: Option<&Path>) -> Result<Result<(Runtime, String), String>, String> {
    if inference == Inference::Builtin {
        return Ok(Err("as asked for".to_owned()));
    }
    let variable = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
    let named = library.map(Path::to_owned).or(variable);
    let must = named.is_some() || inference == Inference::OnnxRuntime;
    let library = named.unwrap_or_else(|| system_name().into());
    match open(&library) {
        Ok(runtime) => Ok(Ok((runtime, format!("ONNX Runtime, {}", library.display())))),
        Err(why) if must => Err(why),
        Err(_) => Ok(Err("no ONNX Runtime was found".to_owned())),
    }
}

/// What the system's linker knows the library by.
fn system_name() -> String {
    format!("{}onnxruntime{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX)
}

fn open(library: &Path) -> Result<Runtime, String> {
    let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((path, runtime)) = &*in_use {
        return if path == library {
            Ok(runtime.clone())
        } else {
            Err(format!("{} is in use already, {} can be only after a restart", path.display(), library.display()))
        };
    }
    let builder = ort::init_from(library).map_err(|error| error.to_string())?;
    let environment = builder.with_telemetry(false).build().map_err(|error| error.to_string())?;
    let runtime = Runtime::new(environment);
    *in_use = Some((library.to_owned(), runtime.clone()));
    Ok(runtime)
}
