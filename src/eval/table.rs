//! The figures of one tracker over all sequences, one row a sequence, and what makes sequences hard.

use std::collections::BTreeMap;

use serde::Serialize;

use super::attributes::Attribute;
use super::dataset::Sequence;
use super::figures::{Figures, Scored, mean};
use super::long_term::LongTerm;
use super::run::Run;
use super::spread::Spreads;
use crate::params::{Params, descriptors};

/// The sequences that are hard in one way.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hard {
    /// In what.
    pub attribute: Attribute,
    /// By which rule.
    pub rule: String,
    /// Their names.
    pub sequences: Vec<String>,
}

impl Hard {
    /// Sorts sequences, each with its attributes, by these; one that no sequence has is left out.
    pub fn sort(all: &[(&Sequence, Vec<Attribute>)]) -> Vec<Self> {
        let hard = |attribute: Attribute| {
            let with = all.iter().filter(|(_, has)| has.contains(&attribute));
            let sequences: Vec<String> = with.map(|(s, _)| s.name.clone()).collect();
            (!sequences.is_empty()).then(|| Self { attribute, rule: attribute.rule(), sequences })
        };
        Attribute::ALL.into_iter().filter_map(hard).collect()
    }
}

/// The figures of one tracker: one of ours with its parameters, or another's.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// What the setup is called.
    pub name: String,
    /// Whether the boxes were read from files.
    pub peer: bool,
    /// The parameters that differ from their defaults, values as YAML.
    pub parameters: BTreeMap<&'static str, String>,
    /// Over all sequences, from the plain start.
    pub mean: Option<Figures>,
    /// Of the means from each start, where there are several.
    pub spread: Option<Spreads>,
    /// Over the sequences of each attribute.
    pub attributes: Vec<Part>,
    /// One a sequence that was run to its end, by name.
    pub sequences: Vec<Row>,
}

/// The figures over some of the sequences, means.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// What they have in common.
    pub attribute: Attribute,
    /// How many of them were run.
    pub sequences: usize,
    /// As in [`Figures`].
    pub precision: f64,
    /// As in [`Figures`].
    pub auc: f64,
    /// As in [`Figures`].
    pub held: f64,
    /// As in [`Figures`].
    pub long_term: LongTerm,
}

impl Part {
    fn new(hard: &Hard, scored: &[(String, Vec<Scored>)]) -> Option<Self> {
        let among = scored.iter().filter(|(name, _)| hard.sequences.contains(name));
        let among: Vec<&Scored> = among.map(|(_, runs)| &runs[0]).collect();
        let Figures { precision, auc, held, long_term, .. } = mean(&among)?;
        Some(Self { attribute: hard.attribute, sequences: among.len(), precision, auc, held, long_term })
    }
}

/// The figures of one sequence.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The sequence.
    pub name: String,
    /// Its figures, from the plain start.
    #[serde(flatten)]
    pub figures: Figures,
    /// Of the figures from each start, where there are several.
    pub spread: Option<Spreads>,
}

impl Table {
    /// The table of a setup from the sequences that were run to their ends, each with its runs by start.
    pub fn new(name: &str, params: Option<&Params>, done: &[(&Sequence, Vec<&Run>)], hard: &[Hard]) -> Self {
        let scored = |(sequence, runs): &(&Sequence, Vec<&Run>)| {
            let scored: Option<Vec<_>> = runs.iter().map(|run| Scored::new(run, sequence)).collect();
            Some((sequence.name.clone(), scored.filter(|s| !s.is_empty())?))
        };
        let scored: Vec<(String, Vec<Scored>)> = done.iter().filter_map(scored).collect();
        let starts = scored.iter().map(|(_, runs)| runs.len()).min().unwrap_or(0);
        let means: Vec<Figures> =
            (0..starts).filter_map(|k| mean(&scored.iter().map(|(_, runs)| &runs[k]).collect::<Vec<_>>())).collect();
        let row = |(name, runs): &(String, Vec<Scored>)| Row {
            name: name.clone(),
            figures: runs[0].figures.clone(),
            spread: Spreads::new(&runs.iter().map(|s| &s.figures).collect::<Vec<_>>()),
        };
        Self {
            name: name.to_owned(),
            peer: params.is_none(),
            parameters: params.map(changed).unwrap_or_default(),
            spread: Spreads::new(&means.iter().collect::<Vec<_>>()),
            mean: means.into_iter().next(),
            attributes: hard.iter().filter_map(|hard| Part::new(hard, &scored)).collect(),
            sequences: scored.iter().map(row).collect(),
        }
    }
}

