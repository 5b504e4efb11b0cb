//! The name of a node, and which keys of a parameter file mean it.

/// The full name of a node, by which it finds its own part of a parameter file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeName {
    /// Absolute, without a slash at its end; `/` for the root.
    pub namespace: String,
    /// The node's own name.
    pub name: String,
}

impl Default for NodeName {
    fn default() -> Self {
        Self { namespace: "/".to_owned(), name: "tracker".to_owned() }
    }
}

impl NodeName {
    /// `/namespace/name`.
    pub fn full(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.name)
    }

    /// Whether a key of a parameter file means this node: `**` stands for any number of names, `*` for one; a key
    /// without a leading slash is taken from the root.
    pub fn matches(&self, key: &str) -> bool {
        let full = self.full();
        let path: Vec<&str> = full.split('/').filter(|part| !part.is_empty()).collect();
        // Which beginnings of the path the key has matched so far.
        let mut matched = vec![false; path.len() + 1];
        matched[0] = true;
        for part in key.split('/').filter(|part| !part.is_empty()) {
            if part == "**" {
                let first = matched.iter().position(|m| *m).unwrap_or(matched.len());
                matched[first..].fill(true);
            } else {
                for end in (1..matched.len()).rev() {
                    matched[end] = matched[end - 1] && (part == "*" || part == path[end - 1]);
                }
                matched[0] = false;
            }
        }
        matched[path.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(namespace: &str, name: &str) -> NodeName {
        NodeName { namespace: namespace.to_owned(), name: name.to_owned() }
    }

    #[test]
    fn node_keys_match_as_rcl_matches_them() {
        let n = node("/robot/front", "tracker");
        for key in
            ["/**", "/robot/front/tracker", "robot/front/tracker", "/**/tracker", "/robot/*/tracker", "/robot/**"]
        {
            assert!(n.matches(key), "{key}");
        }
        for key in ["tracker", "/*", "/robot/tracker", "/**/other", "/robot/front"] {
            assert!(!n.matches(key), "{key}");
        }
        assert!(node("/", "tracker").matches("tracker"));
        assert!(node("/", "tracker").matches("/*"));
        let wild = "/**".repeat(100);
        assert!(n.matches(&wild) && !n.matches(&format!("{wild}/x")));
    }
}
