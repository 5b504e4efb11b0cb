//! Looks after the process as a whole, on a thread that does nothing else: signals, threads that end, memory, and an
//! end that does not come.
//!
//! The first reason to end (a signal, or a thread that came to its end by itself) is given to whoever waits for it, who
//! then takes the node down in good order. What does not end so is ended: `PATIENCE` after that, or at a second
//! signal. When memory grows past its limit, the process is ended at once, for who knows how fast it grows.
//!
//! The thread writes nothing and waits for no other, so that nothing that hangs can hold it up.

use std::panic::{self, PanicHookInfo};
use std::process;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, Builder};
use std::time::{Duration, Instant};

use log::error;

use super::fault::Fault;
use super::process::{Thread, resident};

/// How long an end in good order may take.
const PATIENCE: Duration = Duration::from_secs(3);
/// How long it may take at least, for signals often come twice at once: from the terminal, and from a launcher.
const ORDERLY: Duration = Duration::from_secs(1);
/// How often memory and threads are looked at. Memory can grow by a gigabyte a second.
const PERIOD: Duration = Duration::from_millis(100);
/// How long the last line may take: whoever should read it may not.
const LAST_LINE: Duration = Duration::from_millis(500);
/// How the names of the library's threads begin, that run as long as the node does; the system cuts them short. And
/// what they are.
const LIBRARY: [(&str, &str); 2] = [("RustDDS Partici", "DDS event loop"), ("RustDDS discove", "DDS discovery")];
/// So many panics are remembered.
const PANICS: usize = 16;

/// What happened.
#[derive(Debug)]
enum Event {
    /// The user wants the node to end.
    Signal,
    /// A thread of ours starts.
    Started(&'static str),
    /// It has ended, for this reason if there is one.
    Ended(&'static str, Option<String>),
    /// These threads of the library must not end.
    Watched(Vec<Thread>),
}

/// Why the node is to end: a signal, or a fault.
type Reason = Result<(), Fault>;

/// What is to be done.
#[derive(Debug)]
enum Verdict {
    Nothing,
    /// The node is to be taken down.
    End(Reason),
    /// The process is to be ended.
    Leave(Fault),
}

/// What is known, and what follows from it. Time is given to it.
struct Watch {
    /// Resident memory in bytes that is allowed.
    limit: u64,
    /// The threads of ours that run.
    running: Vec<&'static str>,
    /// The library's.
    library: Vec<Thread>,
    panics: Panics,
    ending: Option<Ending>,
}

#[derive(Clone, Copy)]
struct Ending {
    since: Instant,
    /// When the process is ended.
    until: Instant,
}

impl Watch {
    fn new(limit_mb: u64, panics: Panics) -> Self {
        Self { limit: limit_mb * 1_000_000, running: Vec::new(), library: Vec::new(), panics, ending: None }
    }

    /// Takes notice.
    fn note(&mut self, event: Event, now: Instant) -> Verdict {
        match event {
            Event::Started(name) => self.running.push(name),
            Event::Watched(threads) => self.library = threads,
            Event::Signal => match &mut self.ending {
                Some(ending) => ending.until = ending.until.min(now.max(ending.since + ORDERLY)),
                None => return self.end(Ok(()), now),
            },
            Event::Ended(name, why) => {
                self.running.retain(|other| *other != name);
                if self.ending.is_none() {
                    let why = why.or_else(|| self.panics.of(name)).unwrap_or_else(|| "it returned".to_owned());
                    return self.end(Err(Fault::Thread { name: name.to_owned(), why }), now);
                }
            }
        }
        Verdict::Nothing
    }

    /// Looks at what tells nothing by itself.
    fn look(&mut self, resident: Option<u64>, now: Instant) -> Verdict {
        if let Some(resident) = resident.filter(|resident| *resident > self.limit) {
            let mb = |bytes: u64| bytes / 1_000_000;
            return Verdict::Leave(Fault::Memory { resident_mb: mb(resident), limit_mb: mb(self.limit) });
        }
        match self.ending {
            Some(ending) if now >= ending.until => {
                let seconds = (now - ending.since).as_secs_f64();
                Verdict::Leave(Fault::Hung { seconds, threads: self.hung() })
            }
            Some(_) => Verdict::Nothing,
            None => match self.library.iter().find(|thread| !thread.is_alive()) {
                Some(thread) => {
                    let why = self.panics.of(thread.name()).unwrap_or_else(|| "it returned".to_owned());
                    self.end(Err(Fault::Thread { name: library_name(thread).to_owned(), why }), now)
                }
                None => Verdict::Nothing,
            },
        }
    }

    fn end(&mut self, reason: Reason, now: Instant) -> Verdict {
        self.ending = Some(Ending { since: now, until: now + PATIENCE });
        Verdict::End(reason)
    }

    /// The threads that should have ended: ours, or else the library's, for which the main thread waits last.
    fn hung(&self) -> String {
        let library = self.library.iter().filter(|thread| thread.is_alive()).map(library_name);
        let names = match &self.running[..] {
            [] => library.collect(),
            running => running.to_vec(),
        };
        match &names[..] {
            [] => "the main thread hangs".to_owned(),
            [name] => format!("the {name} thread hangs"),
            names => format!("the threads {} hang", names.join(", ")),
        }
    }
}

fn library_name(thread: &Thread) -> &'static str {
    LIBRARY.iter().find(|(name, _)| *name == thread.name()).map_or("DDS", |(_, told)| told)
}

/// The latest panics: in which thread, and where.
#[derive(Clone, Default)]
struct Panics(Arc<Mutex<Vec<(String, String)>>>);

impl Panics {
    /// Remembers panics from now on; they are told on standard error as before.
    fn hook(&self) {
        let (panics, before) = (self.clone(), panic::take_hook());
        panic::set_hook(Box::new(move |about| {
            panics.add(thread::current().name().unwrap_or_default(), about);
            before(about);
        }));
    }

