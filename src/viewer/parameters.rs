//! The table of parameters as pages show it.

use serde::Serialize;
use serde_json::Value as Json;

use crate::params::{self, Descriptor, Need, Params, Range, Value, ValueKind};

/// Who has the page has it, and needs it not in a file.
const SECRET: &str = "viewer.token";

/// One parameter, but for its value.
#[derive(Serialize)]
pub(super) struct Row {
    name: &'static str,
    kind: &'static str,
    default: Json,
    range: Option<[Json; 2]>,
    choices: &'static [&'static str],
    unit: &'static str,
    description: &'static str,
    /// What becomes of a change.
    change: &'static str,
    fixed: bool,
    tier: &'static str,
}

fn shown() -> impl Iterator<Item = &'static Descriptor> {
    params::descriptors().iter().filter(|d| d.name != SECRET)
}

/// All parameters, those that are met first in front.
pub(super) fn rows() -> Vec<Row> {
    let row = |d: &'static Descriptor| Row {
        name: d.name,
        kind: d.default.kind().name(),
        default: json(&d.default),
        range: d.range.map(|range| match range {
            Range::Integer(low, high) => [low.into(), high.into()],
            Range::Double(low, high) => [low.into(), high.into()],
        }),
        choices: d.choices,
        unit: d.unit,
        description: d.description,
        change: d.need.about(),
        fixed: d.need == Need::Restart,
        tier: d.tier.name(),
    };
    shown().map(row).collect()
}

/// Their values, in the same order.
pub(super) fn values(params: &Params) -> Vec<Json> {
    shown().map(|d| params.get(d.name).map_or(Json::Null, |value| json(&value))).collect()
}

/// Those that are not at their default, as a parameter file.
pub(super) fn file(params: &Params) -> String {
    let mut rest = params.clone();
    if let Some(secret) = params::descriptor(SECRET) {
        rest = rest.with([(SECRET, &secret.default)], params::Phase::StartUp).unwrap_or(rest);
    }
    params::changed_preset(&rest, "What was changed on the live page.")
}

fn json(value: &Value) -> Json {
    match value {
        Value::Bool(v) => (*v).into(),
        Value::Integer(v) => (*v).into(),
        Value::Double(v) => (*v).into(),
        Value::String(v) => v.as_str().into(),
        Value::BoolArray(v) => v.clone().into(),
        Value::IntegerArray(v) => v.clone().into(),
        Value::DoubleArray(v) => v.clone().into(),
        Value::StringArray(v) => v.clone().into(),
    }
}

/// The value that a page gave for a parameter; what is of another type is refused by the table, with both types.
pub(super) fn value(name: &str, given: &Json) -> Result<Value, String> {
    let Some(descriptor) = params::descriptor(name).filter(|d| d.name != SECRET) else {
        return Err(params::unknown(name).to_string());
    };
    let kind = descriptor.default.kind();
    let wrong = || format!("parameter '{name}' is of type {}, got {given}", kind.name());
    fn list<T>(given: &Json, one: impl Fn(&Json) -> Option<T>) -> Option<Vec<T>> {
        given.as_array()?.iter().map(one).collect()
    }
    let text = |v: &Json| v.as_str().map(str::to_owned);
    let value = match kind {
        ValueKind::Bool => given.as_bool().map(Value::Bool),
        ValueKind::Integer => given.as_i64().map(Value::Integer),
        ValueKind::Double => given.as_f64().map(Value::Double),
        ValueKind::String => text(given).map(Value::String),
        ValueKind::BoolArray => list(given, Json::as_bool).map(Value::BoolArray),
        ValueKind::IntegerArray => list(given, Json::as_i64).map(Value::IntegerArray),
        ValueKind::DoubleArray => list(given, Json::as_f64).map(Value::DoubleArray),
        ValueKind::StringArray => list(given, text).map(Value::StringArray),
    };
    value.ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_as_they_were_shown_and_others_are_refused() {
        let params = Params::default();
        for (row, shown) in rows().iter().zip(values(&params)) {
            assert_eq!(value(row.name, &shown).as_ref(), Ok(&params.get(row.name).unwrap()));
        }
        assert_eq!(
            value("debug.max_side", &"x".into()).unwrap_err(),
            "parameter 'debug.max_side' is of type integer, got \"x\""
        );
        assert!(value("debug.max_sid", &3.into()).unwrap_err().contains("did you mean"));
        assert!(value(SECRET, &"x".into()).is_err());
    }

    #[test]
    fn the_file_holds_what_was_changed_and_no_secret() {
        let (side, token) = (Value::Integer(100), Value::String("secret-of-mine".to_owned()));
        let changed = [("debug.max_side", &side), (SECRET, &token)];
        let params = Params::default().with(changed, params::Phase::StartUp).unwrap();
        let text = file(&params);
        let rows: Vec<_> = text.lines().map(str::trim).filter(|line| !line.starts_with('#')).collect();
        assert_eq!(rows, ["/**:", "ros__parameters:", "debug:", "max_side: 100"]);
        assert!(!text.contains("secret-of-mine"));
    }
}
