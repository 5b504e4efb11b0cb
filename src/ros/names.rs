//! Names of the node, its topics and services: expansion, remap rules and validity, as rcl does it.
//!
//! The ROS 2 library gets absolute names only; it would put a relative one on the wire as it stands.

use ros2_client::Name;

use super::fault::Fault;
use crate::params::NodeName;

/// A remap rule, `[NODE:][rostopic://|rosservice://]FROM:=TO`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rule {
    /// As it was given.
    text: String,
    /// The only node meant, where one is named.
    node: Option<String>,
    kind: Option<NameKind>,
    from: String,
    to: String,
}

/// What a name names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NameKind {
    Topic,
    Service,
}

impl Rule {
    /// Reads a rule.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        let wrong = |why: &str| Fault::Argument { argument: text.to_owned(), why: why.to_owned() };
        let (left, to) = text.split_once(":=").ok_or_else(|| wrong("a remap rule must read FROM:=TO"))?;
        let (node, rest) = match left.split_once(':') {
            Some((node, rest)) if !rest.starts_with("//") => (Some(node.to_owned()), rest),
            _ => (None, left),
        };
        let (kind, from) = match (rest.strip_prefix("rostopic://"), rest.strip_prefix("rosservice://")) {
            (Some(topic), _) => (Some(NameKind::Topic), topic),
            (_, Some(service)) => (Some(NameKind::Service), service),
            _ => (None, rest),
        };
        if from.is_empty() || to.is_empty() || node.as_deref() == Some("") {
            return Err(wrong("a name in the remap rule is empty"));
        }
        Ok(Self { text: text.to_owned(), node, kind, from: from.to_owned(), to: to.to_owned() })
    }

    fn is_for(&self, node: &str) -> bool {
        self.node.as_deref().is_none_or(|n| n == node)
    }
}

/// The node's name and the rules that hold for it.
#[derive(Debug, Clone)]
pub struct Names {
    node: NodeName,
    rules: Vec<Rule>,
}

impl Names {
    /// Renames the node as `__ns`, `__node` and `__name` rules say, and keeps the rest for topics and services.
    pub fn new(default: NodeName, rules: Vec<Rule>) -> Result<Self, Fault> {
        let rule = |keys: &[&str]| {
            rules.iter().find(|r| r.is_for(&default.name) && keys.contains(&r.from.as_str())).map(|r| r.to.clone())
        };
        let namespace = rule(&["__ns"]).unwrap_or_else(|| default.namespace.clone());
        let name = rule(&["__node", "__name"]).unwrap_or_else(|| default.name.clone());
        if !is_token(&name) {
            let why = "a node name may contain only letters, digits and '_', and must not begin with a digit";
            return Err(Fault::Name { name, why: why.to_owned() });
        }
        if !is_namespace(&namespace) {
            let why = "a namespace must begin with '/' and have valid names between its slashes";
            return Err(Fault::Name { name: namespace, why: why.to_owned() });
        }
        Ok(Self { node: NodeName { namespace, name }, rules })
    }

    /// The node's own name.
    pub fn node(&self) -> &NodeName {
        &self.node
    }

    /// The absolute name of a topic of ours.
    pub fn topic(&self, name: &str) -> Result<Name, Fault> {
        self.resolve(name, NameKind::Topic)
    }

    /// The absolute name of a topic that transports `base` in another form: what a rule for it says, or else below that
    /// of `base`.
    pub fn transported(&self, base: &str, transport: &str) -> Result<Name, Fault> {
        let own = format!("{base}/{transport}");
        let named = self.topic(&own)?;
        if named.to_string() == self.expand(&own) {
            return self.topic(&format!("{}/{transport}", self.topic(base)?));
        }
        Ok(named)
    }

    /// The absolute name of a service of ours.
    pub fn service(&self, name: &str) -> Result<Name, Fault> {
        self.resolve(name, NameKind::Service)
    }

    fn resolve(&self, name: &str, kind: NameKind) -> Result<Name, Fault> {
        let (mut full, mut by) = (self.expand(name), None);
        for rule in self.rules.iter().filter(|r| r.kind.is_none_or(|k| k == kind) && !r.from.starts_with("__")) {
            if rule.is_for(&self.node.name) && self.expand(&rule.from) == full {
                (full, by) = (self.expand(&rule.to), Some(rule));
                break;
            }
        }
        let parsed = check(&full).and_then(|()| Name::parse(&full).map_err(|e| NameError::Other(e.to_string())));
        parsed.map_err(|why| match by {
            Some(rule) => {
                Fault::Argument { argument: rule.text.clone(), why: format!("'{full}' is not a valid name: {why}") }
            }
            None => Fault::Name { name: full, why: why.to_string() },
        })
    }

    /// The absolute name: `~` stands for the node, a relative name lies in the namespace.
    fn expand(&self, name: &str) -> String {
        let namespace = self.node.namespace.trim_end_matches('/');
        let name = name.replace("{node}", &self.node.name).replace("{namespace}", namespace).replace("{ns}", namespace);
        if name.starts_with('/') {
            name
        } else if let Some(rest) = name.strip_prefix("~/") {
            format!("{}/{rest}", self.node.full())
        } else if name == "~" {
            self.node.full()
        } else {
            format!("{namespace}/{name}")
        }
    }
}

