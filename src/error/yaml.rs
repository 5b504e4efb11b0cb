//! Why parameter files and `NAME:=VALUE` are refused.

use yaml_events::Place;

/// Why a name in a parameter file or an argument is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum NameError {
    /// A key without a character.
    #[error("a name is empty")]
    Empty,
    /// Nothing stands before, between or after slashes.
    #[error("a name before, between or after slashes is empty")]
    EmptyPart,
    /// Nothing stands before, between or after dots.
    #[error("a name in '{name}' is empty")]
    EmptyGroup { name: String },
    /// With all that it lies below, it is longer than what is read.
    #[error("the name '{start}...' has {len} bytes, at most {most} are allowed")]
    Long { start: String, len: usize, most: usize },
    /// A part is longer than ROS allows.
    #[error("'{part}' is longer than {most} bytes")]
    LongPart { part: String, most: usize },
    /// A wildcard and something else in one part.
    #[error("'*' matches a whole name only, not a part as in '{part}'")]
    Wildcard { part: String },
    /// A character that names do not hold.
    #[error("'{part}' contains '{character}'; names may contain only letters, digits and '_'")]
    Character { part: String, character: char },
    /// Names begin with a letter or `_`.
    #[error("'{part}' begins with a digit")]
    Digit { part: String },
    /// Such names are ROS's own.
    #[error("'{part}' begins with two underscores")]
    Underscores { part: String },
    /// A key of a file that no node could match.
    #[error("'{key}' does not match a node: {source}")]
    Nodes { key: String, source: Box<Self> },
    /// An argument that names several nodes, or none that could be.
    #[error("it must be a node's name")]
    Node,
    /// An argument that names several parameters.
    #[error("wildcards are not allowed in parameter names")]
    Parameters,
}

/// Why a parameter file or `NAME:=VALUE` is refused. `key` is the one under which parameters stand.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum YamlError {
    /// The file system refuses.
    #[error("{why}")]
    Unreadable { why: String },
    /// A file larger than what is read.
    #[error("it has more than {most} bytes")]
    TooLarge { most: u64 },
    /// Directives take long to read.
    #[error("it has more than {most} directives")]
    Directives { most: usize },
    /// It begins like UTF-16 and is not.
    #[error("it is not valid UTF-16")]
    Utf16,
    /// It is not UTF-8.
    #[error("{place}: the byte {byte:#04x} is not UTF-8")]
    Utf8 { place: Place, byte: u8 },
    /// A character that YAML does not allow.
    #[error("{place}: the character U+{:04X} is not allowed", u32::from(*character))]
    Character { place: Place, character: char },
    /// No YAML, in the words of its reader.
    #[error("{place}: {why}")]
    Syntax { place: Place, why: String },
    /// What is wrong at a place.
    #[error("{place}: {source}")]
    At { place: Place, source: Box<Self> },
    /// What is wrong with the value of a parameter.
    #[error("'{name}': {source}")]
    Value { name: String, source: Box<Self> },
    /// A name is refused.
    #[error(transparent)]
    Name(#[from] NameError),
    /// Depth takes long to read.
    #[error("lists and maps are nested more than {most} deep")]
    Deep { most: u32 },
    /// A reference to an anchor.
    #[error("'*{anchor}' is an alias, which parameter files may not use")]
    Alias { anchor: String },
    /// A list as a key.
    #[error("a list where a name is expected")]
    ListAsName,
    /// A map as a key.
    #[error("a map where a name is expected")]
    MapAsName,
    /// A map as the value of an argument.
    #[error("a map is not a value; name each parameter in full, with dots")]
    MapAsValue,
    /// Parameters of no node.
    #[error("'{key}' must be below a node name, such as '/**'")]
    NoNode { key: &'static str },
    /// Values without names.
    #[error("'{key}' must hold names with values")]
    NoName { key: &'static str },
    /// A value among the names of nodes; `nodes` are those that it lies below.
    #[error("a value {}where '{key}' or a node name is expected", below(nodes.as_deref()))]
    Outside { nodes: Option<String>, key: &'static str },
    /// A list of several types.
    #[error("the items of a list must be of one type, and {value} is of type {got}, not {expected}")]
    Item { value: String, got: &'static str, expected: &'static str },
    /// A list that goes on as a map, or the other way round.
    #[error("a list and a map are mixed")]
    Mixed,
    /// Nothing stands where a value must.
    #[error("it has no value")]
    NoValue,
    /// An argument that ends at its `:=`.
    #[error("it has no value; for an empty string write ''")]
    NothingAssigned,
    /// An argument without `:=`.
    #[error("it must read NAME:=VALUE")]
    NoAssignment,
    /// An argument for another node, where there is only one.
    #[error("no node can be named here")]
    OtherNode,
}

/// `below 'NODES' `; nothing where there are none.
fn below(nodes: Option<&str>) -> String {
    nodes.map(|nodes| format!("below '{nodes}' ")).unwrap_or_default()
}
