//! The six parameter services and `/parameter_events`, from the one table of parameters.
//!
//! The library's own would describe nothing, know no ranges and check one value at a time.

use std::cell::RefCell;
use std::fmt::Arguments;
use std::future::ready;
use std::mem::{Discriminant, discriminant};
use std::sync::Arc;
use std::time::Instant;

use log::{Level, log};
use ros2_client::parameters::raw;
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest, GetParameterTypesResponse,
    GetParametersRequest, GetParametersResponse, ListParametersRequest, ListParametersResponse, ListParametersResult,
    SetParametersAtomicallyResponse, SetParametersRequest, SetParametersResponse,
};
use ros2_client::{Publisher, ServiceTypeName};
use smol::channel::Receiver;

use super::clock;
use super::endpoints::Endpoints;
use super::fault::Fault;
use super::inbox::Inbox;
use super::logging::{Throttle, held_back};
use super::page;
use super::parameters::{Change, NodeSettings, Store};
use super::part::Part;
use super::service::Service;
use crate::error::ParamsError;
use crate::params::{self, Assignment, Range, Value, ValueKind};
use crate::viewer::{Event, Hub};

/// The services, and where what they set goes.
pub struct ParameterServices {
    get: Service<GetParametersRequest, GetParametersResponse>,
    get_types: Service<GetParameterTypesRequest, GetParameterTypesResponse>,
    list: Service<ListParametersRequest, ListParametersResponse>,
    describe: Service<DescribeParametersRequest, DescribeParametersResponse>,
    set: Service<SetParametersRequest, SetParametersResponse>,
    set_atomically: Service<SetParametersRequest, SetParametersAtomicallyResponse>,
    events: Publisher<raw::ParameterEvent>,
    node: String,
    store: Arc<Store>,
    inbox: Arc<Inbox>,
    page: Option<(Hub, Receiver<page::Change>)>,
    throttle: RefCell<Throttle<Told>>,
}

/// What is told at most once a second.
#[derive(PartialEq)]
enum Told {
    Refused(Discriminant<ParamsError>),
    Changed(String),
    Unpublished,
}

/// Parameters that are asked for or set at a time, at most; there are not half as many.
const MOST: usize = 1000;

fn many(changes: &[raw::Parameter]) -> ParamsError {
    ParamsError::Many { len: changes.len(), most: MOST }
}

/// The names, unless there are more than make sense: what is said of them would be many times as long.
fn few(names: &[String]) -> &[String] {
    if names.len() > MOST { &[] } else { names }
}

impl ParameterServices {
    /// Offers the services, and obeys the live page where there is one.
    pub fn new(
        endpoints: &mut Endpoints,
        store: Arc<Store>,
        inbox: Arc<Inbox>,
        page: Option<(Hub, Receiver<page::Change>)>,
    ) -> Result<Self, Fault> {
        let kind = |name| ServiceTypeName::new("rcl_interfaces", name);
        let topic = endpoints.context.get_parameter_events_topic();
        let events = endpoints.node.create_publisher(&topic, None);
        Ok(Self {
            get: endpoints.server("~/get_parameters", &kind("GetParameters"))?,
            get_types: endpoints.server("~/get_parameter_types", &kind("GetParameterTypes"))?,
            list: endpoints.server("~/list_parameters", &kind("ListParameters"))?,
            describe: endpoints.server("~/describe_parameters", &kind("DescribeParameters"))?,
            set: endpoints.server("~/set_parameters", &kind("SetParameters"))?,
            set_atomically: endpoints.server("~/set_parameters_atomically", &kind("SetParametersAtomically"))?,
            events: events.map_err(|e| Fault::system("publish on /parameter_events", e))?,
            node: endpoints.names.node().full(),
            store,
            inbox,
            page,
            throttle: RefCell::default(),
        })
    }

