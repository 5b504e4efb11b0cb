//! From the events of a YAML text to the parameters of nodes.
//!
//! rcl keeps only where it is (which node, which group, key or value), builds no tree, and is lenient where that does
//! not show: names may come twice, documents follow each other, lists may hold lists. So does this, step by step, for
//! what other nodes take from a file must be taken here too.

use yaml_events::{Event, Invalid, Parser};

use super::names::{Nested, check_nodes, length};
use super::{Origin, Overrides, PARAMETERS_KEY, Place, scalar};
use crate::error::{NameError, YamlError};
use crate::params::{Value, ValueKind};

/// The deepest nesting of lists and maps. rcl has no limit, but the time to read grows with the depth.
const DEEPEST: u32 = 64;
/// The tag of what is text whatever it looks like.
const TEXT_TAG: &str = "tag:yaml.org,2002:str";

/// What keys name at a point of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    Nodes,
    Parameters,
}

/// Where a walk through a file is.
struct Walk<'a> {
    to: &'a mut Overrides,
    origin: Origin,
    level: Level,
    /// Whether the next scalar is a key.
    is_key: bool,
    /// Whether a map has begun that no key has come from yet.
    new_map: bool,
    /// Maps that are open.
    maps: u32,
    list: List,
    nodes: Nested,
    groups: Nested,
    node: usize,
    parameter: usize,
    /// The nodes that the file named.
    named: Vec<usize>,
}

/// The list that values come from, if they do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum List {
    None,
    Empty,
    Of(ValueKind),
}

/// Takes in a parameter file; gives the nodes it names.
pub fn file(text: &str, origin: Origin, to: &mut Overrides) -> Result<Vec<usize>, YamlError> {
    let mut walk = Walk {
        to,
        origin,
        level: Level::Nodes,
        is_key: true,
        new_map: false,
        maps: 0,
        list: List::None,
        nodes: Nested::new('/'),
        groups: Nested::new('.'),
        node: 0,
        parameter: 0,
        named: Vec::new(),
    };
    each_event(text, |event, place| walk.step(event, place))?;
    Ok(walk.named)
}

/// Takes in the value of one parameter.
pub fn value(text: &str, origin: Origin, at: (usize, usize), to: &mut Overrides) -> Result<(), YamlError> {
    let mut list = List::None;
    each_event(text, |event, place| match event {
        Event::Scalar { text, quoted, tag } => {
            let value = typed(&text, quoted, tag.as_deref())?;
            to.put(at, value, &mut list, Origin { place: Some(place), ..origin.clone() })
        }
        Event::ListStart => {
            list = List::Empty;
            Ok(())
        }
        Event::ListEnd => {
            list = List::None;
            Ok(())
        }
        Event::MapStart => Err(YamlError::MapAsValue),
        Event::Alias(anchor) => Err(YamlError::Alias { anchor }),
        Event::MapEnd | Event::Frame => Ok(()),
    })
}

