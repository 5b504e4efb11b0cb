//! A name as texts and numbers in turn.

use std::cmp::Ordering;
use std::str::Chars;

/// After these, or at the start of a name, a `-` may be a minus.
const BEFORE_SIGN: [char; 4] = ['_', '=', '(', ' '];
/// Digits of an exponent; longer ones are something else.
const EXPONENT: std::ops::RangeInclusive<usize> = 1..=3;

/// A name taken apart: a text, which may be empty, then a number, then a text, and so on.
#[derive(Debug, PartialEq)]
pub struct Name {
    texts: Vec<String>,
    pub numbers: Vec<Number>,
}

/// A number in a name.
#[derive(Debug, Default, PartialEq)]
pub struct Number {
    /// Whether a `-` stands before it that may be a minus; it is in no text.
    pub dash: bool,
    /// Digits between dots.
    pub groups: Vec<String>,
    /// Whether the dash is a minus.
    pub signed: bool,
    /// The group that is a fraction.
    pub fraction: Option<usize>,
}

impl Name {
    pub fn new(text: &str) -> Self {
        let mut this = Self { texts: vec![String::new()], numbers: Vec::new() };
        let mut rest = text.chars();
        while let Some(c) = rest.clone().next() {
            if !c.is_ascii_digit() {
                this.texts.last_mut().expect("a text to begin with").push(c);
                rest.next();
                continue;
            }
            let first = this.numbers.is_empty();
            let before = this.texts.last_mut().expect("a text to begin with");
            let apart = !before.ends_with(char::is_alphabetic);
            let dash = before.strip_suffix('-').is_some_and(|b| b.ends_with(BEFORE_SIGN) || first && b.is_empty());
            if dash {
                before.pop();
            }
            this.numbers.push(Number { dash, groups: groups(&mut rest, apart), ..Number::default() });
            this.texts.push(String::new());
        }
        this
    }

    /// The texts in order.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        self.texts.iter().map(String::as_str)
    }

    /// All that stands before a group of a number.
    pub fn up_to(&self, number: usize, group: usize) -> String {
        let mut all = String::new();
        for (text, number) in self.texts.iter().zip(&self.numbers[..number]) {
            all += &format!("{text}{}{}", if number.dash { "-" } else { "" }, number.groups.join("."));
        }
        let last = &self.numbers[number];
        all + &self.texts[number] + if last.dash { "-" } else { "" } + &last.groups[..group].join(".")
    }

    /// Which comes first. Names whose texts and numbers are the same are equal, however the numbers are written.
    pub fn order(&self, other: &Self) -> Ordering {
        for (i, (a, b)) in self.texts.iter().zip(&other.texts).enumerate() {
            let text = a.cmp(b);
            let both = text.then_with(|| match (self.numbers.get(i), other.numbers.get(i)) {
                (Some(a), Some(b)) => a.order(b),
                (a, b) => a.is_some().cmp(&b.is_some()),
            });
            if both != Ordering::Equal {
                return both;
            }
        }
        Ordering::Equal
    }
}

impl Number {
    fn order(&self, other: &Self) -> Ordering {
        let minus = |n: &Self| n.signed && n.dash && !n.is_zero();
        match (minus(self), minus(other)) {
            (true, false) => Ordering::Less,
            (false, true) => Ordering::Greater,
            (false, false) => self.size_order(other),
            (true, true) => other.size_order(self),
        }
    }

    fn size_order(&self, other: &Self) -> Ordering {
        for i in 0..self.groups.len().max(other.groups.len()) {
            let group = |n: &Self| n.groups.get(i).cloned();
            let order = match (group(self), group(other)) {
                (a, b) if self.fraction == Some(i) => decimal_order(&a.unwrap_or_default(), &b.unwrap_or_default()),
                (Some(a), Some(b)) => whole_order(&a, &b),
                (a, b) => a.is_some().cmp(&b.is_some()),
            };
            if order != Ordering::Equal {
                return order;
            }
        }
        Ordering::Equal
    }

    fn is_zero(&self) -> bool {
        self.groups.iter().all(|digits| digits.bytes().all(|d| d == b'0'))
    }
}

/// The order of digits read as whole numbers, of any length.
pub fn whole_order(a: &str, b: &str) -> Ordering {
    let (a, b) = (a.trim_start_matches('0'), b.trim_start_matches('0'));
    a.len().cmp(&b.len()).then_with(|| a.cmp(b))
}

/// The order of digits read as fractions, of any length.
pub fn decimal_order(a: &str, b: &str) -> Ordering {
    a.trim_end_matches('0').cmp(b.trim_end_matches('0'))
}

/// Reads digits with dots between them, and an exponent where the number stands `apart` from letters before it.
fn groups(rest: &mut Chars, apart: bool) -> Vec<String> {
    let mut groups = vec![digits(rest)];
    loop {
        let mut ahead = rest.clone();
        if !ahead.next().is_some_and(|c| c == '.' || c == ',') {
            break;
        }
        let more = digits(&mut ahead);
        if more.is_empty() {
            break;
        }
        groups.push(more);
        *rest = ahead;
    }
    if apart
        && groups.len() <= 2
        && let Some(exponent) = exponent(rest, groups.len() > 1)
    {
        return shifted(&groups[0], groups.get(1).map_or("", String::as_str), exponent);
    }
    groups
}

fn digits(rest: &mut Chars) -> String {
    let taken: String = rest.as_str().chars().take_while(char::is_ascii_digit).collect();
    *rest = rest.as_str()[taken.len()..].chars();
    taken
}

/// Reads an exponent as programs write it, with a sign: `e-05`. After a dot a unit may follow it; without, it may be
/// part of an identifier (`12e-41d4`).
fn exponent(rest: &mut Chars, dotted: bool) -> Option<i32> {
    let text = rest.as_str().strip_prefix(['e', 'E'])?;
    let mut ahead = text.strip_prefix(['+', '-'])?.chars();
    let found = digits(&mut ahead);
    let ends = dotted || !ahead.as_str().starts_with(|c: char| c.is_alphanumeric());
    let size: i32 = found.parse().ok()?;
    (ends && EXPONENT.contains(&found.len())).then(|| {
        *rest = ahead;
        if text.starts_with('-') { -size } else { size }
    })
}

/// The digits before and after the dot, once it is moved.
fn shifted(whole: &str, fraction: &str, exponent: i32) -> Vec<String> {
    let distance = exponent.unsigned_abs() as usize;
    let (before, after) = if exponent < 0 {
        let filled = format!("{}{whole}", "0".repeat(distance));
        let (before, after) = filled.split_at(filled.len() - distance);
        (before.to_owned(), format!("{after}{fraction}"))
    } else {
        let filled = format!("{fraction}{}", "0".repeat(distance.saturating_sub(fraction.len())));
        let (before, after) = filled.split_at(distance);
        (format!("{whole}{before}"), after.to_owned())
    };
    if after.is_empty() { vec![before] } else { vec![before, after] }
}
