//! Parameter files and arguments as rcl reads them.
//!
//! A file that other nodes of a system take must be taken here too, with the same values, and what rcl refuses is
//! refused. So this follows rcl's own reader, which reads YAML by libyaml and has rules of its own for everything
//! above it: [`scalar`] for the types of values, [`names`] for those of nodes and parameters, [`events`] for what a
//! file may hold, from what [`yaml_events`] finds in it. [`Overrides`] is what all files and arguments of a process
//! come to.

mod events;
mod names;
mod scalar;
mod text;

use std::collections::{BTreeSet, HashMap};
use std::fmt;
use std::path::{Path, PathBuf};
use std::rc::Rc;

pub use yaml_events::Place;

use super::{NodeName, Value, ValueKind, descriptor};
use crate::error::{ParamsError, YamlError};

/// The key under which a node's parameters stand.
pub const PARAMETERS_KEY: &str = "ros__parameters";
/// Whom an argument concerns that names no node.
const EVERY_NODE: &str = "/**";

/// Where a value comes from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// The file; `None` for an argument.
    pub file: Option<Rc<Path>>,
    /// The place in it.
    pub place: Option<Place>,
}

/// ` in FILE, line L, column C`; nothing for an argument, which its message names anyway.
impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.file, self.place) {
            (Some(file), Some(place)) => write!(f, " in {}, {place}", file.display()),
            (Some(file), None) => write!(f, " in {}", file.display()),
            (None, _) => Ok(()),
        }
    }
}

/// A parameter as a node finds it.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// Full name.
    pub name: String,
    /// The value; `None` for an empty list or map, which tell no type.
    pub value: Option<Value>,
    /// The types that it was given values of, where those are several. The first of them in the order of [`ValueKind`]
    /// holds, whichever came last.
    pub kinds: Vec<ValueKind>,
    /// Where the last value comes from.
    pub origin: Origin,
}

impl Override {
    /// The value; an empty list is one of the type that the package's table has for that name.
    pub fn value(&self) -> Value {
        self.value.clone().unwrap_or_else(|| match descriptor(&self.name).map(|d| d.default.kind()) {
            Some(ValueKind::BoolArray) => Value::BoolArray(Vec::new()),
            Some(ValueKind::IntegerArray) => Value::IntegerArray(Vec::new()),
            Some(ValueKind::DoubleArray) => Value::DoubleArray(Vec::new()),
            _ => Value::StringArray(Vec::new()),
        })
    }
}

/// What the files and arguments of a process say of the parameters of any node, in the order in which they came.
#[derive(Debug, Default)]
pub struct Overrides {
    nodes: Vec<Node>,
    index: HashMap<Rc<str>, usize>,
}

/// The parameters of the nodes that a key stands for.
#[derive(Debug)]
struct Node {
    key: Rc<str>,
    parameters: Vec<Parameter>,
    /// Where a name is, for it may be there several times.
    index: HashMap<Rc<str>, BTreeSet<usize>>,
}

#[derive(Debug)]
struct Parameter {
    name: Rc<str>,
    /// The last value of each type.
    values: Vec<Value>,
    origin: Origin,
}

impl Overrides {
    /// Takes in a parameter file. Gives the keys of the nodes that it names.
    pub fn read(&mut self, path: &Path) -> Result<Vec<String>, ParamsError> {
        let wrong = |source| ParamsError::File { path: PathBuf::from(path), source };
        let text = text::read(path).map_err(wrong)?;
        self.take(path, &text)
    }

    /// Takes in the text of a parameter file that errors call `path`. Gives the keys of the nodes that it names.
    pub fn take(&mut self, path: &Path, text: &str) -> Result<Vec<String>, ParamsError> {
        let wrong = |source| ParamsError::File { path: PathBuf::from(path), source };
        let origin = Origin { file: Some(path.into()), place: None };
        let mut named = events::file(text, origin, self).map_err(wrong)?;
        named.sort_unstable();
        named.dedup();
        Ok(named.iter().map(|n| self.nodes[*n].key.to_string()).collect())
    }

