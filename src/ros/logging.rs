//! Log lines: to standard error and a file as ROS nodes write them, and ours to `/rosout` as well.

use std::fs::File;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{LazyLock, Mutex, OnceLock, PoisonError, RwLock};
use std::time::{Duration, Instant, SystemTime};

use env_logger::{Target, WriteStyle};
use log::{Level, LevelFilter, Log, Metadata, Record, warn};
use ros2_client::ros2::LogLevel;
use ros2_client::{NodeLoggingHandle, RosoutRaw};

use super::args::Args;
use super::{clock, log_file};
use crate::params::NodeName;

/// The module path of our own lines.
const OURS: &str = "long_term_tracker";
/// What other crates may say unless `RUST_LOG` or `--log-level` ask for more: RustDDS warns of every datagram above
/// 1500 bytes, and the node's look-up of subscribers is an error until somebody subscribes.
const DEFAULT: &str = "error,long_term_tracker=info,rustdds=error,ros2_client=error,ros2_client::node=off";
/// At least this long between two lines of one kind.
const PERIOD: Duration = Duration::from_secs(1);

struct Logger {
    terminal: Option<env_logger::Logger>,
    /// Each line is written at once, so that the file holds all of them however the process ends.
    file: Option<env_logger::Logger>,
    filter: env_logger::Logger,
    /// The name in log lines, dots between the parts of the namespace.
    name: String,
    rosout: bool,
}

static LOGGER: OnceLock<Logger> = OnceLock::new();
/// Whether the node is being taken down, when other crates complain of what is gone already.
static ENDING: AtomicBool = AtomicBool::new(false);
static ROSOUT: RwLock<Option<NodeLoggingHandle>> = RwLock::new(None);
/// When each line of other crates was last written, by where it stands.
static FOREIGN: LazyLock<Mutex<Throttle<Place>>> = LazyLock::new(Mutex::default);
/// Module and line.
type Place = (String, Option<u32>);

/// Starts logging. Only the first call in a process has an effect.
pub fn start(args: &Args, node: &NodeName) {
    let name = node.full().trim_start_matches('/').replace('/', ".");
    let builder = || {
        let mut builder = env_logger::Builder::new();
        builder.parse_filters(DEFAULT);
        builder.parse_default_env();
        for (logger, level) in &args.levels {
            match logger {
                None => builder.filter_module(OURS, *level),
                Some(l) if *l == name => builder.filter_module(OURS, *level),
                Some(other) => builder.filter_module(other, *level),
            };
        }
        let name = name.clone();
        builder.format(move |out, record| {
            let style = out.default_level_style(record.level());
            let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
            let from = if is_ours(record.target()) { &name } else { record.target() };
            let level = level_name(record.level());
            writeln!(out, "{style}[{level}] [{:.9}] [{from}]: {}{style:#}", now.as_secs_f64(), record.args())
        });
        builder
    };
    let terminal = (!args.no_terminal).then(|| builder().build());
    let made = (!args.no_file).then(|| log_file::create(args.file_name.as_deref()));
    let (made, failure) = match made.transpose() {
        Ok(made) => (made, None),
        Err(failure) => (None, Some(failure)),
    };
    let to = |file: File| builder().target(Target::Pipe(Box::new(file))).write_style(WriteStyle::Never).build();
    let logger =
        Logger { terminal, file: made.map(to), filter: builder().build(), name: name.clone(), rosout: !args.no_rosout };
    if LOGGER.set(logger).is_ok()
        && let Some(logger) = LOGGER.get()
        && log::set_logger(logger).is_ok()
    {
        log::set_max_level(logger.filter.filter().max(LevelFilter::Error));
        let report = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            report(panic);
            to_file(&panic.to_string());
        }));
    }
    if let Some((path, why)) = failure {
        warn!("no log file is written: {} cannot be created: {why}", path.display());
    }
}

/// Writes to the log file what the terminal is told by other ways.
pub fn to_file(text: &str) {
    if let Some(file) = LOGGER.get().and_then(|logger| logger.file.as_ref()) {
        file.log(&Record::builder().level(Level::Error).target(OURS).args(format_args!("{text}")).build());
    }
}

/// Sends our lines to `/rosout` too.
pub fn to_rosout(handle: NodeLoggingHandle) {
    if let Ok(mut current) = ROSOUT.write() {
        *current = Some(handle);
    }
}

/// From now on there are only lines of our own, and none to `/rosout`.
pub fn end() {
    ENDING.store(true, Ordering::Relaxed);
    if let Ok(mut current) = ROSOUT.write() {
        *current = None;
    }
}

