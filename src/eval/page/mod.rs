//! The report as one page for a browser, with nothing beside it: diagrams are SVG in the page, pictures are in its
//! text, and there is no script. `results.json` beside it holds the figures.
//!
//! `charts` draws, `filmstrip` takes pictures; `report.html` is the template and `style.css` gives the looks, which
//! follow the reader's light or dark scheme.

mod charts;
mod filmstrip;

use std::path::{Path, PathBuf};

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, Value};
use serde::Serialize;

use self::charts::{ChartError, Story};
use self::filmstrip::Moment;
use super::dataset::Sequence;
use super::long_term::LongTerm;
use super::moments::worst;
use super::otb::OVERLAP_THRESHOLDS;
use super::report::Report;
use super::run::Run;
use super::table::{Hard, Row, Table};
use crate::replay::ReplayError;

/// The files in the report's folder.
pub const PAGE_FILE: &str = "index.html";
/// The figures.
pub const RESULTS_FILE: &str = "results.json";

/// Pictures of a sequence.
const MOMENTS: usize = 6;
/// The style sheet knows so many colours; further setups have the same again, in dashes.
const COLOURS: usize = 10;
const TEMPLATE: &str = include_str!("report.html");
const STYLE: &str = include_str!("style.css");

/// Why a page could not be made.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum PageError {
    /// A frame that was to be shown cannot be read.
    #[error(transparent)]
    Frames(#[from] ReplayError),
    /// A diagram.
    #[error("a diagram cannot be drawn: {0}")]
    Chart(#[from] ChartError),
    /// The template.
    #[error("the page cannot be made: {0}")]
    Template(#[from] minijinja::Error),
    /// A file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
}

/// What a cell of a table compares.
#[derive(Serialize)]
struct Cell {
    precision: f64,
    auc: f64,
    held: f64,
    f: f64,
}

impl Cell {
    fn of(row: &Row) -> Self {
        let g = &row.figures;
        Self { precision: g.precision, auc: g.auc, held: g.held, f: g.long_term.best.f }
    }
}

/// A row of the tables that compare the setups: one sequence, or those of one attribute.
#[derive(Serialize)]
struct Compared<'a> {
    name: &'a str,
    /// What stands beside the name.
    note: String,
    /// The number of the card that the name leads to.
    card: Option<usize>,
    /// One a setup; `None` where it was not run.
    cells: Vec<Option<Cell>>,
    /// The best of each figure.
    best: Option<Cell>,
}

impl<'a> Compared<'a> {
    fn new(name: &'a str, note: String, cells: Vec<Option<Cell>>) -> Self {
        let best = |of: fn(&Cell) -> f64| cells.iter().flatten().map(of).fold(0.0, f64::max);
        let best =
            Cell { precision: best(|c| c.precision), auc: best(|c| c.auc), held: best(|c| c.held), f: best(|c| c.f) };
        Self { name, note, card: None, best: (cells.len() > 1).then_some(best), cells }
    }
}

/// What is shown of one sequence: how the first setup fared.
#[derive(Serialize)]
struct Card<'a> {
    row: &'a Row,
    attributes: Vec<&'static str>,
    story: String,
    moments: Vec<Moment>,
}

/// Writes the page and the figures. `runs` are those of the report's first setup, from the plain start.
pub fn write(folder: &Path, report: &Report, runs: &[(&Sequence, &Run)]) -> Result<(), PageError> {
    let page = render(report, runs)?;
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|source| PageError::Write { path, source })
    };
    write(PAGE_FILE, &page)?;
    let figures = serde_json::to_string_pretty(report)
        .map_err(|e| PageError::Write { path: folder.join(RESULTS_FILE), source: e.into() })?;
    write(RESULTS_FILE, &(figures + "\n"))
}

/// All that the template is filled with.
#[derive(Serialize)]
struct Page<'a> {
    report: &'a Report,
    style: &'static str,
    colours: usize,
    overlaps: usize,
    success: String,
    precision: String,
    calibration: Option<String>,
    attributes: Vec<Compared<'a>>,
    sequences: Vec<Compared<'a>>,
    cards: Vec<Card<'a>>,
    version: &'static str,
}