    /// Takes in `[NODE:]NAME:=VALUE`.
    pub fn assign(&mut self, text: &str) -> Result<(), ParamsError> {
        let wrong = |source| ParamsError::Assignment { text: text.to_owned(), source };
        let (target, value) = text.split_once(":=").ok_or_else(|| wrong(YamlError::NoAssignment))?;
        let (node, name) = match target.split_once(':') {
            Some((node, name)) => (Some(node), name),
            None => (None, target),
        };
        names::check_argument(node, name).map_err(|why| wrong(why.into()))?;
        if value.is_empty() {
            return Err(wrong(YamlError::NothingAssigned));
        }
        text::check(value).map_err(wrong)?;
        let node = self.node(node.unwrap_or(EVERY_NODE));
        let parameter = self.parameter(node, name);
        self.get_mut((node, parameter)).origin = Origin::default();
        events::value(value, Origin::default(), (node, parameter), self).map_err(wrong)
    }

    /// What all of it comes to for one node.
    pub fn of(&self, node: &NodeName) -> Vec<Override> {
        let mut found: Vec<Override> = Vec::new();
        let mut index: HashMap<&str, usize> = HashMap::new();
        let matching = self.nodes.iter().filter(|n| node.matches(&n.key));
        for parameter in matching.flat_map(|n| &n.parameters) {
            let value = parameter.found();
            match index.get(&*parameter.name) {
                Some(&earlier) => found[earlier] = value,
                None => {
                    index.insert(&parameter.name, found.len());
                    found.push(value);
                }
            }
        }
        found
    }

    fn node(&mut self, key: &str) -> usize {
        if let Some(known) = self.index.get(key) {
            return *known;
        }
        let key: Rc<str> = key.into();
        self.index.insert(key.clone(), self.nodes.len());
        self.nodes.push(Node { key, parameters: Vec::new(), index: HashMap::new() });
        self.nodes.len() - 1
    }

    /// The first parameter of that name, which is made if there is none.
    fn parameter(&mut self, node: usize, name: &str) -> usize {
        let node = &mut self.nodes[node];
        if let Some(known) = node.index.get(name).and_then(BTreeSet::first) {
            return *known;
        }
        let (name, at): (Rc<str>, _) = (name.into(), node.parameters.len());
        node.index.entry(name.clone()).or_default().insert(at);
        node.parameters.push(Parameter { name, values: Vec::new(), origin: Origin::default() });
        at
    }

    fn rename(&mut self, (node, parameter): (usize, usize), name: &str) {
        let node = &mut self.nodes[node];
        let name: Rc<str> = name.into();
        let old = std::mem::replace(&mut node.parameters[parameter].name, name.clone());
        if let Some(places) = node.index.get_mut(&old) {
            places.remove(&parameter);
            if places.is_empty() {
                node.index.remove(&old);
            }
        }
        node.index.entry(name).or_default().insert(parameter);
    }

    fn name(&self, (node, parameter): (usize, usize)) -> Option<Rc<str>> {
        Some(self.nodes.get(node)?.parameters.get(parameter)?.name.clone())
    }

    fn get_mut(&mut self, (node, parameter): (usize, usize)) -> &mut Parameter {
        &mut self.nodes[node].parameters[parameter]
    }
}

impl Parameter {
    fn set(&mut self, value: Value) {
        match self.values.iter_mut().find(|v| v.kind() == value.kind()) {
            Some(old) => *old = value,
            None => self.values.push(value),
        }
    }

    /// Adds the item to the list of its type, if there is one.
    fn append(&mut self, item: Value) -> bool {
        self.values.iter_mut().any(|list| list.push(&item))
    }

    fn found(&self) -> Override {
        let mut values: Vec<&Value> = self.values.iter().collect();
        values.sort_by_key(|v| v.kind());
        Override {
            name: self.name.to_string(),
            value: values.first().map(|v| (*v).clone()),
            kinds: if values.len() > 1 { values.iter().map(|v| v.kind()).collect() } else { Vec::new() },
            origin: self.origin.clone(),
        }
    }
}

#[cfg(test)]
mod tests;
