//! What came of each of many recordings, as its rows say: `summary.json`.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Serialize;

use super::{Error, rows};
use crate::file;
use crate::geometry::Rect;
use crate::output::State;
use crate::params::Algorithm;
use crate::replay::{ReplayError, truth};

/// The file's name in the folder of rows.
pub const FILE_NAME: &str = "summary.json";

/// Bytes that a file of rows may have.
const MOST_BYTES: u64 = 1 << 32;

/// What came of a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Outcome {
    /// A marked target was followed: frames in each state, and how often it was lost.
    #[expect(missing_docs, reason = "its doc names the fields")]
    Followed { frames: usize, tracking: usize, uncertain: usize, lost: usize, losses: usize },
    /// Targets were found: rows, and different targets.
    #[expect(missing_docs, reason = "its doc names the fields")]
    Found { rows: usize, targets: usize },
    /// It was not tracked to its end.
    #[expect(missing_docs, reason = "the reason")]
    Failed { error: String },
}

impl Outcome {
    /// Whether the recording has no rows.
    pub fn is_failure(&self) -> bool {
        matches!(self, Self::Failed { .. })
    }
}

/// A recording and what came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// Its rows are in `NAME.csv`.
    pub name: String,
    /// The path that was given.
    pub source: String,
    /// Its figures, or why there are none.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// All recordings of a run, in the order in which they were given. The same rows give the same bytes.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// How many have rows.
    pub finished: usize,
    /// How many have not.
    pub failed: usize,
    /// Each.
    pub recordings: Vec<Entry>,
}

impl Summary {
    /// That of these recordings.
    pub fn new(recordings: Vec<Entry>) -> Self {
        let failed = recordings.iter().filter(|entry| entry.outcome.is_failure()).count();
        Self { finished: recordings.len() - failed, failed, recordings }
    }

    /// As text.
    pub fn json(&self) -> String {
        // Texts and counts always become JSON.
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }
}

/// Reads a file of rows: what came of its recording, and the first box of a target that was marked.
pub fn read(path: &Path, algorithm: Algorithm) -> Result<(Outcome, Option<Rect>), Error> {
    let text = file::read_text(path, MOST_BYTES);
    let text = text.map_err(|e| Error::Truth(ReplayError::Io { path: path.to_owned(), source: e.into() }))?;
    let refused =
        |(i, line): (usize, &str)| Error::NotRows { path: path.to_owned(), line: i + 1, text: line.to_owned() };
    let mut lines = text.lines().enumerate();
    if algorithm == Algorithm::Maptrack {
        let id = |(i, line): (usize, &'_ str)| match line.split(',').collect::<Vec<_>>()[..] {
            [_, id, _, _, _, _, _, "-1", "-1", "-1"] => Ok(id.to_owned()),
            _ => Err(refused((i, line))),
        };
        let ids = lines.map(id).collect::<Result<Vec<_>, _>>()?;
        let (rows, targets) = (ids.len(), ids.iter().collect::<BTreeSet<_>>().len());
        return Ok((Outcome::Found { rows, targets }, None));
    }
    let header = lines.next().unwrap_or((0, ""));
    if header.1 != rows::HEADER {
        return Err(refused(header));
    }
    let (mut first, mut last) = (None, None);
    let (mut frames, mut counts, mut losses) = (0, [0; 3], 0);
    for line in lines {
        let words: Vec<&str> = line.1.rsplitn(3, ',').collect();
        let &[state, _, rect] = words.as_slice() else { return Err(refused(line)) };
        let states = [State::Tracking, State::Uncertain, State::Lost];
        let state = states.into_iter().find(|known| known.name() == state).ok_or_else(|| refused(line))?;
        if frames == 0 {
            first = truth::parse(rect).ok();
        }
        frames += 1;
        counts[state as usize] += 1;
        losses += usize::from(state == State::Lost && last != Some(State::Lost));
        last = Some(state);
    }
    let [tracking, uncertain, lost] = counts;
    Ok((Outcome::Followed { frames, tracking, uncertain, lost, losses }, first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_tell_what_came_of_a_recording() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("walk.csv");
        let read = |text: &str, algorithm| {
            std::fs::write(&path, text).unwrap();
            read(&path, algorithm).map_err(|error| error.to_string())
        };
        let states = ["tracking", "lost", "lost", "uncertain", "lost"];
        let text: String = states.iter().map(|state| format!("1.5,2,30,40,0.5,{state}\n")).collect();
        let text = format!("{}\n{text}", rows::HEADER);
        let followed = Outcome::Followed { frames: 5, tracking: 1, uncertain: 1, lost: 3, losses: 2 };
        assert_eq!(read(&text, Algorithm::Lcmht).unwrap(), (followed, Some(Rect::new(1.5, 2.0, 30.0, 40.0))));
        let mot = "1,0,1,2,3,4,0.5,-1,-1,-1\n1,7,1,2,3,4,0.5,-1,-1,-1\n2,7,1,2,3,4,0.5,-1,-1,-1\n";
        assert_eq!(read(mot, Algorithm::Maptrack).unwrap(), (Outcome::Found { rows: 3, targets: 2 }, None));
        assert_eq!(read("", Algorithm::Maptrack).unwrap().0, Outcome::Found { rows: 0, targets: 0 });
        for (text, line) in [(&text, 1), (&format!("{}\n1,2\n", rows::HEADER), 2)] {
            let algorithm = if line == 1 { Algorithm::Maptrack } else { Algorithm::Etepf };
            let message = read(text, algorithm).unwrap_err();
            assert!(message.contains(&format!("walk.csv, line {line}: '")), "{message}");
        }
    }
}
