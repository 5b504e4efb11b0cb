//! The tracker that the parameters name.

use super::Tracker;
use super::etepf::Etepf;
use super::lcmht::Lcmht;
use super::maptrack::Maptrack;
use crate::network::Networks;
use crate::params::{Algorithm, Params};

/// The tracker that the parameters name, with the networks that they ask for. Without one, layers of it are left
/// out.
pub fn build(params: &Params, networks: Networks) -> Box<dyn Tracker> {
    match params.general.algorithm {
        Algorithm::Lcmht => Box::new(Lcmht::new(params, networks)),
        Algorithm::Etepf => Box::new(Etepf::new(params)),
        Algorithm::Maptrack => Box::new(Maptrack::new(params)),
    }
}