    fn add(&self, thread: &str, about: &PanicHookInfo) {
        let place = about.location().map(|at| format!(" at {at}")).unwrap_or_default();
        let message = about.payload_as_str().unwrap_or("no message");
        let mut panics = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        panics.truncate(PANICS - 1);
        panics.insert(0, (thread.to_owned(), format!("it panicked{place}: {message}")));
    }

    /// What the last panic of the thread was whose name begins so.
    fn of(&self, thread: &str) -> Option<String> {
        let panics = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        panics.iter().find(|(name, _)| name.starts_with(thread)).map(|(_, told)| told.clone())
    }
}

/// The way to the thread that looks after the process.
pub struct Supervisor {
    events: Sender<Event>,
    reasons: Receiver<Reason>,
}

impl Supervisor {
    /// Looks after the process from now on, in which signals are handled and which may take so much memory.
    pub fn start(limit_mb: u64) -> Result<Self, Fault> {
        let panics = Panics::default();
        panics.hook();
        let this = Self::watch(Watch::new(limit_mb, panics), leave)?;
        let events = this.events.clone();
        ctrlc::set_handler(move || drop(events.send(Event::Signal))).map_err(|e| Fault::system("handle signals", e))?;
        Ok(this)
    }

    fn watch(mut watch: Watch, leave: impl FnOnce(Fault) + Send + 'static) -> Result<Self, Fault> {
        let (events, happened) = channel();
        let (give, reasons) = channel();
        let run = move || {
            let mut next_look = Instant::now();
            loop {
                let now = Instant::now();
                let verdict = if now >= next_look {
                    next_look = now + PERIOD;
                    watch.look(resident(), now)
                } else {
                    match happened.recv_timeout(next_look - now) {
                        Ok(event) => watch.note(event, Instant::now()),
                        Err(RecvTimeoutError::Timeout) => Verdict::Nothing,
                        Err(RecvTimeoutError::Disconnected) => return,
                    }
                };
                match verdict {
                    Verdict::Nothing => {}
                    Verdict::End(reason) => drop(give.send(reason)),
                    Verdict::Leave(fault) => return leave(fault),
                }
            }
        };
        let thread = Builder::new().name("supervisor".to_owned()).spawn(run);
        thread.map_err(|e| Fault::system("start the supervisor thread", e))?;
        Ok(Self { events, reasons })
    }

