//! Parameters: the one table, checked changes, and files.
//!
//! [`Params`] is a plain struct; everything else about a parameter (type, range, unit, description, what a change
//! of it needs) is in its [`Descriptor`]. Both come from the same rows, in `schema.rs`,
//! `lcmht.rs`, `etepf.rs` and `maptrack.rs`.
//! A change is checked as a whole and makes a new set, or is refused as a whole: [`Params::with`].

mod bounds;
mod etepf;
mod gone;
mod lcmht;
mod maptrack;
mod markdown;
mod need;
mod node_name;
mod order;
mod presets;
mod rcl;
mod schema;
mod table;
mod tier;
mod value;
mod yaml;

use std::sync::LazyLock;

pub use etepf::*;
pub use lcmht::*;
pub use maptrack::*;
pub use markdown::markdown;
pub use need::Need;
pub use node_name::NodeName;
pub use presets::{PRESETS, Preset, list as preset_list, preset_or_file};
pub use rcl::{Origin, Override, Overrides, Place};
pub use schema::*;
pub(crate) use table::Group;
pub use tier::Tier;
pub use value::{Descriptor, Range, Value, ValueKind};
pub use yaml::{Assignment, assignment, changed_preset, file, preset};

use crate::error::ParamsError;

static DESCRIPTORS: LazyLock<Vec<Descriptor>> = LazyLock::new(|| {
    let mut all = Vec::new();
    Params::describe(&mut all);
    // Stable: within a tier, the order of the table.
    all.sort_by_key(|d| d.tier);
    all
});

/// Every parameter: those that are met first in front, those for ablation last, otherwise in the order of the table.
pub fn descriptors() -> &'static [Descriptor] {
    &DESCRIPTORS
}

/// The descriptor of a parameter.
pub fn descriptor(name: &str) -> Option<&'static Descriptor> {
    DESCRIPTORS.iter().find(|d| d.name == name)
}

/// Characters of a string, or values of a list, that a parameter may hold. It is told when it is refused.
pub const MOST_VALUES: usize = 4096;

/// When a change is made: fixed parameters may be set only before the program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// From files, arguments and defaults.
    StartUp,
    /// While frames are being tracked.
    Running,
}

impl Params {
    /// The present value of a parameter.
    pub fn get(&self, name: &str) -> Option<Value> {
        Group::get(self, name)
    }

    /// This set with the changes made, in order, so that the last value of a name stands; or the first reason
    /// why not. Integers are taken for doubles.
    pub fn with<'a>(
        &self,
        changes: impl IntoIterator<Item = (&'a str, &'a Value)>,
        phase: Phase,
    ) -> Result<Self, ParamsError> {
        let mut changed = self.clone();
        for (name, value) in changes {
            changed.set(name, value, phase)?;
        }
        changed.check()?;
        if phase == Phase::Running {
            changed.check_growth(self)?;
        }
        Ok(changed)
    }

    fn set(&mut self, name: &str, value: &Value, phase: Phase) -> Result<(), ParamsError> {
        let descriptor = descriptor(name).ok_or_else(|| unknown(name))?;
        let name = name.to_owned();
        if value.extent() > MOST_VALUES {
            return Err(ParamsError::Long { name, len: value.extent(), most: MOST_VALUES });
        }
        let value = widened(value, descriptor.default.kind());
        if value.kind() != descriptor.default.kind() {
            return Err(ParamsError::Type {
                name,
                expected: descriptor.default.kind().name(),
                got: format!("{} {value}", value.kind().name()),
            });
        }
        if let Some(range) = &descriptor.range
            && !range.contains(&value)
        {
            return Err(ParamsError::Range { name, range: range.to_string(), got: value.to_string() });
        }
        if let Value::String(got) = &value
            && !descriptor.choices.is_empty()
            && !descriptor.choices.contains(&got.as_str())
        {
            return Err(ParamsError::Choice { name, choices: descriptor.choices.join(", "), got: got.clone() });
        }
        if phase == Phase::Running && descriptor.need == Need::Restart && self.get(&name).as_ref() != Some(&value) {
            return Err(ParamsError::ReadOnly { name });
        }
        let stored = self.put(&name, &value);
        debug_assert_eq!(stored, Some(true), "{name} was checked above");
        Ok(())
    }
}

