//! Which world a sequence is from: crowds, drones, thermal cameras. A file tells it, a row `sequence,world`; a name
//! that ends in `*` stands for all that begin so, and the first row that fits counts. Empty lines, and those that begin
//! with `#`, are skipped.

use std::path::{Path, PathBuf};

/// The file's name beside the sequences.
pub const FILE_NAME: &str = "worlds.csv";
/// The world of sequences that no row names.
pub const OTHER: &str = "other";

/// Why a file of worlds cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum WorldsError {
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// A row that is none.
    #[error("{}, line {line}: '{text}' is not sequence,world", path.display())]
    Row { path: PathBuf, line: usize, text: String },
}

/// The worlds of sequences.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Worlds(Vec<(String, String)>);

impl Worlds {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, WorldsError> {
        let text = std::fs::read_to_string(path).map_err(|source| WorldsError::Io { path: path.to_owned(), source })?;
        let rows = text.lines().map(str::trim).enumerate().filter(|(_, row)| !row.is_empty() && !row.starts_with('#'));
        let parsed = rows.map(|(i, row)| {
            let words = row.split_once(',').map(|(name, world)| (name.trim().to_owned(), world.trim().to_owned()));
            let row = words.filter(|(name, world)| !name.is_empty() && !world.is_empty()).ok_or(row);
            row.map_err(|text| WorldsError::Row { path: path.to_owned(), line: i + 1, text: text.to_owned() })
        });
        parsed.collect::<Result<_, _>>().map(Self)
    }

    /// The world of a sequence; [`OTHER`] of one that no row names.
    pub fn of(&self, sequence: &str) -> &str {
        let fits = |name: &str| match name.strip_suffix('*') {
            Some(begin) => sequence.starts_with(begin),
            None => sequence == name,
        };
        self.0.iter().find(|(name, _)| fits(name)).map_or(OTHER, |(_, world)| world)
    }

    /// Whether any is named.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_row_that_fits_names_the_world() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE_NAME);
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Worlds::read(&path)
        };
        let worlds = read("# of two cameras\nrun-1, drone\n\nrun*,crowd\n").unwrap();
        assert_eq!(["run-1", "run-12", "walk"].map(|name| worlds.of(name)), ["drone", "crowd", OTHER]);
        assert!(!worlds.is_empty() && read("").unwrap().is_empty());
        for text in ["run\n", "run,\n", ",drone\n"] {
            let error = read(&format!("walk,crowd\n{text}")).unwrap_err().to_string();
            assert!(error.ends_with(&format!("line 2: '{}' is not sequence,world", text.trim())), "{error}");
        }
        std::fs::remove_file(&path).unwrap();
        assert!(Worlds::read(&path).unwrap_err().to_string().starts_with(&format!("{}: ", path.display())));
    }
}
