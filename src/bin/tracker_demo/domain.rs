//! ROS domains that no two runs on a host share.

use std::net::{Ipv4Addr, UdpSocket};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::Duration;

/// Of RTPS: the first port of domain 0, and how many ports each domain has.
const FIRST_PORT: u16 = 7400;
const PORTS: u16 = 250;
/// Of a domain's ports, counted from its first: where all its participants listen, and one that RTPS leaves free.
const DISCOVERY: u16 = 0;
const HELD: u16 = 2;
/// All ports of the domains from 1 to this one lie below those that Linux hands out. 0 is what everybody uses.
const LAST: u16 = 101;
/// From one look for a free domain to the next, where none is.
const AGAIN: Duration = Duration::from_millis(100);

/// A domain that is this process's alone for as long as the value lives.
///
/// Who holds it is bound to a port of the domain that nobody else needs. So it is free again when its holder ends,
/// however that ends, and it is held exactly where it could be met: in one network.
pub struct Domain {
    /// Its number.
    pub number: u16,
    _held: UdpSocket,
}

impl Domain {
    /// The next domain that is free; waits for one where all are taken.
    pub fn take() -> Self {
        static NEXT: AtomicU16 = AtomicU16::new(0);
        // Neighbours begin their search apart, so that a domain that was just left is not taken at once.
        let first = (std::process::id() % u32::from(LAST)) as u16 * 13 + NEXT.fetch_add(1, Ordering::Relaxed) % LAST;
        loop {
            if let Some(domain) = (0..LAST).find_map(|n| Self::try_take(1 + (first + n) % LAST)) {
                return domain;
            }
            std::thread::sleep(AGAIN);
        }
    }

    /// The domain, unless it is another's, or somebody is in it who does not ask.
    fn try_take(number: u16) -> Option<Self> {
        let bind = |address, offset| UdpSocket::bind((address, FIRST_PORT + PORTS * number + offset)).ok();
        let _held = bind(Ipv4Addr::LOCALHOST, HELD)?;
        bind(Ipv4Addr::UNSPECIFIED, DISCOVERY)?;
        Some(Self { number, _held })
    }
}
