//! Whether a gain holds on video that it was not chosen on.
//!
//! Every second sequence by name is one half, the rest the other. On each half the best setup is chosen, and scored on
//! the other. A setup whose difference from the best is chance is as good; of these the one that was given first wins,
//! so simpler setups are given first. Setups are compared in pairs, sequence by sequence, over those that both were run
//! on.

use serde::Serialize;

use super::bootstrap::{Interval, mean, p_value};
use super::calibration::Calibration;
use super::figures::Figures;
use super::honesty::Honesty;
use super::spread::Spreads;
use super::table::{Row, Table};
use super::worlds::Worlds;

/// A difference that would come by chance more often than this is none.
pub const CHANCE: f64 = 0.05;
/// What the halves are called.
pub const NAMES: [&str; 2] = ["A", "B"];
/// What all sequences together are called.
pub const ALL: &str = "all";

/// All that is said of the halves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Halves {
    /// The names of the sequences of each half.
    pub halves: [Vec<String>; 2],
    /// One a setup, in the order given.
    pub setups: Vec<Standing>,
    /// What is chosen on each half, where there are several setups.
    pub choices: Vec<Choice>,
    /// Each half by what the other half chose.
    pub crossed: Option<Summary>,
}

/// How a setup does on the halves, on all sequences, and on those of each world; and against the first setup.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Standing {
    /// What the setup is called.
    pub name: String,
    /// By group.
    pub groups: Vec<Group>,
}

/// How a setup does on a group of sequences.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// What they are called: A, B, all, or a world.
    pub name: String,
    /// The figures.
    pub summary: Summary,
    /// The AUC less that of the first setup; of the first there is none.
    pub against_first: Option<Difference>,
}

/// Means over the sequences of a group.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// How many there are.
    pub sequences: usize,
    /// Precision at 20 px.
    pub precision: Interval,
    /// Area under the success curve.
    pub auc: Interval,
    /// Share of frames in which the target is held.
    pub held: Interval,
    /// The expected calibration error over the frames of the first start, where confidences are shares.
    pub calibration_error: Option<f64>,
    /// What state was reported on the target and off it, from the first start.
    pub honesty: Honesty,
}

/// A difference of means of two setups over the same sequences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// How many sequences both were run on.
    pub sequences: usize,
    /// The difference.
    pub interval: Interval,
    /// How probable it is by chance: see [`p_value`].
    pub p: f64,
}

/// What one half chooses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// The half that it is chosen on.
    pub on: &'static str,
    /// The setup.
    pub setup: String,
    /// How that does on the other half.
    pub on_other: Summary,
}

/// A figure that the halves are compared by.
type Figure = (fn(&Figures) -> f64, fn(&Spreads) -> &[f64]);

const PRECISION: Figure = (|f| f.precision, |s| &s.precision.runs);
const AUC: Figure = (|f| f.auc, |s| &s.auc.runs);
const HELD: Figure = (|f| f.held, |s| &s.held.runs);

/// A figure of a sequence from each start.
fn by_start(row: &Row, (of, runs): Figure) -> Vec<f64> {
    row.spread.as_ref().map_or_else(|| vec![of(&row.figures)], |spread| runs(spread).to_vec())
}

impl Halves {
    /// Of sequences by name, in order, and of what was run on them.
    pub fn new(names: &[String], tables: &[Table], worlds: &Worlds) -> Self {
        let half = |k: usize| names.iter().skip(k).step_by(2).cloned().collect();
        let halves: [Vec<String>; 2] = [half(0), half(1)];
        let mut groups = vec![(NAMES[0], halves[0].clone()), (NAMES[1], halves[1].clone()), (ALL, names.to_vec())];
        if !worlds.is_empty() {
            let mut known: Vec<&str> = names.iter().map(|name| worlds.of(name)).collect();
            known.sort_unstable();
            known.dedup();
            let of = |world| names.iter().filter(|name| worlds.of(name) == world).cloned().collect();
            groups.extend(known.into_iter().map(|world| (world, of(world))));
        }
        let standing = |(i, table): (usize, &Table)| Standing {
            name: table.name.clone(),
            groups: groups.iter().filter_map(|(name, names)| Group::new(name, names, table, tables, i)).collect(),
        };
        let setups = tables.iter().enumerate().map(standing).collect();
        let several = if tables.len() > 1 { tables } else { &[] };
        let chosen = [0, 1].map(|k| choose(several, &halves[k]));
        let choice = |k: usize| {
            let table = chosen[k]?;
            let on_other = Summary::new(&rows(table, &halves[1 - k]))?;
            Some(Choice { on: NAMES[k], setup: table.name.clone(), on_other })
        };
        let crossed = || {
            let [a, b] = chosen;
            Summary::new(&[rows(b?, &halves[0]), rows(a?, &halves[1])].concat())
        };
        Self { setups, choices: [0, 1].into_iter().filter_map(choice).collect(), crossed: crossed(), halves }
    }
}

