//! What the node says of its health on `/diagnostics`, once a second: images, targets, network.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use futures::StreamExt;
use log::warn;
use ros2_client::{Name, Publisher};

use super::clock;
use super::endpoints::Endpoints;
use super::env::{buffer_warning, receive_buffer_limit};
use super::fault::Fault;
use super::messages::{DiagnosticArray, DiagnosticStatus, Header, KeyValue, Time};
use super::stats::Stats;
use crate::viewer::{self, Hub};

/// From one message to the next.
const PERIOD: Duration = Duration::from_secs(1);

/// `diagnostic_msgs/msg/DiagnosticStatus`: all is well, or not quite.
const OK: u8 = 0;
const WARN: u8 = 1;

/// The topic, and what is told there.
pub struct Diagnostics {
    publisher: Publisher<DiagnosticArray>,
    node: String,
    image_topic: String,
    stats: Arc<Stats>,
    page: Option<Hub>,
}

/// The counts at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Counts {
    at: Instant,
    received: u64,
    missed: u64,
    rejected: u64,
    skipped: u64,
    superseded: u64,
    published: u64,
    unsent: u64,
}

impl Counts {
    fn read(stats: &Stats) -> Self {
        let read = |counter: &AtomicU64| counter.load(Relaxed);
        Self {
            at: Instant::now(),
            received: read(&stats.received),
            missed: read(&stats.missed),
            rejected: read(&stats.rejected),
            skipped: read(&stats.skipped),
            superseded: read(&stats.superseded),
            published: read(&stats.published),
            unsent: read(&stats.unsent),
        }
    }
}

impl Diagnostics {
    /// Makes the topic.
    pub fn new(
        endpoints: &mut Endpoints,
        image_topic: &Name,
        stats: Arc<Stats>,
        page: Option<Hub>,
    ) -> Result<Self, Fault> {
        Ok(Self {
            publisher: endpoints.publisher("/diagnostics")?,
            node: endpoints.names.node().full(),
            image_topic: image_topic.to_string(),
            stats,
            page,
        })
    }

    /// Tells for ever.
    pub async fn serve(&self) {
        let mut last = Counts::read(&self.stats);
        let mut ticks = smol::Timer::interval(PERIOD);
        while ticks.next().await.is_some() {
            let now = Counts::read(&self.stats);
            let latency = self.stats.take_latency().to_string();
            let status = vec![
                images(&self.image_topic, &last, &now),
                targets(self.stats.targets(), &latency, &last, &now),
                network(receive_buffer_limit(), buffer_warning()),
            ];
            if let Some(page) = &self.page {
                page.report(status.iter().map(Part::shown));
            }
            let status = status.into_iter().map(|part| part.of(&self.node)).collect();
            let header = Header { stamp: Time::from_nanos(clock::now().to_nanos()), frame_id: String::new() };
            if let Err(why) = self.publisher.publish(DiagnosticArray { header, status }) {
                warn!("diagnostics not published: {why}");
            }
            last = now;
        }
    }
}

/// The health of one part of the node.
struct Part {
    name: &'static str,
    level: u8,
    message: String,
    values: Vec<(&'static str, String)>,
}

impl Part {
    /// As the live page shows it.
    fn shown(&self) -> viewer::Part {
        let value = |(key, value): &(&str, String)| ((*key).to_owned(), value.clone());
        viewer::Part {
            name: self.name.to_owned(),
            level: self.level,
            message: self.message.clone(),
            values: self.values.iter().map(value).collect(),
        }
    }

