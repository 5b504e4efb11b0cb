//! The boxes of other trackers, from files: a folder a tracker, in it SEQUENCE.txt or SEQUENCE.csv with a row a frame.
//!
//! A row is `x,y,w,h`, with commas, tabs or spaces between, in pixels; NaN where the tracker says that the target is
//! not in view. A fifth column is the tracker's confidence or any score that grows with it. A file whose first row
//! begins with a letter names its columns there, as those of `track` and of `evaluate --boxes` do:
//! `x,y,w,h,confidence,state`; `state` is tracking, uncertain or lost, other columns are skipped.
//!
//! In `times.csv` of the folder may stand how long the tracker took: `sequence,frames,seconds`.
//!
//! Further folders in it, `start-1`, `start-2` and so on, hold the same of runs that were started a little differently.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::answer::Answer;
use super::dataset::Sequence;
use super::run::Run;
use crate::geometry::Rect;
use crate::tracker::State;

/// Names that files of boxes end in, first choice first.
const EXTENSIONS: [&str; 2] = ["txt", "csv"];
/// The file of times.
pub const TIMES_FILE: &str = "times.csv";

/// The folder of the boxes from a start: that of the plain one is `folder` itself.
pub fn start_folder(folder: &Path, start: usize) -> PathBuf {
    if start == 0 { folder.to_owned() } else { folder.join(format!("start-{start}")) }
}

/// Why the files of another tracker cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum PeerError {
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// A row that is none.
    #[error("{}, line {line}: '{text}': {source}", path.display())]
    Row { path: PathBuf, line: usize, text: String, source: RowError },
    /// The file is of other frames.
    #[error("{}: {rows} rows, but {frames} frames", path.display())]
    Rows { path: PathBuf, rows: usize, frames: usize },
    /// There is nothing of any of the sequences.
    #[error("{}: no file of boxes (SEQUENCE.txt, SEQUENCE.csv) of any of the sequences", .0.display())]
    Empty(PathBuf),
}

/// What is wrong with a row.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RowError {
    /// A column that must be there is not among those that the first row names.
    #[error("there is no column '{0}'")]
    NoColumn(&'static str),
    /// Neither four numbers nor five.
    #[error("it must hold x,y,w,h and may hold a confidence, not {0} numbers")]
    Count(usize),
    /// Fewer columns than the first row has.
    #[error("there are only {0} columns")]
    Short(usize),
    /// A word that is no number.
    #[error("'{0}' is not a number")]
    Number(String),
    /// A box of which the confidence is NaN.
    #[error("a box without its confidence")]
    NoConfidence,
    /// A word that is no state.
    #[error("'{0}' is not a state")]
    State(String),
    /// A row of the file of times that is none.
    #[error("it must hold sequence,frames,seconds")]
    Times,
}

/// Another tracker whose boxes are to be scored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peer {
    /// What tables call it.
    pub name: String,
    /// The folder of its files.
    pub path: PathBuf,
}

/// A text that does not name a tracker and its folder.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("it must be NAME=DIR")]
pub struct NotNamed;

impl std::str::FromStr for Peer {
    type Err = NotNamed;

    fn from_str(text: &str) -> Result<Self, NotNamed> {
        match text.split_once('=') {
            Some((name, path)) if !name.is_empty() && !path.is_empty() => {
                Ok(Self { name: name.to_owned(), path: path.into() })
            }
            _ => Err(NotNamed),
        }
    }
}

impl Peer {
    /// What the tracker said of each sequence from each start; nothing of one that it has no file of. As many rows as
    /// the sequence has frames, at most `limit`, must be there; further ones are skipped.
    pub fn load(&self, sequences: &[Sequence], limit: usize) -> Result<Vec<Vec<Run>>, PeerError> {
        let folders = (0..).map(|start| start_folder(&self.path, start)).take_while(|folder| folder.is_dir());
        let mut starts = folders.map(|folder| load_start(&folder, sequences, limit)).collect::<Result<Vec<_>, _>>()?;
        let by_start = |i: usize| starts.iter_mut().map_while(|runs| runs[i].take()).collect();
        let runs: Vec<Vec<Run>> = (0..sequences.len()).map(by_start).collect();
        if runs.iter().all(Vec::is_empty) {
            return Err(PeerError::Empty(self.path.clone()));
        }
        Ok(runs)
    }
}

/// What the files of one folder say of each sequence.
fn load_start(folder: &Path, sequences: &[Sequence], limit: usize) -> Result<Vec<Option<Run>>, PeerError> {
    let times = times(&folder.join(TIMES_FILE))?;
    let run = |sequence: &Sequence| {
        let file = |extension| folder.join(format!("{}.{extension}", sequence.name));
        let Some(path) = EXTENSIONS.map(file).into_iter().find(|p| p.exists()) else { return Ok(None) };
        let frames = sequence.truth.len().min(limit);
        let mut answers = answers(&path)?;
        if answers.len() < frames {
            return Err(PeerError::Rows { path, rows: answers.len(), frames });
        }
        answers.truncate(frames);
        // A run over another number of frames had another speed, but the rate is what matters.
        let time = times.iter().find(|t| t.0 == sequence.name).filter(|t| t.1 > 0);
        let processor_time = time.map(|&(_, count, seconds)| seconds.mul_f64(frames as f64 / count as f64));
        Ok(Some(Run { answers, processor_time }))
    };
    sequences.iter().map(run).collect()
}

