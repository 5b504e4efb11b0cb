//! A folder of sequences: each a folder with images and the target's true boxes.

use std::path::{Path, PathBuf};

use crate::geometry::Rect;
use crate::replay::{ReplayError, truth};

/// The file beside the true boxes, for sequences that have it: a row a frame, the share of the box that nearer things
/// hide, 0 to 1.
pub const OCCLUSION_FILE: &str = "occlusion.txt";
/// A target of which this share is hidden is not to be seen. Below 1, for the shares are estimates from boxes.
pub const FULLY_HIDDEN: f64 = 0.95;

/// Why a dataset cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum DatasetError {
    /// The folder cannot be listed.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// No folder in it is a sequence.
    #[error("{}: no sequences (folders with a {}) in the folder", .0.display(), truth::FILE_NAME)]
    Empty(PathBuf),
    /// The folder is a sequence and not one of sequences.
    #[error(
        "{}: no sequences (folders with a {}) in the folder, which is a sequence itself: give its parent folder",
        .0.display(), truth::FILE_NAME
    )]
    Sequence(PathBuf),
    /// A sequence that was asked for is not there.
    #[error("{}: no sequence '{name}'; there are {known}", path.display())]
    Unknown { path: PathBuf, name: String, known: String },
    /// The boxes of a sequence cannot be read.
    #[error(transparent)]
    Truth(#[from] ReplayError),
    /// A row of a file of hidden shares that is none.
    #[error("{}, line {line}: '{text}' is not a number from 0 to 1", path.display())]
    Share { path: PathBuf, line: usize, text: String },
    /// Such a file is of other frames.
    #[error("{}: {rows} rows, but {frames} boxes in {}", path.display(), truth::FILE_NAME)]
    Rows { path: PathBuf, rows: usize, frames: usize },
}

/// Frames with the true box of the target.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// The folder's name.
    pub name: String,
    /// The folder.
    pub path: PathBuf,
    /// One entry a frame; `None` where the target is not in view.
    pub truth: Vec<Option<Rect>>,
    /// The share of the true box that is hidden, one entry a frame (1 where there is no box); `None` where nothing is
    /// known of it.
    pub hidden: Option<Vec<f64>>,
}

impl Sequence {
    /// The true box where the target is to be seen: in view, and not fully hidden as far as that is known.
    pub fn visible(&self) -> Vec<Option<Rect>> {
        let is_hidden = |i: usize| self.hidden.as_ref().is_some_and(|h| h[i] >= FULLY_HIDDEN);
        self.truth.iter().enumerate().map(|(i, t)| t.filter(|_| !is_hidden(i))).collect()
    }
}

/// The sequences of a folder in the order of their names, or those of the given names in the order given.
pub fn load(folder: &Path, only: &[String]) -> Result<Vec<Sequence>, DatasetError> {
    let known = names(folder)?;
    if known.is_empty() {
        let is_sequence = folder.join(truth::FILE_NAME).is_file();
        let error = if is_sequence { DatasetError::Sequence } else { DatasetError::Empty };
        return Err(error(folder.to_owned()));
    }
    if let Some(name) = only.iter().find(|n| !known.contains(n)) {
        let (path, known) = (folder.to_owned(), known.join(", "));
        return Err(DatasetError::Unknown { path, name: name.clone(), known });
    }
    let wanted = if only.is_empty() { &known } else { only };
    wanted
        .iter()
        .map(|name| {
            let path = folder.join(name);
            let truth = truth::read(&path.join(truth::FILE_NAME))?;
            let hidden = hidden(&path.join(OCCLUSION_FILE), truth.len())?;
            Ok(Sequence { name: name.clone(), path, truth, hidden })
        })
        .collect()
}

