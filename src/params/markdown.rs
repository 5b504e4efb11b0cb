//! The table of parameters for people to read: Markdown for the README.

use std::fmt::Write as _;

use super::{Descriptor, descriptors};

/// A Markdown table of all parameters, in the order of the table of parameters.
pub fn markdown() -> String {
    let mut text = String::from(
        "| parameter | type | default | allowed | live | meaning |\n\
         |---|---|---|---|---|---|\n",
    );
    for d in descriptors() {
        let _ = writeln!(
            text,
            "| `{}` | {} | `{}` | {} | {} | {} |",
            d.name,
            d.default.kind().name(),
            d.default,
            allowed(d),
            if d.live { "yes" } else { "no" },
            d.description.replace('|', "\\|")
        );
    }
    text
}

/// The range with its unit, or the choices.
fn allowed(d: &Descriptor) -> String {
    let choices = d.choices.iter().map(|c| format!("`{c}`")).collect::<Vec<_>>().join(", ");
    let range = d.range.map_or(choices, |r| r.to_string());
    [range.as_str(), d.unit].into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(" ")
}
