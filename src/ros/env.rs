//! What the environment says: the domain, how far discovery reaches, and how much the kernel buffers. What is set there
//! but cannot be obeyed is told, or keeps the node from starting where rcl would not start without it either.

use std::net::{IpAddr, Ipv4Addr, ToSocketAddrs};

use log::warn;
use ros2_client::Context;
use rustdds::DomainParticipantBuilder;
use rustdds::hooks::{set_initial_peers, set_user_data};

use super::fault::Fault;
use super::type_hash::user_data;

/// The receive buffer asked for, in bytes: an image of 1920 x 1080 rgb8 comes as a burst of 6.2 MB.
const RECEIVE_BUFFER: usize = 8 << 20;
/// The send buffer asked for, in bytes.
const SEND_BUFFER: usize = 8 << 20;
/// The least `net.core.rmem_max`, in bytes, with which images of 1280 x 720 and more come through.
const ENOUGH_RMEM: usize = 4 << 20;
/// Where Linux says how large a receive buffer may be.
const RMEM_MAX: &str = "/proc/sys/net/core/rmem_max";
/// The highest domain whose ports fit below 65536.
const MAX_DOMAIN: u16 = 232;

/// What separates the hosts in `ROS_STATIC_PEERS`.
const PEER_SEPARATOR: char = ';';
/// Implementations of rmw that speak the protocol of this node, by what their names begin with.
const DDS_IMPLEMENTATIONS: [&str; 4] = ["rmw_fastrtps", "rmw_cyclonedds", "rmw_connextdds", "rmw_gurumdds"];

/// How far discovery reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Every interface.
    Subnet,
    /// This machine.
    Localhost,
    /// Nobody.
    Off,
}

/// What a participant is made from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Environment {
    /// `ROS_DOMAIN_ID`; 0 where it is not set.
    pub domain: u16,
    /// `ROS_LOCALHOST_ONLY` and `ROS_AUTOMATIC_DISCOVERY_RANGE`.
    pub reach: Reach,
    /// The hosts of `ROS_STATIC_PEERS`, as they are written there.
    pub peers: Vec<String>,
    /// What is set but not obeyed, or not wholly: one line each.
    pub warnings: Vec<String>,
}

impl Environment {
    /// Reads the variables of the process. `enclave` is what `--enclave` says.
    pub fn read(enclave: Option<&str>) -> Result<Self, Fault> {
        Self::from(|name| std::env::var(name).ok().filter(|v| !v.is_empty()), enclave)
    }

    fn from(variable: impl Fn(&str) -> Option<String>, enclave: Option<&str>) -> Result<Self, Fault> {
        let domain = match variable("ROS_DOMAIN_ID") {
            None => 0,
            Some(value) => value.trim().parse().ok().filter(|&d| d <= MAX_DOMAIN).ok_or_else(|| {
                let why = format!("it must be a number from 0 to {MAX_DOMAIN}");
                Fault::Environment { variable: "ROS_DOMAIN_ID", value, why }
            })?,
        };
        let mut warnings: Vec<_> = [security(&variable, enclave)?, implementation(&variable), server(&variable)]
            .into_iter()
            .flatten()
            .collect();
        let (reach, obeys_peers) = reach(&variable, &mut warnings);
        let mut peers: Vec<_> = variable("ROS_STATIC_PEERS").map_or_else(Vec::new, |hosts| {
            hosts.split(PEER_SEPARATOR).map(str::trim).filter(|host| !host.is_empty()).map(str::to_owned).collect()
        });
        if !peers.is_empty() && !obeys_peers {
            warnings.push(format!(
                "ROS_STATIC_PEERS={}: ignored because of ROS_LOCALHOST_ONLY or ROS_AUTOMATIC_DISCOVERY_RANGE",
                peers.join(";")
            ));
            peers.clear();
        } else if !peers.is_empty() && reach == Reach::Localhost {
            warnings.push(format!(
                "ROS_STATIC_PEERS={}: with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST this node reaches only peers on \
                 this machine; use SUBNET for others",
                peers.join(";")
            ));
        }
        Ok(Self { domain, reach, peers, warnings })
    }

    /// Joins the domain.
    pub fn context(&self) -> Result<Context, Fault> {
        set_user_data(|_, type_name| user_data(type_name));
        set_initial_peers(self.peers.iter().filter_map(|host| address(host)).collect());
        let builder = DomainParticipantBuilder::new(self.domain)
            .socket_receive_buffer_size(RECEIVE_BUFFER)
            .socket_send_buffer_size(SEND_BUFFER);
        let builder = match self.reach {
            Reach::Subnet => builder,
            Reach::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
            Reach::Off => builder.with_only_networks(Vec::<IpAddr>::new()).same_host_loopback(false),
        };
        let failed = |why: String| Fault::system(format!("join ROS domain {}", self.domain), why);
        let participant = builder.build().map_err(|e| failed(e.to_string()))?;
        Context::from_domain_participant(participant).map_err(|e| failed(e.to_string()))
    }
}