/// The text of the page.
fn render(report: &Report, runs: &[(&Sequence, &Run)]) -> Result<String, PageError> {
    let cards = runs.iter().map(|(sequence, run)| card(report, sequence, run)).collect::<Result<Vec<_>, _>>()?;
    let cards: Vec<Card> = cards.into_iter().flatten().collect();
    let mut sequences = by_sequence(report);
    for sequence in &mut sequences {
        sequence.card = cards.iter().position(|card| card.row.name == sequence.name).map(|at| at + 1);
    }
    let page = Page {
        report,
        style: STYLE,
        colours: COLOURS,
        overlaps: OVERLAP_THRESHOLDS,
        success: charts::success(report)?,
        precision: charts::precision(report)?,
        calibration: charts::calibration(report)?,
        attributes: by_attribute(report),
        sequences,
        cards,
        version: env!("CARGO_PKG_VERSION"),
    };
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_filter("fixed", fixed);
    Ok(environment.render_str(TEMPLATE, Serde(&page))? + "\n")
}

/// A number with so many decimals, a dash for none.
fn fixed(value: Value, decimals: usize) -> String {
    match f64::try_from(value) {
        Ok(value) => format!("{value:.decimals$}"),
        Err(_) => "–".to_owned(),
    }
}

fn by_sequence(report: &Report) -> Vec<Compared<'_>> {
    let mut names: Vec<&str> = Vec::new();
    for row in report.setups.iter().flat_map(|t| &t.sequences) {
        if !names.contains(&row.name.as_str()) {
            names.push(&row.name);
        }
    }
    let compared = |name| {
        let row = |table: &Table| table.sequences.iter().find(|r| r.name == name).map(Cell::of);
        Compared::new(name, String::new(), report.setups.iter().map(row).collect())
    };
    names.into_iter().map(compared).collect()
}

fn by_attribute(report: &Report) -> Vec<Compared<'_>> {
    let cell = |precision, auc, held, long_term: &LongTerm| Cell { precision, auc, held, f: long_term.best.f };
    let compared = |hard: &Hard| {
        let part = |table: &Table| {
            let part = table.attributes.iter().find(|p| p.attribute == hard.attribute)?;
            Some(cell(part.precision, part.auc, part.held, &part.long_term))
        };
        Compared::new(
            hard.attribute.label(),
            hard.sequences.len().to_string(),
            report.setups.iter().map(part).collect(),
        )
    };
    let mean = |table: &Table| table.mean.as_ref().map(|m| cell(m.precision, m.auc, m.held, &m.long_term));
    let all =
        Compared::new("all sequences", by_sequence(report).len().to_string(), report.setups.iter().map(mean).collect());
    report.attributes.iter().map(compared).chain([all]).collect()
}