/// Gives each event of the text and its place to `take`; what either finds wrong is told with the place.
fn each_event(text: &str, mut take: impl FnMut(Event, Place) -> Result<(), YamlError>) -> Result<(), YamlError> {
    let mut depth = 0u32;
    for event in Parser::new(text) {
        let (event, place) = event.map_err(|Invalid { why, place }| YamlError::Syntax { place, why })?;
        let told = |why| YamlError::At { place, source: Box::new(why) };
        match event {
            Event::ListStart | Event::MapStart => depth += 1,
            Event::ListEnd | Event::MapEnd => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > DEEPEST {
            return Err(told(YamlError::Deep { most: DEEPEST }));
        }
        take(event, place).map_err(told)?;
    }
    Ok(())
}

impl Walk<'_> {
    fn step(&mut self, event: Event, place: Place) -> Result<(), YamlError> {
        self.origin.place = Some(place);
        match event {
            Event::Scalar { text, .. } if self.is_key => {
                self.key(&text)?;
                self.is_key = false;
            }
            Event::Scalar { text, quoted, tag } => {
                self.value(&text, quoted, tag.as_deref())?;
                self.is_key = self.list == List::None;
            }
            Event::ListStart => {
                if self.is_key {
                    return Err(YamlError::ListAsName);
                }
                self.must_be_below_parameters()?;
                self.list = List::Empty;
            }
            Event::ListEnd => {
                self.list = List::None;
                self.is_key = true;
            }
            Event::MapStart => {
                self.maps += 1;
                self.is_key = true;
                // The keys of the map right below the node are parameters; those of any other lie in a group.
                let below_nodes = self.maps.wrapping_sub(self.nodes.parts() + 1);
                self.new_map = self.level != Level::Parameters || below_nodes != 2;
            }
            Event::MapEnd => {
                match self.level {
                    Level::Parameters if self.groups.parts() > 0 => self.groups.pop(),
                    Level::Parameters => self.level = Level::Nodes,
                    Level::Nodes if self.maps == self.nodes.parts() + 1 => self.nodes.pop(),
                    Level::Nodes => {}
                }
                self.maps -= 1;
            }
            Event::Alias(anchor) => return Err(YamlError::Alias { anchor }),
            Event::Frame => {}
        }
        Ok(())
    }

    fn key(&mut self, written: &str) -> Result<(), YamlError> {
        if written.is_empty() {
            return Err(NameError::Empty.into());
        }
        let key = c_string(written);
        match self.level {
            Level::Nodes if !key.starts_with(PARAMETERS_KEY) => Ok(self.nodes.push(key)?),
            Level::Nodes => {
                let nodes = self.nodes.joined().ok_or(YamlError::NoNode { key: PARAMETERS_KEY })?;
                check_nodes(nodes)?;
                self.node = self.to.node(nodes);
                self.named.push(self.node);
                self.nodes.pop();
                self.level = Level::Parameters;
                Ok(())
            }
            Level::Parameters => {
                if std::mem::take(&mut self.new_map) {
                    let group = self.to.name((self.node, self.parameter));
                    self.groups.enter(&group.ok_or(YamlError::MapAsName)?);
                }
                self.parameter = match self.groups.joined() {
                    None => {
                        length(key)?;
                        self.to.parameter(self.node, key)
                    }
                    // What rcl found by the group's name gets the name of the group's member.
                    Some(group) => {
                        let name = format!("{group}.{key}");
                        length(&name)?;
                        let parameter = self.to.parameter(self.node, group);
                        self.to.rename((self.node, parameter), &name);
                        parameter
                    }
                };
                Ok(())
            }
        }
    }

    fn value(&mut self, text: &str, quoted: bool, tag: Option<&str>) -> Result<(), YamlError> {
        self.must_be_below_parameters()?;
        let at = (self.node, self.parameter);
        let name = self.to.name(at).ok_or(YamlError::NoName { key: PARAMETERS_KEY })?;
        let told = |why| YamlError::Value { name: name.to_string(), source: Box::new(why) };
        let value = typed(text, quoted, tag).map_err(told)?;
        self.to.put(at, value, &mut self.list, self.origin.clone()).map_err(told)
    }

    fn must_be_below_parameters(&self) -> Result<(), YamlError> {
        match self.level {
            Level::Parameters => Ok(()),
            Level::Nodes => {
                let nodes = self.nodes.joined().map(str::to_owned);
                Err(YamlError::Outside { nodes, key: PARAMETERS_KEY })
            }
        }
    }
}

impl Overrides {
    /// Gives a parameter a value, or adds it to its list.
    fn put(&mut self, at: (usize, usize), value: Value, list: &mut List, origin: Origin) -> Result<(), YamlError> {
        let kind = value.kind();
        let parameter = self.get_mut(at);
        parameter.origin = origin;
        match *list {
            List::None => parameter.set(value),
            List::Empty => {
                *list = List::Of(kind);
                parameter.set(value.into_array());
            }
            List::Of(first) if first != kind => {
                let (value, got, expected) = (value.to_string(), kind.name(), first.name());
                return Err(YamlError::Item { value, got, expected });
            }
            List::Of(_) if !parameter.append(value) => return Err(YamlError::Mixed),
            List::Of(_) => {}
        }
        Ok(())
    }
}

/// The value of a scalar.
fn typed(text: &str, quoted: bool, tag: Option<&str>) -> Result<Value, YamlError> {
    if text.is_empty() && !quoted {
        return Err(YamlError::NoValue);
    }
    let text = c_string(text);
    Ok(if quoted || tag == Some(TEXT_TAG) { Value::String(text.to_owned()) } else { scalar::value(text) })
}

/// The text as C sees it, which ends at a NUL.
fn c_string(text: &str) -> &str {
    text.split('\0').next().unwrap_or_default()
}
