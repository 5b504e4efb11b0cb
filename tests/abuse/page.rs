//! Strangers at the port of the live page of a running node.

#![cfg(all(feature = "ros", feature = "viewer"))]

use std::collections::HashSet;
use std::fs;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};

use super::support::{Environment, Node, Peer, domain, free_port};

const TOKEN: &str = "0123456789abcdef";
/// Of `/proc/net/tcp`: a socket that listens.
const LISTENS: &str = "0A";

fn node(domain: u32, port: u16) -> Node {
    let (port, token) = (format!("viewer.port:={port}"), format!("viewer.token:='{TOKEN}'"));
    // Few images are kept, so that memory soon stands still.
    let set = ["lcmht.cnn.enabled:=false", "history.frames:=4", &port, &token].map(|set| ["-p", set]);
    let node = Node::start(domain, &[["--ros-args"].as_slice(), set.as_flattened()].concat());
    node.wait_for("live page: http://127.0.0.1:");
    node
}

/// Runs a function of `tests/peer/abuse_page.py` against the node.
fn against(node: &Node, domain: u32, function: &str, port: u16, args: &[&str]) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/abuse_page.py");
    let (pid, port) = (node.id().to_string(), port.to_string());
    let args = [&[function, &pid, &port, TOKEN], args].concat();
    Peer::spawn(&mut Environment::get().python(), domain, &script, &args).succeed(node);
}

/// The addresses at which the process listens for TCP, by IP version 4; those by version 6 are told as they are.
fn listening(node: &Node) -> Result<Vec<SocketAddrV4>, String> {
    let process = PathBuf::from(format!("/proc/{}", node.id()));
    let files = fs::read_dir(process.join("fd")).expect("the open files of a process");
    let links = files.filter_map(|file| fs::read_link(file.ok()?.path()).ok());
    let inodes: HashSet<String> =
        links.filter_map(|link| Some(link.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned())).collect();
    let own = |table: &str| -> Vec<String> {
        // A kernel without IPv6 has no such table.
        let rows = fs::read_to_string(process.join("net").join(table)).unwrap_or_default();
        let rows = rows.lines().skip(1).map(|row| row.split_whitespace().collect::<Vec<_>>());
        let own = rows.filter(|row| row[3] == LISTENS && inodes.contains(row[9]));
        own.map(|row| row[1].to_owned()).collect()
    };
    let six = own("tcp6");
    if !six.is_empty() {
        return Err(format!("{six:?}"));
    }
    let address = |text: String| {
        let (ip, port) = text.split_once(':').expect("address and port");
        let ip = u32::from_str_radix(ip, 16).expect("an address").to_ne_bytes();
        SocketAddrV4::new(Ipv4Addr::from(ip), u16::from_str_radix(port, 16).expect("a port"))
    };
    Ok(own("tcp").into_iter().map(address).collect())
}

#[test]
fn strangers_at_the_live_page_are_refused_and_the_node_tracks_on() {
    let (domain, port) = (domain(), free_port());
    let node = node(domain, port);
    assert_eq!(listening(&node), Ok(vec![SocketAddrV4::new(Ipv4Addr::LOCALHOST, port)]));
    against(&node, domain, "strangers", port, &[]);
    let log = node.end();
    // A line about them at most once a second.
    assert!(log.lines().filter(|line| line.contains("live page")).count() < 100, "{log}");
    assert!(!log.contains(TOKEN), "{log}");
}

#[test]
fn pages_that_stop_reading_cost_no_memory() {
    let (domain, port) = (domain(), free_port());
    let node = node(domain, port);
    against(&node, domain, "deaf", port, &["100"]);
    node.end();
}

#[test]
fn nothing_listens_where_no_page_is_asked_for() {
    let node = Node::start(domain(), &[]);
    node.wait_for("waits for images");
    assert_eq!(listening(&node), Ok(Vec::new()));
    node.end();
}