/// What is shown of a sequence; `None` of one that was not scored.
fn card<'a>(report: &'a Report, sequence: &Sequence, run: &Run) -> Result<Option<Card<'a>>, PageError> {
    let rows = report.setups.first().into_iter().flat_map(|t| &t.sequences);
    let Some(row) = rows.into_iter().find(|r| r.name == sequence.name) else { return Ok(None) };
    let answers = &run.answers;
    let moments = worst(answers, &sequence.truth, MOMENTS);
    let with = report.attributes.iter().filter(|hard| hard.sequences.contains(&sequence.name));
    let story = Story {
        overlaps: answers.iter().zip(&sequence.truth).map(|(a, t)| t.map(|t| t.iou(&a.rect))).collect(),
        visible: sequence.visible()[..answers.len()].iter().map(Option::is_some).collect(),
        lost: answers.iter().map(|a| a.is_lost()).collect(),
        moments: moments.clone(),
    };
    Ok(Some(Card {
        row,
        attributes: with.map(|hard| hard.attribute.label()).collect(),
        story: charts::story(&story)?,
        moments: filmstrip::moments(sequence, answers, &moments)?,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::answer::Answer;
    use crate::eval::attributes::Attribute;
    use crate::geometry::Rect;
    use crate::params::Params;
    use crate::tracker::State;

    /// A sequence of four frames in a folder, its run, and the report of two setups with names that are none in HTML.
    fn report(folder: &Path) -> (Report, Sequence, Run) {
        let target = Rect::new(10.0, 10.0, 20.0, 20.0);
        for i in 0..4 {
            image::GrayImage::from_pixel(64, 48, image::Luma([90])).save(folder.join(format!("{i}.png"))).unwrap();
        }
        let truth = vec![Some(target), Some(target), None, Some(target)];
        let sequence = Sequence { name: "a<b>&c".to_owned(), path: folder.to_owned(), truth, hidden: None };
        let state = |i| if i == 2 { State::Lost } else { State::Tracking };
        let answer = |i: usize| Answer {
            rect: target.shifted(3.0 * i as f64, 0.0),
            confidence: Some(0.75),
            state: state(i),
            reacquired: false,
        };
        let run = Run { answers: (0..4).map(answer).collect(), processor_time: None };
        let hard = Hard::sort(&[(&sequence, vec![Attribute::OutOfView])]);
        let done = [(&sequence, vec![&run, &run])];
        let setups = vec![
            Table::new("ours'", Some(&Params::default()), &done, &hard),
            Table::new("<i>theirs", None, &[(&sequence, vec![&run])], &hard),
        ];
        let report = Report { dataset: "data & more".to_owned(), starts: 2, attributes: hard, setups, halves: None };
        (report, sequence, run)
    }

    #[test]
    fn the_page_stands_alone_and_names_are_text() {
        let dir = tempfile::tempdir().unwrap();
        let (report, sequence, run) = report(dir.path());
        let page = render(&report, &[(&sequence, &run)]).unwrap();
        for text in ["a&lt;b&gt;&amp;c", "&lt;i&gt;theirs", "data &amp; more", "out of view", "frame 4"] {
            assert!(page.contains(text), "{text}");
        }
        assert!(!page.contains("a<b>") && !page.contains("<i>theirs") && !page.contains("<script"));
        // Of addresses only those of pictures in the text, of parts of the page, of the file beside it, and SVG's name.
        let addresses = ["src=", "href=", "url(", "@import"].iter().flat_map(|a| page.split(a).skip(1));
        for address in addresses {
            let known = ["\"data:image/jpeg", "\"#", "\"results.json\""].iter().any(|a| address.starts_with(a));
            assert!(known, "{}", &address[..40.min(address.len())]);
        }
        assert_eq!(page.matches("http").count(), page.matches("http://www.w3.org/2000/svg").count());
        assert_eq!(page.matches("<svg").count(), 4, "three diagrams and the story of the sequence");
        // The first was given; the third is no fault, for the target was said to be lost.
        assert_eq!(page.matches("<img").count(), 2);
    }

    #[test]
    fn figures_lie_beside_the_page() {
        let dir = tempfile::tempdir().unwrap();
        let (report, sequence, run) = report(dir.path());
        write(dir.path(), &report, &[(&sequence, &run)]).unwrap();
        assert!(std::fs::read_to_string(dir.path().join(PAGE_FILE)).unwrap().ends_with("</html>\n"));
        let figures: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(dir.path().join(RESULTS_FILE)).unwrap()).unwrap();
        assert_eq!(figures["attributes"][0]["attribute"], "out_of_view");
        assert_eq!(figures["setups"][0]["attributes"][0]["precision"], 1.0);
        let missing = dir.path().join("missing");
        let message = write(&missing, &report, &[]).unwrap_err().to_string();
        assert!(message.starts_with(&missing.join(PAGE_FILE).display().to_string()), "{message}");
    }

    #[test]
    fn numbers_that_are_none_are_dashes() {
        assert_eq!(fixed(Value::from(0.256), 2), "0.26");
        assert_eq!(fixed(Value::from(3), 1), "3.0");
        assert_eq!(fixed(Value::from(()), 2), "–");
    }
}
