//! A virtual environment with what `assets/requirements.txt` names, made on first use and kept below the target folder.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

/// Where ONNX Runtime's library lies in the package for Python.
const LIBRARY: &str = "import onnxruntime, glob, os; \
    print(*glob.glob(os.path.join(os.path.dirname(onnxruntime.__file__), 'capi', 'libonnxruntime.*')))";

static PYTHON: LazyLock<PathBuf> = LazyLock::new(|| {
    let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/requirements.txt");
    let wanted = fs::read_to_string(&requirements).expect("the requirements");
    let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("networks");
    fs::create_dir_all(&root).expect("a folder for the environment");
    // Other test processes wait here until the first has made everything.
    let lock = File::create(root.join("lock")).expect("a lock file");
    lock.lock().expect("the lock");
    let (python, done) = (root.join("venv/bin/python"), root.join("done"));
    if fs::read_to_string(&done).ok().as_ref() != Some(&wanted) {
        let _ = fs::remove_dir_all(root.join("venv"));
        run(Command::new("python3").args(["-m", "venv"]).arg(root.join("venv")));
        let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(Command::new(&python).args(pip).arg(&requirements));
        fs::write(done, wanted).expect("the completed step noted");
    }
    python
});

/// ONNX Runtime's shared library.
pub fn onnxruntime() -> PathBuf {
    run(Command::new(&*PYTHON).args(["-c", LIBRARY])).trim().into()
}

/// Runs a script of the repository's; gives what it printed.
pub fn script(path: &str, arguments: &[&str]) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    run(Command::new(&*PYTHON).arg("-B").arg(path).args(arguments))
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}
