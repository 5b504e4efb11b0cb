//! What the parameters let a node take, so that a change while it runs cannot make it take more than it may.
//!
//! At the start the user decides. Afterwards anybody on the network may change a parameter: each has its range, but
//! ranges must allow for what makes sense by itself, and together they would let a node be stopped or filled up.

use super::{Algorithm, CLIMB, EtepfParams, LcmhtParams, MaptrackParams, Params, STEPS, SURROUND};
use crate::error::ParamsError;

/// Bytes of a complex number of single precision.
const COMPLEX: f64 = 8.0;
/// Bytes of a pixel that ETEPF looks at, measured at 4 and rounded up.
const ETEPF_PIXEL: f64 = 8.0;
/// Bytes of a pixel in the pictures of MAPTrack, its Gaussians among them: measured at 89 and rounded up.
const MAPTRACK_PIXEL: f64 = 94.0;
/// The share of `limits.memory_mb` that parameters may ask for; the rest is for images and the program itself.
const SHARE: f64 = 0.75;
/// Operations a frame that parameters may ask for: about a second's. The factors below are measured, in nanoseconds.
const MOST_OPERATIONS: f64 = 1e9;

impl Params {
    /// Refuses a change that asks for more than may be, unless it asks for no more than what is in force.
    pub(super) fn check_growth(&self, in_force: &Self) -> Result<(), ParamsError> {
        let most = SHARE * 1e6 * self.limits.memory_mb as f64;
        let (memory, before) = (self.memory(), in_force.memory());
        if memory > most && memory > before {
            return Err(ParamsError::Conflict(format!(
                "they would need up to {:.0} MB of memory, and may use {:.0} MB, which is {SHARE} x limits.memory_mb: \
                 history.megabytes is {}, max_targets {}, {}",
                memory / 1e6,
                most / 1e6,
                self.history.megabytes,
                self.general.max_targets,
                self.sizes()
            )));
        }
        let (operations, before) = (self.operations(), in_force.operations());
        if operations > MOST_OPERATIONS && operations > before {
            return Err(ParamsError::Conflict(format!(
                "they would need about {operations:.1e} operations per frame and target, and may use \
                 {MOST_OPERATIONS:.0e}: {}",
                self.sizes()
            )));
        }
        Ok(())
    }

    /// Bytes, about.
    fn memory(&self) -> f64 {
        let targets = self.general.max_targets as f64;
        let tracker = match self.general.algorithm {
            Algorithm::Lcmht => targets * self.lcmht.sample_values() * COMPLEX,
            Algorithm::Etepf => targets * self.etepf.view_pixels() * ETEPF_PIXEL,
            Algorithm::Maptrack => self.maptrack.memory(),
        };
        self.history.megabytes as f64 * 1e6 + tracker
    }

    /// Operations a frame and target, about.
    fn operations(&self) -> f64 {
        match self.general.algorithm {
            Algorithm::Lcmht => self.lcmht.operations(),
            Algorithm::Etepf => self.etepf.operations(),
            Algorithm::Maptrack => self.maptrack.operations(),
        }
    }

    /// The values that decide.
    fn sizes(&self) -> String {
        match self.general.algorithm {
            Algorithm::Lcmht => {
                let LcmhtParams { filter, cnn, .. } = &self.lcmht;
                let (cells, components, side) = (filter.cells, &cnn.components, cnn.side);
                format!("lcmht.filter.cells {cells}, lcmht.cnn.components {components:?} and .side {side}")
            }
            Algorithm::Etepf => {
                let EtepfParams { features, particles, modes, .. } = &self.etepf;
                format!(
                    "etepf.features.pixels {}, etepf.particles.count {}, etepf.modes.extent {}",
                    features.pixels, particles.count, modes.extent
                )
            }
            Algorithm::Maptrack => {
                let MaptrackParams { image, find, .. } = &self.maptrack;
                format!("maptrack.image.pixels {}, maptrack.find.lambda {}", image.pixels, find.lambda)
            }
        }
    }
}

