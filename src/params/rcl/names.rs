//! Names in parameter files and arguments: of nodes, with wildcards, and of groups within groups.

use crate::error::NameError;

/// The longest part of a namespace and the longest name of a node, in bytes, as rmw has them.
const LONGEST_PART: usize = 244;
const LONGEST_NODE: usize = 255;
/// The longest name of a parameter or a node with all that it lies below, in bytes: far beyond what is of use, so that
/// the names of a small file cannot fill the memory.
const LONGEST: usize = 500;
/// How many characters of a longer one a message shows.
const SHOWN: usize = 40;

/// Names that lie in each other, joined to one.
#[derive(Debug)]
pub struct Nested {
    separator: char,
    joined: String,
    parts: u32,
}

impl Nested {
    /// None yet, to be joined by `separator`.
    pub fn new(separator: char) -> Self {
        Self { separator, joined: String::new(), parts: 0 }
    }

    /// All of them, or `None` where there are none.
    pub fn joined(&self) -> Option<&str> {
        (self.parts > 0).then_some(self.joined.as_str())
    }

    /// How many there are. A name that holds the separator counts as one.
    pub fn parts(&self) -> u32 {
        self.parts
    }

    /// Goes down into a name.
    pub fn push(&mut self, name: &str) -> Result<(), NameError> {
        if name.is_empty() {
            return Err(NameError::Empty);
        }
        if self.parts > 0 && !self.joined.ends_with(self.separator) {
            self.joined.push(self.separator);
        }
        self.joined.push_str(name);
        self.parts += 1;
        length(&self.joined)
    }

    /// Goes down to what is called `joined` altogether.
    pub fn enter(&mut self, joined: &str) {
        joined.clone_into(&mut self.joined);
        self.parts += 1;
    }

    /// Goes up again. As in rcl, only what follows the last separator goes, so that after `a: {b.c: {d: 1}, e: 2}` the
    /// second parameter is called `a.b.e`.
    pub fn pop(&mut self) {
        if self.parts == 1 {
            self.joined.clear();
        } else if let Some(end) = self.joined.rfind(self.separator) {
            self.joined.truncate(end);
        }
        self.parts = self.parts.saturating_sub(1);
    }
}

/// Whether a joined name is short enough.
pub fn length(name: &str) -> Result<(), NameError> {
    if name.len() > LONGEST {
        let start = name.chars().take(SHOWN).collect();
        return Err(NameError::Long { start, len: name.len(), most: LONGEST });
    }
    Ok(())
}

/// Checks a key that stands for nodes: names with `*` for any one and `**` for any number of them.
pub fn check_nodes(key: &str) -> Result<(), NameError> {
    let (namespace, node) = key.rsplit_once('/').unwrap_or(("", key));
    let wrong = |why| NameError::Nodes { key: key.to_owned(), source: Box::new(why) };
    if !namespace.is_empty() {
        for part in namespace.strip_prefix('/').unwrap_or(namespace).split('/') {
            check_part(part, LONGEST_PART).map_err(wrong)?;
        }
    }
    check_part(node, LONGEST_NODE).map_err(wrong)
}

fn check_part(part: &str, longest: usize) -> Result<(), NameError> {
    if part == "*" || part == "**" {
        return Ok(());
    }
    let owned = || part.to_owned();
    let bad = part.chars().find(|c| !c.is_ascii_alphanumeric() && *c != '_');
    match (part.chars().next(), bad) {
        (None, _) => Err(NameError::EmptyPart),
        (_, Some('*')) => Err(NameError::Wildcard { part: owned() }),
        (_, Some(character)) => Err(NameError::Character { part: owned(), character }),
        (Some(first), _) if first.is_ascii_digit() => Err(NameError::Digit { part: owned() }),
        _ if part.len() > longest => Err(NameError::LongPart { part: owned(), most: longest }),
        _ => Ok(()),
    }
}

/// Checks the name in `[NODE:]NAME:=VALUE`, and the node where one is named.
pub fn check_argument(node: Option<&str>, name: &str) -> Result<(), NameError> {
    if let Some(node) = node {
        let own = node.starts_with("__") || node.contains(['/', '*']);
        check_part(node, LONGEST_NODE).and(if own { Err(NameError::Node) } else { Ok(()) })?;
    }
    for part in name.split('.') {
        if part.is_empty() {
            return Err(NameError::EmptyGroup { name: name.to_owned() });
        }
        for token in part.split('/').filter(|token| !token.is_empty()) {
            if token.starts_with("__") {
                return Err(NameError::Underscores { part: token.to_owned() });
            }
            check_part(token, LONGEST)?;
            if token.starts_with('*') {
                return Err(NameError::Parameters);
            }
        }
    }
    length(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_nodes_are_checked_part_by_part() {
        for key in ["/**", "/*", "**", "*", "tracker", "/a/b", "a/b", "/**/tracker", "/a/*/b", "_x/y1"] {
            assert_eq!(check_nodes(key), Ok(()), "{key}");
        }
        for (key, why) in [
            ("/track*", "'*' matches a whole name only"),
            ("/", "is empty"),
            ("a//b", "is empty"),
            ("//a", "is empty"),
            ("a/", "is empty"),
            ("/a-b", "contains '-'"),
            ("1a", "begins with a digit"),
            ("/1/a", "begins with a digit"),
        ] {
            let got = check_nodes(key).unwrap_err().to_string();
            assert!(got.contains(why), "{key}: {got}");
        }
    }

    #[test]
    fn names_in_arguments_are_dotted_and_may_hold_topics() {
        for name in ["a", "a.b", "a_.b9", "qos_overrides./image.subscription.depth", "/a", "a//b", "a/"] {
            assert_eq!(check_argument(None, name), Ok(()), "{name}");
            assert_eq!(check_argument(Some("n"), name), Ok(()), "{name}");
        }
        for name in ["", ".a", "a.", "a..b", "1a", "a.1", "__a", "a-b", "a b", "a*", "a.*", "ä"] {
            assert!(check_argument(None, name).is_err(), "{name}");
        }
        for node in ["", "/n", "1", "n-x", "**", "__n"] {
            assert!(check_argument(Some(node), "a").is_err(), "{node}");
        }
    }

    #[test]
    fn names_are_joined_and_taken_apart_at_the_separator() {
        let mut names = Nested::new('.');
        assert_eq!(names.joined(), None);
        names.push("a").unwrap();
        names.enter("a.b.c");
        assert_eq!((names.joined(), names.parts()), (Some("a.b.c"), 2));
        names.pop();
        assert_eq!((names.joined(), names.parts()), (Some("a.b"), 1));
        names.pop();
        assert_eq!(names.joined(), None);
        assert!(names.push("").is_err() && names.push(&"x".repeat(2000)).is_err());
    }
}
