//! The order of numbered names: by the numbers in them.
//!
//! Digits count as numbers, so that `10` follows `9`. Digits on both sides of a dot are one of two things, and which of
//! them is seen from all names together, at each place by itself:
//!
//! | reading | as in | how it shows |
//! |---|---|---|
//! | decimals | `0.1` after `0.067`, as programs name files by `time.time()` | lengths differ, and no fraction ends in a zero |
//! | whole numbers | `1.10` after `1.9`, or seconds and nanoseconds | none begins with a zero, unless all are filled up to one length |
//!
//! Where both can be meant, or neither fits, the reading whose numbers are spaced more evenly is taken, decimals if
//! that tells nothing; a note says so. Fractions of one length have one order only, and there is no question.
//! A comma counts as a dot. `_` and `-` between two numbers separate whole numbers, unless what follows can only be
//! decimals (`1700000000_0333`, `1700000000_1`). Of several dots in a row (`10.11.12.5`) the last may begin a fraction.
//! `1e-05` is a number too. A `-` before a number, at the start of a name or after `_`, `=`, `(` or a space, is a minus
//! where other names have none at that place.

mod name;

use std::cmp::Ordering;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use self::name::{Name, decimal_order, whole_order};

/// Between two numbers, these separate them, and may stand for a dot where a program avoids dots in names.
const SEPARATORS: [&str; 2] = ["_", "-"];

/// How the digits after a dot are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reading {
    /// As the fraction of a decimal number.
    Decimals,
    /// As a number of their own.
    Whole,
}

impl Reading {
    fn name(self) -> &'static str {
        match self {
            Self::Decimals => "decimals",
            Self::Whole => "whole numbers",
        }
    }

    fn order(self, a: &str, b: &str) -> Ordering {
        match self {
            Self::Decimals => decimal_order(a, b),
            Self::Whole => whole_order(a, b),
        }
    }

    /// The number that the digits stand for.
    fn value(self, digits: &str) -> f64 {
        match self {
            Self::Decimals => format!("0.{digits}").parse(),
            Self::Whole => digits.parse(),
        }
        .unwrap_or_default()
    }
}

