//! Virtual environments with the packages of a requirements file, made on first use and kept below the target folder.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The Python of the environment of this name, with what the file names, a path in the repository; and beside it what
/// `base` has, if that is given.
pub fn python(name: &str, requirements: &str, base: Option<&Path>) -> PathBuf {
    let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join(requirements);
    let wanted = fs::read_to_string(&requirements).expect("the requirements");
    let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&root).expect("a folder for the environment");
    // Other test processes wait here until the first has made everything.
    let lock = File::create(root.join("lock")).expect("a lock file");
    lock.lock().expect("the lock");
    let (python, done) = (root.join("venv/bin/python"), root.join("done"));
    if fs::read_to_string(&done).ok().as_ref() != Some(&wanted) {
        let _ = fs::remove_dir_all(root.join("venv"));
        let options = if base.is_some() { &["--system-site-packages"][..] } else { &[] };
        let base = base.unwrap_or(Path::new("python3"));
        run(Command::new(base).args(["-m", "venv"]).args(options).arg(root.join("venv")));
        let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(Command::new(&python).args(pip).arg(&requirements));
        fs::write(done, wanted).expect("the completed step noted");
    }
    python
}

/// Runs the command to its end, which must be a good one; gives what it printed.
pub fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}
