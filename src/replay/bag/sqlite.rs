//! Bags in SQLite files (`.db3`): the tables `topics` and `messages`.
//!
//! A file is only read, and may lie where nothing can be written. What a recorder left beside it when it was ended is
//! read too: its log of what is not in the file yet (`-wal`), or its journal of what was there before (`-journal`).

use std::collections::HashMap;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Read as _};
use std::os::unix::ffi::OsStrExt as _;
use std::path::{Path, PathBuf};

use rusqlite::ffi::SQLITE_READONLY_ROLLBACK;
use rusqlite::limits::Limit;
use rusqlite::{Connection, ErrorCode, OpenFlags};
use tempfile::TempDir;

use super::{BagError, Contents, Messages, Recorded, TopicInfo};
use crate::params::Limits;

/// What the files begin with.
pub const MAGIC: &[u8] = b"SQLite format 3\0";
/// Which byte says how the file is written, and what it says where a log is kept.
const LOGGED: (usize, u8) = (18, 2);
/// How the names of a log, of its index in shared memory, and of a journal end.
const LOG: &str = "-wal";
const INDEX: &str = "-shm";
const JOURNAL: &str = "-journal";

/// Only tables: a view may compute for ever.
const TABLES: &str = "SELECT name FROM sqlite_schema WHERE type = 'table' AND sql LIKE 'CREATE TABLE%' ORDER BY name";
const TOPICS: &str = "SELECT id, name, type, serialization_format FROM topics ORDER BY name";
const RECORDED: &str = "SELECT topic_id, timestamp FROM messages";
const ORDER: &str = "SELECT m.id FROM messages m JOIN topics t ON m.topic_id = t.id WHERE t.name = ?1 \
                     ORDER BY m.timestamp, m.id";
const MESSAGE: &str = "SELECT timestamp, data FROM messages WHERE id = ?1";

/// An open file, which is not changed.
struct Database {
    connection: Connection,
    /// Where a copy lies that is read instead.
    copy: Option<TempDir>,
}

/// How SQLite is told to read a file.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    /// As a reader beside a writer, which takes locks and, beside a log, an index that readers and writers share.
    Shared,
    /// As the only one, without locks, with the index of a log in memory.
    Alone,
    /// As a file that nobody writes and that has no log.
    Immutable,
}

impl Way {
    /// The ways to try. Without the index in shared memory nobody writes a log, and nothing need be made to read it.
    fn of(path: &Path) -> io::Result<&'static [Self]> {
        let mut start = [0; LOGGED.0 + 1];
        File::open(path)?.read_exact(&mut start)?;
        let log = fs::metadata(beside(path, LOG)).map_or(0, |log| log.len());
        Ok(match (start[LOGGED.0] == LOGGED.1, log > 0, beside(path, INDEX).exists()) {
            (false, ..) => &[Self::Shared],
            (true, true, true) => &[Self::Shared, Self::Alone],
            (true, true, false) => &[Self::Alone],
            (true, false, true) => &[Self::Shared, Self::Immutable],
            (true, false, false) => &[Self::Immutable],
        })
    }

    /// Opens the file and reads from it, for it is then that SQLite refuses.
    fn open(self, path: &Path, limits: &Limits) -> rusqlite::Result<Connection> {
        let how = match self {
            Self::Shared => "mode=ro",
            Self::Alone => "mode=ro&vfs=unix-none",
            Self::Immutable => "mode=ro&immutable=1",
        };
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX | OpenFlags::SQLITE_OPEN_URI;
        let connection = Connection::open_with_flags(format!("{}?{how}", uri(path)), flags)?;
        if self == Self::Alone {
            connection.pragma_update(None, "locking_mode", "EXCLUSIVE")?;
        }
        touch(&connection, limits)?;
        Ok(connection)
    }
}

impl Database {
    fn open(path: &Path, limits: &Limits) -> Result<Self, BagError> {
        let failed = |source| BagError::Io { path: path.to_owned(), source };
        let mut result = Err(rusqlite::Error::InvalidQuery);
        for way in Way::of(path).map_err(failed)? {
            result = way.open(path, limits);
            if result.is_ok() {
                break;
            }
        }
        match result {
            Ok(connection) => Ok(Self { connection, copy: None }),
            Err(error) if error.sqlite_error().is_some_and(|e| e.extended_code == SQLITE_READONLY_ROLLBACK) => {
                let copy = TempDir::new().map_err(failed)?;
                let connection =
                    rolled_back(path, copy.path(), limits).map_err(failed)?.map_err(|e| broken(path, &e))?;
                Ok(Self { connection, copy: Some(copy) })
            }
            Err(error) => Err(broken(path, &error)),
        }
    }
}

/// Opens a copy, in which SQLite takes back a transaction that was not ended.
fn rolled_back(path: &Path, folder: &Path, limits: &Limits) -> io::Result<rusqlite::Result<Connection>> {
    let copy = folder.join("copy.db3");
    fs::copy(path, &copy)?;
    fs::copy(beside(path, JOURNAL), beside(&copy, JOURNAL))?;
    Ok(Connection::open(&copy).and_then(|connection| touch(&connection, limits).map(|()| connection)))
}

/// Bounds what is read, and reads a little.
fn touch(connection: &Connection, limits: &Limits) -> rusqlite::Result<()> {
    let most = i32::try_from(limits.message_bytes()).unwrap_or(i32::MAX);
    connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, most)?;
    connection.query_row("SELECT COUNT(*) FROM sqlite_schema", [], |_| Ok(()))
}

fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    name.into()
}

/// The path with what means something in an address written as numbers.
fn uri(path: &Path) -> String {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut uri = "file://".to_owned();
    for &byte in path.as_os_str().as_bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' | b'_' | b'-' => uri.push(byte.into()),
            other => drop(write!(uri, "%{other:02X}")),
        }
    }
    uri
}

fn broken(path: &Path, why: &rusqlite::Error) -> BagError {
    let recover = match why.sqlite_error_code() {
        Some(ErrorCode::DatabaseCorrupt) => {
            format!(" ('sqlite3 \"{}\" .recover | sqlite3 recovered.db3' saves what is there)", path.display())
        }
        _ => String::new(),
    };
    BagError::Broken { path: path.to_owned(), why: format!("{why}{recover}") }
}

/// What was recorded in the file.
pub fn contents(path: &Path, limits: &Limits) -> Result<Contents, BagError> {
    let Database { connection, copy } = Database::open(path, limits)?;
    let tables = || connection.prepare(TABLES)?.query_map([], |row| row.get(0))?.collect::<Result<Vec<String>, _>>();
    let tables = tables().map_err(|e| broken(path, &e))?;
    if !["topics", "messages"].iter().all(|name| tables.iter().any(|table| table == name)) {
        let there =
            if tables.is_empty() { "there are none".to_owned() } else { format!("it has {}", tables.join(", ")) };
        let why = format!("it lacks the tables 'topics' and 'messages' of a recording; {there}");
        return Err(BagError::Broken { path: path.to_owned(), why });
    }
    let (counts, span) = recorded(path, &connection)?;
    let topics = || {
        let mut statement = connection.prepare(TOPICS)?;
        let topics = statement.query_map([], |row| {
            let count = counts.get(&row.get(0)?).copied().unwrap_or(0);
            Ok(TopicInfo { name: row.get(1)?, kind: row.get(2)?, format: row.get(3)?, count })
        })?;
        topics.collect::<Result<_, _>>()
    };
    let note = copy.map(|_| "the recorder was killed while writing; what it had not finished is left out".to_owned());
    Ok(Contents { topics: topics().map_err(|e| broken(path, &e))?, span, note })
}

/// How many messages each topic has, by its row, and the times of the first and the last message.
type Tally = (HashMap<i64, u64>, Option<(u64, u64)>);

/// Looks through the messages. In a broken file there may seem to be more than it has bytes, and no end of them.
fn recorded(path: &Path, connection: &Connection) -> Result<Tally, BagError> {
    let failed = |source| BagError::Io { path: path.to_owned(), source };
    let size = |path: &Path| fs::metadata(path).map(|file| file.len());
    let most = size(path).map_err(failed)? + size(&beside(path, LOG)).unwrap_or(0);
    let mut counts = HashMap::new();
    let mut span: Option<(u64, u64)> = None;
    let mut count = || {
        let mut statement = connection.prepare(RECORDED)?;
        let mut rows = statement.query([])?;
        let mut seen = 0;
        while let Some(row) = rows.next()? {
            *counts.entry(row.get(0)?).or_default() += 1;
            let time = u64::try_from(row.get::<_, i64>(1)?).unwrap_or(0);
            span = Some(span.map_or((time, time), |(first, last)| (first.min(time), last.max(time))));
            seen += 1;
            if seen > most {
                return Ok(false);
            }
        }
        Ok(true)
    };
    if count().map_err(|e| broken(path, &e))? {
        Ok((counts, span))
    } else {
        let why = format!("it lists more messages than its {most} bytes can hold");
        Err(BagError::Broken { path: path.to_owned(), why })
    }
}

/// The messages of a topic.
pub struct Reader {
    path: PathBuf,
    database: Database,
    /// Rows in order.
    rows: std::vec::IntoIter<i64>,
}

impl Reader {
    /// Finds the messages. What is remembered of each is its row.
    pub fn open(path: &Path, topic: &str, limits: &Limits) -> Result<Self, BagError> {
        let database = Database::open(path, limits)?;
        let rows = || {
            let mut statement = database.connection.prepare(ORDER)?;
            let rows = statement.query_map([topic], |row| row.get(0))?;
            rows.collect::<Result<Vec<i64>, _>>()
        };
        let rows = rows().map_err(|e| broken(path, &e))?.into_iter();
        Ok(Self { path: path.to_owned(), database, rows })
    }
}

impl Messages for Reader {
    fn next_into(&mut self, message: &mut Recorded) -> Result<bool, BagError> {
        let Some(id) = self.rows.next() else { return Ok(false) };
        let read = self.database.connection.query_row(MESSAGE, [id], |row| {
            let time: i64 = row.get(0)?;
            message.log_time = u64::try_from(time).unwrap_or(0);
            message.bytes.clear();
            message.bytes.extend_from_slice(row.get_ref(1)?.as_blob()?);
            Ok(())
        });
        read.map(|()| true).map_err(|e| broken(&self.path, &e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_any_bytes_becomes_an_address() {
        assert_eq!(uri(Path::new("/a b/c?d#e%f.db3")), "file:///a%20b/c%3Fd%23e%25f.db3");
        assert_eq!(uri(Path::new("//a")), "file:////a");
    }
}
