//! One-pass evaluation: each tracker set up once on the first frame of each sequence and followed to the end. Several
//! times, started a little differently each time, where the question is how much hangs on luck.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

use super::answer::Answer;
use super::dataset::Sequence;
use crate::error::{NetworkError, StartError};
use crate::geometry::Rect;
use crate::loader::FailureLog;
use crate::params::Params;
use crate::replay::{self, ReplayError};
use crate::session::Session;

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
    #[error("the target is not in view in the first frame")]
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
    pub answers: Vec<Answer>,
    /// Processor time that the tracker took, without reading frames; `None` where that is not known.
    pub processor_time: Option<Duration>,
}

/// How a run begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Start {
    /// Pixels in x and y from the true box to that which the tracker is given.
    pub offset: [i8; 2],
    /// What is added to the parameter `seed`.
    pub seed: i64,
}

/// The directions of starts after the plain one.
const DIRECTIONS: [[i8; 2]; 8] = [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]];

impl Start {
    /// The plain start first; the others one pixel off, each in the next direction, with the next seed.
    pub fn variants(count: usize) -> Vec<Self> {
        let variant = |k: usize| Self { offset: DIRECTIONS[(k - 1) % DIRECTIONS.len()], seed: k as i64 };
        std::iter::once(Self::default()).chain((1..count).map(variant)).collect()
    }

    fn rect(self, truth: Rect) -> Rect {
        truth.shifted(f64::from(self.offset[0]), f64::from(self.offset[1]))
    }

    fn params(self, params: &Params) -> Params {
        let mut params = params.clone();
        params.general.seed = params.general.seed.wrapping_add(self.seed);
        params
    }
}

/// Runs one set of parameters over a sequence: as many frames as have a row in the ground truth, at most `limit`.
/// Where nothing else runs in this process, `is_timed`, its processor time is told.
pub fn run(
    setup: &Setup,
    sequence: &Sequence,
    start: Start,
    limit: usize,
    is_timed: bool,
    on_frame: impl Fn(),
) -> Result<Run, RunError> {
    let target = sequence.truth.first().copied().flatten().ok_or(RunError::NoTarget)?;
    let mut source = replay::open(&sequence.path, None, &setup.params.limits)?;
    let mut session = Session::new(start.params(&setup.params))?;
    let mut answers = Vec::with_capacity(sequence.truth.len());
    let mut time = Duration::ZERO;
    let mut failures = FailureLog::default();
    while answers.len() < limit.min(sequence.truth.len()) {
        let Some(buffer) = source.next_frame()? else { break };
        let frame = buffer.frame();
        let begun = processor_time();
        if answers.is_empty() {
            session.start(&frame, start.rect(target), &mut ())?;
        } else {
            session.step(&frame, &mut ());
        }
        time += processor_time().saturating_sub(begun);
        failures.watch(&session);
        answers.push(Answer::of(session.output()));
        on_frame();
    }
    if start == Start::default() {
        source.notes().iter().for_each(|note| log::warn!("{note}"));
        if let Some(note) = miscounted(sequence, answers.len(), source.remaining(), limit) {
            log::warn!("{note}");
        }
    }
    Ok(Run { answers, processor_time: is_timed.then_some(time) })
}

/// What to say of a sequence that has not as many images as boxes.
fn miscounted(sequence: &Sequence, scored: usize, left: Option<usize>, limit: usize) -> Option<String> {
    let boxes = sequence.truth.len();
    let images = scored + left?;
    let differ = images != boxes && images.min(boxes) < limit;
    let name = &sequence.name;
    differ.then(|| format!("{name}: {images} images, but {boxes} boxes; the first {scored} are scored"))
}

/// The runs of one set of parameters: by start, and within it by sequence.
pub type Runs = Vec<Vec<Result<Run, RunError>>>;

/// Runs every set over every sequence from every start on so many threads. The results stand by set, start and
/// sequence, in the order given. Processor time is told on a single thread only: it is that of the whole process, for
/// networks compute in threads of their own.
pub fn run_all(
    setups: &[Setup],
    sequences: &[Sequence],
    starts: &[Start],
    limit: usize,
    threads: usize,
    on_frame: impl Fn() + Sync,
) -> Vec<Runs> {
    let runs = (0..setups.len()).flat_map(|s| (0..starts.len()).map(move |k| (s, k)));
    let mut jobs: Vec<_> = runs.flat_map(|(s, k)| (0..sequences.len()).map(move |q| (s, k, q))).collect();
    // The longest first, so that none is left over for a single thread at the end.
    jobs.sort_by_key(|&(.., q)| std::cmp::Reverse(sequences[q].truth.len()));
    let threads = threads.min(jobs.len());
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(jobs.len()));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(&(s, k, q)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let result = run(&setups[s], &sequences[q], starts[k], limit, threads == 1, &on_frame);
                    done.lock().unwrap_or_else(|e| e.into_inner()).push(((s, k, q), result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(|e| e.into_inner());
    done.sort_by_key(|&(job, _)| job);
    let mut done = done.into_iter().map(|(_, result)| result);
    let mut runs = || starts.iter().map(|_| done.by_ref().take(sequences.len()).collect()).collect();
    setups.iter().map(|_| runs()).collect()
}

/// The processor time of this process.
fn processor_time() -> Duration {
    Duration::try_from(clock_gettime(ClockId::ProcessCPUTime)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_without_boxes_and_boxes_without_images_are_told() {
        let truth = vec![None; 10];
        let sequence = Sequence { name: "walk".to_owned(), path: "walk".into(), truth, hidden: None };
        let note = |scored, left, limit| miscounted(&sequence, scored, Some(left), limit);
        assert_eq!(note(8, 0, usize::MAX).as_deref(), Some("walk: 8 images, but 10 boxes; the first 8 are scored"));
        assert_eq!(note(10, 2, usize::MAX).as_deref(), Some("walk: 12 images, but 10 boxes; the first 10 are scored"));
        assert_eq!(note(10, 0, usize::MAX), None);
        // Fewer were asked for.
        assert_eq!((note(5, 5, 5), note(10, 2, 10)), (None, None));
    }

    #[test]
    fn the_first_start_is_plain_and_the_others_differ_from_it_and_each_other() {
        let starts = Start::variants(17);
        assert_eq!(starts[0], Start { offset: [0, 0], seed: 0 });
        for (i, a) in starts.iter().enumerate().skip(1) {
            assert!(a.offset.iter().any(|v| v.abs() == 1) && a.offset.iter().all(|v| v.abs() <= 1));
            assert!(starts[..i].iter().all(|b| a.seed != b.seed && (i > 8 || a.offset != b.offset)));
        }
        assert_eq!(Start::variants(1), [Start::default()]);
        let rect = starts[2].rect(Rect::new(10.0, 20.0, 3.0, 4.0));
        assert_eq!(rect, Rect::new(9.0, 20.0, 3.0, 4.0));
        let params = Params::default();
        assert_eq!(starts[0].params(&params), params);
        assert_eq!(starts[2].params(&params).general.seed, params.general.seed + 2);
    }
}
