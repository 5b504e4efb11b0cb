//! The events of a YAML text, as libyaml finds them.
//!
//! rcl reads by libyaml, and where libyaml is lenient or strict beyond the standard, so are all nodes. Its port to Rust
//! was made by a machine and has the functions and pointers of the original; this crate makes it safe to use.

use std::ffi::CStr;
use std::fmt;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::slice;

use unsafe_libyaml as unsafe_yaml;

/// A place in a text, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: u64,
    /// Character in the line.
    pub column: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// What libyaml finds next in a text.
#[derive(Debug, PartialEq, Eq)]
pub enum Event {
    /// A piece of text.
    Scalar {
        /// Without its quotes and with what its escapes stand for.
        text: String,
        /// Whether it stands in quotes.
        quoted: bool,
        /// Its tag, resolved.
        tag: Option<String>,
    },
    /// A list begins.
    ListStart,
    /// A list ends.
    ListEnd,
    /// A map begins.
    MapStart,
    /// A map ends.
    MapEnd,
    /// `*NAME`.
    Alias(String),
    /// The text or a document in it begins or ends.
    Frame,
}

/// What is wrong with a text that is no YAML.
#[derive(Debug, PartialEq, Eq)]
pub struct Invalid {
    /// In libyaml's words.
    pub why: String,
    /// Where that was found.
    pub place: Place,
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.why)
    }
}

impl std::error::Error for Invalid {}

/// Reads a text event by event.
#[derive(Debug)]
pub struct Parser<'a> {
    raw: Box<MaybeUninit<unsafe_yaml::yaml_parser_t>>,
    ended: bool,
    text: PhantomData<&'a str>,
}

impl<'a> Parser<'a> {
    /// At the beginning of the text.
    pub fn new(text: &'a str) -> Self {
        let mut raw = Box::new(MaybeUninit::uninit());
        // SAFETY: the parser is initialised in its place on the heap, where it stays until `drop`, and the text that it
        // points to lives longer than it does. Initialising cannot fail: where memory is short, the process aborts.
        unsafe {
            let parser = raw.as_mut_ptr();
            let _ = unsafe_yaml::yaml_parser_initialize(parser);
            unsafe_yaml::yaml_parser_set_encoding(parser, unsafe_yaml::YAML_UTF8_ENCODING);
            unsafe_yaml::yaml_parser_set_input_string(parser, text.as_ptr(), text.len() as u64);
        }
        Self { raw, ended: false, text: PhantomData }
    }
}

impl Iterator for Parser<'_> {
    type Item = Result<(Event, Place), Invalid>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let parser = self.raw.as_mut_ptr();
        let mut raw = MaybeUninit::<unsafe_yaml::yaml_event_t>::uninit();
        // SAFETY: `new` has initialised the parser. The call initialises the event, whose strings are copied before the
        // event is deleted; where it fails, the messages it leaves are literals.
        unsafe {
            if unsafe_yaml::yaml_parser_parse(parser, raw.as_mut_ptr()).fail {
                self.ended = true;
                return Some(Err(invalid(&*parser)));
            }
            let event = raw.assume_init_mut();
            let found = (convert(event), Place::from(event.start_mark));
            self.ended = event.type_ == unsafe_yaml::YAML_STREAM_END_EVENT;
            unsafe_yaml::yaml_event_delete(event);
            Some(Ok(found))
        }
    }
}

impl Drop for Parser<'_> {
    fn drop(&mut self) {
        // SAFETY: `new` has initialised the parser, and nothing uses it after this.
        unsafe { unsafe_yaml::yaml_parser_delete(self.raw.as_mut_ptr()) }
    }
}

impl From<unsafe_yaml::yaml_mark_t> for Place {
    fn from(mark: unsafe_yaml::yaml_mark_t) -> Self {
        Self { line: mark.line + 1, column: mark.column + 1 }
    }
}

/// # Safety
/// The event comes from libyaml and has not been deleted.
unsafe fn convert(event: &unsafe_yaml::yaml_event_t) -> Event {
    match event.type_ {
        // SAFETY: the type says which member of the union is there.
        unsafe_yaml::YAML_SCALAR_EVENT => unsafe {
            let scalar = &event.data.scalar;
            let text = slice::from_raw_parts(scalar.value, usize::try_from(scalar.length).unwrap_or_default());
            Event::Scalar {
                text: String::from_utf8_lossy(text).into_owned(),
                quoted: matches!(
                    scalar.style,
                    unsafe_yaml::YAML_SINGLE_QUOTED_SCALAR_STYLE | unsafe_yaml::YAML_DOUBLE_QUOTED_SCALAR_STYLE
                ),
                tag: (!scalar.tag.is_null()).then(|| string(scalar.tag.cast())),
            }
        },
        // SAFETY: as above.
        unsafe_yaml::YAML_ALIAS_EVENT => unsafe { Event::Alias(string(event.data.alias.anchor.cast())) },
        unsafe_yaml::YAML_SEQUENCE_START_EVENT => Event::ListStart,
        unsafe_yaml::YAML_SEQUENCE_END_EVENT => Event::ListEnd,
        unsafe_yaml::YAML_MAPPING_START_EVENT => Event::MapStart,
        unsafe_yaml::YAML_MAPPING_END_EVENT => Event::MapEnd,
        _ => Event::Frame,
    }
}

/// # Safety
/// libyaml has initialised the parser.
unsafe fn invalid(parser: &unsafe_yaml::yaml_parser_t) -> Invalid {
    // SAFETY: what the messages of a parser point to are literals.
    let message = |text: *const i8| if text.is_null() { String::new() } else { unsafe { string(text) } };
    let (problem, context) = (message(parser.problem), message(parser.context));
    let why = if context.is_empty() { problem } else { format!("{problem} {context}") };
    Invalid { why, place: parser.problem_mark.into() }
}

/// # Safety
/// There is a string that ends with a NUL.
unsafe fn string(text: *const i8) -> String {
    // SAFETY: the caller's.
    unsafe { CStr::from_ptr(text.cast()) }.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(text: &str) -> Vec<Result<Event, Invalid>> {
        Parser::new(text).map(|e| e.map(|(event, _)| event)).filter(|e| *e != Ok(Event::Frame)).collect()
    }

    fn scalar(text: &str, quoted: bool, tag: Option<&str>) -> Result<Event, Invalid> {
        Ok(Event::Scalar { text: text.to_owned(), quoted, tag: tag.map(str::to_owned) })
    }

    #[test]
    fn a_text_is_taken_apart() {
        let plain = |text| scalar(text, false, None);
        let got = events("a: [1, '2', \"\\0\", !!str x]\nb: *y\n");
        let list = [plain("1"), scalar("2", true, None), scalar("\0", true, None)];
        let mut want = vec![Ok(Event::MapStart), plain("a"), Ok(Event::ListStart)];
        want.extend(list);
        want.push(scalar("x", false, Some("tag:yaml.org,2002:str")));
        want.extend([Ok(Event::ListEnd), plain("b"), Ok(Event::Alias("y".to_owned())), Ok(Event::MapEnd)]);
        assert_eq!(got, want);
        assert!(events("").is_empty());
        assert_eq!(events("|\n  x"), [plain("x")]);
    }

    #[test]
    fn what_is_wrong_has_a_place() {
        let got = Parser::new("a: b\n  c: d").last().unwrap().unwrap_err();
        assert_eq!(got.place, Place { line: 2, column: 4 });
        assert_eq!(got.why, "mapping values are not allowed in this context");
    }
}
