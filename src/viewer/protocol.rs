//! What goes over a page's WebSocket as text, in JSON; pictures go as binary messages, see `picture.rs`.

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::hub::News;
use super::parameters::{self, Row};
use super::story::{Happened, Part, Sample};
use super::{Command, Host, Playback, Replay};
use crate::geometry::Rect;

/// Characters that the name of a target may have.
const MOST_NAME: usize = 64;

/// What a page sends.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Incoming {
    /// The first message: may it come in?
    Enter { token: String },
    /// It waits for one more picture, of about so many pixels.
    Look { side: u32 },
    /// Something is to be done; the answer bears the number.
    Ask { number: u64, command: Asking },
}

/// What is to be done.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Asking {
    Mark { rect: [f64; 4], id: Option<String>, stamp: Option<String> },
    Stop { id: Option<String> },
    Restart {},
    Rename { id: String, to: String },
    Hold { stamp: Option<String> },
    Release {},
    Set { name: String, value: Json },
    Save {},
    Replay(Replay),
}

/// What is sent to a page.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Outgoing {
    Hello { title: String, version: &'static str, now: u64, rows: Vec<Row>, values: Vec<Json> },
    News(Told),
    Answer { number: u64, error: Option<String>, file: Option<String> },
    Refused { why: String, asks_token: bool },
}

/// News as it is sent.
#[derive(Serialize)]
pub(super) struct Told {
    now: u64,
    /// Another run has begun; these are the figures of the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    previous: Option<Vec<Sample>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    playback: Option<Playback>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    samples: Vec<Sample>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    events: Vec<Happened>,
    #[serde(skip_serializing_if = "Option::is_none")]
    parts: Option<Vec<Part>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    values: Option<Vec<Json>>,
}

impl Told {
    /// The news of this time; `None` where there are none.
    pub(super) fn new(news: News, now: u64, host: &dyn Host) -> Option<Self> {
        let News { previous, samples, playback, events, parts, has_new_params } = news;
        let is_same = previous.is_none() && playback.is_none();
        let is_empty = is_same && samples.is_empty() && events.is_empty() && parts.is_none() && !has_new_params;
        let values = || has_new_params.then(|| parameters::values(&host.params()));
        (!is_empty).then(|| Self { now, previous, playback, samples, events, parts, values: values() })
    }
}

impl Asking {
    /// The command of the page of this number.
    pub(super) fn command(self, page: u64) -> Result<Command, String> {
        Ok(match self {
            Self::Mark { rect: [x, y, w, h], id, stamp } => {
                let id = id.map(named).transpose()?;
                Command::Mark { rect: Rect::new(x, y, w, h), id, stamp: number(stamp)? }
            }
            Self::Stop { id } => Command::Stop(id),
            Self::Restart {} => Command::Restart,
            Self::Rename { id, to } => Command::Rename { id, to: named(to)? },
            Self::Hold { stamp } => Command::Hold { page, stamp: number(stamp)? },
            Self::Release {} => Command::Release { page },
            Self::Set { name, value } => {
                let value = parameters::value(&name, &value)?;
                Command::Set { name, value }
            }
            Self::Replay(replay) => Command::Replay(replay),
            Self::Save {} => return Err("a file is saved by the page".to_owned()),
        })
    }
}

/// A stamp, which goes as text: it has more digits than numbers of JSON keep.
fn number(stamp: Option<String>) -> Result<Option<i64>, String> {
    stamp.map(|text| text.parse().map_err(|_| format!("'{text}' is no stamp"))).transpose()
}

fn named(name: String) -> Result<String, String> {
    let length = name.chars().count();
    match length {
        0 => Err("a target needs a name".to_owned()),
        _ if length > MOST_NAME => Err(format!("the name has {length} characters, at most {MOST_NAME} are taken")),
        _ if name.chars().any(char::is_control) => Err(format!("the name {name:?} has characters that are none")),
        _ => Ok(name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Value;

    fn asked(text: &str) -> Result<Command, String> {
        let text = format!("{{\"ask\": {{\"number\": 1, \"command\": {text}}}}}");
        match serde_json::from_str(&text).map_err(|why| why.to_string())? {
            Incoming::Ask { command, .. } => command.command(7),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn commands_are_read_with_their_stamps_whole() {
        let mark = asked(r#"{"mark": {"rect": [1, 2.5, 3, 4], "id": null, "stamp": "1700000000123456789"}}"#);
        let rect = Rect::new(1.0, 2.5, 3.0, 4.0);
        assert_eq!(mark, Ok(Command::Mark { rect, id: None, stamp: Some(1_700_000_000_123_456_789) }));
        assert_eq!(asked(r#"{"hold": {"stamp": null}}"#), Ok(Command::Hold { page: 7, stamp: None }));
        let set = Command::Set { name: "debug.max_side".into(), value: Value::Integer(100) };
        assert_eq!(asked(r#"{"set": {"name": "debug.max_side", "value": 100}}"#), Ok(set));
    }

    #[test]
    fn what_is_no_command_is_refused() {
        for text in [
            r#"{"mark": {"rect": [NaN, 2, 3, 4]}}"#,
            r#"{"mark": {"rect": [1e999, 2, 3, 4]}}"#,
            r#"{"mark": {"rect": [null, 2, 3, 4]}}"#,
            r#"{"mark": {"rect": [1, 2, 3]}}"#,
            r#"{"mark": {"rect": [1, 2, 3, 4], "stamp": "x"}}"#,
            r#"{"mark": {"rect": [1, 2, 3, 4], "id": ""}}"#,
            r#"{"rename": {"id": "0", "to": "a\nb"}}"#,
            r#"{"set": {"name": "debug.max_side", "value": [1]}}"#,
            r#"{"explode": {}}"#,
        ] {
            assert!(asked(text).is_err(), "{text}");
        }
        let long = format!(r#"{{"rename": {{"id": "0", "to": "{}"}}}}"#, "x".repeat(65));
        assert_eq!(asked(&long).unwrap_err(), "the name has 65 characters, at most 64 are taken");
    }
}
