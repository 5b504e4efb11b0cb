//! Values of which one must not be above another: what would contradict itself is refused with both, not mended inside.

use super::{Params, Value};
use crate::error::ParamsError;

/// Pairs of parameters of which the first must not be above the second.
const ORDERED: [(&str, &str); 10] = [
    // One that is certain is not lost, and what a lost one must answer is not less than what makes it certain.
    ("lcmht.confidence.lost", "lcmht.confidence.activate"),
    ("lcmht.confidence.activate", "lcmht.confidence.reacquire"),
    ("lcmht.motion.prior_min", "lcmht.motion.prior_max"),
    // One that was taken up again is not lost by the same look.
    ("etepf.modes.lost", "etepf.modes.certain"),
    ("etepf.modes.lost_contrast", "etepf.modes.found_contrast"),
    ("etepf.modes.lost_similar", "etepf.modes.similar"),
    ("maptrack.background.least_deviation", "maptrack.background.initial_deviation"),
    ("maptrack.find.least_area", "maptrack.find.most_area"),
    // A hidden target is lost before its track ends.
    ("maptrack.occlusion.believed", "maptrack.occlusion.frames"),
    // What the images may take is part of what the process may.
    ("history.megabytes", "limits.memory_mb"),
];

impl Params {
    /// Refuses values that contradict each other.
    pub(super) fn check_order(&self) -> Result<(), ParamsError> {
        for (lesser, greater) in ORDERED {
            let [low, high] = [lesser, greater].map(|name| self.get(name).as_ref().and_then(number));
            if let (Some(low), Some(high)) = (low, high)
                && low > high
            {
                return Err(ParamsError::Conflict(format!("{lesser} is {low}, above {greater}, which is {high}")));
            }
        }
        Ok(())
    }
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(v) => Some(*v as f64),
        Value::Double(v) => Some(*v),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Phase, Range, descriptor};
    use super::*;

    /// A value of the type and within the range of a parameter.
    fn value(name: &str, number: f64) -> Value {
        match descriptor(name).unwrap().range.unwrap() {
            Range::Integer(..) => Value::Integer(number as i64),
            Range::Double(..) => Value::Double(number),
        }
    }

    #[test]
    fn values_that_cross_are_refused_with_both_and_equal_ones_are_not() {
        for (lesser, greater) in ORDERED {
            let limits = |name: &str| match descriptor(name).unwrap().range.unwrap() {
                Range::Integer(low, high) => (low as f64, high as f64),
                Range::Double(low, high) => (low, high),
            };
            // The least value that both may have, and one above it.
            let least = limits(lesser).0.max(limits(greater).0);
            let above = least + 1.0_f64.min(limits(lesser).1 - least);
            let with = |low: f64, high: f64| {
                let (low, high) = (value(lesser, low), value(greater, high));
                Params::default().with([(lesser, &low), (greater, &high)], Phase::StartUp)
            };
            let why = with(above, least).unwrap_err().to_string();
            let told = format!("{lesser} is {above}, above {greater}, which is {least}");
            assert!(why.contains(&told), "{why}, not {told}");
            // Another pair may bind where this one is equal.
            assert!(!with(least, least).is_err_and(|why| why.to_string().contains(&format!("above {greater}"))));
        }
    }
}