    /// Answers requests for ever.
    pub fn parts(&self) -> Vec<Part<'_>> {
        let current = || self.store.current();
        let get = move |q: GetParametersRequest| GetParametersResponse { values: values(&current(), few(&q.names)) };
        let types =
            move |q: GetParameterTypesRequest| GetParameterTypesResponse { values: types(&current(), few(&q.names)) };
        let list = move |q: ListParametersRequest| ListParametersResponse {
            result: list(&current(), few(&q.prefixes), q.depth),
        };
        let describe = move |q: DescribeParametersRequest| DescribeParametersResponse {
            values: descriptions(&current(), few(&q.names)),
        };
        let set =
            async |q: SetParametersRequest| SetParametersResponse { results: self.change_each(q.parameter).await };
        let set_atomically =
            async |q: SetParametersRequest| SetParametersAtomicallyResponse { result: self.change(q.parameter).await };
        vec![
            Part::new("the service get_parameters", self.get.serve(move |q| ready(get(q)))),
            Part::new("the service get_parameter_types", self.get_types.serve(move |q| ready(types(q)))),
            Part::new("the service list_parameters", self.list.serve(move |q| ready(list(q)))),
            Part::new("the service describe_parameters", self.describe.serve(move |q| ready(describe(q)))),
            Part::new("the service set_parameters", self.set.serve(set)),
            Part::new("the service set_parameters_atomically", self.set_atomically.serve(set_atomically)),
            Part::new("parameters from the live page", self.obey_page()),
        ]
    }

    /// Makes the changes that are asked for on the live page, for ever.
    async fn obey_page(&self) {
        if let Some((_, changes)) = &self.page {
            while let Ok(page::Change { assignment: (name, value), answer }) = changes.recv().await {
                let change = raw::Parameter { name, value: to_raw(Some(&value)) };
                let result = self.change(vec![change]).await;
                // A page that has gone away needs no answer.
                let _ = answer.try_send(if result.successful { Ok(()) } else { Err(result.reason) });
            }
        }
        std::future::pending().await
    }

    async fn change_each(&self, changes: Vec<raw::Parameter>) -> Vec<raw::SetParametersResult> {
        if changes.len() > MOST {
            return vec![self.answer(Err(many(&changes))); changes.len()];
        }
        let mut results = Vec::new();
        for change in changes {
            results.push(self.change(vec![change]).await);
        }
        results
    }

    async fn change(&self, changes: Vec<raw::Parameter>) -> raw::SetParametersResult {
        if changes.len() > MOST {
            return self.answer(Err(many(&changes)));
        }
        let taken = self.taken(changes).await;
        self.answer(taken)
    }

    fn answer(&self, taken: Result<Change, ParamsError>) -> raw::SetParametersResult {
        match taken {
            Ok(Change { settings, networks, different }) => {
                if !different.is_empty() {
                    self.inbox.retune(settings.params.clone(), networks);
                    self.publish(different);
                }
                raw::SetParametersResult { successful: true, reason: String::new() }
            }
            Err(why) => {
                self.tell(Level::Warn, Told::Refused(discriminant(&why)), format_args!("parameters refused: {why}"));
                raw::SetParametersResult { successful: false, reason: why.to_string() }
            }
        }
    }

    /// Makes the changes, in the order of the requests; but one that asks for another network waits until that is
    /// loaded, while other requests are answered.
    async fn taken(&self, changes: Vec<raw::Parameter>) -> Result<Change, ParamsError> {
        let changes: Vec<Assignment> = changes.into_iter().map(|p| self.assignment(p)).collect::<Result<_, _>>()?;
        let changes: Arc<[Assignment]> = changes.into();
        let mut prepared = None;
        loop {
            if let Some(change) = self.store.change(&changes, prepared)? {
                return Ok(change);
            }
            let (store, changes) = (self.store.clone(), changes.clone());
            prepared = Some(smol::unblock(move || store.prepare(&changes)).await?);
        }
    }

    fn assignment(&self, parameter: raw::Parameter) -> Result<Assignment, ParamsError> {
        let raw::Parameter { name, value } = parameter;
        let kind = self.store.current().describe(&name).map(|d| d.kind);
        match (from_raw(value), kind) {
            (Ok(value), Some(kind)) => Ok((name, number(value, kind))),
            // The table refuses it, and knows names that are close.
            (Ok(value), None) => Ok((name, value)),
            (Err(got), Some(kind)) => Err(ParamsError::Type { name, expected: kind.name(), got: got.to_owned() }),
            (Err(_), None) => Err(params::unknown(&name)),
        }
    }

    fn publish(&self, changes: Vec<Assignment>) {
        for (name, value) in &changes {
            self.tell(Level::Info, Told::Changed(name.clone()), format_args!("parameter {name} is now {value}"));
            if let Some((hub, _)) = &self.page {
                hub.tell(None, Event::Set { name: name.clone(), value: value.to_string() });
            }
        }
        if let Some((hub, _)) = &self.page {
            hub.params_changed();
        }
        let changed = changes.into_iter().map(|(name, value)| raw::Parameter { name, value: to_raw(Some(&value)) });
        let event = raw::ParameterEvent {
            stamp: clock::now(),
            node: self.node.clone(),
            new_parameters: Vec::new(),
            changed_parameters: changed.collect(),
            deleted_parameters: Vec::new(),
        };
        if let Err(why) = self.events.publish(event) {
            let line = format_args!("the change of parameters could not be published: {why}");
            self.tell(Level::Warn, Told::Unpublished, line);
        }
    }

    /// Tells the log, unless it was told of such a thing just before.
    fn tell(&self, level: Level, what: Told, line: Arguments) {
        if let Some(held) = self.throttle.borrow_mut().pass(what, Instant::now()) {
            log!(level, "{line}{}", held_back(held));
        }
    }
}

