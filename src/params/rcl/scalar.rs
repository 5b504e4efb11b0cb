//! Which type a piece of text is of, as the C library's `strtoll` and `strtod` read it.

use crate::params::Value;

/// What stands for `true`.
const TRUE: [&str; 11] = ["Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"];
/// What stands for `false`.
const FALSE: [&str; 11] = ["N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"];
/// YAML's words for what is no finite number.
const NAN: [&str; 3] = [".nan", ".NaN", ".NAN"];
const INFINITE: [&str; 3] = [".inf", ".Inf", ".INF"];

/// The value that text without quotes stands for: a boolean, else an integer, else a float, else the text itself.
pub fn value(text: &str) -> Value {
    if TRUE.contains(&text) {
        Value::Bool(true)
    } else if FALSE.contains(&text) {
        Value::Bool(false)
    } else if let Some(number) = integer(text) {
        Value::Integer(number)
    } else if let Some(number) = double(text) {
        Value::Double(number)
    } else {
        Value::String(text.to_owned())
    }
}

/// The number after its sign, and whether that is a minus. White space before it does not count.
fn unsigned(text: &str) -> (&str, bool) {
    let text = text.trim_start_matches([' ', '\t', '\n', '\x0b', '\x0c', '\r']);
    match text.strip_prefix('-') {
        Some(rest) => (rest, true),
        None => (text.strip_prefix('+').unwrap_or(text), false),
    }
}

fn hexadecimal(digits: &str) -> Option<&str> {
    digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X"))
}

/// An integer of 64 bits: hexadecimal after `0x`, octal after `0`, else decimal.
fn integer(text: &str) -> Option<i64> {
    let (digits, negative) = unsigned(text);
    let (digits, radix) = match hexadecimal(digits) {
        Some(rest) => (rest, 16),
        None if digits.starts_with('0') => (digits, 8),
        None => (digits, 10),
    };
    // A second sign is no digit here, but it is one to the standard library.
    if !digits.starts_with(|c: char| c.is_digit(radix)) {
        return None;
    }
    let size = i128::from_str_radix(digits, radix).ok()?;
    i64::try_from(if negative { -size } else { size }).ok()
}

/// A float within the range of normal numbers; beyond it, text stays text.
fn double(text: &str) -> Option<f64> {
    if NAN.contains(&text) {
        return Some(f64::NAN);
    }
    let (digits, negative) = unsigned(text);
    let signed = |size: f64| if negative { -size } else { size };
    // YAML's infinity bears no white space.
    if INFINITE.contains(&text.strip_prefix(['+', '-']).unwrap_or(text)) {
        return Some(signed(f64::INFINITY));
    }
    if let Some(rest) = hexadecimal(digits) {
        return hexadecimal_double(rest).map(signed);
    }
    let lower = digits.to_ascii_lowercase();
    if lower == "inf" || lower == "infinity" {
        return Some(signed(f64::INFINITY));
    }
    if let Some(rest) = lower.strip_prefix("nan") {
        let payload = |p: &str| p.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        let named = rest.strip_prefix('(').and_then(|r| r.strip_suffix(')')).is_some_and(payload);
        return (rest.is_empty() || named).then_some(f64::NAN);
    }
    if !digits.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        return None;
    }
    let size: f64 = digits.parse().ok()?;
    let zero = !digits.split(['e', 'E']).next()?.contains(|c: char| ('1'..='9').contains(&c));
    in_range(size, zero).map(signed)
}

/// The number, unless it is too large or too small for one of full precision.
fn in_range(size: f64, zero: bool) -> Option<f64> {
    (zero || size.is_normal()).then_some(size)
}

/// What follows `0x`: digits with or without a point, and a binary exponent after `p`.
fn hexadecimal_double(text: &str) -> Option<f64> {
    let (mantissa, exponent) = match text.split_once(['p', 'P']) {
        Some((mantissa, exponent)) => {
            let digits = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
            if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
                return None;
            }
            // What does not fit is out of range all the same.
            let far = if exponent.starts_with('-') { i64::MIN / 2 } else { i64::MAX / 2 };
            (mantissa, exponent.parse().unwrap_or(far).clamp(i64::MIN / 2, i64::MAX / 2))
        }
        None => (text, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let (mut bits, mut scale) = (0u64, exponent);
    for (index, digit) in whole.chars().chain(fraction.chars()).enumerate() {
        let digit = u64::from(digit.to_digit(16)?);
        let after_point = index >= whole.len();
        if bits >> 60 == 0 {
            bits = bits << 4 | digit;
            scale -= if after_point { 4 } else { 0 };
        } else {
            // Too far down to matter but for rounding.
            bits |= u64::from(digit != 0);
            scale += if after_point { 0 } else { 4 };
        }
    }
    // In two steps, for neither power of two may leave the range where the product does not.
    let scale = i32::try_from(scale.clamp(-3000, 3000)).ok()?;
    in_range(bits as f64 * 2f64.powi(scale / 2) * 2f64.powi(scale - scale / 2), bits == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(v: &str) -> Value {
        Value::String(v.to_owned())
    }

    #[test]
    fn booleans_are_those_of_the_older_yaml() {
        for word in ["y", "Yes", "TRUE", "on"] {
            assert_eq!(value(word), Value::Bool(true), "{word}");
        }
        for word in ["n", "No", "FALSE", "off"] {
            assert_eq!(value(word), Value::Bool(false), "{word}");
        }
        for word in ["yEs", "oN", "t", "", "~", "null", "true "] {
            assert_eq!(value(word), text(word));
        }
    }

    #[test]
    fn integers_may_be_octal_and_hexadecimal() {
        for (written, number) in [
            ("007", 7),
            ("-010", -8),
            ("0x1F", 31),
            ("-0Xff", -255),
            ("+5", 5),
            ("0", 0),
            (" 5", 5),
            ("\n5", 5),
            ("9223372036854775807", i64::MAX),
            ("-9223372036854775808", i64::MIN),
        ] {
            assert_eq!(value(written), Value::Integer(number), "{written}");
        }
        for written in ["0o7", "0b1", "1_000", "5 ", "--5", "+-5", "0x", "1,5", "12:30"] {
            assert_eq!(value(written), text(written));
        }
    }

    #[test]
    fn what_is_no_integer_may_be_a_float() {
        for (written, number) in [
            ("08", 8.0),
            ("1e5", 1e5),
            ("1.", 1.0),
            (".5", 0.5),
            ("-2.5E-3", -2.5e-3),
            ("99999999999999999999", 1e20),
            ("0x1p3", 8.0),
            ("0x.8", 0.5),
            ("-0x1.8P+1", -3.0),
            ("0xFFFFFFFFFFFFFFFFF", 295_147_905_179_352_825_855.0),
            ("0e999999999999", 0.0),
            ("inf", f64::INFINITY),
            ("-Infinity", f64::NEG_INFINITY),
            ("-.inf", f64::NEG_INFINITY),
            ("+.INF", f64::INFINITY),
        ] {
            assert_eq!(value(written), Value::Double(number), "{written}");
        }
        for written in ["nan", ".NaN", "-nan", "NAN(x_1)"] {
            assert!(matches!(value(written), Value::Double(v) if v.is_nan()), "{written}");
        }
        for written in
            ["1e999", "1e-320", "1e", "e5", ".", "+.nan", "-.nan", " .inf", "nan(", "1.5f", "0x1p", "0x1p9999", "0x.p1"]
        {
            assert_eq!(value(written), text(written));
        }
    }
}
