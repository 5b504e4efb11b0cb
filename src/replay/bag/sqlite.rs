//! Bags in SQLite files (`.db3`): the tables `topics` and `messages`.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use rusqlite::limits::Limit;
use rusqlite::{Connection, OpenFlags};

use super::{BagError, Messages, Recorded, TopicInfo};
use crate::params::Limits;

/// What the files begin with.
pub const MAGIC: &[u8] = b"SQLite format 3\0";

/// Only tables: a view may compute for ever.
const TABLES: &str = "SELECT COUNT(*) FROM sqlite_schema WHERE type = 'table' AND sql LIKE 'CREATE TABLE%' \
                      AND name IN ('topics', 'messages')";
const TOPICS: &str = "SELECT id, name, type, serialization_format FROM topics ORDER BY name";
const OWNERS: &str = "SELECT topic_id FROM messages";
const ORDER: &str = "SELECT m.id FROM messages m JOIN topics t ON m.topic_id = t.id WHERE t.name = ?1 \
                     ORDER BY m.timestamp, m.id";
const MESSAGE: &str = "SELECT timestamp, data FROM messages WHERE id = ?1";

fn open(path: &Path, limits: &Limits) -> Result<Connection, BagError> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let opened = || {
        let connection = Connection::open_with_flags(path, flags)?;
        let most = i32::try_from(limits.message_bytes()).unwrap_or(i32::MAX);
        connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, most)?;
        let tables: i64 = connection.query_row(TABLES, [], |row| row.get(0))?;
        Ok((connection, tables))
    };
    match opened().map_err(|e| broken(path, &e))? {
        (connection, 2) => Ok(connection),
        _ => Err(BagError::Broken {
            path: path.to_owned(),
            why: "it lacks the tables 'topics' and 'messages'".to_owned(),
        }),
    }
}

fn broken(path: &Path, why: &rusqlite::Error) -> BagError {
    BagError::Broken { path: path.to_owned(), why: why.to_string() }
}

/// What was recorded in the file.
pub fn topics(path: &Path, limits: &Limits) -> Result<Vec<TopicInfo>, BagError> {
    let connection = open(path, limits)?;
    let counts = counts(path, &connection)?;
    let all = || {
        let mut statement = connection.prepare(TOPICS)?;
        let topics = statement.query_map([], |row| {
            let count = counts.get(&row.get(0)?).copied().unwrap_or(0);
            Ok(TopicInfo { name: row.get(1)?, kind: row.get(2)?, format: row.get(3)?, count })
        })?;
        topics.collect::<Result<_, _>>()
    };
    all().map_err(|e| broken(path, &e))
}

/// How many messages each topic has. In a broken file there may seem to be more than it has bytes, and no end of them.
fn counts(path: &Path, connection: &Connection) -> Result<HashMap<i64, u64>, BagError> {
    let failed = |source| BagError::Io { path: path.to_owned(), source };
    let most = std::fs::metadata(path).map_err(failed)?.len();
    let mut counts = HashMap::new();
    let mut count = || {
        let mut statement = connection.prepare(OWNERS)?;
        let mut rows = statement.query([])?;
        let mut seen = 0;
        while let Some(row) = rows.next()? {
            *counts.entry(row.get(0)?).or_default() += 1;
            seen += 1;
            if seen > most {
                return Ok(false);
            }
        }
        Ok(true)
    };
    if count().map_err(|e| broken(path, &e))? {
        Ok(counts)
    } else {
        let why = format!("it lists more messages than its {most} bytes can hold");
        Err(BagError::Broken { path: path.to_owned(), why })
    }
}

/// The messages of a topic.
pub struct Reader {
    path: PathBuf,
    connection: Connection,
    /// Rows in order.
    rows: std::vec::IntoIter<i64>,
}

impl Reader {
    /// Finds the messages. What is remembered of each is its row.
    pub fn open(path: &Path, topic: &str, limits: &Limits) -> Result<Self, BagError> {
        let connection = open(path, limits)?;
        let rows = || {
            let mut statement = connection.prepare(ORDER)?;
            let rows = statement.query_map([topic], |row| row.get(0))?;
            rows.collect::<Result<Vec<i64>, _>>()
        };
        let rows = rows().map_err(|e| broken(path, &e))?.into_iter();
        Ok(Self { path: path.to_owned(), connection, rows })
    }
}

impl Messages for Reader {
    fn next_into(&mut self, message: &mut Recorded) -> Result<bool, BagError> {
        let Some(id) = self.rows.next() else { return Ok(false) };
        let read = self.connection.query_row(MESSAGE, [id], |row| {
            let time: i64 = row.get(0)?;
            message.log_time = u64::try_from(time).unwrap_or(0);
            message.bytes.clear();
            message.bytes.extend_from_slice(row.get_ref(1)?.as_blob()?);
            Ok(())
        });
        read.map(|()| true).map_err(|e| broken(&self.path, &e))
    }
}
