//! A folder of sequences: each a folder with images and the target's true boxes.

use std::path::{Path, PathBuf};

use crate::geometry::Rect;
use crate::replay::{ReplayError, truth};

/// Why a dataset cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The folder cannot be listed.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// No folder in it is a sequence.
    #[error("{}: no sequences (folders with a {}) in the folder", .0.display(), truth::FILE_NAME)]
    Empty(PathBuf),
    /// A sequence that was asked for is not there.
    #[error("{}: no sequence '{name}'; there are {known}", path.display())]
    Unknown { path: PathBuf, name: String, known: String },
    /// The boxes of a sequence cannot be read.
    #[error(transparent)]
    Truth(#[from] ReplayError),
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
}

/// The sequences of a folder in the order of their names, or those of the given names in the order given.
pub fn load(folder: &Path, only: &[String]) -> Result<Vec<Sequence>, DatasetError> {
    let known = names(folder)?;
    if known.is_empty() {
        return Err(DatasetError::Empty(folder.to_owned()));
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
            Ok(Sequence { name: name.clone(), path, truth })
        })
        .collect()
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
}