    /// Starts a thread that must not end before the node does, whether by panic or by returning, with why if it knows.
    pub fn spawn(
        &self,
        name: &'static str,
        body: impl FnOnce() -> Option<String> + Send + 'static,
    ) -> Result<thread::JoinHandle<()>, Fault> {
        let _ = self.events.send(Event::Started(name));
        let guard = Guard { name, why: None, events: self.events.clone() };
        let thread = Builder::new().name(name.to_owned()).spawn(move || {
            let mut guard = guard;
            guard.why = body();
        });
        thread.map_err(|e| Fault::system(format!("start the {name} thread"), e))
    }

    /// The threads of the DDS library that run now must not end before the node does either.
    pub fn watch_library(&self) {
        let mut threads = Thread::all();
        threads.retain(|thread| LIBRARY.iter().any(|(name, _)| *name == thread.name()));
        let _ = self.events.send(Event::Watched(threads));
    }

    /// Waits until the node is to end. From then on it has `PATIENCE` to do so.
    pub fn wait(&self) -> Reason {
        self.reasons.recv().unwrap_or_else(|_| {
            Err(Fault::Thread { name: "supervisor".to_owned(), why: "it no longer responds".to_owned() })
        })
    }
}

/// Tells when a thread ends.
struct Guard {
    name: &'static str,
    why: Option<String>,
    events: Sender<Event>,
}

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.events.send(Event::Ended(self.name, self.why.take()));
    }
}