/// The hidden shares of so many frames; `None` where there is no such file.
fn hidden(path: &Path, frames: usize) -> Result<Option<Vec<f64>>, DatasetError> {
    if !path.exists() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(path).map_err(|source| DatasetError::Io { path: path.to_owned(), source })?;
    let share = |(i, row): (usize, &str)| match row.trim().parse::<f64>() {
        Ok(share) if share.is_nan() => Ok(1.0),
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err(DatasetError::Share { path: path.to_owned(), line: i + 1, text: row.trim().to_owned() }),
    };
    let rows = text.lines().enumerate().filter(|(_, row)| !row.trim().is_empty());
    let shares = rows.map(share).collect::<Result<Vec<_>, _>>()?;
    if shares.len() != frames {
        return Err(DatasetError::Rows { path: path.to_owned(), rows: shares.len(), frames });
    }
    Ok(Some(shares))
}

fn names(folder: &Path) -> Result<Vec<String>, DatasetError> {
    let failed = |source| DatasetError::Io { path: folder.to_owned(), source };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if entry.path().join(truth::FILE_NAME).is_file() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    alphanumeric_sort::sort_str_slice(&mut names);
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_with_ground_truth_are_sequences() {
        let dir = tempfile::tempdir().unwrap();
        let list = |only: &[&str]| {
            let only: Vec<String> = only.iter().map(|s| (*s).to_owned()).collect();
            load(dir.path(), &only).map(|all| all.into_iter().map(|s| s.name).collect::<Vec<_>>())
        };
        assert!(list(&[]).unwrap_err().to_string().contains("no sequences (folders with a groundtruth_rect.txt)"));
        for name in ["run-10", "run-9", "frames"] {
            std::fs::create_dir(dir.path().join(name)).unwrap();
        }
        for name in ["run-10", "run-9"] {
            std::fs::write(dir.path().join(name).join(truth::FILE_NAME), "1,2,3,4\nNaN,NaN,NaN,NaN\n").unwrap();
        }
        assert_eq!(list(&[]).unwrap(), ["run-9", "run-10"]);
        assert_eq!(list(&["run-10"]).unwrap(), ["run-10"]);
        assert!(list(&["run"]).unwrap_err().to_string().ends_with("no sequence 'run'; there are run-9, run-10"));
        assert_eq!(load(dir.path(), &[]).unwrap()[0].truth, [Some(Rect::new(1.0, 2.0, 3.0, 4.0)), None]);
        std::fs::write(dir.path().join("run-9").join(truth::FILE_NAME), "1,2\n").unwrap();
        assert!(matches!(list(&[]), Err(DatasetError::Truth(ReplayError::Box { line: 1, .. }))));
    }
    #[test]
    fn a_fully_hidden_target_is_not_visible() {
        let dir = tempfile::tempdir().unwrap();
        let walk = dir.path().join("walk");
        std::fs::create_dir(&walk).unwrap();
        std::fs::write(walk.join(truth::FILE_NAME), "1,2,3,4\n1,2,3,4\nNaN,NaN,NaN,NaN\n").unwrap();
        let only = || load(dir.path(), &[]).map(|mut all| all.remove(0));
        let sequence = only().unwrap();
        let marked = Some(Rect::new(1.0, 2.0, 3.0, 4.0));
        assert_eq!((&sequence.hidden, sequence.visible()), (&None, vec![marked, marked, None]));
        let write = |text: &str| std::fs::write(walk.join(OCCLUSION_FILE), text).unwrap();
        write("0.9\n0.96\nNaN\n");
        let sequence = only().unwrap();
        assert_eq!(sequence.visible(), [marked, None, None]);
        assert_eq!(sequence.truth, [marked, marked, None], "the box is known all the same");
        write("0.9\n1.2\nNaN\n");
        assert!(only().unwrap_err().to_string().ends_with("line 2: '1.2' is not a number from 0 to 1"));
        write("0.9\n");
        assert!(only().unwrap_err().to_string().ends_with("1 rows, but 3 boxes in groundtruth_rect.txt"));
    }
}
