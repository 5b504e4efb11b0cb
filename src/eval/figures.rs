//! All figures of one sequence, and of several together. The names of the fields are those in the JSON.

use serde::Serialize;

use super::absences::{Absences, absences};
use super::calibration::Calibration;
use super::dataset::Sequence;
use super::honesty::Honesty;
use super::long_term::{self, LongTerm, Profile};
use super::losses::losses;
use super::otb::{self, Curves};
use super::run::Run;

/// Figures of one or more sequences. Of several, shares and curves are means over the sequences, counts are sums, and
/// the speed is over all frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Frames that were tracked.
    pub frames: usize,
    /// See [`Score::precision`](otb::Score::precision).
    pub precision: f64,
    /// See [`Score::auc`](otb::Score::auc).
    pub auc: f64,
    /// See [`Score::held`](otb::Score::held).
    pub held: f64,
    /// See [`long_term`].
    pub long_term: LongTerm,
    /// Frames reported as lost.
    pub lost_frames: usize,
    /// Times the tracker said that it found the target again.
    pub reacquired: usize,
    /// Runs of lost frames.
    pub losses: usize,
    /// Those that ended on the right target; see [`Losses`](super::losses::Losses).
    pub recovered: usize,
    /// Frames until the target was lost for the first time; see [`Losses::first`](super::losses::Losses::first).
    pub first_loss: usize,
    /// How honestly `lost` was said.
    pub absences: Absences,
    /// Of trackers whose confidence is a share.
    pub calibration: Option<Calibration>,
    /// The expected calibration error.
    pub calibration_error: Option<f64>,
    /// What state was reported on the target and off it.
    pub honesty: Honesty,
    /// Processor time of the tracker, in seconds, where it is known.
    pub seconds: Option<f64>,
    /// Frames a second of that time.
    pub fps: Option<f64>,
    /// Precision and success at every threshold.
    pub curves: Curves,
}

/// The figures of one sequence, with what is needed to put several together.
#[derive(Clone, Debug)]
pub struct Scored {
    /// Its figures.
    pub figures: Figures,
    /// What its answers add up to.
    pub profile: Profile,
}

impl Scored {
    /// Scores a run; `None` where the target is never to be seen.
    pub fn new(run: &Run, sequence: &Sequence) -> Option<Self> {
        let answers = &run.answers;
        let truth = &sequence.truth[..answers.len()];
        let visible = &sequence.visible()[..answers.len()];
        let boxes: Vec<_> = answers.iter().map(|a| a.rect).collect();
        let score = otb::score(&boxes, truth)?;
        let profile = Profile::new(answers, visible)?;
        let losses = losses(answers, truth);
        let calibration = Calibration::new(answers, truth);
        let seconds = run.processor_time.map(|t| t.as_secs_f64());
        let figures = Figures {
            frames: answers.len(),
            precision: score.precision,
            auc: score.auc,
            held: score.held,
            long_term: long_term::best(&[&profile]),
            lost_frames: losses.frames,
            reacquired: answers.iter().filter(|a| a.reacquired).count(),
            losses: losses.count,
            recovered: losses.recovered,
            first_loss: losses.first,
            absences: absences(answers, visible),
            calibration,
            calibration_error: calibration.map(|c| c.error()),
            honesty: Honesty::new(answers, truth),
            seconds,
            fps: seconds.map(|s| rate(answers.len(), s)),
            curves: score.curves,
        };
        Some(Self { figures, profile })
    }
}

/// The figures of several sequences; `None` of none.
pub fn mean(all: &[&Scored]) -> Option<Figures> {
    if all.is_empty() {
        return None;
    }
    let figures = || all.iter().map(|s| &s.figures);
    let share = |of: fn(&Figures) -> f64| figures().map(of).sum::<f64>() / all.len() as f64;
    let sum = |of: fn(&Figures) -> usize| figures().map(of).sum::<usize>();
    let profiles: Vec<_> = all.iter().map(|s| &s.profile).collect();
    let frames = sum(|f| f.frames);
    let seconds = figures().map(|f| f.seconds).sum::<Option<f64>>();
    let calibration = figures().map(|f| f.calibration).try_fold(Calibration::default(), |mut sum, next| {
        sum += next?;
        Some(sum)
    });
    Some(Figures {
        frames,
        precision: share(|f| f.precision),
        auc: share(|f| f.auc),
        held: share(|f| f.held),
        long_term: long_term::best(&profiles),
        lost_frames: sum(|f| f.lost_frames),
        reacquired: sum(|f| f.reacquired),
        losses: sum(|f| f.losses),
        recovered: sum(|f| f.recovered),
        first_loss: sum(|f| f.first_loss),
        absences: figures().fold(Absences::default(), |mut sum, f| {
            sum += f.absences;
            sum
        }),
        calibration,
        calibration_error: calibration.map(|c| c.error()),
        honesty: figures().fold(Honesty::default(), |mut sum, f| {
            sum += f.honesty;
            sum
        }),
        seconds,
        fps: seconds.map(|s| rate(frames, s)),
        curves: Curves::mean(figures().map(|f| &f.curves)),
    })
}

/// So many a second; 0 where no time has passed.
fn rate(frames: usize, seconds: f64) -> f64 {
    if seconds > 0.0 { frames as f64 / seconds } else { 0.0 }
}