/// Sorts the files by the numbers in their names, which are looked at without folder and suffix. Gives what a user
/// should know of the order: which of two was taken, and which files bear the same numbers.
pub fn sort(paths: &mut [PathBuf]) -> Vec<String> {
    let mut names: Vec<(Name, PathBuf)> = paths.iter().map(|path| (Name::new(&stem(path)), path.clone())).collect();
    let mut notes = Vec::new();
    for place in places(&names) {
        notes.extend(decide(&mut names, &place));
    }
    names.sort_by(|(a, at), (b, bt)| a.order(b).then_with(|| at.cmp(bt)));
    notes.extend(equals(&names));
    for (path, (_, sorted)) in paths.iter_mut().zip(names) {
        *path = sorted;
    }
    notes
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn shown(path: &Path) -> String {
    format!("'{}'", path.file_name().unwrap_or_default().to_string_lossy())
}

/// The numbers that stand at the same place: after the same texts.
struct Place {
    /// The names that have a number there.
    names: Vec<usize>,
    /// Which number of its name it is.
    number: usize,
    /// The text between it and the one before it.
    before: String,
}

/// The places of the numbers in all names, in the order in which they are met.
fn places(names: &[(Name, PathBuf)]) -> Vec<Place> {
    let mut known = HashMap::new();
    let mut places: Vec<Place> = Vec::new();
    for (index, (name, _)) in names.iter().enumerate() {
        let mut texts = Vec::new();
        for (number, text) in name.texts().take(name.numbers.len()).enumerate() {
            texts.push(text.to_owned());
            let at = *known.entry(texts.clone()).or_insert(places.len());
            if at == places.len() {
                places.push(Place { names: Vec::new(), number, before: text.to_owned() });
            }
            places[at].names.push(index);
        }
    }
    places
}

/// Decides how the numbers of a place are read, and sets it in the names.
fn decide(names: &mut [(Name, PathBuf)], place: &Place) -> Vec<String> {
    let mut notes = Vec::new();
    let numbers = || place.names.iter().map(|&index| &names[index].0.numbers[place.number]);
    let dashes = numbers().filter(|n| n.dash).count();
    let signed = dashes > 0 && dashes < place.names.len();
    if dashes > 1 && !signed {
        notes.push("the '-' before every number is read as a dash, not as a minus".to_owned());
    }
    let longest = numbers().map(|n| n.groups.len()).max().unwrap_or(0);
    let (dotted, last) = (longest > 1, longest.saturating_sub(1));
    let separated = place.number > 0 && SEPARATORS.contains(&place.before.as_str());
    let mut reading = Reading::Whole;
    if dotted || separated {
        let mut series: HashMap<String, Series> = HashMap::new();
        for &index in &place.names {
            let (name, path) = &names[index];
            if let Some(digits) = name.numbers[place.number].groups.get(last) {
                series.entry(name.up_to(place.number, last)).or_default().push((digits, path));
            }
        }
        let (taken, note) = choose(series.into_values().collect(), dotted);
        reading = taken;
        notes.extend(note);
    }
    let fraction = (reading == Reading::Decimals).then_some(last);
    for &index in &place.names {
        let number = &mut names[index].0.numbers[place.number];
        (number.fraction, number.signed) = (fraction, signed);
    }
    notes
}

/// Files whose names are the same but for the digits in question, and these digits.
type Series<'a> = Vec<(&'a str, &'a Path)>;

/// How the digits are to be read, and what to say of it. After `_` and `-`, decimals must be the only way to read them.
fn choose(mut series: Vec<Series>, dotted: bool) -> (Reading, Option<String>) {
    let default = if dotted { Reading::Decimals } else { Reading::Whole };
    if differing(&mut series, default).is_none() {
        return (default, None);
    }
    let all = || series.iter().flatten().map(|(digits, _)| *digits);
    let (decimals, whole) = (may_be_decimals(all()), may_be_whole(all()));
    let reading = match (decimals, whole) {
        (true, false) => Reading::Decimals,
        _ if !dotted => Reading::Whole,
        (false, true) => Reading::Whole,
        _ if unevenness(&series, Reading::Whole) < unevenness(&series, Reading::Decimals) => Reading::Whole,
        _ => Reading::Decimals,
    };
    // What is usual and clear needs no word.
    let clear = decimals != whole;
    if reading == default && (clear || !dotted) {
        return (reading, None);
    }
    let example = differing(&mut series, reading);
    let note = example.map(|(a, b)| {
        let (a, b, sign) = (shown(a), shown(b), if dotted { "dot" } else { "last sign" });
        let doubt = if clear { "" } else { ", which the names leave open" };
        format!("the digits after the {sign} are read as {}{doubt}: {a} comes before {b}", reading.name())
    });
    (reading, note)
}

/// Sorts by a reading. Gives two files that follow each other and that the other reading would put the other way round.
fn differing<'a>(series: &mut [Series<'a>], reading: Reading) -> Option<(&'a Path, &'a Path)> {
    let other = if reading == Reading::Whole { Reading::Decimals } else { Reading::Whole };
    series.iter_mut().find_map(|files| {
        files.sort_by(|a, b| reading.order(a.0, b.0).then_with(|| a.1.cmp(b.1)));
        let pair = files.windows(2).find(|pair| other.order(pair[0].0, pair[1].0) == Ordering::Greater);
        pair.map(|pair| (pair[0].1, pair[1].1))
    })
}

/// Decimals are written with one number of digits, or without zeros at their ends (`0` stands for none at all).
fn may_be_decimals<'a>(mut digits: impl Iterator<Item = &'a str> + Clone) -> bool {
    let len = digits.clone().next().map_or(0, str::len);
    digits.clone().all(|d| d.len() == len) || digits.all(|d| d == "0" || !d.ends_with('0'))
}

/// Whole numbers are written without zeros before them, or all filled up with such to one length.
fn may_be_whole<'a>(digits: impl Iterator<Item = &'a str> + Clone) -> bool {
    let shortest = digits.clone().map(str::len).min().unwrap_or(0);
    let mut filled = digits.filter(|d| d.len() > 1 && d.starts_with('0'));
    filled.all(|d| d.len() == shortest)
}

/// How much the steps from file to file differ, as a share of their mean: 0 where all are alike.
fn unevenness(series: &[Series], reading: Reading) -> f64 {
    let (mut off, mut steps) = (0.0, 0);
    for files in series {
        let mut values: Vec<f64> = files.iter().map(|(digits, _)| reading.value(digits)).collect();
        values.sort_by(f64::total_cmp);
        let gaps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
        if mean > 0.0 {
            off += gaps.iter().map(|gap| (gap - mean).abs() / mean).sum::<f64>();
            steps += gaps.len();
        }
    }
    if steps == 0 { 0.0 } else { off / steps as f64 }
}

/// What to say of files whose numbers are the same.
fn equals(sorted: &[(Name, PathBuf)]) -> Option<String> {
    let same = |pair: &&[(Name, PathBuf)]| pair[0].0.order(&pair[1].0) == Ordering::Equal;
    let count = sorted.windows(2).filter(same).count();
    let first = sorted.windows(2).find(same)?;
    let (a, b) = (shown(&first[0].1), shown(&first[1].1));
    let others = if count > 1 { format!(" (and {} more such pairs)", count - 1) } else { String::new() };
    Some(format!("{a} and {b} have the same number{others}: both are used, in the order of their names"))
}

#[cfg(test)]
mod tests;
