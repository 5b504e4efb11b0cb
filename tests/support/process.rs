//! The processes of a test, each ended with it.

use std::cell::RefCell;
use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::Environment;
use super::domain::Domain;

/// The signal that cannot be handled.
const SIGKILL: i32 = 9;
/// Until something that must happen has to have happened. It only ends what hangs: nothing is judged by it.
const DEADLINE: Duration = Duration::from_secs(120);
/// The same for all that a peer does, which has its own deadline for each thing that it waits for.
const PEER_DEADLINE: Duration = Duration::from_secs(1200);

/// A ROS domain that nobody else on this machine uses until the calling thread ends, as that of a test does.
pub fn domain() -> u32 {
    thread_local!(static TAKEN: RefCell<Vec<Domain>> = const { RefCell::new(Vec::new()) });
    let domain = Domain::take();
    let number = domain.number.into();
    TAKEN.with_borrow_mut(|taken| taken.push(domain));
    number
}

fn isolated(command: &mut Command, domain: u32) -> &mut Command {
    command
        .env("ROS_DOMAIN_ID", domain.to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .env("ROS_LOG_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/log"))
}

#[derive(Default)]
struct Lines {
    text: Mutex<String>,
    changed: Condvar,
}

/// What a process holds.
#[derive(Debug, Clone, Copy)]
pub struct Resources {
    /// Resident memory in kB.
    pub resident: usize,
    /// Threads.
    pub threads: usize,
    /// Open files and sockets.
    pub files: usize,
}

/// The node as a process of its own.
pub struct Node {
    child: Child,
    lines: Arc<Lines>,
    reader: Option<JoinHandle<()>>,
}

impl Node {
    /// Starts the node with its arguments.
    pub fn start(domain: u32, args: &[&str]) -> Self {
        Self::started(&mut Command::new(env!("CARGO_BIN_EXE_tracker_node")), domain, args)
    }

    /// Starts it by a command, in whose environment more may be set.
    pub fn started(command: &mut Command, domain: u32, args: &[&str]) -> Self {
        command.env_remove("RUST_LOG").env_remove("ROS_LOCALHOST_ONLY");
        let child = isolated(command, domain).args(args).stderr(Stdio::piped()).spawn();
        let mut child = child.expect("the node started");
        let lines = Arc::new(Lines::default());
        let stderr = BufReader::new(child.stderr.take().expect("standard error is piped"));
        let reader = std::thread::spawn({
            let lines = lines.clone();
            move || {
                for line in stderr.lines().map_while(Result::ok) {
                    let mut text = lines.text.lock().expect("the lines");
                    text.push_str(&line);
                    text.push('\n');
                    lines.changed.notify_all();
                }
            }
        });
        Self { child, lines, reader: Some(reader) }
    }

    /// The process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits until a line holds `part`.
    pub fn wait_for(&self, part: &str) {
        let text = self.lines.text.lock().expect("the lines");
        let waiting = |text: &mut String| !text.contains(part);
        let (text, timeout) = self.lines.changed.wait_timeout_while(text, DEADLINE, waiting).expect("the lines");
        assert!(!timeout.timed_out(), "no line with '{part}' in:\n{text}");
    }

    /// All it has written so far.
    pub fn log(&self) -> String {
        self.lines.text.lock().expect("the lines").clone()
    }

    /// Sends the signal, as `kill -NAME` names it.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").arg(format!("-{name}")).arg(self.id().to_string()).status();
        assert!(sent.expect("kill").success());
    }

    /// What the process holds.
    pub fn resources(&self) -> Resources {
        let process = PathBuf::from(format!("/proc/{}", self.id()));
        let status = fs::read_to_string(process.join("status")).expect("the status of a process");
        let number = |key: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(key)).expect("a line of the status");
            line.trim_end_matches("kB").trim().parse().expect("a number")
        };
        let files = fs::read_dir(process.join("fd")).expect("the open files of a process").count();
        Resources { resident: number("VmRSS:"), threads: number("Threads:"), files }
    }

    /// Ends it as a user does, and gives all that was written.
    pub fn end(self) -> String {
        self.signal("INT");
        let (code, log) = self.finish();
        assert_eq!(code, Some(0), "{log}");
        log
    }

    /// Waits for the end; gives the exit code and all that was written.
    pub fn finish(mut self) -> (Option<i32>, String) {
        let status = wait(&mut self.child, DEADLINE).unwrap_or_else(|| panic!("the node runs on:\n{}", self.log()));
        if let Some(reader) = self.reader.take() {
            reader.join().expect("the reader of lines");
        }
        (status.code(), self.log())
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        end(&mut self.child);
    }
}

/// A process that runs one function of `tests/peer/scenarios.py`.
pub struct Peer(Child);

impl Peer {
    /// Starts the function with its arguments.
    pub fn start(domain: u32, scenario: &str, args: &[&str]) -> Self {
        Self::of(Environment::get(), domain, scenario, args)
    }

    /// Starts it in another environment.
    pub fn of(environment: &Environment, domain: u32, scenario: &str, args: &[&str]) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/scenarios.py");
        Self::spawn(&mut environment.python(), domain, &script, &[&[scenario], args].concat())
    }

    /// Starts a script by a command that runs Python.
    pub fn spawn(python: &mut Command, domain: u32, script: &Path, args: &[&str]) -> Self {
        Self(isolated(python, domain).arg(script).args(args).spawn().expect("python started"))
    }

    /// Waits until the function has returned without a failure, where it starts the node itself.
    pub fn succeed_alone(self) {
        self.succeed_alone_within(PEER_DEADLINE);
    }

    /// Waits for that as long as it may take.
    pub fn succeed_alone_within(mut self, limit: Duration) {
        let status = wait(&mut self.0, limit);
        assert!(status.is_some_and(|s| s.success()), "the peer failed: {status:?}");
    }

    /// Waits until the function has killed its process.
    pub fn be_killed(mut self, node: &Node) {
        let status = wait(&mut self.0, PEER_DEADLINE);
        let killed = status.is_some_and(|s| s.signal() == Some(SIGKILL));
        assert!(killed, "the peer failed: {status:?}; the node wrote:\n{}", node.log());
    }

    /// Waits until the function has returned without a failure.
    pub fn succeed(self, node: &Node) {
        self.succeed_within(PEER_DEADLINE, node);
    }

    /// Waits for that as long as it may take.
    pub fn succeed_within(mut self, limit: Duration, node: &Node) {
        let status = wait(&mut self.0, limit);
        assert!(status.is_some_and(|s| s.success()), "the peer failed: {status:?}; the node wrote:\n{}", node.log());
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        end(&mut self.0);
    }
}

/// Runs a function of `tests/peer/scenarios.py` against a node with these arguments, then ends the node; gives what it
/// wrote.
pub fn scenario(name: &str, args: &[&str], node_args: &[&str]) -> String {
    let domain = domain();
    let node = Node::start(domain, node_args);
    Peer::start(domain, name, args).succeed(&node);
    node.end()
}

/// The exit status, unless the process still runs after `limit`.
fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let end = Instant::now() + limit;
    loop {
        if let Some(status) = child.try_wait().expect("the status of a child") {
            return Some(status);
        }
        if Instant::now() > end {
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn end(child: &mut Child) {
    // It may be gone already.
    let _ = child.kill();
    let _ = child.wait();
}