/// Ends the process now, whatever its threads do. The line that says why is written if somebody reads it.
fn leave(fault: Fault) {
    let (written, is_written) = channel();
    let write = move || {
        fault.report();
        let _ = written.send(());
        error!("{fault}");
        let _ = written.send(());
    };
    if Builder::new().spawn(write).is_ok() {
        let end = Instant::now() + LAST_LINE;
        // Both lines: the process's own, and the log's.
        for _ in 0..2 {
            let _ = is_written.recv_timeout(end.saturating_duration_since(Instant::now()));
        }
    }
    // What libraries do at the end of a process may hang as well.
    let _ = Builder::new().spawn(|| {
        thread::sleep(LAST_LINE);
        process::abort();
    });
    process::exit(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);
    const LIMIT: u64 = 100;

    fn watch() -> Watch {
        Watch::new(LIMIT, Panics::default())
    }

    fn line(verdict: Verdict) -> String {
        match verdict {
            Verdict::Nothing => String::new(),
            Verdict::End(reason) => format!("end: {}", reason.map_or_else(|why| why.to_string(), |()| "ok".to_owned())),
            Verdict::Leave(fault) => format!("leave: {fault}"),
        }
    }

    #[test]
    fn an_end_that_does_not_come_is_made_after_three_seconds_and_the_thread_is_named() {
        let (mut watch, now) = (watch(), Instant::now());
        for name in ["worker", "spin"] {
            assert_eq!(line(watch.note(Event::Started(name), now)), "");
        }
        assert_eq!(line(watch.note(Event::Signal, now)), "end: ok");
        assert_eq!(line(watch.note(Event::Ended("spin", None), now)), "");
        assert_eq!(line(watch.look(None, now + PATIENCE - MS)), "");
        let told = "leave: still running 3.0 s after shutdown began, so the process is ended: the worker thread hangs";
        assert_eq!(line(watch.look(None, now + PATIENCE)), told);
    }

    #[test]
    fn a_second_signal_makes_it_but_not_before_an_orderly_end_had_its_time() {
        for (second, made) in [(1 * MS, ORDERLY), (ORDERLY + 500 * MS, ORDERLY + 500 * MS)] {
            let (mut watch, now) = (watch(), Instant::now());
            watch.note(Event::Signal, now);
            assert_eq!(line(watch.note(Event::Signal, now + second)), "");
            assert_eq!(line(watch.look(None, now + made - MS)), "");
            assert!(line(watch.look(None, now + made)).starts_with("leave: still running"));
        }
        let (mut watch, now) = (watch(), Instant::now());
        watch.note(Event::Signal, now);
        for n in 0..5 {
            watch.note(Event::Signal, now + n * 400 * MS);
        }
        assert!(line(watch.look(None, now + ORDERLY)).starts_with("leave"), "more signals do not put it off");
    }

    #[test]
    fn memory_past_its_limit_ends_the_process_at_any_time() {
        let (mut watch, now) = (watch(), Instant::now());
        let told = "leave: resident memory of 101 MB is more than the 100 MB that parameter 'limits.memory_mb' \
                    allows: the node exits";
        assert_eq!(line(watch.look(Some(100_000_000), now)), "");
        assert_eq!(line(watch.look(Some(101_000_000), now)), told);
        watch.note(Event::Signal, now);
        assert_eq!(line(watch.look(Some(101_000_000), now)), told);
    }

    /// Runs the body on a watched thread; gives why the node is to end.
    fn end_of(body: impl FnOnce() -> Option<String> + Send + 'static) -> String {
        let panics = Panics::default();
        panics.hook();
        let supervisor = Supervisor::watch(Watch::new(u64::MAX / 1_000_000, panics), |_| {}).unwrap();
        let _ = supervisor.spawn("worker", body).unwrap().join();
        supervisor.wait().unwrap_err().to_string()
    }

    #[test]
    fn the_end_of_a_thread_is_a_fault_with_its_reason() {
        let told = "the worker thread ended unexpectedly: ";
        assert_eq!(end_of(|| None), format!("{told}it returned"));
        assert_eq!(end_of(|| Some("discovery ended".to_owned())), format!("{told}discovery ended"));
        let line = line!() + 1;
        let panicked = end_of(|| panic!("a bug"));
        let place = format!("{told}it panicked at {}:{line}:", file!());
        assert!(panicked.starts_with(&place) && panicked.ends_with(": a bug"), "{panicked}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_end_of_a_thread_of_the_library_is_a_fault_however_it_ends() {
        for panics in [false, true] {
            let watching = Panics::default();
            watching.hook();
            let supervisor = Supervisor::watch(Watch::new(u64::MAX / 1_000_000, watching), |_| {}).unwrap();
            let (end, ended) = channel::<()>();
            let (started, is_started) = channel();
            let thread = Builder::new().name("RustDDS discovery thread".to_owned());
            let thread = thread.spawn(move || {
                started.send(()).unwrap();
                let _ = ended.recv();
                assert!(!panics, "a malformed message");
            });
            is_started.recv().unwrap();
            supervisor.watch_library();
            drop(end);
            let _ = thread.unwrap().join();
            let told = supervisor.wait().unwrap_err().to_string();
            let why = if panics { "it panicked at src/ros/supervisor.rs:" } else { "it returned" };
            assert!(told.starts_with(&format!("the DDS discovery thread ended unexpectedly: {why}")), "{told}");
        }
    }

    #[test]
    fn a_thread_that_never_ends_and_memory_without_end_are_left() {
        let (left, has_left) = channel();
        let leave = move |fault: Fault| left.send(fault.to_string()).unwrap();
        let supervisor = Supervisor::watch(Watch::new(LIMIT * 1_000_000, Panics::default()), leave).unwrap();
        let (end, ended) = channel::<()>();
        supervisor.spawn("worker", move || ended.recv().err().map(|e| e.to_string())).unwrap();
        let begin = Instant::now();
        (0..2).for_each(|_| supervisor.events.send(Event::Signal).unwrap());
        assert!(supervisor.wait().is_ok());
        let told = has_left.recv().unwrap();
        assert!(begin.elapsed() >= ORDERLY && told.ends_with("the worker thread hangs"), "{told}");
        drop(end);

        let (left, has_left) = channel();
        let leave = move |fault: Fault| left.send(fault.to_string()).unwrap();
        let _supervisor = Supervisor::watch(Watch::new(1, Panics::default()), leave).unwrap();
        if cfg!(target_os = "linux") {
            assert!(has_left.recv().unwrap().contains("limits.memory_mb"));
        }
    }
}