impl Group {
    fn new(name: &str, names: &[String], table: &Table, tables: &[Table], place: usize) -> Option<Self> {
        let summary = Summary::new(&rows(table, names))?;
        let first = tables.first().filter(|_| place > 0);
        let against_first = first.and_then(|first| Difference::new(table, first, names));
        Some(Self { name: name.to_owned(), summary, against_first })
    }
}

impl Summary {
    fn new(rows: &[&Row]) -> Option<Self> {
        let interval = |figure| Interval::of(&rows.iter().map(|row| by_start(row, figure)).collect::<Vec<_>>());
        let calibration = rows.iter().try_fold(Calibration::default(), |mut sum, row| {
            sum += row.figures.calibration?;
            Some(sum)
        });
        let honesty = rows.iter().fold(Honesty::default(), |mut sum, row| {
            sum += row.figures.honesty;
            sum
        });
        Some(Self {
            sequences: rows.len(),
            precision: interval(PRECISION)?,
            auc: interval(AUC)?,
            held: interval(HELD)?,
            calibration_error: calibration.map(|sum| sum.error()),
            honesty,
        })
    }
}

impl Difference {
    /// Of the AUC of `table` less that of `other`. Starts are paired where both have as many, else the means of them.
    fn new(table: &Table, other: &Table, names: &[String]) -> Option<Self> {
        let pairs = rows(table, names).into_iter().filter_map(|row| {
            let other = other.sequences.iter().find(|r| r.name == row.name)?;
            let [own, others] = [row, other].map(|row| by_start(row, AUC));
            Some(match own.len() == others.len() {
                true => own.iter().zip(&others).map(|(a, b)| a - b).collect(),
                false => vec![mean(own.into_iter()) - mean(others.into_iter())],
            })
        });
        let differences: Vec<Vec<f64>> = pairs.collect();
        let by_sequence: Vec<f64> = differences.iter().map(|starts| mean(starts.iter().copied())).collect();
        let interval = Interval::of(&differences)?;
        Some(Self { sequences: differences.len(), interval, p: p_value(&by_sequence) })
    }
}

/// The rows of those sequences.
fn rows<'a>(table: &'a Table, names: &[String]) -> Vec<&'a Row> {
    table.sequences.iter().filter(|row| names.contains(&row.name)).collect()
}