/// How far discovery reaches, and whether static peers are asked. As in rcl, `ROS_LOCALHOST_ONLY` counts only where it
/// is 1, upper and lower case are told apart, and what cannot be understood is the safer choice.
fn reach(variable: &impl Fn(&str) -> Option<String>, warnings: &mut Vec<String>) -> (Reach, bool) {
    if variable("ROS_LOCALHOST_ONLY").as_deref() == Some("1") {
        return (Reach::Localhost, false);
    }
    match variable("ROS_AUTOMATIC_DISCOVERY_RANGE").as_deref() {
        None | Some("SUBNET") => (Reach::Subnet, true),
        Some("SYSTEM_DEFAULT") => (Reach::Subnet, false),
        Some("LOCALHOST") => (Reach::Localhost, true),
        Some("OFF") => (Reach::Off, false),
        Some(other) => {
            warnings.push(format!(
                "ROS_AUTOMATIC_DISCOVERY_RANGE={other}: it must be SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT; \
                 LOCALHOST is used"
            ));
            (Reach::Localhost, true)
        }
    }
}

/// Security is not supported: where it is enforced the node must not start, for it would talk to those whom it is to be
/// kept from.
fn security(variable: &impl Fn(&str) -> Option<String>, enclave: Option<&str>) -> Result<Option<String>, Fault> {
    // As in rcl, any other value means no.
    let is_enabled = variable("ROS_SECURITY_ENABLE").as_deref() == Some("true");
    let strategy = variable("ROS_SECURITY_STRATEGY").unwrap_or_default();
    let unsupported = "ROS 2 security is not supported by this node";
    if is_enabled && strategy == "Enforce" {
        let why = format!("{unsupported}; with ROS_SECURITY_ENABLE=true it does not start");
        return Err(Fault::Environment { variable: "ROS_SECURITY_STRATEGY", value: strategy, why });
    }
    let asked = match (is_enabled, enclave) {
        (true, _) => "ROS_SECURITY_ENABLE=true".to_owned(),
        (false, Some(enclave)) => format!("--enclave {enclave}"),
        (false, None) => return Ok(None),
    };
    Ok(Some(format!("{asked}: {unsupported}: it neither signs nor encrypts, and anyone in its domain can talk to it")))
}

/// Whoever sets another implementation expects to meet its peers.
fn implementation(variable: &impl Fn(&str) -> Option<String>) -> Option<String> {
    let name = variable("RMW_IMPLEMENTATION")?;
    let meets = if DDS_IMPLEMENTATIONS.iter().any(|known| name.starts_with(known)) {
        "it can talk to nodes of that implementation all the same"
    } else {
        "it can talk only to nodes whose implementation uses DDS as well"
    };
    Some(format!("RMW_IMPLEMENTATION={name}: ignored; this node uses RustDDS, and {meets}"))
}

fn server(variable: &impl Fn(&str) -> Option<String>) -> Option<String> {
    let value = variable("ROS_DISCOVERY_SERVER")?;
    Some(format!(
        "ROS_DISCOVERY_SERVER={value}: discovery servers are not supported; this node finds others by multicast, and \
         peers that only ask a server do not find it"
    ))
}

/// The address of a host, by its name or as it stands. RustDDS sends by IPv4 alone.
fn address(host: &str) -> Option<IpAddr> {
    let found = (host, 0).to_socket_addrs().map(|found| found.map(|a| a.ip()).find(IpAddr::is_ipv4));
    match found {
        Ok(Some(address)) => return Some(address),
        Ok(None) => warn!("ROS_STATIC_PEERS: '{host}' has no IPv4 address; it is ignored"),
        Err(why) => warn!("ROS_STATIC_PEERS: '{host}' cannot be resolved, {why}; it is ignored"),
    }
    None
}

/// Bytes that the kernel allows a receive buffer, where it tells.
pub fn receive_buffer_limit() -> Option<usize> {
    std::fs::read_to_string(RMEM_MAX).ok()?.trim().parse().ok()
}

