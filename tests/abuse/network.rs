//! Datagrams, signals and environments that a peer or an operator may bring.

#![cfg(feature = "ros")]

use std::net::UdpSocket;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::support::{Environment, Node, Peer, domain};

/// Where an announcement must come within.
const DEADLINE: Duration = Duration::from_secs(20);

fn peer(domain: u32, scenario: &str, args: &[&str]) -> Peer {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/abuse_network.py");
    Peer::spawn(&mut Environment::get().python(), domain, &script, &[&[scenario], args].concat())
}

/// A node and one function of the script against it, which takes the process and the domain first.
fn against_node(scenario: &str, args: &[&str]) {
    let domain = domain();
    let node = Node::start(domain, &[]);
    // The first in the domain, and so at the ports that the script knows.
    node.wait_for("waits for images");
    let (pid, number) = (node.id().to_string(), domain.to_string());
    // The function sees that the node works; it need not say goodbye to all whom it believes to be there.
    peer(domain, scenario, &[&[pid.as_str(), number.as_str()], args].concat()).succeed(&node);
}

#[test]
fn a_node_that_was_stopped_and_continued_goes_on() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    peer(domain, "frozen", &[&node.id().to_string(), "7"]).succeed(&node);
    peer(domain, "attached", &[&node.id().to_string()]).succeed(&node);
    node.end();
}

#[test]
fn numbers_and_sizes_that_peers_claim_are_not_believed() {
    against_node("hostile", &["far", "gaps", "fragments", "requests", "lengths"]);
}

#[test]
fn more_participants_than_any_robot_has_take_little_memory() {
    against_node("hostile", &["crowd"]);
}

#[test]
fn announcements_that_cannot_be_read_hide_no_others() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    node.wait_for("waits for images");
    peer(domain, "malformed", &[&domain.to_string()]).succeed(&node);
    node.end();
}

#[test]
fn datagrams_changed_at_random_do_no_harm() {
    against_node("fuzz", &["20240229", "24"]);
}

#[test]
fn the_clock_of_a_simulator_is_read_only_when_asked_for() {
    for (simulated, args) in [("no", &[][..]), ("yes", &["--ros-args", "-p", "use_sim_time:=true"])] {
        let domain = domain();
        let node = Node::start(domain, args);
        peer(domain, "clock", &[simulated]).succeed(&node);
        node.end();
    }
}

#[test]
fn topics_bear_the_hashes_of_their_types() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    let python = Environment::get().python();
    let prefixes = python.get_envs().find(|(name, _)| *name == "AMENT_PREFIX_PATH").and_then(|(_, value)| value);
    peer(domain, "type_hashes", &[prefixes.unwrap().to_str().unwrap()]).succeed(&node);
    node.end();
}

#[test]
fn a_second_node_of_the_name_is_told() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    peer(domain, "namesake", &["other"]).succeed(&node);
    assert!(!node.log().contains("is also named /tracker"), "{}", node.log());
    peer(domain, "namesake", &["tracker"]).succeed(&node);
    node.wait_for("another node is also named /tracker");
    let log = node.end();
    assert_eq!(log.matches("is also named /tracker").count(), 1, "{log}");
}

#[test]
fn a_node_that_ends_says_goodbye() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    peer(domain, "goodbye", &[&node.id().to_string()]).succeed(&node);
    assert_eq!(node.finish().0, Some(0));
}

/// What was announced out of order was lost to some, so that a node stayed unseen for as long as both lived.
#[test]
fn nodes_that_start_at_once_are_all_seen() {
    peer(domain(), "started_together", &[env!("CARGO_BIN_EXE_tracker_node"), "5", "3"]).succeed_alone();
}

/// The node in an environment in which rcl would not start either: it ends at once, and the line says why.
#[test]
fn security_that_is_enforced_keeps_the_node_from_starting() {
    for args in [&[][..], &["--ros-args", "--enclave", "/eye"]] {
        let mut node = Command::new(env!("CARGO_BIN_EXE_tracker_node"));
        node.args(args).env("ROS_SECURITY_ENABLE", "true").env("ROS_SECURITY_STRATEGY", "Enforce");
        let output = node.stdout(Stdio::null()).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains("ROS_SECURITY_STRATEGY=Enforce") && told.contains("not supported"), "{told}");
    }
}

/// Static peers listen where the first participants of their host do.
#[test]
fn the_node_announces_itself_to_static_peers() {
    const HOST: &str = "127.0.0.2";
    let domain = domain();
    let port = 7400 + 250 * u16::try_from(domain).unwrap() + 10;
    let socket = UdpSocket::bind((HOST, port)).unwrap();
    socket.set_read_timeout(Some(DEADLINE)).unwrap();
    let mut node = Command::new(env!("CARGO_BIN_EXE_tracker_node"));
    let node = Node::started(node.env("ROS_STATIC_PEERS", HOST), domain, &[]);
    let mut datagram = [0; 65536];
    let (length, _) = socket.recv_from(&mut datagram).unwrap();
    assert!(length > 20 && datagram.starts_with(b"RTPS"), "{:?}", &datagram[..length]);
    node.end();
}
