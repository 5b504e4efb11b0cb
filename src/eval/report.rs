//! The figures of an evaluation, as a table for people and as JSON for programs.

use std::fmt::{self, Write as _};

use serde::Serialize;

use super::dataset::Sequence;
use super::losses::losses;
use super::otb::score;
use super::run::{Run, Setup};
use crate::params::{Params, descriptors};

/// The figures of all sets of parameters.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The dataset's folder, as it was given.
    pub dataset: String,
    /// One a set of parameters.
    pub setups: Vec<Table>,
}

/// The figures of one set of parameters.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// What the set is called.
    pub name: String,
    /// The parameters that differ from their defaults, values as YAML.
    pub parameters: std::collections::BTreeMap<&'static str, String>,
    /// Shares are means over the sequences, counts are sums, the speed is over all frames.
    pub mean: Option<Figures>,
    /// One a sequence that was run to its end, by name.
    pub sequences: Vec<Row>,
}

/// The figures of one sequence.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The sequence.
    pub name: String,
    /// Its figures.
    #[serde(flatten)]
    pub figures: Figures,
}

/// Figures of one or more sequences.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Frames that were tracked.
    pub frames: usize,
    /// See [`Score::precision`](super::otb::Score::precision).
    pub precision: f64,
    /// See [`Score::auc`](super::otb::Score::auc).
    pub auc: f64,
    /// See [`Score::held`](super::otb::Score::held).
    pub held: f64,
    /// Frames reported as lost.
    pub lost_frames: usize,
    /// Times the tracker said that it found the target again.
    pub reacquired: usize,
    /// Runs of lost frames.
    pub losses: usize,
    /// Those that ended on the right target; see [`Losses`](super::losses::Losses).
    pub recovered: usize,
    /// Processor time of the tracker, in seconds.
    pub seconds: f64,
    /// Frames a second of that time.
    pub fps: f64,
}

impl Figures {
    /// The figures of a run; `None` where no frame of it has ground truth.
    pub fn of(run: &Run, sequence: &Sequence) -> Option<Self> {
        let rows = run.rows();
        let truth = &sequence.truth[..rows.len()];
        let boxes: Vec<_> = rows.iter().map(|r| r.1).collect();
        let score = score(&boxes, truth)?;
        let losses = losses(&rows, truth);
        let seconds = run.processor_time.as_secs_f64();
        Some(Self {
            frames: rows.len(),
            precision: score.precision,
            auc: score.auc,
            held: score.held,
            lost_frames: losses.frames,
            reacquired: run.outputs.iter().flat_map(|o| &o.targets).filter(|t| t.reacquired).count(),
            losses: losses.count,
            recovered: losses.recovered,
            seconds,
            fps: rate(rows.len(), seconds),
        })
    }

    /// Means of shares, sums of counts; `None` of nothing.
    fn mean(rows: &[Row]) -> Option<Self> {
        if rows.is_empty() {
            return None;
        }
        let share = |of: fn(&Self) -> f64| rows.iter().map(|r| of(&r.figures)).sum::<f64>() / rows.len() as f64;
        let sum = |of: fn(&Self) -> usize| rows.iter().map(|r| of(&r.figures)).sum::<usize>();
        let (frames, seconds) = (sum(|f| f.frames), rows.iter().map(|r| r.figures.seconds).sum::<f64>());
        Some(Self {
            frames,
            precision: share(|f| f.precision),
            auc: share(|f| f.auc),
            held: share(|f| f.held),
            lost_frames: sum(|f| f.lost_frames),
            reacquired: sum(|f| f.reacquired),
            losses: sum(|f| f.losses),
            recovered: sum(|f| f.recovered),
            seconds,
            fps: rate(frames, seconds),
        })
    }
}

/// So many a second; 0 where no time has passed.
fn rate(frames: usize, seconds: f64) -> f64 {
    if seconds > 0.0 { frames as f64 / seconds } else { 0.0 }
}

impl Table {
    /// The table of a set from its runs.
    pub fn new<'a>(setup: &Setup, runs: impl IntoIterator<Item = (&'a Sequence, &'a Run)>) -> Self {
        let row =
            |(sequence, run)| Some(Row { name: Sequence::clone(sequence).name, figures: Figures::of(run, sequence)? });
        let sequences: Vec<Row> = runs.into_iter().filter_map(row).collect();
        Self {
            name: setup.name.clone(),
            parameters: changed(&setup.params),
            mean: Figures::mean(&sequences),
            sequences,
        }
    }
}

