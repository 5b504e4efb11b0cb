//! What the environment says: the domain, how far discovery reaches, and how much the kernel buffers.

use std::net::{IpAddr, Ipv4Addr};

use ros2_client::Context;
use rustdds::DomainParticipantBuilder;

use super::fault::Fault;

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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Environment {
    /// `ROS_DOMAIN_ID`; 0 where it is not set.
    pub domain: u16,
    /// `ROS_LOCALHOST_ONLY` and `ROS_AUTOMATIC_DISCOVERY_RANGE`.
    pub reach: Reach,
}

impl Environment {
    /// Reads the variables of the process.
    pub fn read() -> Result<Self, Fault> {
        Self::from(|name| std::env::var(name).ok().filter(|v| !v.is_empty()))
    }

    fn from(variable: impl Fn(&str) -> Option<String>) -> Result<Self, Fault> {
        let domain = match variable("ROS_DOMAIN_ID") {
            None => 0,
            Some(value) => value.trim().parse().ok().filter(|&d| d <= MAX_DOMAIN).ok_or_else(|| {
                let why = format!("it must be a number from 0 to {MAX_DOMAIN}");
                Fault::Environment { variable: "ROS_DOMAIN_ID", value, why }
            })?,
        };
        // As in rmw, the older variable takes precedence where it is set at all.
        let reach = match variable("ROS_LOCALHOST_ONLY").as_deref() {
            Some("1") => Reach::Localhost,
            Some(_) => Reach::Subnet,
            None => range(variable("ROS_AUTOMATIC_DISCOVERY_RANGE"))?,
        };
        Ok(Self { domain, reach })
    }

    /// Joins the domain.
    pub fn context(&self) -> Result<Context, Fault> {
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

fn range(value: Option<String>) -> Result<Reach, Fault> {
    match value.as_deref().map(str::to_ascii_uppercase).as_deref() {
        None | Some("SUBNET" | "SYSTEM_DEFAULT") => Ok(Reach::Subnet),
        Some("LOCALHOST") => Ok(Reach::Localhost),
        Some("OFF") => Ok(Reach::Off),
        Some(_) => Err(Fault::Environment {
            variable: "ROS_AUTOMATIC_DISCOVERY_RANGE",
            value: value.unwrap_or_default(),
            why: "it must be SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT".to_owned(),
        }),
    }
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
            "the kernel allows receive buffers of {limit} bytes only, and large images will be lost; run: \
             sudo sysctl -w net.core.rmem_max={RECEIVE_BUFFER}"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(variables: &[(&str, &str)]) -> Result<Environment, Fault> {
        Environment::from(|name| variables.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned()))
    }

    #[test]
    fn variables_set_the_domain_and_the_reach() {
        let of = |domain, reach| Environment { domain, reach };
        assert_eq!(read(&[]).unwrap(), of(0, Reach::Subnet));
        assert_eq!(read(&[("ROS_DOMAIN_ID", "42"), ("ROS_LOCALHOST_ONLY", "1")]).unwrap(), of(42, Reach::Localhost));
        assert_eq!(read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "localhost")]).unwrap().reach, Reach::Localhost);
        assert_eq!(read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")]).unwrap().reach, Reach::Off);
        let both = [("ROS_LOCALHOST_ONLY", "0"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")];
        assert_eq!(read(&both).unwrap().reach, Reach::Subnet);
    }

    #[test]
    fn values_that_make_no_sense_are_named() {
        for value in ["233", "-1", "x"] {
            let message = read(&[("ROS_DOMAIN_ID", value)]).unwrap_err().to_string();
            assert!(message.contains(&format!("ROS_DOMAIN_ID={value}")), "{message}");
        }
        assert!(read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "MOON")]).unwrap_err().to_string().contains("MOON"));
    }
}
