//! The virtual environment with rclpy and the built messages, made on first use and kept below the target folder.

use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

/// Include folders of the machine that built the wheels, which their CMake files hold; and what to ask Python for
/// instead.
const BAKED: [(&str, &str); 2] = [
    (
        "/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include",
        "import numpy; print(numpy.get_include())",
    ),
    ("/opt/python/cp311-cp311/include/python3.11", "import sysconfig; print(sysconfig.get_paths()['include'])"),
];
/// The file whose presence says that a step was completed.
const DONE: &str = "done";

static SHARED: LazyLock<Environment> = LazyLock::new(Environment::make);

/// Where Python and the built message packages are.
pub struct Environment {
    venv: PathBuf,
    install: PathBuf,
}

impl Environment {
    /// The environment, which the first caller on this machine makes; that takes a minute and needs a network.
    pub fn get() -> &'static Self {
        &SHARED
    }

    fn make() -> Self {
        let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ros-peer");
        fs::create_dir_all(&root).expect("a folder for the peer");
        // Other test processes wait here until the first has made everything.
        let lock = File::create(root.join("lock")).expect("a lock file");
        lock.lock().expect("the lock");
        let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
        let peer = repository.join("tests/peer");
        let this = Self { venv: root.join("venv"), install: root.join("install") };

        let requirements = peer.join("requirements.txt");
        step(&this.venv, &read(&requirements), || this.make_venv(&requirements));
        for (name, from) in [("vision_msgs", peer.join("vision_msgs")), ("long_term_tracker", repository.to_owned())] {
            let source = root.join("source").join(name);
            let key = stage(&from, &source);
            let build = root.join("build").join(name);
            step(&build, &key, || this.build(&source, &build));
        }
        this
    }

    fn make_venv(&self, requirements: &Path) {
        let venv = self.venv.as_os_str();
        run(Command::new("python3").args(["-m", "venv"]).arg(venv));
        let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(Command::new(self.bin("python")).args(pip).arg(requirements));
        let answers = BAKED.map(|(baked, question)| (baked, self.ask(question)));
        repair(&self.venv.join("share"), &answers);
    }

    /// Builds the messages of a package outside the repository, for CMake refuses include folders inside its source.
    fn build(&self, source: &Path, build: &Path) {
        let cmake = || self.command(&self.bin("cmake"));
        let python = format!("-DPython3_EXECUTABLE={}", self.bin("python").display());
        let prefix = format!("-DCMAKE_INSTALL_PREFIX={}", self.install.display());
        let options = [prefix.as_str(), &python, "-DBUILD_NODE=OFF", "-DBUILD_TESTING=OFF"];
        run(cmake().arg("-S").arg(source).arg("-B").arg(build).args(options));
        run(cmake().arg("--build").arg(build).args(["--parallel", "2"]));
        run(cmake().arg("--install").arg(build));
    }

    fn bin(&self, name: &str) -> PathBuf {
        self.venv.join("bin").join(name)
    }

    fn ask(&self, question: &str) -> String {
        let output = Command::new(self.bin("python")).args(["-c", question]).output().expect("python");
        String::from_utf8(output.stdout).expect("a path").trim().to_owned()
    }

    /// A command that finds the environment's programs, libraries, packages and messages, and nothing of a ROS 2 that
    /// may be installed besides.
    pub fn command(&self, program: &Path) -> Command {
        let [venv, install] = [&self.venv, &self.install].map(|p| p.display().to_string());
        let path = std::env::var("PATH").unwrap_or_default();
        let mut command = Command::new(program);
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("ROS_")) {
            command.env_remove(name);
        }
        command
            .env("PATH", format!("{venv}/bin:{path}"))
            .env("LD_LIBRARY_PATH", format!("{venv}/lib:{install}/lib"))
            .env("AMENT_PREFIX_PATH", format!("{install}:{venv}"))
            .env("CMAKE_PREFIX_PATH", format!("{install}:{venv}"))
            .env("ROS_LOG_DIR", self.install.join("log"))
            .env("PYTHONPATH", self.messages())
            .env("PYTHONDONTWRITEBYTECODE", "1");
        command
    }

    /// A command that runs Python.
    pub fn python(&self) -> Command {
        self.command(&self.bin("python"))
    }

    /// Where the built messages can be imported from.
    fn messages(&self) -> PathBuf {
        let lib = self.install.join("lib");
        let versions = fs::read_dir(&lib).into_iter().flatten().flatten().map(|e| e.path().join("site-packages"));
        versions.into_iter().find(|p| p.is_dir()).unwrap_or(lib)
    }
}

/// Makes `folder` anew by `make` unless it was completed with the same key.
fn step(folder: &Path, key: &str, make: impl FnOnce()) {
    let done = folder.join(DONE);
    if fs::read_to_string(&done).is_ok_and(|k| k == key) {
        return;
    }
    if folder.exists() {
        fs::remove_dir_all(folder).expect("the old folder removed");
    }
    make();
    fs::write(done, key).expect("the completed step noted");
}

/// Copies what makes a message package, and gives all of its text.
fn stage(from: &Path, to: &Path) -> String {
    let mut messages: Vec<_> = fs::read_dir(from.join("msg")).expect("msg").flatten().map(|e| e.file_name()).collect();
    messages.sort();
    let files = messages.into_iter().map(|name| Path::new("msg").join(name));
    fs::create_dir_all(to.join("msg")).expect("a folder for messages");
    let mut all = String::new();
    for file in files.chain(["CMakeLists.txt", "package.xml"].map(PathBuf::from)) {
        let text = read(&from.join(&file));
        let target = to.join(&file);
        // A new time of change would make CMake build again.
        if fs::read_to_string(&target).ok().as_ref() != Some(&text) {
            fs::write(target, &text).expect("a copied file");
        }
        all.push_str(&text);
    }
    all
}

/// Rewrites the baked paths in every CMake file below the folder.
fn repair(folder: &Path, paths: &[(&str, String)]) {
    for entry in fs::read_dir(folder).expect("a folder of the environment").flatten() {
        let path = entry.path();
        if path.is_dir() {
            repair(&path, paths);
        } else if path.extension().is_some_and(|e| e == "cmake") {
            let mut text = String::new();
            File::open(&path).and_then(|mut f| f.read_to_string(&mut text)).expect("a CMake file");
            let repaired = paths.iter().fold(text.clone(), |t, (baked, real)| t.replace(baked, real));
            if repaired != text {
                File::create(&path).and_then(|mut f| f.write_all(repaired.as_bytes())).expect("a repaired file");
            }
        }
    }
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn run(command: &mut Command) {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{command:?}:\n{}\n{}", text(&output.stdout), text(&output.stderr));
}
