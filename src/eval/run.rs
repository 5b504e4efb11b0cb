//! One-pass evaluation: each tracker set up once on the first frame of each sequence and followed to the end.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

pub use rustix::time::ClockId as Clock;
use rustix::time::clock_gettime;

use super::dataset::Sequence;
use crate::error::{NetworkError, StartError};
use crate::geometry::Rect;
use crate::params::Params;
use crate::replay::{self, ReplayError};
use crate::session::Session;
use crate::tracker::{Output, State};

/// Why a sequence could not be run to its end.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Its frames cannot be read.
    #[error(transparent)]
    Frames(#[from] ReplayError),
    /// The network that the parameters name cannot be used.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Its first row is no box.
    #[error("the target is not in view on the first frame")]
    NoTarget,
    /// Its first box cannot be followed.
    #[error("first box: {0}")]
    Start(#[from] StartError),
}

/// A set of parameters under test.
#[derive(Clone, Debug)]
pub struct Setup {
    /// What tables call it.
    pub name: String,
    /// The parameters.
    pub params: Params,
}

/// What a tracker said of each frame of a sequence.
#[derive(Clone, Debug)]
pub struct Run {
    /// One a frame, the first with the initial box.
    pub outputs: Vec<Output>,
    /// Processor time that the tracker took, without reading frames.
    pub processor_time: Duration,
}

impl Run {
    /// State and box on each frame; a target of which nothing is said is lost.
    pub fn rows(&self) -> Vec<(State, Rect)> {
        let row = |o: &Output| o.targets.first().map_or((State::Lost, Rect::default()), |t| (t.state, t.rect));
        self.outputs.iter().map(row).collect()
    }
}

/// Runs one set of parameters over a sequence: as many frames as have a row in the ground truth, at most `limit`.
pub fn run(
    setup: &Setup,
    sequence: &Sequence,
    limit: usize,
    clock: Clock,
    on_frame: impl Fn(),
) -> Result<Run, RunError> {
    let target = sequence.truth.first().copied().flatten().ok_or(RunError::NoTarget)?;
    let mut source = replay::open(&sequence.path, None)?;
    let mut session = Session::new(setup.params.clone())?;
    let mut run = Run { outputs: Vec::with_capacity(sequence.truth.len()), processor_time: Duration::ZERO };
    while run.outputs.len() < limit.min(sequence.truth.len()) {
        let Some(buffer) = source.next_frame()? else { break };
        let frame = buffer.frame();
        let begun = now(clock);
        if run.outputs.is_empty() {
            session.start(&frame, target, &mut ())?;
        } else {
            session.step(&frame, &mut ());
        }
        run.processor_time += now(clock).saturating_sub(begun);
        run.outputs.push(session.output().clone());
        on_frame();
    }
    Ok(run)
}

/// Runs every set over every sequence on so many threads. The results stand by set, and within it by sequence, in
/// the order given. On a single thread, the processor time is that of the whole process; on several it is that of each
/// thread alone, so that what a network computes in threads of its own is not in it.
pub fn run_all(
    setups: &[Setup],
    sequences: &[Sequence],
    limit: usize,
    threads: usize,
    on_frame: impl Fn() + Sync,
) -> Vec<Vec<Result<Run, RunError>>> {
    let mut jobs: Vec<(usize, usize)> =
        (0..sequences.len()).flat_map(|q| (0..setups.len()).map(move |s| (s, q))).collect();
    // The longest first, so that none is left over for a single thread at the end.
    jobs.sort_by_key(|&(_, q)| std::cmp::Reverse(sequences[q].truth.len()));
    let clock = if threads > 1 { Clock::ThreadCPUTime } else { Clock::ProcessCPUTime };
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(jobs.len()));
    std::thread::scope(|scope| {
        for _ in 0..threads.min(jobs.len()) {
            scope.spawn(|| {
                while let Some(&(s, q)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let result = run(&setups[s], &sequences[q], limit, clock, &on_frame);
                    done.lock().unwrap_or_else(|e| e.into_inner()).push((s, q, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(|e| e.into_inner());
    done.sort_by_key(|&(s, q, _)| (s, q));
    let mut done = done.into_iter().map(|(_, _, result)| result);
    setups.iter().map(|_| done.by_ref().take(sequences.len()).collect()).collect()
}

/// What the clock shows.
fn now(clock: Clock) -> Duration {
    Duration::try_from(clock_gettime(clock)).unwrap_or_default()
}
