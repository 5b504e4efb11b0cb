//! Inputs that ask for more memory or time than they are worth, files that never end, and outputs that cannot be
//! written.

mod bytes;
mod images;
mod recordings;
mod settings;

use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use image::{Rgb, RgbImage};

/// Until a command that must end has to have ended, on a machine that does other work as well.
const DEADLINE: Duration = Duration::from_secs(60);
/// What a command may take at most that refuses its input, in kB: the program itself takes some 10 MB.
const REFUSED: usize = 100_000;

/// What a command did.
struct Ran {
    code: Option<i32>,
    out: String,
    err: String,
    /// The most memory that was resident, in kB.
    peak: usize,
}

impl Ran {
    /// Asserts that the input was refused with these words, in so much memory.
    fn refused(&self, words: &[&str], most: usize) {
        let Self { code, err, peak, .. } = self;
        assert!(matches!(code, Some(1 | 2)), "{code:?}: {err}");
        assert!(words.iter().all(|word| err.contains(word)), "{words:?} in: {err}");
        assert!(peak < &most, "{peak} kB: {err}");
    }
}

/// Runs `track` with an end to the memory it can have, so that a failure harms no one.
fn track(source: &Path, args: &[&str]) -> Ran {
    const MOST: &str = "ulimit -v 3000000; exec \"$@\"";
    let mut command = Command::new("sh");
    command.args(["-c", MOST, "sh", env!("CARGO_BIN_EXE_track")]).arg(source).args(args);
    run(&mut command)
}

fn run(command: &mut Command) -> Ran {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut streams = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
    let reader = std::thread::spawn(move || {
        let text = |stream: &mut dyn Read| {
            let mut bytes = Vec::new();
            stream.read_to_end(&mut bytes).unwrap();
            String::from_utf8(bytes).unwrap()
        };
        let out = std::thread::spawn(move || text(&mut streams.0));
        (text(&mut streams.1), out.join().unwrap())
    });
    let status = format!("/proc/{}/status", child.id());
    let end = Instant::now() + DEADLINE;
    let mut peak = 0;
    let code = loop {
        // The mark only rises, and is gone with the process.
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let now = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        peak = peak.max(now.unwrap_or(0));
        if let Some(status) = child.try_wait().unwrap() {
            break status.code();
        }
        if Instant::now() > end {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{command:?} runs on");
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    let (err, out) = reader.join().unwrap();
    Ran { code, out, err, peak }
}

/// A picture with something to follow in the middle, moved to the right by so many pixels.
fn scene(moved: u32) -> RgbImage {
    RgbImage::from_fn(96, 72, |x, y| {
        let inside = (30 + moved..54 + moved).contains(&x) && (20..52).contains(&y);
        let [x, y] = if inside { [x - moved, y].map(|side| side / 4 * 61) } else { [x / 8 * 17, y / 8 * 29] };
        Rgb([(x * y) as u8 ^ 0x55, (x + 3 * y) as u8, if inside { 200 } else { 60 }])
    })
}

/// Where it is.
const INIT: [&str; 4] = ["--init", "30,20,24,32", "-p", "lcmht.cnn.enabled:=false"];

/// A file that waits for a writer for ever.
fn fifo(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}
