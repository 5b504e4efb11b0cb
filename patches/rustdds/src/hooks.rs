//! What the original has no setting for. To be set before the first participant is made; what is set later, or twice,
//! has no effect.

use std::net::{IpAddr, SocketAddr};
use std::sync::OnceLock;

use crate::{network::constant::spdp_well_known_unicast_port, structure::locator::Locator};

/// Gives the user data of a reader or writer from the names that DDS has for its topic and type.
pub type UserData = fn(topic: &str, type_name: &str) -> Option<String>;

static PEERS: OnceLock<Vec<IpAddr>> = OnceLock::new();
static USER_DATA: OnceLock<UserData> = OnceLock::new();

/// Hosts to which participants announce themselves besides.
pub fn set_initial_peers(hosts: Vec<IpAddr>) {
    let _ = PEERS.set(hosts);
}

/// What readers and writers announce as their user data.
pub fn set_user_data(user_data: UserData) {
    let _ = USER_DATA.set(user_data);
}

/// Where the first `count` participants of each of the hosts listen.
pub(crate) fn initial_peer_locators(domain_id: u16, count: u16) -> Vec<Locator> {
    let ports = || (0..count).map(|participant| spdp_well_known_unicast_port(domain_id, participant));
    let hosts = PEERS.get().into_iter().flatten();
    hosts.flat_map(|host| ports().map(|port| Locator::from(SocketAddr::new(*host, port)))).collect()
}

/// The user data as it is serialized: a sequence of octets, in the byte order of all that is announced.
pub(crate) fn user_data(topic: &str, type_name: &str) -> Vec<u8> {
    let Some(text) = USER_DATA.get().and_then(|user_data| user_data(topic, type_name)) else { return Vec::new() };
    let mut bytes = (text.len() as u32).to_le_bytes().to_vec();
    bytes.extend(text.into_bytes());
    bytes
}