/// YAML writes `1` where a double is meant.
fn widened(value: &Value, kind: ValueKind) -> Value {
    match (value, kind) {
        (Value::Integer(v), ValueKind::Double) => Value::Double(*v as f64),
        (Value::IntegerArray(v), ValueKind::DoubleArray) => Value::DoubleArray(v.iter().map(|&v| v as f64).collect()),
        _ => value.clone(),
    }
}

/// The beginning of a name that may be of any length.
fn brief(name: &str) -> String {
    const MOST: usize = 100;
    match name.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}...", &name[..end]),
        None => name.to_owned(),
    }
}

/// The error for a name that no parameter bears, with what became of it or the closest name there is.
pub fn unknown(name: &str) -> ParamsError {
    if let Some(value) = gone::constant(name) {
        return ParamsError::Unknown { name: name.to_owned(), hint: format!("; it is now a constant: {value}") };
    }
    let name = &*brief(name);
    let shared = |a: &str, b: &str| {
        let ends = a.bytes().zip(b.bytes()).take_while(|(x, y)| x == y).count();
        ends + a.bytes().rev().zip(b.bytes().rev()).take_while(|(x, y)| x == y).count()
    };
    let hint = DESCRIPTORS
        .iter()
        .max_by_key(|d| shared(d.name, name))
        .filter(|d| shared(d.name, name) * 2 >= name.len())
        .map_or(String::new(), |d| format!("; did you mean '{}'?", d.name));
    ParamsError::Unknown { name: name.to_owned(), hint }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(name: &str, value: Value) -> Result<Params, ParamsError> {
        Params::default().with([(name, &value)], Phase::Running)
    }

    #[test]
    fn every_row_reads_back_its_default_and_describes_itself() {
        let params = Params::default();
        params.check().unwrap();
        for d in descriptors() {
            assert_eq!(params.get(d.name).as_ref(), Some(&d.default), "{}", d.name);
            assert!(!d.description.is_empty(), "{}", d.name);
            assert!(d.range.is_none_or(|r| r.contains(&d.default)), "{}", d.name);
            let number = matches!(d.default.kind(), ValueKind::Integer | ValueKind::Double);
            assert!(!number || d.range.is_some(), "{} has no range", d.name);
        }
        let mut names: Vec<_> = descriptors().iter().map(|d| d.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), descriptors().len());
    }

    #[test]
    fn wrong_changes_are_refused_with_the_reason() {
        let message = |name, value| set(name, value).unwrap_err().to_string();
        assert_eq!(
            message("debug.max_sid", Value::Integer(3)),
            "unknown parameter 'debug.max_sid'; did you mean 'debug.max_side'?"
        );
        assert_eq!(
            message("debug.max_side", Value::String("x".into())),
            "parameter 'debug.max_side' is of type integer, got string \"x\""
        );
        assert_eq!(
            message("debug.max_side", Value::Integer(3)),
            "parameter 'debug.max_side' must be from 16 to 4096, got 3"
        );
        assert!(matches!(set("lcmht.filter.learning_rate", Value::Double(f64::NAN)), Err(ParamsError::Range { .. })));
        assert!(matches!(set("algorithm", Value::String("kcf".into())), Err(ParamsError::Choice { .. })));
        assert!(matches!(set("seed", Value::Integer(5)), Err(ParamsError::ReadOnly { .. })));
        // Setting a fixed parameter to what it is changes nothing.
        assert!(set("seed", Params::default().get("seed").unwrap()).is_ok());
    }

    #[test]
    fn a_set_of_changes_is_taken_or_refused_as_a_whole() {
        let params = Params::default();
        let (good, bad) = (Value::Integer(100), Value::Integer(-1));
        let refused = params.with([("debug.max_side", &good), ("debug.jpeg_quality", &bad)], Phase::Running);
        assert!(refused.is_err());
        let taken = params.with([("debug.max_side", &bad), ("debug.max_side", &good)], Phase::Running);
        assert!(taken.is_err(), "a value out of range is refused even if a later one stands");
        let one = Value::Integer(1);
        let widened = params.with([("lcmht.filter.learning_rate", &one)], Phase::Running);
        assert_eq!(widened.unwrap().lcmht.filter.learning_rate, 1.0);
    }
}
