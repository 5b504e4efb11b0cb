//! Bags in SQLite files (`.db3`): the tables `topics` and `messages`.

use std::path::{Path, PathBuf};

use rusqlite::{Connection, OpenFlags};

use super::{BagError, Messages, Recorded, TopicInfo};

/// What the files begin with.
pub const MAGIC: &[u8] = b"SQLite format 3\0";

const TOPICS: &str = "SELECT t.name, t.type, t.serialization_format, \
                      (SELECT COUNT(*) FROM messages m WHERE m.topic_id = t.id) FROM topics t ORDER BY t.name";
const ORDER: &str = "SELECT m.id FROM messages m JOIN topics t ON m.topic_id = t.id WHERE t.name = ?1 \
                     ORDER BY m.timestamp, m.id";
const MESSAGE: &str = "SELECT timestamp, data FROM messages WHERE id = ?1";

fn open(path: &Path) -> Result<Connection, BagError> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    Connection::open_with_flags(path, flags).map_err(|e| broken(path, &e))
}

fn broken(path: &Path, why: &rusqlite::Error) -> BagError {
    BagError::Broken { path: path.to_owned(), why: why.to_string() }
}

/// What was recorded in the file.
pub fn topics(path: &Path) -> Result<Vec<TopicInfo>, BagError> {
    let connection = open(path)?;
    let all = || {
        let mut statement = connection.prepare(TOPICS)?;
        let topics = statement.query_map([], |row| {
            let count: i64 = row.get(3)?;
            let count = u64::try_from(count).unwrap_or(0);
            Ok(TopicInfo { name: row.get(0)?, kind: row.get(1)?, format: row.get(2)?, count })
        })?;
        topics.collect::<Result<_, _>>()
    };
    all().map_err(|e| broken(path, &e))
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
    pub fn open(path: &Path, topic: &str) -> Result<Self, BagError> {
        let connection = open(path)?;
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
