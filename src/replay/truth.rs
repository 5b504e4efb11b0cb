//! Marked boxes: of a sequence, `groundtruth_rect.txt` with one row a frame; of many recordings, one row each.

use std::collections::BTreeMap;
use std::path::Path;

use super::ReplayError;
use crate::file;
use crate::geometry::Rect;

/// The file's name beside the images.
pub const FILE_NAME: &str = "groundtruth_rect.txt";

/// The header that a file of named boxes may have.
pub const NAMED_HEADER: &str = "name,x,y,w,h";

/// Bytes that such a file may have: a million rows and more.
const MOST_BYTES: u64 = 64_000_000;

/// The boxes of a file, one a frame: `x,y,w,h` in pixels, separated by commas, semicolons, tabs or spaces. `None` where
/// the target is not in view: a number is NaN, or the box has no area. Empty lines are skipped.
pub fn read(path: &Path) -> Result<Vec<Option<Rect>>, ReplayError> {
    let text = text(path)?;
    let boxes = lines(&text).map(|line| {
        let rect = parse(line.1).map_err(|source| no_box(path, line, source))?;
        Ok((rect.is_finite() && rect.area() > 0.0).then_some(rect))
    });
    boxes.collect()
}

/// The boxes of a file by the names of recordings, each in a row `name,x,y,w,h`, below the header
/// [`NAMED_HEADER`] if there is one. Names may hold commas. Empty lines are skipped.
pub fn read_named(path: &Path) -> Result<BTreeMap<String, Rect>, ReplayError> {
    let text = text(path)?;
    let mut boxes = BTreeMap::new();
    for (i, line) in lines(&text).filter(|(_, row)| row.trim() != NAMED_HEADER) {
        let refused = |source| no_box(path, (i, line), source);
        let comma = line.rmatch_indices(',').nth(3).ok_or(BoxError::Unnamed).map_err(refused)?.0;
        let (name, rect) = (line[..comma].trim(), parse(&line[comma + 1..]).map_err(refused)?);
        if boxes.insert(name.to_owned(), rect).is_some() {
            return Err(refused(BoxError::Twice(name.to_owned())));
        }
    }
    Ok(boxes)
}

fn text(path: &Path) -> Result<String, ReplayError> {
    let text = file::read_text(path, MOST_BYTES);
    text.map_err(|error| ReplayError::Io { path: path.to_owned(), source: error.into() })
}

/// The lines that are not empty, numbered from 0.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    // Some editors of Windows begin text with a mark.
    let text = text.trim_start_matches('\u{feff}');
    text.lines().enumerate().filter(|(_, row)| !row.trim().is_empty())
}

fn no_box(path: &Path, (i, row): (usize, &str), source: BoxError) -> ReplayError {
    ReplayError::Box { path: path.to_owned(), line: i + 1, text: row.trim().to_owned(), source }
}

/// Why a text is no box.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BoxError {
    /// Too few or too many.
    #[error("it must hold four numbers x,y,w,h, not {0}")]
    Count(usize),
    /// A word that is none.
    #[error("'{0}' is not a number")]
    Number(String),
    /// Nothing stands before them.
    #[error("it must hold a name and four numbers: name,x,y,w,h")]
    Unnamed,
    /// The name stands in a row before.
    #[error("'{0}' has a box already")]
    Twice(String),
}

/// A box as four numbers: x, y, width, height.
pub fn parse(text: &str) -> Result<Rect, BoxError> {
    let words: Vec<&str> = text.split([',', ';', '\t', ' ']).filter(|w| !w.trim().is_empty()).collect();
    let &[x, y, w, h] = words.as_slice() else {
        return Err(BoxError::Count(words.len()));
    };
    let number = |word: &str| word.trim().parse::<f64>().map_err(|_| BoxError::Number(word.to_owned()));
    Ok(Rect::new(number(x)?, number(y)?, number(w)?, number(h)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_read_whatever_separates_their_numbers() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE_NAME);
        let marked = Some(Rect::new(1.5, 2.0, 30.0, 40.0));
        std::fs::write(
            &path,
            "\u{feff}1.5,2,30,40\n1.5\t2\t30\t40\r\n 1.5  2 30, 40\n1.5;2;30;40\nNaN,nan,-nan,NaN\n0,0,0,0\n\n",
        )
        .unwrap();
        assert_eq!(read(&path).unwrap(), [marked, marked, marked, marked, None, None]);
    }

    #[test]
    fn what_is_no_box_is_named_with_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE_NAME);
        for (row, why) in [("1,2,3", "it must hold four numbers x,y,w,h, not 3"), ("1,2,x,4", "'x' is not a number")] {
            std::fs::write(&path, format!("1,2,3,4\n{row}\n")).unwrap();
            let expected = format!("{}, line 2: '{row}' is not a box: {why}", path.display());
            assert_eq!(read(&path).unwrap_err().to_string(), expected);
        }
    }

    #[test]
    fn boxes_of_recordings_are_found_by_their_names() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("marks.csv");
        std::fs::write(&path, "name,x,y,w,h\nwalk,1,2,30,40\n\n a, b.mcap ,1.5, 2, 3,4\r\n").unwrap();
        let want = [("walk", Rect::new(1.0, 2.0, 30.0, 40.0)), ("a, b.mcap", Rect::new(1.5, 2.0, 3.0, 4.0))];
        assert_eq!(read_named(&path).unwrap(), want.map(|(name, rect)| (name.to_owned(), rect)).into());
        for (row, why) in [
            ("1,2,3,4", "it must hold a name and four numbers: name,x,y,w,h"),
            ("b,1,2,3,x", "'x' is not a number"),
            ("walk,1,2,3,4", "'walk' has a box already"),
        ] {
            std::fs::write(&path, format!("walk,1,2,30,40\n{row}\n")).unwrap();
            let expected = format!("{}, line 2: '{row}' is not a box: {why}", path.display());
            assert_eq!(read_named(&path).unwrap_err().to_string(), expected);
        }
    }
}