impl LcmhtParams {
    fn operations(&self) -> f64 {
        /// Of the embedded network for a pixel of its input: 0.65 s at 1024 x 1024.
        const NETWORK: f64 = 1e3;
        let network = if self.cnn.enabled { NETWORK * (self.cnn.side as f64).powi(2) } else { 0.0 };
        network + STEPS as f64 * self.sample_values()
    }
}

impl EtepfParams {
    /// Pixels of the area that is looked at around a target.
    fn view_pixels(&self) -> f64 {
        self.features.pixels as f64 * self.modes.extent.max(SURROUND).powi(2)
    }

    fn operations(&self) -> f64 {
        let climbs = (self.particles.count * CLIMB) as f64 * self.features.pixels as f64;
        climbs + self.view_pixels() * self.ensemble.classifiers as f64
    }
}

impl MaptrackParams {
    fn memory(&self) -> f64 {
        self.image.pixels as f64 * MAPTRACK_PIXEL
    }

    fn operations(&self) -> f64 {
        /// Of the background model for a pixel, and of opening and closing for each pixel of the disc's diameter.
        const BACKGROUND: f64 = 40.0;
        const DIAMETER: f64 = 6.0;
        self.image.pixels as f64 * (BACKGROUND + DIAMETER * self.find.lambda as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Params, Phase, Value};

    fn start(algorithm: &str, changes: &[(&str, i64)]) -> Params {
        let algorithm = [("algorithm", Value::String(algorithm.to_owned()))];
        let values: Vec<_> = changes.iter().map(|(name, value)| (*name, Value::Integer(*value))).collect();
        let all = algorithm.iter().chain(&values).map(|(name, value)| (*name, value));
        Params::default().with(all, Phase::StartUp).unwrap()
    }

    fn change(from: &Params, changes: &[(&str, i64)]) -> Result<Params, String> {
        let values: Vec<_> = changes.iter().map(|(name, value)| (*name, Value::Integer(*value))).collect();
        from.with(values.iter().map(|(name, value)| (*name, value)), Phase::Running).map_err(|e| e.to_string())
    }

    #[test]
    fn what_together_would_fill_the_memory_or_take_minutes_is_refused_with_the_values() {
        let samples = [("max_targets", 64), ("lcmht.filter.cells", 96), ("history.megabytes", 100)];
        for (algorithm, changes, told) in [
            ("lcmht", &samples[..], "lcmht.filter.cells 96"),
            ("lcmht", &[("history.megabytes", 4096)], "history.megabytes is 4096"),
            ("lcmht", &[("lcmht.cnn.side", 1024)], ".side 1024"),
            ("etepf", &[("etepf.features.pixels", 1_000_000), ("max_targets", 64)], "etepf.features.pixels 1000000"),
            ("etepf", &[("etepf.particles.count", 1000), ("etepf.features.pixels", 100_000)], ".count 1000"),
            ("maptrack", &[("maptrack.image.pixels", 16_777_216), ("maptrack.find.lambda", 99)], ".lambda 99"),
        ] {
            let why = change(&start(algorithm, &[]), changes).unwrap_err();
            assert!(why.contains(told) && why.contains("and may use"), "{changes:?}: {why}");
        }
    }

    #[test]
    fn what_makes_sense_is_allowed_and_what_was_started_with_may_shrink() {
        for (algorithm, changes) in [
            ("lcmht", &[("max_targets", 64)][..]),
            ("lcmht", &[("lcmht.filter.cells", 96), ("history.megabytes", 1000)]),
            ("lcmht", &[("lcmht.cnn.side", 384)]),
            ("etepf", &[("etepf.particles.count", 1000), ("etepf.features.pixels", 10_000)]),
            ("maptrack", &[("maptrack.image.pixels", 2_073_600), ("maptrack.find.lambda", 15)]),
        ] {
            assert_eq!(change(&start(algorithm, &[]), changes).map(drop), Ok(()));
        }
        let large = start("lcmht", &[("lcmht.cnn.side", 1024), ("history.megabytes", 4096)]);
        assert!(change(&large, &[("lcmht.cnn.side", 1000), ("debug.max_side", 100)]).is_ok());
        assert!(change(&large, &[("max_targets", 2)]).is_err());
    }
}