    fn of(self, node: &str) -> DiagnosticStatus {
        let value = |(key, value): (&str, String)| KeyValue { key: key.to_owned(), value };
        DiagnosticStatus {
            level: self.level,
            name: format!("{}: {}", node.trim_start_matches('/'), self.name),
            message: self.message,
            hardware_id: String::new(),
            values: self.values.into_iter().map(value).collect(),
        }
    }
}

/// A rate since `last`.
fn rate(count: u64, last: &Counts, now: &Counts) -> f64 {
    count as f64 / (now.at - last.at).as_secs_f64().max(f64::MIN_POSITIVE)
}

fn images(topic: &str, last: &Counts, now: &Counts) -> Part {
    let came = now.received - last.received;
    let rate = rate(came, last, now);
    let troubles: Vec<String> = [
        (now.missed - last.missed, "missed"),
        (now.rejected - last.rejected, "refused"),
        (now.skipped - last.skipped, "skipped"),
    ]
    .into_iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, what)| format!("{count} {what}"))
    .collect();
    let (level, message) = match came {
        0 if troubles.is_empty() => (WARN, format!("no image on {topic}")),
        _ if troubles.is_empty() => (OK, format!("{rate:.1} a second")),
        _ => (WARN, format!("{rate:.1} a second, {}", troubles.join(", "))),
    };
    let values = vec![
        ("topic", topic.to_owned()),
        ("rate (Hz)", format!("{rate:.1}")),
        ("received", now.received.to_string()),
        ("missed", now.missed.to_string()),
        ("refused", now.rejected.to_string()),
        ("skipped", now.skipped.to_string()),
    ];
    Part { name: "images", level, message, values }
}

fn targets([tracking, uncertain, lost]: [usize; 3], latency: &str, last: &Counts, now: &Counts) -> Part {
    let message = match tracking + uncertain + lost {
        0 => "no target".to_owned(),
        _ => [(tracking, "tracking"), (uncertain, "uncertain"), (lost, "lost")]
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, state)| format!("{count} {state}"))
            .collect::<Vec<_>>()
            .join(", "),
    };
    let unsent = now.unsent > last.unsent;
    let values = vec![
        ("tracking", tracking.to_string()),
        ("uncertain", uncertain.to_string()),
        ("lost", lost.to_string()),
        ("track messages", now.published.to_string()),
        ("rate (Hz)", format!("{:.1}", rate(now.published - last.published, last, now))),
        ("latency, min / mean / max (ms)", latency.to_owned()),
        ("messages unsent", now.unsent.to_string()),
        ("marks superseded", now.superseded.to_string()),
    ];
    let level = if lost > 0 || unsent { WARN } else { OK };
    Part { name: "targets", level, message, values }
}

fn network(limit: Option<usize>, warning: Option<String>) -> Part {
    let limit = limit.map_or("unknown".to_owned(), |limit| limit.to_string());
    let (level, message) = match warning {
        Some(warning) => (WARN, warning),
        None => (OK, "receive buffers are large enough for images".to_owned()),
    };
    Part { name: "network", level, message, values: vec![("receive buffer limit (bytes)", limit)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(at: Instant, [received, missed, skipped]: [u64; 3]) -> Counts {
        Counts { at, received, missed, rejected: 4, skipped, superseded: 2, published: received, unsent: 0 }
    }

    #[test]
    fn images_are_told_by_what_came_since_the_last_time() {
        let begin = Instant::now();
        let end = begin + Duration::from_secs(2);
        let good = images("/eye", &counts(begin, [100, 7, 3]), &counts(end, [160, 7, 3]));
        assert_eq!((good.level, good.message.as_str()), (OK, "30.0 a second"));
        let bad = images("/eye", &counts(begin, [100, 7, 3]), &counts(end, [130, 9, 4]));
        assert_eq!((bad.level, bad.message.as_str()), (WARN, "15.0 a second, 2 missed, 1 skipped"));
        let none = images("/eye", &counts(begin, [100, 7, 3]), &counts(end, [100, 7, 3]));
        assert_eq!((none.level, none.message.as_str()), (WARN, "no image on /eye"));
    }

    #[test]
    fn a_lost_target_is_a_warning() {
        let now = counts(Instant::now(), [0; 3]);
        let told = |states| {
            let part = targets(states, "", &now, &now);
            (part.level, part.message)
        };
        assert_eq!(told([0, 0, 0]), (OK, "no target".to_owned()));
        assert_eq!(told([2, 1, 0]), (OK, "2 tracking, 1 uncertain".to_owned()));
        assert_eq!(told([1, 0, 1]), (WARN, "1 tracking, 1 lost".to_owned()));
    }

    #[test]
    fn names_are_of_the_node_and_its_part() {
        let status = network(Some(212_992), Some("too small".to_owned())).of("/robot/eye");
        assert_eq!((status.name.as_str(), status.level), ("robot/eye: network", WARN));
        assert_eq!(status.values[0].value, "212992");
    }
}
