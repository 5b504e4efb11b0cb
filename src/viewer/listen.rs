//! Where the page is served: the port, the address, and the token that others than this machine must know.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use rand::RngExt as _;

use super::{Host, Hub};
use crate::params::ViewerParams;

/// Characters of a token that is made, and the fewest of one that is given.
const TOKEN: usize = 32;
const LEAST_TOKEN: usize = 16;

/// Why the page cannot be served.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum ListenError {
    /// No address.
    #[error("parameter 'viewer.address' must be an IP address, got \"{0}\"")]
    Address(String),
    /// Easily guessed, or to be escaped in an address.
    #[error(
        "parameter 'viewer.token' must have at least {LEAST_TOKEN} characters, letters, digits, - or _ only; it has {0}"
    )]
    Token(usize),
    /// The port is taken, or not to be had.
    #[error("the live page cannot be served on {address}: {source}")]
    Bind { address: SocketAddr, source: std::io::Error },
    /// The program was built without.
    #[error("parameter 'viewer.port' is {0}, but this program was built without the cargo feature viewer")]
    Missing(i64),
}

/// A page that can be served: it listens, and answers once it runs.
pub struct Listening {
    #[cfg(feature = "viewer")]
    pub(super) server: super::server::Server,
    /// The address to open in a browser, with the token if one was made.
    pub link: String,
}

/// What whoever wants to see the page must show.
#[derive(Debug, PartialEq)]
pub(super) struct Secret {
    /// The token; empty where none is asked for.
    pub(super) token: String,
    /// Whether it was made here, so that it has to be told.
    pub(super) is_made: bool,
}

impl Secret {
    /// Off loopback there is a token; on loopback only where one was given.
    pub(super) fn new(given: &str, address: IpAddr) -> Result<Self, ListenError> {
        let is_plain = given.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
        match given.len() {
            0 if address.to_canonical().is_loopback() => Ok(Self { token: String::new(), is_made: false }),
            0 => Ok(Self { token: made(), is_made: true }),
            length if length < LEAST_TOKEN || !is_plain => Err(ListenError::Token(given.chars().count())),
            _ => Ok(Self { token: given.to_owned(), is_made: false }),
        }
    }
}

/// As many random digits of base 16.
fn made() -> String {
    let mut random = rand::rng();
    (0..TOKEN).map(|_| char::from_digit(random.random_range(0..16), 16).unwrap_or('0')).collect()
}

/// The IP address that the parameter names.
pub(super) fn address(text: &str) -> Result<IpAddr, ListenError> {
    match text {
        "localhost" => Ok(IpAddr::from([127, 0, 0, 1])),
        _ => text.parse().map_err(|_| ListenError::Address(text.to_owned())),
    }
}

/// Listens as the parameters say. Pages are served by [`Listening::run`].
#[cfg(feature = "viewer")]
pub fn listen(params: &ViewerParams, title: &str, hub: Hub, host: Arc<dyn Host>) -> Result<Listening, ListenError> {
    let ip = address(&params.address)?;
    let secret = Secret::new(&params.token, ip)?;
    // Within 16 bits by its range.
    let address = SocketAddr::new(ip, params.port as u16);
    let bound = std::net::TcpListener::bind(address).and_then(|l| l.local_addr().map(|at| (l, at)));
    let (listener, at) = bound.map_err(|source| ListenError::Bind { address, source })?;
    let link = link(at, &secret);
    Ok(Listening { server: super::server::Server::new(listener, title.to_owned(), secret.token, hub, host), link })
}

/// Tells that it cannot.
#[cfg(not(feature = "viewer"))]
pub fn listen(params: &ViewerParams, _: &str, _: Hub, _: Arc<dyn Host>) -> Result<Listening, ListenError> {
    Secret::new(&params.token, address(&params.address)?)?;
    Err(ListenError::Missing(params.port))
}

impl Listening {
    /// Serves pages until `end` gives something.
    #[cfg(feature = "viewer")]
    pub fn run(self, end: impl Future<Output = ()>) {
        self.server.run(end);
    }

    /// There is nothing to serve.
    #[cfg(not(feature = "viewer"))]
    pub fn run(self, _: impl Future<Output = ()>) {}
}

/// What a user is told to open. A token that was given is not told: the log may be read by others.
fn link(mut at: SocketAddr, secret: &Secret) -> String {
    if at.ip().is_unspecified() {
        at.set_ip(if at.is_ipv4() { IpAddr::from([127, 0, 0, 1]) } else { std::net::Ipv6Addr::LOCALHOST.into() });
    }
    let token = match secret.is_made {
        true => format!("#{}", secret.token),
        false => String::new(),
    };
    format!("http://{at}/{token}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOPBACK: [&str; 4] = ["127.0.0.1", "127.9.9.9", "::1", "::ffff:127.0.0.1"];

    #[test]
    fn off_loopback_there_is_a_token() {
        for text in LOOPBACK {
            assert_eq!(Secret::new("", address(text).unwrap()).unwrap().token, "", "{text}");
        }
        let any = address("0.0.0.0").unwrap();
        let [one, two] = [(); 2].map(|()| Secret::new("", any).unwrap());
        assert!(one.is_made && one.token.len() == TOKEN && one != two);
        assert_eq!(link(SocketAddr::new(any, 80), &one), format!("http://127.0.0.1:80/#{}", one.token));
        let given = Secret::new("0123456789abcdef", any).unwrap();
        assert_eq!(link(SocketAddr::new(any, 80), &given), "http://127.0.0.1:80/");
    }

    #[test]
    fn what_cannot_be_used_is_refused_with_its_value_but_a_token_is_not_told() {
        assert!(address("my.host").unwrap_err().to_string().contains("\"my.host\""));
        for token in ["short", "0123456789abcde/", "0123456789abcdeß"] {
            let why = Secret::new(token, IpAddr::from([127, 0, 0, 1])).unwrap_err().to_string();
            assert!(!why.contains(token), "{why}");
        }
    }
}
