//! How much of a result hangs on luck: the same figures from runs that were started a little differently.

use serde::Serialize;

use super::figures::Figures;

/// One figure of several runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Of each run, in order; the plain start is the first.
    pub runs: Vec<f64>,
    /// Their mean.
    pub mean: f64,
    /// The largest less the smallest.
    pub spread: f64,
}

impl Spread {
    fn new(runs: Vec<f64>) -> Self {
        let (low, high) = runs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        Self { mean: runs.iter().sum::<f64>() / runs.len() as f64, spread: high - low, runs }
    }
}

/// The figures that are looked at.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Spreads {
    /// Precision at 20 px.
    pub precision: Spread,
    /// Area under the success curve.
    pub auc: Spread,
    /// Share of frames in which the target is held.
    pub held: Spread,
}

impl Spreads {
    /// Of at least two runs over the same sequences; `None` of fewer.
    pub fn new(runs: &[&Figures]) -> Option<Self> {
        let spread = |of: fn(&Figures) -> f64| Spread::new(runs.iter().map(|f| of(f)).collect());
        (runs.len() > 1).then(|| Self {
            precision: spread(|f| f.precision),
            auc: spread(|f| f.auc),
            held: spread(|f| f.held),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_from_the_worst_run_to_the_best() {
        let run = |precision, auc| Figures { precision, auc, ..Figures::default() };
        let runs = [run(0.5, 0.25), run(0.25, 0.25), run(0.75, 0.25)];
        let found = Spreads::new(&runs.each_ref()).unwrap();
        assert_eq!(found.precision, Spread { runs: vec![0.5, 0.25, 0.75], mean: 0.5, spread: 0.5 });
        assert_eq!((found.auc.mean, found.auc.spread), (0.25, 0.0));
        assert_eq!(Spreads::new(&[&runs[0]]), None);
    }
}