impl Log for Logger {
    fn enabled(&self, metadata: &Metadata) -> bool {
        self.filter.enabled(metadata)
    }

    fn log(&self, record: &Record) {
        let foreign = !is_ours(record.target());
        if !self.filter.matches(record) || foreign && (ENDING.load(Ordering::Relaxed) || is_held_back(record)) {
            return;
        }
        for writer in [&self.terminal, &self.file].into_iter().flatten() {
            writer.log(record);
        }
        // Publishing may log in its turn; only lines of ours are published, so that this ends.
        if self.rosout
            && !foreign
            && let Ok(handle) = ROSOUT.read()
            && let Some(handle) = handle.as_ref()
        {
            handle.rosout_raw(
                clock::now(),
                ros_level(record.level()),
                &self.name,
                &record.args().to_string(),
                record.file().unwrap_or(""),
                record.module_path().unwrap_or(""),
                record.line().unwrap_or(0),
            );
        }
    }

    fn flush(&self) {}
}

/// Whether a complaint of another crate comes too soon after the last from that place. A peer can cause some of them
/// with every datagram.
fn is_held_back(record: &Record) -> bool {
    let place = (record.target().to_owned(), record.line());
    let mut throttle = FOREIGN.lock().unwrap_or_else(PoisonError::into_inner);
    record.level() <= Level::Warn && throttle.pass(place, Instant::now()).is_none()
}

fn is_ours(target: &str) -> bool {
    target.strip_prefix(OURS).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

const fn level_name(level: Level) -> &'static str {
    match level {
        Level::Error => "ERROR",
        Level::Warn => "WARN",
        Level::Info => "INFO",
        Level::Debug | Level::Trace => "DEBUG",
    }
}

const fn ros_level(level: Level) -> LogLevel {
    match level {
        Level::Error => LogLevel::Error,
        Level::Warn => LogLevel::Warn,
        Level::Info => LogLevel::Info,
        Level::Debug | Level::Trace => LogLevel::Debug,
    }
}

/// Lets a line of each kind through at most once a second, so that a stream of bad frames fills no log.
#[derive(Debug)]
pub struct Throttle<K> {
    /// What came when, and how much was held back since.
    seen: Vec<(K, Instant, u64)>,
}

impl<K> Default for Throttle<K> {
    fn default() -> Self {
        Self { seen: Vec::new() }
    }
}

impl<K: PartialEq> Throttle<K> {
    /// Whether a line of that kind may be written at `now`, and if so how many were held back before it.
    pub fn pass(&mut self, kind: K, now: Instant) -> Option<u64> {
        match self.seen.iter_mut().find(|(k, ..)| *k == kind) {
            None => {
                self.seen.push((kind, now, 0));
                Some(0)
            }
            Some((_, last, held)) if now.duration_since(*last) < PERIOD => {
                *held += 1;
                None
            }
            Some((_, last, held)) => {
                *last = now;
                Some(std::mem::take(held))
            }
        }
    }
}

/// ` (N more like it)` where lines were held back.
pub fn held_back(n: u64) -> String {
    if n == 0 { String::new() } else { format!(" ({n} more like it since the last one)") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_of_line_passes_once_a_period_with_the_count_of_the_others() {
        let mut throttle = Throttle::default();
        let start = Instant::now();
        assert_eq!(throttle.pass('a', start), Some(0));
        assert_eq!(throttle.pass('a', start + PERIOD / 2), None);
        assert_eq!(throttle.pass('b', start + PERIOD / 2), Some(0), "another kind");
        assert_eq!(throttle.pass('a', start + PERIOD * 2 / 3), None);
        assert_eq!(throttle.pass('a', start + PERIOD), Some(2));
        assert_eq!(throttle.pass('a', start + PERIOD * 2), Some(0));
    }

    #[test]
    fn complaints_of_other_crates_come_once_a_second_for_each_place() {
        let record = |level, line| Record::builder().level(level).target("elsewhere").line(Some(line)).build();
        assert!(!is_held_back(&record(Level::Error, 1)));
        assert!(is_held_back(&record(Level::Error, 1)));
        assert!(!is_held_back(&record(Level::Error, 2)), "another place");
        assert!((0..3).all(|_| !is_held_back(&record(Level::Debug, 3))), "asked for, so wanted whole");
    }

    #[test]
    fn only_our_own_modules_are_ours() {
        assert!(is_ours("long_term_tracker::ros") && is_ours("long_term_tracker"));
        assert!(!is_ours("long_term_tracker_x") && !is_ours("rustdds"));
    }
}
