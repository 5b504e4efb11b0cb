//! The tracker that the parameters name.

use super::Tracker;
use super::etepf::Etepf;
use super::lcmht::Lcmht;
use super::maptrack::Maptrack;
use crate::network::SharedCnn;
use crate::params::{Algorithm, Params};

/// The tracker that the parameters name, with the network that they ask for. Without it, layers of a network are left
/// out.
pub fn build(params: &Params, network: Option<SharedCnn>) -> Box<dyn Tracker> {
    match params.general.algorithm {
        Algorithm::Lcmht => Box::new(Lcmht::new(params, network)),
        Algorithm::Etepf => Box::new(Etepf::new(params)),
        Algorithm::Maptrack => Box::new(Maptrack::new(params)),
    }
}
