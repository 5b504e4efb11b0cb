//! What needs Python beside ONNX Runtime and networks: `assets/requirements.txt`.

#[path = "../support/venv.rs"]
mod venv;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use venv::run;

/// Where ONNX Runtime's library lies in the package for Python.
const LIBRARY: &str = "import onnxruntime, glob, os; \
    print(*glob.glob(os.path.join(os.path.dirname(onnxruntime.__file__), 'capi', 'libonnxruntime.*')))";

static PYTHON: LazyLock<PathBuf> = LazyLock::new(|| venv::python("networks", "assets/requirements.txt", None));

/// ONNX Runtime's shared library.
pub fn onnxruntime() -> PathBuf {
    run(Command::new(&*PYTHON).args(["-c", LIBRARY])).trim().into()
}

/// Runs a script of the repository's; gives what it printed.
pub fn script(path: &str, arguments: &[&str]) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    run(Command::new(&*PYTHON).arg("-B").arg(path).args(arguments))
}
