//! Values of parameters, the types a parameter may have, and the description of one.

use std::fmt;

use super::need::Need;
use super::tier::Tier;

/// The value of a parameter, of one of the types that ROS 2 knows.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A boolean.
    Bool(bool),
    /// A 64-bit signed integer.
    Integer(i64),
    /// A 64-bit float.
    Double(f64),
    /// Text.
    String(String),
    /// A list of booleans.
    BoolArray(Vec<bool>),
    /// A list of integers.
    IntegerArray(Vec<i64>),
    /// A list of floats.
    DoubleArray(Vec<f64>),
    /// A list of texts.
    StringArray(Vec<String>),
}

impl Value {
    /// The type's name as messages and tables give it.
    pub const fn kind(&self) -> ValueKind {
        match self {
            Self::Bool(_) => ValueKind::Bool,
            Self::Integer(_) => ValueKind::Integer,
            Self::Double(_) => ValueKind::Double,
            Self::String(_) => ValueKind::String,
            Self::BoolArray(_) => ValueKind::BoolArray,
            Self::IntegerArray(_) => ValueKind::IntegerArray,
            Self::DoubleArray(_) => ValueKind::DoubleArray,
            Self::StringArray(_) => ValueKind::StringArray,
        }
    }

    /// A list of this value alone; a list stays as it is.
    pub fn into_array(self) -> Self {
        match self {
            Self::Bool(v) => Self::BoolArray(vec![v]),
            Self::Integer(v) => Self::IntegerArray(vec![v]),
            Self::Double(v) => Self::DoubleArray(vec![v]),
            Self::String(v) => Self::StringArray(vec![v]),
            list => list,
        }
    }

    /// Adds a value to a list of its type; whether this is one.
    pub fn push(&mut self, item: &Self) -> bool {
        match (self, item) {
            (Self::BoolArray(list), Self::Bool(v)) => list.push(*v),
            (Self::IntegerArray(list), Self::Integer(v)) => list.push(*v),
            (Self::DoubleArray(list), Self::Double(v)) => list.push(*v),
            (Self::StringArray(list), Self::String(v)) => list.push(v.clone()),
            _ => return false,
        }
        true
    }
}

impl Value {
    /// Characters of text, values of a list, or both together; 1 for a single value.
    pub fn extent(&self) -> usize {
        match self {
            Self::Bool(_) | Self::Integer(_) | Self::Double(_) => 1,
            Self::String(v) => v.len(),
            Self::BoolArray(v) => v.len(),
            Self::IntegerArray(v) => v.len(),
            Self::DoubleArray(v) => v.len(),
            Self::StringArray(v) => v.len() + v.iter().map(String::len).sum::<usize>(),
        }
    }
}

/// Writes the value as YAML in one line, so that what is printed can be read back.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fn list<T>(f: &mut fmt::Formatter<'_>, items: &[T], one: impl Fn(&T) -> String) -> fmt::Result {
            write!(f, "[{}]", items.iter().map(one).collect::<Vec<_>>().join(", "))
        }
        let quoted = |v: &String| format!("{v:?}");
        match self {
            Self::Bool(v) => write!(f, "{v}"),
            Self::Integer(v) => write!(f, "{v}"),
            Self::Double(v) => f.write_str(&double(v)),
            Self::String(v) => f.write_str(&quoted(v)),
            Self::BoolArray(v) => list(f, v, bool::to_string),
            Self::IntegerArray(v) => list(f, v, i64::to_string),
            Self::DoubleArray(v) => list(f, v, double),
            Self::StringArray(v) => list(f, v, quoted),
        }
    }
}

/// The number with a point and, in an exponent, a sign: without both, YAML 1.1 (and so Python) takes `1e-5` for text.
fn double(v: &f64) -> String {
    let text = format!("{v:?}");
    let Some((mantissa, exponent)) = text.split_once('e') else { return text };
    let point = if mantissa.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{mantissa}{point}e{sign}{exponent}")
}