fn changed(params: &Params) -> std::collections::BTreeMap<&'static str, String> {
    let value = |name| params.get(name);
    descriptors()
        .iter()
        .filter_map(|d| Some((d.name, value(d.name).filter(|v| *v != d.default)?.to_string())))
        .collect()
}

/// One table a set, one line a sequence, the means last.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, table) in self.setups.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{table}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const MEAN: &str = "mean";
        let names = self.sequences.iter().map(|r| r.name.chars().count());
        let width = names.chain([MEAN.len()]).max().unwrap_or_default();
        writeln!(f, "{}", self.name)?;
        writeln!(f, "{:width$}  frames  precision    AUC   held   lost  re-acquired  recovered/losses    fps", "")?;
        let mut line = |name: &str, d: usize, g: &Figures| {
            let mut ratio = String::new();
            write!(ratio, "{}/{}", g.recovered, g.losses)?;
            writeln!(
                f,
                "{name:width$}  {:6}  {:9.d$}  {:5.d$}  {:5.d$}  {:5}  {:11}  {ratio:>16}  {:5.0}",
                g.frames, g.precision, g.auc, g.held, g.lost_frames, g.reacquired, g.fps
            )
        };
        for row in &self.sequences {
            line(&row.name, 2, &row.figures)?;
        }
        self.mean.iter().try_for_each(|mean| line(MEAN, 3, mean))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rect;
    use crate::tracker::{Output, State, Target};
    use std::time::Duration;

    fn sequence(name: &str, truth: Vec<Option<Rect>>) -> Sequence {
        Sequence { name: name.to_owned(), path: name.into(), truth }
    }

    fn output(rect: Rect, state: State, reacquired: bool) -> Output {
        let target = Target {
            id: "0".into(),
            rect,
            velocity: [0.0; 2],
            confidence: 1.0,
            response: 0.0,
            state,
            reacquired,
            age: 0,
            lost_for: 0,
        };
        Output { targets: vec![target] }
    }

    /// Two sequences by hand: a perfect one with a frame out of view, and one that is lost for a frame, 30 px off.
    #[test]
    fn figures_and_means_agree_with_those_computed_by_hand() {
        let t = Rect::new(10.0, 10.0, 20.0, 20.0);
        let away = t.shifted(30.0, 0.0);
        let sequences = [sequence("a", vec![Some(t), None, Some(t)]), sequence("b", vec![Some(t); 4])];
        let tracked = |state| output(t, state, false);
        let runs = [
            Run {
                outputs: vec![
                    tracked(State::Tracking),
                    output(away, State::Uncertain, false),
                    tracked(State::Tracking),
                ],
                processor_time: Duration::from_millis(30),
            },
            Run {
                outputs: vec![
                    tracked(State::Tracking),
                    output(away, State::Lost, false),
                    output(t, State::Tracking, true),
                    output(away, State::Tracking, false),
                ],
                processor_time: Duration::from_millis(110),
            },
        ];
        let setup = Setup { name: "lcmht".to_owned(), params: Params::default() };
        let table = Table::new(&setup, sequences.iter().zip(&runs));
        let (a, b) = (&table.sequences[0].figures, &table.sequences[1].figures);
        assert_eq!((a.frames, a.precision, a.held, a.losses), (3, 1.0, 1.0, 0));
        assert_eq!((b.frames, b.precision, b.held, b.reacquired), (4, 0.5, 0.5, 1));
        assert_eq!((b.lost_frames, b.losses, b.recovered), (1, 1, 1));
        let mean = table.mean.as_ref().unwrap();
        assert_eq!((mean.frames, mean.precision, mean.held), (7, 0.75, 0.75));
        assert!((mean.auc - (20.0 / 21.0 + 10.0 / 21.0) / 2.0).abs() < 1e-12);
        assert!((mean.fps - 50.0).abs() < 1e-9, "seven frames in 0.14 s");
        let text = table.to_string();
        assert_eq!(
            text.lines().last().unwrap().split_whitespace().collect::<Vec<_>>(),
            ["mean", "7", "0.750", "0.714", "0.750", "1", "1", "1/1", "50"]
        );
        assert!(table.parameters.is_empty());
    }
}