fn values(settings: &NodeSettings, names: &[String]) -> Vec<raw::ParameterValue> {
    names.iter().map(|name| to_raw(settings.get(name).as_ref())).collect()
}

fn types(settings: &NodeSettings, names: &[String]) -> Vec<u8> {
    names.iter().map(|name| settings.get(name).map_or(raw::ParameterType::NOT_SET, |v| v.kind() as u8)).collect()
}

fn descriptions(settings: &NodeSettings, names: &[String]) -> Vec<raw::ParameterDescriptor> {
    names.iter().map(|name| description(settings, name)).collect()
}

fn description(settings: &NodeSettings, name: &str) -> raw::ParameterDescriptor {
    let mut raw = raw::ParameterDescriptor {
        name: name.to_owned(),
        r#type: raw::ParameterType::NOT_SET,
        description: String::new(),
        additional_constraints: String::new(),
        read_only: false,
        dynamic_typing: false,
        floating_point_range: Vec::new(),
        integer_range: Vec::new(),
    };
    if let Some(d) = settings.describe(name) {
        raw.r#type = d.kind as u8;
        raw.description = d.description;
        raw.additional_constraints = d.constraints;
        raw.read_only = d.read_only;
        // A step of 0 allows every value between; with any other, tools refuse most.
        match d.range {
            Some(Range::Integer(from_value, to_value)) => {
                raw.integer_range.push(raw::IntegerRange { from_value, to_value, step: 0 });
            }
            Some(Range::Double(from_value, to_value)) => {
                raw.floating_point_range.push(raw::FloatingPointRange { from_value, to_value, step: 0.0 });
            }
            None => {}
        }
    }
    raw
}

/// The names that equal a prefix or lie below one, no more than `depth` levels deep (0: any), as rclcpp lists them.
fn list(settings: &NodeSettings, prefixes: &[String], depth: u64) -> ListParametersResult {
    let levels = |name: &str| name.matches('.').count() as u64;
    let wanted = |name: &str| {
        if prefixes.is_empty() {
            return depth == 0 || levels(name) < depth;
        }
        prefixes.iter().any(|prefix| {
            let below = name.strip_prefix(prefix.as_str()).filter(|rest| rest.is_empty() || rest.starts_with('.'));
            below.is_some_and(|rest| rest.is_empty() || depth == 0 || levels(rest) < depth)
        })
    };
    let names: Vec<String> = settings.names().into_iter().filter(|n| wanted(n)).map(str::to_owned).collect();
    let mut groups: Vec<String> = names.iter().filter_map(|n| n.rsplit_once('.')).map(|(g, _)| g.to_owned()).collect();
    groups.sort_unstable();
    groups.dedup();
    ListParametersResult { names, prefixes: groups }
}

fn to_raw(value: Option<&Value>) -> raw::ParameterValue {
    let mut raw = raw::ParameterValue {
        ptype: value.map_or(raw::ParameterType::NOT_SET, |v| v.kind() as u8),
        boolean_value: false,
        int_value: 0,
        double_value: 0.0,
        string_value: String::new(),
        byte_array: Vec::new(),
        bool_array: Vec::new(),
        int_array: Vec::new(),
        double_array: Vec::new(),
        string_array: Vec::new(),
    };
    match value {
        None => {}
        Some(Value::Bool(v)) => raw.boolean_value = *v,
        Some(Value::Integer(v)) => raw.int_value = *v,
        Some(Value::Double(v)) => raw.double_value = *v,
        Some(Value::String(v)) => raw.string_value.clone_from(v),
        Some(Value::BoolArray(v)) => raw.bool_array.clone_from(v),
        Some(Value::IntegerArray(v)) => raw.int_array.clone_from(v),
        Some(Value::DoubleArray(v)) => raw.double_array.clone_from(v),
        Some(Value::StringArray(v)) => raw.string_array.clone_from(v),
    }
    raw
}