fn lines(path: &Path) -> Result<Vec<(usize, String)>, PeerError> {
    let text = std::fs::read_to_string(path).map_err(|source| PeerError::Io { path: path.to_owned(), source })?;
    let rows = text.lines().enumerate().filter(|(_, row)| !row.trim().is_empty());
    Ok(rows.map(|(i, row)| (i + 1, row.trim().to_owned())).collect())
}

fn words(row: &str) -> Vec<&str> {
    row.split([',', '\t', ' ']).map(str::trim).filter(|w| !w.is_empty()).collect()
}

/// Where the values stand in a row.
struct Columns {
    rect: [usize; 4],
    confidence: Option<usize>,
    state: Option<usize>,
}

impl Columns {
    /// As the first row names them; `None` where it holds values.
    fn named(row: &str) -> Option<Result<Self, RowError>> {
        let names = words(row);
        if names.first()?.parse::<f64>().is_ok() {
            return None;
        }
        let column = |name: &str| names.iter().position(|n| *n == name);
        let needed = |name| column(name).ok_or(RowError::NoColumn(name));
        Some((|| {
            let rect = [needed("x")?, needed("y")?, needed("w")?, needed("h")?];
            Ok(Self { rect, confidence: column("confidence"), state: column("state") })
        })())
    }

    /// Four or five in a row.
    fn plain(row: &str) -> Result<Self, RowError> {
        match words(row).len() {
            count @ (4 | 5) => Ok(Self { rect: [0, 1, 2, 3], confidence: (count == 5).then_some(4), state: None }),
            count => Err(RowError::Count(count)),
        }
    }

    fn answer(&self, row: &str, last: Rect) -> Result<Answer, RowError> {
        let words = words(row);
        let word = |at: usize| words.get(at).copied().ok_or(RowError::Short(words.len()));
        let number = |at| word(at).and_then(|w| w.parse::<f64>().map_err(|_| RowError::Number(w.to_owned())));
        let [x, y, w, h] = self.rect.map(number);
        let rect = Rect::new(x?, y?, w?, h?);
        let is_given = rect.is_finite() && rect.area() > 0.0;
        let confidence = self.confidence.map(number).transpose()?;
        if is_given && confidence.is_some_and(f64::is_nan) {
            return Err(RowError::NoConfidence);
        }
        let state = match self.state.map(word).transpose()? {
            _ if !is_given => State::Lost,
            None => State::Tracking,
            Some(name) => {
                let known = [State::Tracking, State::Uncertain, State::Lost].into_iter().find(|s| s.name() == name);
                known.ok_or_else(|| RowError::State(name.to_owned()))?
            }
        };
        // Benchmarks score a box in every frame: where none is given, the last one stands.
        let rect = if is_given { rect } else { last };
        Ok(Answer { rect, confidence: confidence.map(|c| if c.is_nan() { 0.0 } else { c }), state, reacquired: false })
    }
}

/// The rows of a file of boxes.
fn answers(path: &Path) -> Result<Vec<Answer>, PeerError> {
    let lines = lines(path)?;
    let failed = |(line, text): &(usize, String), source| PeerError::Row {
        path: path.to_owned(),
        line: *line,
        text: text.clone(),
        source,
    };
    let Some(first) = lines.first() else { return Ok(Vec::new()) };
    let (columns, rows) = match Columns::named(&first.1) {
        Some(columns) => (columns, &lines[1..]),
        None => (Columns::plain(&first.1), &lines[..]),
    };
    let columns = columns.map_err(|e| failed(first, e))?;
    let mut found: Vec<Answer> = Vec::with_capacity(rows.len());
    let mut was_lost = false;
    for row in rows {
        let last = found.last().map_or(Rect::default(), |a| a.rect);
        let mut answer = columns.answer(&row.1, last).map_err(|e| failed(row, e))?;
        answer.reacquired = was_lost && !answer.is_lost();
        was_lost = answer.is_lost();
        found.push(answer);
    }
    Ok(found)
}

