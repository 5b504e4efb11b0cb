//! The text of a parameter file: no more of it than is of use, and only characters that YAML allows.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::Place;
use crate::error::YamlError;

/// The largest parameter file, in bytes.
const LARGEST: u64 = 1 << 20;
/// The most lines that begin like a directive, `%`, for each of those is compared with all before it.
const MOST_DIRECTIVES: usize = 100;

/// Reads a file, which may be a pipe.
pub fn read(path: &Path) -> Result<String, YamlError> {
    let mut bytes = Vec::new();
    let refused = |error: io::Error| YamlError::Unreadable { why: error.to_string() };
    let file = File::open(path).map_err(refused)?;
    file.take(LARGEST + 1).read_to_end(&mut bytes).map_err(refused)?;
    if bytes.len() as u64 > LARGEST {
        return Err(YamlError::TooLarge { most: LARGEST });
    }
    let text = decode(bytes)?;
    check(&text)?;
    if text.lines().filter(|line| line.starts_with('%')).count() > MOST_DIRECTIVES {
        return Err(YamlError::Directives { most: MOST_DIRECTIVES });
    }
    Ok(text)
}

/// UTF-8, or UTF-16 if its mark stands at the beginning.
fn decode(bytes: Vec<u8>) -> Result<String, YamlError> {
    let utf16 = |unit: fn([u8; 2]) -> u16| {
        let (pairs, rest) = bytes[2..].as_chunks::<2>();
        let units: Vec<u16> = pairs.iter().map(|pair| unit(*pair)).collect();
        match (String::from_utf16(&units), rest) {
            (Ok(text), []) => Ok(text),
            _ => Err(YamlError::Utf16),
        }
    };
    match bytes.as_slice() {
        [0xff, 0xfe, ..] => utf16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => utf16(u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => utf8(rest),
        rest => utf8(rest),
    }
}

fn utf8(bytes: &[u8]) -> Result<String, YamlError> {
    match str::from_utf8(bytes) {
        Ok(text) => Ok(text.to_owned()),
        Err(error) => {
            let (valid, rest) = bytes.split_at(error.valid_up_to());
            let place = end(&String::from_utf8_lossy(valid));
            let byte = rest.first().copied().unwrap_or_default();
            Err(YamlError::Utf8 { place, byte })
        }
    }
}

/// Refuses the characters that YAML does not allow.
pub fn check(text: &str) -> Result<(), YamlError> {
    let in_ranges = |c| matches!(c, ' '..='~' | '\u{a0}'..='\u{fffd}' | '\u{10000}'..='\u{10ffff}');
    let allowed = |c| matches!(c, '\t' | '\n' | '\r' | '\u{85}') || in_ranges(c);
    match text.char_indices().find(|(_, c)| !allowed(*c)) {
        None => Ok(()),
        Some((index, character)) => Err(YamlError::Character { place: end(&text[..index]), character }),
    }
}

/// Where what follows the text stands.
fn end(text: &str) -> Place {
    let lines = text.split('\n');
    let column = text.rsplit('\n').next().map_or(0, |last| last.chars().count());
    Place { line: lines.count() as u64, column: column as u64 + 1 }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn of(bytes: &[u8]) -> Result<String, YamlError> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(bytes).unwrap();
        read(file.path())
    }

    #[test]
    fn the_encodings_of_yaml_are_read() {
        let utf16 =
            |unit: fn(u16) -> [u8; 2]| "\u{feff}a: \u{1f600}".encode_utf16().flat_map(unit).collect::<Vec<u8>>();
        for bytes in
            ["a: \u{1f600}".into(), "\u{feff}a: \u{1f600}".into(), utf16(u16::to_le_bytes), utf16(u16::to_be_bytes)]
        {
            assert_eq!(of(&bytes).unwrap(), "a: \u{1f600}");
        }
        assert_eq!(of(b"").unwrap(), "");
    }

    #[test]
    fn what_is_no_text_is_refused_with_its_place() {
        for (bytes, why) in [
            (&b"a: 1\n b\xff: 2"[..], "line 2, column 3: the byte 0xff is not UTF-8"),
            (b"a: 1\n\x07", "line 2, column 1: the character U+0007 is not allowed"),
            (b"a\0", "line 1, column 2: the character U+0000"),
            (b"\xff\xfea", "not valid UTF-16"),
            (b"\xff\xfe\x00\xd8", "not valid UTF-16"),
        ] {
            let got = of(bytes).unwrap_err().to_string();
            assert!(got.contains(why), "{got}");
        }
    }

    #[test]
    fn files_without_an_end_are_not_read_to_it() {
        let endless = read(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(endless.to_string(), "it has more than 1048576 bytes");
        assert!(of(&[b'#'; 1 << 20]).is_ok());
        assert!(read(Path::new("/tmp")).unwrap_err().to_string().contains("directory"));
    }
}