/// A double that came as text. rclpy makes text of doubles below 0.0001 when it loads a parameter file, for it writes
/// them as `1e-05`, which is no number in its YAML.
fn number(value: Value, kind: ValueKind) -> Value {
    match &value {
        Value::String(text) if kind == ValueKind::Double => text.parse().map_or(value, Value::Double),
        _ => value,
    }
}

/// The value, or what it is instead of one.
fn from_raw(raw: raw::ParameterValue) -> Result<Value, &'static str> {
    match raw.ptype {
        raw::ParameterType::BOOL => Ok(Value::Bool(raw.boolean_value)),
        raw::ParameterType::INTEGER => Ok(Value::Integer(raw.int_value)),
        raw::ParameterType::DOUBLE => Ok(Value::Double(raw.double_value)),
        raw::ParameterType::STRING => Ok(Value::String(raw.string_value)),
        raw::ParameterType::BOOL_ARRAY => Ok(Value::BoolArray(raw.bool_array)),
        raw::ParameterType::INTEGER_ARRAY => Ok(Value::IntegerArray(raw.int_array)),
        raw::ParameterType::DOUBLE_ARRAY => Ok(Value::DoubleArray(raw.double_array)),
        raw::ParameterType::STRING_ARRAY => Ok(Value::StringArray(raw.string_array)),
        raw::ParameterType::BYTE_ARRAY => Err("byte array"),
        _ => Err("no value"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_survive_the_way_to_the_wire_and_back() {
        for value in [
            Value::Bool(true),
            Value::Integer(-3),
            Value::Double(0.5),
            Value::String("x".into()),
            Value::BoolArray(vec![true]),
            Value::IntegerArray(vec![1, 2]),
            Value::DoubleArray(vec![0.5]),
            Value::StringArray(vec!["a".into()]),
        ] {
            assert_eq!(from_raw(to_raw(Some(&value))), Ok(value));
        }
        assert_eq!(from_raw(to_raw(None)), Err("no value"));
    }

    #[test]
    fn listing_follows_prefixes_and_depth() {
        let settings = NodeSettings::new("/image");
        let names = |prefixes: &[&str], depth| {
            let prefixes: Vec<String> = prefixes.iter().map(|p| (*p).to_owned()).collect();
            list(&settings, &prefixes, depth).names
        };
        assert_eq!(names(&[], 0).len(), settings.names().len());
        assert!(names(&[], 1).iter().all(|n| !n.contains('.')));
        assert_eq!(names(&["debug"], 0), ["debug.max_side", "debug.compressed_max_side", "debug.jpeg_quality"]);
        assert!(names(&["debug"], 1).is_empty());
        assert_eq!(names(&["seed"], 1), ["seed"]);
        assert!(names(&["deb"], 0).is_empty());
        let all = list(&settings, &[], 0);
        assert!(all.prefixes.contains(&"debug".to_owned()));
    }

    #[test]
    fn text_is_taken_for_a_double_where_it_is_one() {
        let text = |t: &str| Value::String(t.to_owned());
        assert_eq!(number(text("1e-05"), ValueKind::Double), Value::Double(1e-5));
        assert_eq!(number(text("little"), ValueKind::Double), text("little"));
        assert_eq!(number(text("1e-05"), ValueKind::String), text("1e-05"));
    }

    #[test]
    fn descriptors_hold_ranges_with_step_zero() {
        let settings = NodeSettings::new("/image");
        let d = description(&settings, "debug.jpeg_quality");
        assert_eq!((d.r#type, d.read_only), (raw::ParameterType::INTEGER, false));
        let range = &d.integer_range[0];
        assert_eq!((range.from_value, range.to_value, range.step), (1, 100, 0));
        assert!(description(&settings, "seed").read_only);
        assert_eq!(description(&settings, "nonsense").r#type, raw::ParameterType::NOT_SET);
    }
}