/// Sequence, frames and time of each row; nothing where there is no such file.
fn times(path: &Path) -> Result<Vec<(String, usize, Duration)>, PeerError> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let row = |(line, text): (usize, String)| {
        let columns: Vec<&str> = text.split(',').map(str::trim).collect();
        let parsed = || {
            let [name, frames, seconds] = columns.as_slice() else { return None };
            let seconds = Duration::try_from_secs_f64(seconds.parse().ok()?).ok()?;
            Some(((*name).to_owned(), frames.parse().ok()?, seconds))
        };
        let failed = || PeerError::Row { path: path.to_owned(), line, text: text.clone(), source: RowError::Times };
        parsed().ok_or_else(failed)
    };
    lines(path)?.into_iter().skip(1).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequence(name: &str, frames: usize) -> Sequence {
        let truth = vec![Some(Rect::new(0.0, 0.0, 10.0, 10.0)); frames];
        Sequence { name: name.to_owned(), path: name.into(), truth, hidden: None }
    }

    /// The answers, or the message, of a file of this text.
    fn read(text: &str) -> Result<Vec<Answer>, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        std::fs::write(&path, text).unwrap();
        answers(&path).map_err(|e| e.to_string().replace(&path.display().to_string(), "a.txt"))
    }

    fn answer(x: f64, confidence: Option<f64>, state: State) -> Answer {
        Answer { rect: Rect::new(x, 2.0, 3.0, 4.0), confidence, state, reacquired: false }
    }

    #[test]
    fn rows_without_a_box_are_lost_where_the_last_one_was() {
        let (tracking, lost) = (State::Tracking, State::Lost);
        let found = read("1,2,3,4\n5 2\t3  4\nNaN,NaN,NaN,NaN\n0,0,0,0\n\n7,2,3,4\n").unwrap();
        let back = Answer { reacquired: true, ..answer(7.0, None, tracking) };
        let expected = [answer(1.0, None, tracking), answer(5.0, None, tracking), answer(5.0, None, lost)];
        assert_eq!(found[..3], expected);
        assert_eq!(found[3..], [expected[2], back]);
        let found = read("1,2,3,4,0.5\nnan,nan,nan,nan,nan\n").unwrap();
        assert_eq!(found, [answer(1.0, Some(0.5), tracking), answer(1.0, Some(0.0), lost)]);
    }

    #[test]
    fn columns_are_found_by_their_names() {
        let found = read("h,w,y,x,state,overlap\n4,3,2,1,lost,0.2\n4,3,2,1,uncertain,NaN\n").unwrap();
        let back = Answer { reacquired: true, ..answer(1.0, None, State::Uncertain) };
        assert_eq!(found, [answer(1.0, None, State::Lost), back]);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let refused = |text: &str, message: &str| assert_eq!(read(text).unwrap_err(), message);
        refused("1,2,3\n", "a.txt, line 1: '1,2,3': it must hold x,y,w,h and may hold a confidence, not 3 numbers");
        refused("1,2,3,4\n1,2,3\n", "a.txt, line 2: '1,2,3': there are only 3 columns");
        refused("1,2,3,4\n1,2,x,4\n", "a.txt, line 2: '1,2,x,4': 'x' is not a number");
        refused("1,2,3,4,NaN\n", "a.txt, line 1: '1,2,3,4,NaN': a box without its confidence");
        refused("x,y,w\n", "a.txt, line 1: 'x,y,w': there is no column 'h'");
        refused("x,y,w,h,state\n1,2,3,4,gone\n", "a.txt, line 2: '1,2,3,4,gone': 'gone' is not a state");
    }

    #[test]
    fn a_folder_gives_what_it_has_of_each_sequence() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
        let peer: Peer = format!("other={}", dir.path().display()).parse().unwrap();
        let sequences = [sequence("a", 2), sequence("b", 2), sequence("c", 3)];
        let message = |limit| peer.load(&sequences, limit).unwrap_err().to_string();
        assert!(message(9).ends_with("of any of the sequences"));
        write("a.csv", "x,y,w,h\n1,2,3,4\n1,2,3,4\n");
        write("c.txt", "1,2,3,4\n1,2,3,4\n");
        assert!(message(9).ends_with("c.txt: 2 rows, but 3 frames"));
        write(TIMES_FILE, "sequence,frames,seconds\nc,20,4.0\n");
        let runs = peer.load(&sequences, 2).unwrap();
        let seen: Vec<_> = runs.iter().map(|r| r.first().map(|r| (r.answers.len(), r.processor_time))).collect();
        assert_eq!(seen, [Some((2, None)), None, Some((2, Some(Duration::from_millis(400))))]);
        std::fs::create_dir(dir.path().join("start-1")).unwrap();
        write("start-1/a.csv", "x,y,w,h\n5,2,3,4\n5,2,3,4\n");
        let starts = peer.load(&sequences, 2).unwrap();
        assert_eq!(starts.iter().map(Vec::len).collect::<Vec<_>>(), [2, 0, 1]);
        assert_eq!(starts[0][1].answers[0].rect.x, 5.0);
        write(TIMES_FILE, "sequence,frames,seconds\nc,20\n");
        assert!(message(2).ends_with("times.csv, line 2: 'c,20': it must hold sequence,frames,seconds"));
        assert_eq!("other".parse::<Peer>(), Err(NotNamed));
    }
}