/// The first of the setups that are as good on these sequences as the one of the highest AUC.
fn choose<'a>(tables: &'a [Table], names: &[String]) -> Option<&'a Table> {
    let auc = |table: &Table| Summary::new(&rows(table, names)).map(|summary| summary.auc.mean);
    let scored: Vec<(&Table, f64)> = tables.iter().filter_map(|table| Some((table, auc(table)?))).collect();
    let &(best, _) = scored.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let as_good =
        |table: &Table| std::ptr::eq(table, best) || Difference::new(best, table, names).is_some_and(|d| d.p >= CHANCE);
    scored.iter().map(|(table, _)| *table).find(|table| as_good(table))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table with the AUC of each sequence `s0`, `s1` and so on from each start.
    fn table(name: &str, auc: &[&[f64]]) -> Table {
        let row = |(i, starts): (usize, &&[f64])| {
            let figures: Vec<_> = starts.iter().map(|&auc| Figures { auc, ..Figures::default() }).collect();
            let spread = Spreads::new(&figures.iter().collect::<Vec<_>>());
            Row { name: format!("s{i}"), figures: figures[0].clone(), spread }
        };
        Table {
            name: name.to_owned(),
            peer: false,
            parameters: Default::default(),
            mean: None,
            spread: None,
            attributes: Vec::new(),
            sequences: auc.iter().enumerate().map(row).collect(),
        }
    }

    fn names(count: usize) -> Vec<String> {
        (0..count).map(|i| format!("s{i}")).collect()
    }

    fn worlds(text: &str) -> Worlds {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Worlds::read(file.path()).unwrap()
    }

    #[test]
    fn every_second_sequence_is_in_one_half_and_worlds_are_told_apart() {
        let only = table("only", &[&[0.1, 0.3], &[0.4, 0.4], &[0.6, 0.6]]);
        let found = Halves::new(&names(3), &[only], &worlds("s0,drone\ns1,drone\n"));
        assert_eq!(found.halves, [vec!["s0".to_owned(), "s2".to_owned()], vec!["s1".to_owned()]]);
        let groups = found.setups[0].groups.iter().map(|g| (&*g.name, g.summary.sequences, g.summary.auc.mean));
        let rounded: Vec<_> = groups.map(|(name, n, auc)| (name, n, (auc * 1e6).round() / 1e6)).collect();
        assert_eq!(rounded, [("A", 2, 0.4), ("B", 1, 0.4), ("all", 3, 0.4), ("drone", 2, 0.3), ("other", 1, 0.6)]);
        assert!(found.choices.is_empty() && found.crossed.is_none(), "nothing to choose from");
    }

    /// One setup is better on one half, the other on the other half: what either half chooses fails on the other.
    #[test]
    fn what_one_half_chooses_is_scored_on_the_other() {
        const COUNT: usize = 24;
        let alternating = |even: f64, odd: f64| -> Vec<Vec<f64>> {
            (0..COUNT).map(|i| vec![if i % 2 == 0 { even } else { odd }]).collect()
        };
        let of = |name, figures: &[Vec<f64>]| table(name, &figures.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let tables = [of("x", &alternating(0.8, 0.2)), of("y", &alternating(0.4, 0.6))];
        let found = Halves::new(&names(COUNT), &tables, &Worlds::default());
        let told: Vec<_> =
            found.choices.iter().map(|c| (c.on, &*c.setup, (c.on_other.auc.mean * 10.0).round())).collect();
        assert_eq!(told, [("A", "x", 2.0), ("B", "y", 4.0)]);
        let crossed = found.crossed.unwrap();
        assert_eq!((crossed.sequences, (crossed.auc.mean * 10.0).round()), (COUNT, 3.0));
        let against = |group: usize| found.setups[1].groups[group].against_first.unwrap();
        assert!((against(0).interval.mean + 0.4).abs() < 1e-9 && against(0).p < 0.01);
        assert!((against(2).interval.mean).abs() < 1e-9 && against(2).p > 0.5);
        assert_eq!(found.setups[0].groups[0].against_first, None);
    }

    #[test]
    fn where_the_difference_is_chance_the_first_is_chosen() {
        let simple = table("simple", &[&[0.5], &[0.5], &[0.5], &[0.5], &[0.5]]);
        let lucky = table("lucky", &[&[0.45], &[0.8], &[0.45], &[0.5], &[0.5]]);
        let tables = [simple, lucky];
        assert_eq!(choose(&tables, &names(5)).unwrap().name, "simple");
        let better: Vec<[f64; 1]> = (0..12).map(|_| [0.6]).collect();
        let worse: Vec<[f64; 1]> = (0..12).map(|_| [0.5]).collect();
        let slices = |v: &'_ [[f64; 1]]| v.iter().map(|a| a.to_vec()).collect::<Vec<_>>();
        let of = |name, v: Vec<Vec<f64>>| table(name, &v.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let tables = [of("simple", slices(&worse)), of("better", slices(&better))];
        assert_eq!(choose(&tables, &names(12)).unwrap().name, "better");
        assert!(choose(&tables, &[]).is_none());
    }

    #[test]
    fn setups_are_compared_over_what_both_were_run_on() {
        let long = table("long", &[&[0.5, 0.7], &[0.6, 0.6], &[0.9, 0.9]]);
        let short = table("short", &[&[0.4], &[0.4]]);
        let difference = Difference::new(&short, &long, &names(3)).unwrap();
        assert_eq!(difference.sequences, 2);
        assert!((difference.interval.mean + 0.2).abs() < 1e-9);
        assert_eq!(Difference::new(&short, &long, &[]), None);
    }
}