/// The type of a parameter; the discriminants are those of `rcl_interfaces/msg/ParameterType`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum ValueKind {
    /// See [`Value::Bool`].
    Bool = 1,
    /// See [`Value::Integer`].
    Integer = 2,
    /// See [`Value::Double`].
    Double = 3,
    /// See [`Value::String`].
    String = 4,
    /// See [`Value::BoolArray`].
    BoolArray = 6,
    /// See [`Value::IntegerArray`].
    IntegerArray = 7,
    /// See [`Value::DoubleArray`].
    DoubleArray = 8,
    /// See [`Value::StringArray`].
    StringArray = 9,
}

impl ValueKind {
    /// The name in messages and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Integer => "integer",
            Self::Double => "double",
            Self::String => "string",
            Self::BoolArray => "bool array",
            Self::IntegerArray => "integer array",
            Self::DoubleArray => "double array",
            Self::StringArray => "string array",
        }
    }
}

/// The closed interval a number must lie in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// For integers.
    Integer(i64, i64),
    /// For doubles.
    Double(f64, f64),
}

impl From<std::ops::RangeInclusive<i64>> for Range {
    fn from(r: std::ops::RangeInclusive<i64>) -> Self {
        Self::Integer(*r.start(), *r.end())
    }
}

impl From<std::ops::RangeInclusive<f64>> for Range {
    fn from(r: std::ops::RangeInclusive<f64>) -> Self {
        Self::Double(*r.start(), *r.end())
    }
}

impl Range {
    /// Whether the value is a number inside the interval; NaN never is.
    pub fn contains(&self, value: &Value) -> bool {
        match (self, value) {
            (Self::Integer(lo, hi), Value::Integer(v)) => (lo..=hi).contains(&v),
            (Self::Double(lo, hi), Value::Double(v)) => (lo..=hi).contains(&v),
            _ => false,
        }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integer(lo, hi) => write!(f, "{lo} to {hi}"),
            Self::Double(lo, hi) => write!(f, "{lo} to {hi}"),
        }
    }
}

/// All that is known of a parameter besides its present value.
#[derive(Clone, Debug, PartialEq)]
pub struct Descriptor {
    /// Full name, groups separated by dots.
    pub name: &'static str,
    /// Value before anybody sets it.
    pub default: Value,
    /// Interval of a number.
    pub range: Option<Range>,
    /// The values a string may take; empty where any will do.
    pub choices: &'static [&'static str],
    /// Unit of the value; empty where it has none.
    pub unit: &'static str,
    /// What it does, in one sentence.
    pub description: &'static str,
    /// What a change needs before it has effect.
    pub need: Need,
    /// Who meets it.
    pub tier: Tier,
}

/// A Rust type that a parameter can be stored as.
pub trait Stored: Sized {
    /// The strings that stand for its values, where it is a choice.
    const CHOICES: &'static [&'static str] = &[];
    /// As a ROS value.
    fn to_value(&self) -> Value;
    /// From a ROS value of the right type; `None` for another type or choice.
    fn from_value(value: &Value) -> Option<Self>;
}

macro_rules! stored {
    ($($rust:ty => $variant:ident),* $(,)?) => {$(
        impl Stored for $rust {
            fn to_value(&self) -> Value {
                Value::$variant(self.clone())
            }
            fn from_value(value: &Value) -> Option<Self> {
                match value {
                    Value::$variant(v) => Some(v.clone()),
                    _ => None,
                }
            }
        }
    )*};
}
stored! {
    bool => Bool,
    i64 => Integer,
    f64 => Double,
    String => String,
    Vec<i64> => IntegerArray,
    Vec<f64> => DoubleArray,
    Vec<String> => StringArray,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_so_that_every_yaml_reader_takes_them_for_numbers() {
        for (number, written) in [(1e-5, "1.0e-5"), (2.5e-7, "2.5e-7"), (1e16, "1.0e+16"), (0.25, "0.25"), (3.0, "3.0")]
        {
            assert_eq!(Value::Double(number).to_string(), written);
            assert_eq!(written.parse(), Ok(number));
        }
    }
}
