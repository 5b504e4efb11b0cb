//! The table of parameters for people to read: Markdown for `docs/parameters.md`.

use std::fmt::Write as _;

use super::{Descriptor, Need, Tier, descriptors};

/// A Markdown table of the parameters of each tier, in the order of the table of parameters, after a table of what the
/// words in its column *change* mean.
pub fn markdown() -> String {
    let mut text = String::from("| change | what a change does while the program runs |\n|---|---|\n");
    for need in Need::ALL {
        let _ = writeln!(text, "| *{}* | {} |", need.name(), need.about());
    }
    for tier in Tier::ALL {
        let of_tier: Vec<_> = descriptors().iter().filter(|d| d.tier == tier).collect();
        let _ = writeln!(
            text,
            "\n### {}: {}\n\n{} parameters.\n\n| parameter | type | default | allowed | change | meaning |\n\
             |---|---|---|---|---|---|",
            capitalised(tier.name()),
            tier.about(),
            of_tier.len()
        );
        of_tier.into_iter().for_each(|d| text.push_str(&row(d)));
    }
    text
}

fn row(d: &Descriptor) -> String {
    format!(
        "| `{}` | {} | `{}` | {} | {} | {} |\n",
        d.name,
        d.default.kind().name(),
        d.default,
        allowed(d),
        d.need.name(),
        d.description.replace('|', "\\|")
    )
}

fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// The range with its unit, or the choices.
fn allowed(d: &Descriptor) -> String {
    let choices = d.choices.iter().map(|c| format!("`{c}`")).collect::<Vec<_>>().join(", ");
    let range = d.range.map_or(choices, |r| r.to_string());
    [range.as_str(), d.unit].into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(" ")
}
