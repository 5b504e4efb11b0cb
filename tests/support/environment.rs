//! Virtual environments with rclpy and the built messages, made on first use and kept below the target folder.

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

static JAZZY: LazyLock<Environment> = LazyLock::new(|| Environment::make("jazzy"));
static KILTED: LazyLock<Environment> = LazyLock::new(|| Environment::make("kilted"));

/// Where Python and the built message packages of a distribution are.
pub struct Environment {
    venv: PathBuf,
    workspace: PathBuf,
}

impl Environment {
    /// That of ROS 2 Jazzy, which the first caller on this machine makes; it takes a minute or two and needs a network.
    pub fn get() -> &'static Self {
        &JAZZY
    }

    /// That of ROS 2 Kilted.
    pub fn kilted() -> &'static Self {
        &KILTED
    }

    fn make(distribution: &str) -> Self {
        let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("ros-{distribution}"));
        fs::create_dir_all(&root).expect("a folder for the peer");
        // Other test processes wait here until the first has made everything.
        let lock = File::create(root.join("lock")).expect("a lock file");
        lock.lock().expect("the lock");
        let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
        let peer = repository.join("tests/peer");
        let this = Self { venv: root.join("venv"), workspace: root.join("workspace") };

        let requirements = peer.join(format!("requirements-{distribution}.txt"));
        step(&this.venv, &read(&requirements), || this.make_venv(&requirements));
        let sources = [("vision_msgs", peer.join("vision_msgs")), ("long_term_tracker", repository.to_owned())];
        let key: String = sources.iter().map(|(_, from)| messages(from)).collect();
        step(&this.workspace, &key, || {
            for (name, from) in &sources {
                stage(from, &this.workspace.join("src").join(name));
            }
            this.colcon(&this.workspace, &["-DBUILD_NODE=OFF"]);
        });
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

    /// Builds the packages in `workspace/src` with colcon, into `workspace/install`.
    pub fn colcon(&self, workspace: &Path, cmake: &[&str]) {
        let python = format!("-DPython3_EXECUTABLE={}", self.bin("python").display());
        let mut colcon = self.command(&self.bin("colcon"), None);
        colcon.current_dir(workspace).args(["build", "--merge-install", "--base-paths", "src", "--event-handlers"]);
        colcon.args(["console_direct+", "--cmake-args", "-DBUILD_TESTING=OFF", &python]).args(cmake);
        run(&mut colcon);
    }

    fn bin(&self, name: &str) -> PathBuf {
        self.venv.join("bin").join(name)
    }

    fn ask(&self, question: &str) -> String {
        let output = Command::new(self.bin("python")).args(["-c", question]).output().expect("python");
        String::from_utf8(output.stdout).expect("a path").trim().to_owned()
    }

    /// A command that finds the environment's programs, libraries and packages, those that colcon has installed for a
    /// workspace on top, and nothing of a ROS 2 that may be installed besides.
    pub fn command(&self, program: &Path, workspace: Option<&Path>) -> Command {
        let install = workspace.map(|w| w.join("install"));
        let prefixes: Vec<_> = install.iter().chain([&self.venv]).map(|p| p.display().to_string()).collect();
        let libraries: Vec<_> = prefixes.iter().map(|p| format!("{p}/lib")).collect();
        let path = std::env::var("PATH").unwrap_or_default();
        let mut command = Command::new(program);
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("ROS_")) {
            command.env_remove(name);
        }
        command
            .env("PATH", format!("{}/bin:{path}", self.venv.display()))
            .env("LD_LIBRARY_PATH", libraries.join(":"))
            .env("AMENT_PREFIX_PATH", prefixes.join(":"))
            .env("CMAKE_PREFIX_PATH", prefixes.join(":"))
            .env("ROS_LOG_DIR", self.workspace.join("log"))
            .env("PYTHONPATH", install.map(|i| python_packages(&i)).unwrap_or_default())
            .env("PYTHONDONTWRITEBYTECODE", "1");
        command
    }

    /// A command that runs Python with the built messages.
    pub fn python(&self) -> Command {
        self.command(&self.bin("python"), Some(&self.workspace))
    }
}

/// Where the messages below an install folder can be imported from.
fn python_packages(install: &Path) -> PathBuf {
    let lib = install.join("lib");
    let versions = fs::read_dir(&lib).into_iter().flatten().flatten().map(|e| e.path().join("site-packages"));
    versions.into_iter().find(|p| p.is_dir()).unwrap_or(lib)
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

/// What makes a message package: its two descriptions and its messages.
fn parts(from: &Path) -> Vec<PathBuf> {
    let mut messages: Vec<_> = fs::read_dir(from.join("msg")).expect("msg").flatten().map(|e| e.path()).collect();
    messages.sort();
    messages.extend(["CMakeLists.txt", "package.xml"].map(|name| from.join(name)));
    messages
}

/// All of its text.
fn messages(from: &Path) -> String {
    parts(from).iter().map(|part| read(part)).collect()
}

/// Copies it, and the folders it installs from, for CMake refuses include folders inside its source.
fn stage(from: &Path, to: &Path) {
    fs::create_dir_all(to.join("msg")).expect("a folder for messages");
    for part in parts(from) {
        fs::copy(&part, to.join(part.strip_prefix(from).expect("a part below it"))).expect("a copied file");
    }
    for name in ["examples", "launch", "params"].iter().filter(|name| from.join(name).is_dir()) {
        std::os::unix::fs::symlink(from.join(name), to.join(name)).expect("a link");
    }
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
