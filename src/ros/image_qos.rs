//! The quality of service that images are read with: that of sensor data, unless start-up parameters override it.

use rustdds::QosPolicies;
use rustdds::policy::{Durability, History, Reliability, ResourceLimits};

/// What `qos_overrides.*` may say of the image topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageQos {
    /// Whether lost parts are asked for again.
    pub reliable: bool,
    /// Whether images are wanted that were published before the node was there.
    pub transient_local: bool,
    /// Whether images that have not been taken yet are all kept, up to the library's own limit.
    pub keep_all: bool,
    /// How many are kept otherwise.
    pub depth: i32,
}

impl ImageQos {
    /// Names of the parameters, below `qos_overrides./TOPIC.subscription.`.
    pub const RELIABILITY: &str = "reliability";
    /// See [`RELIABILITY`](Self::RELIABILITY).
    pub const DURABILITY: &str = "durability";
    /// See [`RELIABILITY`](Self::RELIABILITY).
    pub const HISTORY: &str = "history";
    /// See [`RELIABILITY`](Self::RELIABILITY).
    pub const DEPTH: &str = "depth";
    /// Choices for reliability, the default first; those for durability and history likewise.
    pub const RELIABILITIES: [&str; 2] = ["best_effort", "reliable"];
    /// See [`RELIABILITIES`](Self::RELIABILITIES).
    pub const DURABILITIES: [&str; 2] = ["volatile", "transient_local"];
    /// See [`RELIABILITIES`](Self::RELIABILITIES).
    pub const HISTORIES: [&str; 2] = ["keep_last", "keep_all"];

    /// The policies. Without resource limits the library would keep 64 images whatever the depth, so that a slow
    /// reader sees ever older ones and memory grows.
    pub fn policies(self) -> QosPolicies {
        let max_blocking_time = rustdds::Duration::ZERO;
        let reliability =
            if self.reliable { Reliability::Reliable { max_blocking_time } } else { Reliability::BestEffort };
        let durability = if self.transient_local { Durability::TransientLocal } else { Durability::Volatile };
        let qos = QosPolicies::builder().reliability(reliability).durability(durability);
        if self.keep_all {
            return qos.history(History::KeepAll).build();
        }
        let depth = self.depth;
        let limits = ResourceLimits { max_samples: depth, max_instances: 1, max_samples_per_instance: depth };
        qos.history(History::KeepLast { depth }).resource_limits(limits).build()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn policies_are_what_was_asked_for() {
        let sensor = ImageQos { reliable: false, transient_local: false, keep_all: false, depth: 3 };
        let qos = sensor.policies();
        assert_eq!(qos.reliability(), Some(Reliability::BestEffort));
        assert_eq!(qos.durability(), Some(Durability::Volatile));
        assert_eq!(qos.history(), Some(History::KeepLast { depth: 3 }));
        assert_eq!(qos.resource_limits().map(|l| l.max_samples), Some(3));
        let qos = ImageQos { reliable: true, transient_local: true, keep_all: true, depth: 3 }.policies();
        assert!(matches!(qos.reliability(), Some(Reliability::Reliable { .. })));
        assert_eq!((qos.durability(), qos.history()), (Some(Durability::TransientLocal), Some(History::KeepAll)));
    }
}