fn changed(params: &Params) -> BTreeMap<&'static str, String> {
    let value = |name| params.get(name);
    descriptors()
        .iter()
        .filter_map(|d| Some((d.name, value(d.name).filter(|v| *v != d.default)?.to_string())))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::answer::Answer;
    use crate::geometry::Rect;
    use crate::tracker::State;
    use std::time::Duration;

    const BOX: Rect = Rect::new(10.0, 10.0, 20.0, 20.0);

    fn sequence(name: &str, truth: Vec<Option<Rect>>) -> Sequence {
        Sequence { name: name.to_owned(), path: name.into(), truth, hidden: None }
    }

    fn run(rows: &[(f64, State, bool)], millis: u64) -> Run {
        let answer = |&(shift, state, reacquired): &(f64, State, bool)| Answer {
            rect: BOX.shifted(shift, 0.0),
            confidence: Some(1.0),
            state,
            reacquired,
        };
        let processor_time = Some(Duration::from_millis(millis));
        Run { answers: rows.iter().map(answer).collect(), processor_time }
    }

    /// Two sequences by hand: a perfect one with a frame out of view, and one that is lost for a frame, 30 px off.
    #[test]
    fn figures_and_means_agree_with_those_computed_by_hand() {
        use State::{Lost, Tracking, Uncertain};
        let sequences = [sequence("a", vec![Some(BOX), None, Some(BOX)]), sequence("b", vec![Some(BOX); 4])];
        let runs = [
            run(&[(0.0, Tracking, false), (30.0, Uncertain, false), (0.0, Tracking, false)], 30),
            run(&[(0.0, Tracking, false), (30.0, Lost, false), (0.0, Tracking, true), (30.0, Tracking, false)], 110),
        ];
        let worse = run(&[(0.0, Tracking, false), (30.0, Tracking, false), (30.0, Tracking, false)], 30);
        let done: Vec<_> = sequences.iter().zip(&runs).map(|(s, r)| (s, vec![r])).collect();
        let table = Table::new("lcmht", Some(&Params::default()), &done, &[]);
        let (a, b) = (&table.sequences[0].figures, &table.sequences[1].figures);
        assert_eq!((a.frames, a.precision, a.held, a.losses), (3, 1.0, 1.0, 0));
        assert_eq!((b.frames, b.precision, b.held, b.reacquired), (4, 0.5, 0.5, 1));
        assert_eq!((b.lost_frames, b.losses, b.recovered), (1, 1, 1));
        assert_eq!((a.first_loss, b.first_loss), (3, 1), "a misses its target while that is out of view only");
        assert_eq!((a.long_term.best.precision, a.long_term.best.recall), (2.0 / 3.0, 1.0));
        assert_eq!((b.long_term.best.precision, b.long_term.best.recall), (2.0 / 3.0, 0.5));
        assert_eq!((a.absences.absent_frames, b.absences.wrong, b.absences.astray), (1, 1, 1));
        let mean = table.mean.as_ref().unwrap();
        assert_eq!((mean.frames, mean.first_loss, mean.precision, mean.held), (7, 4, 0.75, 0.75));
        assert!((mean.auc - (20.0 / 21.0 + 10.0 / 21.0) / 2.0).abs() < 1e-12);
        assert!((mean.fps.unwrap() - 50.0).abs() < 1e-9, "seven frames in 0.14 s");
        assert_eq!((mean.long_term.best.precision, mean.long_term.best.recall), (2.0 / 3.0, 0.75));
        // Of five boxes given at 1, two are right.
        assert_eq!(mean.calibration_error, Some(3.0 / 5.0));
        assert_eq!(mean.curves.precision[20..], [0.75; 10].into_iter().chain([1.0; 21]).collect::<Vec<_>>());
        assert!(table.parameters.is_empty() && table.spread.is_none() && !table.peer);

        let done = [(&sequences[0], vec![&runs[0], &worse]), (&sequences[1], vec![&runs[1], &runs[1]])];
        let hard = Hard::sort(&[(&sequences[0], vec![Attribute::OutOfView]), (&sequences[1], vec![])]);
        assert_eq!(hard.len(), 1);
        let table = Table::new("other", None, &done, &hard);
        assert_eq!((table.attributes[0].sequences, table.attributes[0].precision), (1, 1.0));
        assert_eq!(table.mean.as_ref(), Some(mean), "the plain start's");
        assert_eq!(table.spread.unwrap().precision.runs, [0.75, 0.5]);
        assert_eq!(table.sequences[0].spread.as_ref().unwrap().precision.spread, 0.5);
        assert_eq!(table.sequences[1].spread.as_ref().unwrap().precision.spread, 0.0);
    }
}
