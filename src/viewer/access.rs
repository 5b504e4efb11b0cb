//! Who may connect: requests that name this machine, and pages that came from here.
//!
//! A page elsewhere can make the user's browser send requests to this machine, in two ways. Its requests bear the
//! `Origin` of that page; and where its name is made to lead here after it was loaded (DNS rebinding), they bear that
//! name as `Host`. So both are looked at, before anything else is.

use std::net::IpAddr;

use hyper::header::{HOST, HeaderMap, HeaderName, ORIGIN};

/// Why a request is refused.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(super) enum Refusal {
    #[error("the request must have one Host")]
    NoHost,
    #[error("the host name '{0}' is not one of this machine")]
    Host(String),
    #[error("the origin '{0}' is not this page")]
    Origin(String),
    #[error("the request must have one Origin")]
    NoOrigin,
}

/// The names under which this machine is reached.
#[derive(Debug)]
pub(super) struct Names {
    /// Whether only this machine can reach it.
    is_loopback: bool,
    /// What the machine is called; addresses need no entry.
    names: Vec<String>,
}

impl Names {
    /// Of a server that listens on this address.
    pub(super) fn of(address: IpAddr) -> Self {
        let is_loopback = address.to_canonical().is_loopback();
        let mut names = vec!["localhost".to_owned()];
        if !is_loopback {
            let machine = rustix::system::uname().nodename().to_string_lossy().to_ascii_lowercase();
            names.push(format!("{machine}.local"));
            names.push(machine);
        }
        Self { is_loopback, names }
    }

    /// Whether a request may be answered; one that opens a WebSocket must say where its page came from.
    pub(super) fn check(&self, headers: &HeaderMap, opens_socket: bool) -> Result<(), Refusal> {
        let host = single(headers, HOST)?.ok_or(Refusal::NoHost)?;
        if !self.is_ours(name_of(&host)) {
            return Err(Refusal::Host(shortened(&host)));
        }
        let Some(origin) = single(headers, ORIGIN)? else {
            return if opens_socket { Err(Refusal::NoOrigin) } else { Ok(()) };
        };
        // A proxy in front may speak TLS.
        let from = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
        if from.is_some_and(|from| from.eq_ignore_ascii_case(&host)) {
            Ok(())
        } else {
            Err(Refusal::Origin(shortened(&origin)))
        }
    }

    fn is_ours(&self, name: &str) -> bool {
        let bare = name.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(name);
        match bare.parse::<IpAddr>() {
            // No name leads to an address but itself.
            Ok(address) => !self.is_loopback || address.to_canonical().is_loopback(),
            Err(_) => self.names.iter().any(|own| own.eq_ignore_ascii_case(name)),
        }
    }
}

/// The value of a header, which must not be there twice.
fn single(headers: &HeaderMap, name: HeaderName) -> Result<Option<String>, Refusal> {
    let mut values = headers.get_all(&name).iter();
    let first = values.next();
    if values.next().is_some() {
        return Err(if name == HOST { Refusal::NoHost } else { Refusal::NoOrigin });
    }
    Ok(first.map(|value| String::from_utf8_lossy(value.as_bytes()).into_owned()))
}

/// `name:port` without the port.
fn name_of(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port)) if !port.is_empty() && port.bytes().all(|c| c.is_ascii_digit()) => name,
        _ => host,
    }
}

/// What can be told of a text that a stranger chose.
fn shortened(text: &str) -> String {
    const MOST: usize = 80;
    text.chars().take(MOST).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Whether both are the same, in a time that tells nothing of where they differ.
pub(super) fn same(given: &str, wanted: &str) -> bool {
    let differ = given.bytes().zip(wanted.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
    given.len() == wanted.len() && std::hint::black_box(differ) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(address: &str, headers: &[(HeaderName, &str)], opens: bool) -> Result<(), Refusal> {
        let headers = headers.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect();
        Names::of(address.parse().unwrap()).check(&headers, opens)
    }

    #[test]
    fn only_names_of_this_machine_are_answered() {
        for host in ["localhost:8080", "LOCALHOST", "127.0.0.1:9", "[::1]:8080", "127.1.2.3"] {
            assert_eq!(check("127.0.0.1", &[(HOST, host)], false), Ok(()), "{host}");
        }
        for host in ["evil.example", "evil.example:8080", "192.168.1.2:8080", "localhost.evil.example", "", "a:b"] {
            assert_eq!(check("127.0.0.1", &[(HOST, host)], false), Err(Refusal::Host(host.into())), "{host}");
        }
        assert_eq!(check("0.0.0.0", &[(HOST, "192.168.1.2:8080")], false), Ok(()));
        assert_eq!(check("0.0.0.0", &[(HOST, "evil.example")], false), Err(Refusal::Host("evil.example".into())));
        assert_eq!(check("127.0.0.1", &[], false), Err(Refusal::NoHost));
        assert_eq!(check("127.0.0.1", &[(HOST, "localhost"), (HOST, "localhost")], false), Err(Refusal::NoHost));
    }

    #[test]
    fn only_this_page_may_ask() {
        let with = |origin| check("127.0.0.1", &[(HOST, "localhost:80"), (ORIGIN, origin)], true);
        assert_eq!((with("http://localhost:80"), with("https://LOCALHOST:80")), (Ok(()), Ok(())));
        for origin in ["http://localhost:81", "http://evil.example", "null", "http://127.0.0.1:80", "localhost:80"] {
            assert_eq!(with(origin), Err(Refusal::Origin(origin.into())));
        }
        assert_eq!(check("127.0.0.1", &[(HOST, "localhost")], true), Err(Refusal::NoOrigin));
        let told = with(&"x".repeat(5000)).unwrap_err().to_string();
        assert!(told.len() < 200, "{told}");
    }

    #[test]
    fn tokens_are_compared_whole() {
        assert!(same("", "") && same("abc", "abc"));
        assert!(!same("ab", "abc") && !same("abd", "abc") && !same("", "abc") && !same("abcd", "abc"));
    }
}