/// Which of the rules for names one breaks.
#[derive(Debug, thiserror::Error)]
enum NameError {
    #[error("it contains '{0}'; names may contain only letters, digits, '_' and '/'")]
    Character(char),
    #[error("there must be a name before, between and after its slashes")]
    Empty,
    #[error("'{0}' begins with a digit")]
    Digit(String),
    #[error("{0}")]
    Other(String),
}

/// Whether an absolute name keeps the rules.
fn check(name: &str) -> Result<(), NameError> {
    let bad = name.chars().find(|c| !c.is_ascii_alphanumeric() && !matches!(c, '_' | '/'));
    match bad {
        Some(bad) => Err(NameError::Character(bad)),
        None => match name.split('/').skip(1).find(|token| !is_token(token)) {
            Some("") => Err(NameError::Empty),
            Some(token) => Err(NameError::Digit(token.to_owned())),
            None => Ok(()),
        },
    }
}

/// Whether the text is an absolute namespace.
pub fn is_namespace(text: &str) -> bool {
    text == "/" || text.strip_prefix('/').is_some_and(|ns| ns.split('/').all(is_token))
}

fn is_token(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(rules: &[&str]) -> Result<Names, Fault> {
        Names::new(NodeName::default(), rules.iter().map(|r| Rule::parse(r).unwrap()).collect())
    }

    fn topic(rules: &[&str], name: &str) -> String {
        names(rules).unwrap().topic(name).unwrap().to_string()
    }

    #[test]
    fn names_are_expanded_in_the_namespace_of_the_renamed_node() {
        assert_eq!(topic(&[], "image"), "/image");
        assert_eq!(topic(&[], "~/tracks"), "/tracker/tracks");
        assert_eq!(topic(&["__ns:=/a/b", "__node:=n"], "image"), "/a/b/image");
        assert_eq!(topic(&["__ns:=/a/b", "__name:=n"], "~/tracks"), "/a/b/n/tracks");
        assert_eq!(topic(&["__ns:=/a"], "/image"), "/image");
        assert_eq!(topic(&["other:__node:=n"], "~/tracks"), "/tracker/tracks");
        assert_eq!(topic(&["tracker:__node:=n"], "~/tracks"), "/n/tracks");
    }

    #[test]
    fn rules_match_expanded_names_and_the_first_holds() {
        assert_eq!(topic(&["image:=/cam/image_raw"], "image"), "/cam/image_raw");
        assert_eq!(topic(&["/image:=cam", "image:=late"], "image"), "/cam");
        assert_eq!(topic(&["__ns:=/r", "image:=cam"], "image"), "/r/cam");
        assert_eq!(topic(&["__ns:=/r", "/image:=cam"], "image"), "/r/image");
        assert_eq!(topic(&["~/tracks:=~/out"], "~/tracks"), "/tracker/out");
        assert_eq!(topic(&["/tracker/tracks:={node}_out"], "~/tracks"), "/tracker_out");
        assert_eq!(topic(&["other:image:=cam"], "image"), "/image");
        assert_eq!(topic(&["tracker:image:=cam"], "image"), "/cam");
        assert_eq!(topic(&["rosservice://image:=s", "rostopic://image:=t"], "image"), "/t");
        let n = names(&["rostopic://~/stop:=t", "~/stop:=halt"]).unwrap();
        assert_eq!(n.service("~/stop").unwrap().to_string(), "/halt");
    }

    #[test]
    fn a_transport_lies_below_its_topic_unless_it_is_renamed_itself() {
        let compressed = |rules: &[&str]| names(rules).unwrap().transported("image", "compressed").unwrap().to_string();
        assert_eq!(compressed(&[]), "/image/compressed");
        assert_eq!(compressed(&["__ns:=/a", "image:=cam"]), "/a/cam/compressed");
        assert_eq!(compressed(&["image:=/cam", "image/compressed:=/jpeg"]), "/jpeg");
        assert_eq!(compressed(&["image:=/cam", "/cam/compressed:=/jpeg"]), "/jpeg");
    }

    #[test]
    fn names_that_break_the_rules_are_refused() {
        for rules in [["__node:=a/b"], ["__node:=1a"], ["__ns:=relative"], ["__ns:=/a//b"], ["__ns:=/a/"], ["__ns:=/1"]]
        {
            assert!(names(&rules).is_err(), "{rules:?}");
        }
        for (to, why) in [
            ("a//b", "'/a//b' is not a valid name: there must be a name before, between and after its slashes"),
            ("a/", "'/a/' is not a valid name: there must be"),
            ("/1", "'/1' is not a valid name: '1' begins with a digit"),
            ("a b", "'/a b' is not a valid name: it contains ' '; names may contain only letters"),
            ("/my-camera/x", "'/my-camera/x' is not a valid name: it contains '-'"),
        ] {
            let n = names(&[&format!("image:={to}")]).unwrap();
            let message = n.topic("image").unwrap_err().to_string();
            assert!(message.starts_with(&format!("argument 'image:={to}': {why}")), "{message}");
        }
        for rule in ["a", ":=b", "a:=", ":a:=b"] {
            assert!(Rule::parse(rule).is_err(), "{rule}");
        }
    }
}