/// What to do where the kernel's receive buffers are too small for images; `None` where they are not.
pub fn buffer_warning() -> Option<String> {
    let limit = receive_buffer_limit()?;
    (limit < ENOUGH_RMEM).then(|| {
        format!(
            "the kernel limits receive buffers to {limit} bytes, and large images will be lost; run: \
             sudo sysctl -w net.core.rmem_max={RECEIVE_BUFFER}"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_with(variables: &[(&str, &str)], enclave: Option<&str>) -> Result<Environment, Fault> {
        let value = |name: &str| variables.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned());
        Environment::from(value, enclave)
    }

    fn read(variables: &[(&str, &str)]) -> Result<Environment, Fault> {
        read_with(variables, None)
    }

    #[test]
    fn the_domain_is_a_number_with_ports() {
        assert_eq!(read(&[]).unwrap().domain, 0);
        assert_eq!(read(&[("ROS_DOMAIN_ID", "42")]).unwrap().domain, 42);
        for value in ["233", "-1", "x"] {
            let message = read(&[("ROS_DOMAIN_ID", value)]).unwrap_err().to_string();
            assert!(message.contains(&format!("ROS_DOMAIN_ID={value}")), "{message}");
        }
    }

    /// What rcl makes of each pair, with the static peers it asks.
    #[test]
    fn discovery_reaches_as_far_as_in_rcl() {
        use Reach::{Localhost, Off, Subnet};
        for (localhost_only, range, reach, obeys_peers, warns) in [
            (None, None, Subnet, true, false),
            (None, Some("SUBNET"), Subnet, true, false),
            (None, Some("SYSTEM_DEFAULT"), Subnet, false, false),
            (None, Some("LOCALHOST"), Localhost, true, false),
            (None, Some("OFF"), Off, false, false),
            (None, Some("localhost"), Localhost, true, true),
            (None, Some("subnet"), Localhost, true, true),
            (None, Some("MOON"), Localhost, true, true),
            (Some("0"), None, Subnet, true, false),
            (Some("0"), Some("SUBNET"), Subnet, true, false),
            (Some("0"), Some("LOCALHOST"), Localhost, true, false),
            (Some("0"), Some("OFF"), Off, false, false),
            (Some("true"), Some("OFF"), Off, false, false),
            (Some("1"), None, Localhost, false, false),
            (Some("1"), Some("SUBNET"), Localhost, false, false),
            (Some("1"), Some("SYSTEM_DEFAULT"), Localhost, false, false),
            (Some("1"), Some("LOCALHOST"), Localhost, false, false),
            (Some("1"), Some("OFF"), Localhost, false, false),
        ] {
            let variables = [("ROS_LOCALHOST_ONLY", localhost_only), ("ROS_AUTOMATIC_DISCOVERY_RANGE", range)];
            let set: Vec<_> = variables.into_iter().filter_map(|(name, value)| Some((name, value?))).collect();
            let alone = read(&set).unwrap();
            assert_eq!((alone.reach, alone.warnings.len()), (reach, usize::from(warns)), "{set:?}: {alone:?}");
            let with_peers = read(&[&set[..], &[("ROS_STATIC_PEERS", "a; 10.0.0.2;")]].concat()).unwrap();
            let expected: &[&str] = if obeys_peers { &["a", "10.0.0.2"] } else { &[] };
            assert_eq!(with_peers.peers, expected, "{set:?}");
            let told =
                with_peers.warnings.iter().filter(|line| line.starts_with("ROS_STATIC_PEERS=a;10.0.0.2:")).count();
            assert_eq!(told, usize::from(reach != Subnet || !obeys_peers), "{set:?}: {:?}", with_peers.warnings);
        }
    }

    #[test]
    fn security_that_is_enforced_keeps_the_node_from_starting() {
        let enabled = ("ROS_SECURITY_ENABLE", "true");
        let enforced = ("ROS_SECURITY_STRATEGY", "Enforce");
        for enclave in [None, Some("/eye")] {
            let why = read_with(&[enabled, enforced], enclave).unwrap_err().to_string();
            assert!(why.contains("ROS_SECURITY_STRATEGY=Enforce") && why.contains("not supported"), "{why}");
        }
        for (variables, enclave, told) in [
            (vec![enabled], None, Some("ROS_SECURITY_ENABLE=true: ")),
            (vec![enabled, ("ROS_SECURITY_STRATEGY", "Permissive")], Some("/eye"), Some("ROS_SECURITY_ENABLE=true: ")),
            (vec![enabled, ("ROS_SECURITY_STRATEGY", "enforce")], None, Some("ROS_SECURITY_ENABLE=true: ")),
            (vec![enforced], None, None),
            (vec![("ROS_SECURITY_ENABLE", "True"), enforced], None, None),
            (vec![("ROS_SECURITY_ENABLE", "false"), enforced], Some("/eye"), Some("--enclave /eye: ")),
        ] {
            let warnings = read_with(&variables, enclave).unwrap().warnings;
            assert_eq!(warnings.len(), usize::from(told.is_some()), "{variables:?} {enclave:?}: {warnings:?}");
            assert!(told.is_none_or(|told| warnings[0].starts_with(told)), "{warnings:?}");
        }
    }

    #[test]
    fn what_is_not_obeyed_is_told_in_one_line_each() {
        for (name, value, told) in [
            ("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp", "can talk to nodes of that implementation all the same"),
            ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp", "can talk to nodes of that implementation all the same"),
            ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp", "only to nodes whose implementation uses DDS"),
            ("ROS_DISCOVERY_SERVER", "127.0.0.1:11811", "discovery servers are not supported"),
        ] {
            let warnings = read(&[(name, value)]).unwrap().warnings;
            let [line] = &warnings[..] else { panic!("{warnings:?}") };
            assert!(line.starts_with(&format!("{name}={value}: ")) && line.contains(told), "{line}");
        }
        assert!(read(&[]).unwrap().warnings.is_empty());
    }

    #[test]
    fn peers_are_found_by_address_and_by_name() {
        assert_eq!(address("10.0.0.2"), Some(Ipv4Addr::new(10, 0, 0, 2).into()));
        assert_eq!(address("localhost"), Some(Ipv4Addr::LOCALHOST.into()));
        assert_eq!(address("::1"), None, "it has no IPv4 address");
    }
}
