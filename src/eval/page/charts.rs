//! The diagrams of the page, as SVG to be set into it.
//!
//! They are drawn in stand-ins for colours, which the page's style sheet gives a look by their values
//! (`[stroke="#010000"]`), so that they follow the reader's light or dark scheme: see [`Ink`].

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::eval::calibration::Calibration;
use crate::eval::otb::{LARGEST_DISTANCE, OVERLAP_THRESHOLDS, overlap_threshold};
use crate::eval::report::Report;
use crate::eval::table::Table;

/// Why a diagram could not be drawn.
pub type ChartError = DrawingAreaErrorKind<std::io::Error>;

/// Units of a diagram's width and height; the page shows it at about a third of that.
const SIZE: (u32, u32) = (1200, 840);
/// Those of the line over a sequence's frames.
const WIDE: (u32, u32) = (2400, 300);
/// Height of text, in either.
const TEXT: u32 = 42;
const WIDE_TEXT: u32 = 28;
/// Thickness of a line of ours, and of others'.
const THICK: u32 = 8;
const THIN: u32 = 5;
const HAIR: u32 = 2;
/// Radius of the mark of a bin that holds all boxes, and of the smallest.
const LARGEST_MARK: f64 = 22.0;
const LEAST_MARK: f64 = 6.0;
/// Overlaps and shares end a little above 1, so that a line along it shows.
const TOP: f64 = 1.02;

/// What something is drawn with.
#[derive(Clone, Copy)]
enum Ink {
    /// A setup, by its place.
    Series(u8),
    /// Axes and their texts.
    Axis,
    Grid,
    /// What would be right.
    Ideal,
    /// Frames in which the target is not to be seen.
    Absent,
    /// Frames on which it was said to be lost.
    Lost,
    /// The line of overlaps.
    Overlap,
    /// Frames that are shown below.
    Moment,
}

impl Ink {
    /// The stand-in, as the style sheet has it.
    fn colour(self) -> RGBColor {
        match self {
            Self::Series(i) => RGBColor(1, 0, i),
            Self::Axis => RGBColor(2, 0, 0),
            Self::Grid => RGBColor(2, 0, 1),
            Self::Ideal => RGBColor(2, 0, 2),
            Self::Absent => RGBColor(2, 0, 3),
            Self::Lost => RGBColor(2, 0, 4),
            Self::Overlap => RGBColor(2, 0, 5),
            Self::Moment => RGBColor(2, 0, 6),
        }
    }

    fn stroke(self, width: u32) -> ShapeStyle {
        self.colour().stroke_width(width)
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// A coordinate system with a grid, and what `draw` puts into it.
fn chart(
    x: (&str, Range<f64>),
    y: (&str, Range<f64>),
    draw: impl FnOnce(&mut Chart) -> Result<(), ChartError>,
) -> Result<String, ChartError> {
    let mut svg = String::new();
    {
        let root: Area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .margin(TEXT / 2)
            .margin_right(TEXT)
            .x_label_area_size(TEXT * 5 / 2)
            .y_label_area_size(TEXT * 3)
            .build_cartesian_2d(x.1, y.1)?;
        let text = ("sans-serif", TEXT).into_font().color(&Ink::Axis.colour());
        chart
            .configure_mesh()
            .x_labels(6)
            .y_labels(6)
            .max_light_lines(0)
            .bold_line_style(Ink::Grid.stroke(HAIR))
            .axis_style(Ink::Axis.stroke(HAIR))
            .label_style(text.clone())
            .axis_desc_style(text)
            .x_desc(x.0)
            .y_desc(y.0)
            .x_label_formatter(&|v| label(*v))
            .y_label_formatter(&|v| label(*v))
            .draw()?;
        draw(&mut chart)?;
        root.present()?;
    }
    Ok(svg)
}

/// A number without zeros at its end.
fn label(value: f64) -> String {
    format!("{}", (value * 100.0).round() / 100.0)
}

/// A line of each setup with the points that `points` gives; ours, which come first, are drawn last, over the others.
fn lines(report: &Report, chart: &mut Chart, points: impl Fn(&Table) -> Vec<(f64, f64)>) -> Result<(), ChartError> {
    for (i, table) in report.setups.iter().enumerate().rev() {
        let width = if table.peer { THIN } else { THICK };
        chart.draw_series(LineSeries::new(points(table), Ink::Series(i as u8).stroke(width)))?;
    }
    Ok(())
}

/// Share of frames by the overlap that is asked for.
pub fn success(report: &Report) -> Result<String, ChartError> {
    let points = |table: &Table| {
        let shares = table.mean.iter().flat_map(|m| &m.curves.success);
        shares.enumerate().map(|(i, &share)| (overlap_threshold(i), share)).collect()
    };
    let last = overlap_threshold(OVERLAP_THRESHOLDS - 1);
    chart(("overlap threshold", 0.0..last), ("share of frames", 0.0..TOP), |chart| lines(report, chart, points))
}

/// Share of frames by the distance that is allowed.
pub fn precision(report: &Report) -> Result<String, ChartError> {
    let points = |table: &Table| {
        let shares = table.mean.iter().flat_map(|m| &m.curves.precision);
        shares.enumerate().map(|(i, &share)| (i as f64, share)).collect()
    };
    let last = LARGEST_DISTANCE as f64;
    chart(("distance threshold (px)", 0.0..last), ("share of frames", 0.0..TOP), |chart| lines(report, chart, points))
}

/// Share of right boxes by their confidence, of those setups whose confidence is a share; `None` where there is none.
pub fn calibration(report: &Report) -> Result<Option<String>, ChartError> {
    let known: Vec<(u8, Calibration)> =
        report.setups.iter().enumerate().filter_map(|(i, t)| Some((i as u8, t.mean.as_ref()?.calibration?))).collect();
    if known.is_empty() {
        return Ok(None);
    }
    let draw = |chart: &mut Chart| {
        chart.draw_series(LineSeries::new([(0.0, 0.0), (1.0, 1.0)], Ink::Ideal.stroke(HAIR)))?;
        for (i, calibration) in known.iter().rev() {
            let boxes: usize = calibration.bins.iter().map(|b| b.boxes).sum();
            let bins = || calibration.bins.iter().filter_map(|b| Some(((b.mean()?, b.share()?), b.boxes)));
            chart.draw_series(LineSeries::new(bins().map(|b| b.0), Ink::Series(*i).stroke(THIN)))?;
            let mark = |(at, count): ((f64, f64), usize)| {
                // By area, so that a bin of a tenth of all boxes looks like a tenth.
                let radius = (LARGEST_MARK * (count as f64 / boxes as f64).sqrt()).max(LEAST_MARK);
                Circle::new(at, radius as i32, Ink::Series(*i).colour().filled())
            };
            chart.draw_series(bins().map(mark))?;
        }
        Ok(())
    };
    chart(("confidence", 0.0..TOP), ("share with overlap > 0.5", 0.0..TOP), draw).map(Some)
}

/// What happened on the frames of a sequence.
pub struct Story {
    /// Overlap with the true box, one a frame; `None` where there is no true box.
    pub overlaps: Vec<Option<f64>>,
    /// Where the target is to be seen.
    pub visible: Vec<bool>,
    /// Where it was said to be lost.
    pub lost: Vec<bool>,
    /// The frames that are shown below.
    pub moments: Vec<usize>,
}

/// The overlap over the frames of a sequence, with absences and losses.
pub fn story(story: &Story) -> Result<String, ChartError> {
    let mut svg = String::new();
    {
        let root: Area = SVGBackend::with_string(&mut svg, WIDE).into_drawing_area();
        let frames = story.overlaps.len() as f64;
        let mut chart = ChartBuilder::on(&root)
            .margin(WIDE_TEXT / 2)
            .margin_right(2 * WIDE_TEXT)
            .x_label_area_size(WIDE_TEXT * 3 / 2)
            .y_label_area_size(WIDE_TEXT * 5 / 2)
            .build_cartesian_2d(1.0..frames + 1.0, 0.0..TOP)?;
        let text = ("sans-serif", WIDE_TEXT).into_font().color(&Ink::Axis.colour());
        chart
            .configure_mesh()
            .disable_x_mesh()
            .y_labels(3)
            .x_labels(12)
            .max_light_lines(0)
            .bold_line_style(Ink::Grid.stroke(HAIR))
            .axis_style(Ink::Axis.stroke(HAIR))
            .label_style(text)
            .x_label_formatter(&|v| label(*v))
            .y_label_formatter(&|v| label(*v))
            .draw()?;
        let bands = |is: &[bool], ink: Ink| {
            let band = move |(from, to): (usize, usize)| {
                Rectangle::new([(from as f64 + 1.0, 0.0), (to as f64 + 1.0, TOP)], ink.colour().filled())
            };
            runs(is).into_iter().map(band).collect::<Vec<_>>()
        };
        let absent: Vec<bool> = story.visible.iter().map(|v| !v).collect();
        chart.draw_series(bands(&absent, Ink::Absent))?;
        chart.draw_series(bands(&story.lost, Ink::Lost))?;
        for part in parts(&story.overlaps) {
            chart.draw_series(LineSeries::new(part, Ink::Overlap.stroke(THIN)))?;
        }
        let mark = |&i: &usize| {
            Circle::new((i as f64 + 1.0, story.overlaps[i].unwrap_or(0.0)), 12, Ink::Moment.colour().filled())
        };
        chart.draw_series(story.moments.iter().map(mark))?;
        root.present()?;
    }
    Ok(svg)
}

/// The runs of `true`, each from its first frame to behind its last.
fn runs(is: &[bool]) -> Vec<(usize, usize)> {
    let mut at = 0;
    let spans = is.chunk_by(|a, b| a == b).map(|run| {
        at += run.len();
        (run[0], at - run.len(), at)
    });
    spans.filter(|s| s.0).map(|s| (s.1, s.2)).collect()
}

/// The points of each run of frames that have an overlap; frames count from 1.
fn parts(overlaps: &[Option<f64>]) -> Vec<Vec<(f64, f64)>> {
    let has: Vec<bool> = overlaps.iter().map(Option::is_some).collect();
    let point = |i: usize| Some((i as f64 + 1.0, overlaps[i]?));
    runs(&has).into_iter().map(|(from, to)| (from..to).filter_map(point).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::figures::Figures;
    use crate::eval::otb::Curves;

    fn report(peers: &[bool]) -> Report {
        let mean = Figures {
            curves: Curves { precision: vec![0.5; LARGEST_DISTANCE + 1], success: vec![0.5; OVERLAP_THRESHOLDS] },
            calibration: Some(Calibration::default()),
            ..Figures::default()
        };
        let table = |(i, &peer): (usize, &bool)| Table {
            name: i.to_string(),
            peer,
            parameters: Default::default(),
            mean: Some(Figures { calibration: mean.calibration.filter(|_| !peer), ..mean.clone() }),
            spread: None,
            attributes: Vec::new(),
            sequences: Vec::new(),
        };
        let setups = peers.iter().enumerate().map(table).collect();
        Report { dataset: String::new(), starts: 1, attributes: Vec::new(), setups, halves: None }
    }

    /// Colours of lines, in the order in which they are drawn.
    fn strokes(svg: &str) -> Vec<&str> {
        let lines = svg.split("<polyline").skip(1);
        lines.filter_map(|l| l.split("stroke=\"").nth(1)?.split('"').next()).collect()
    }

    #[test]
    fn each_setup_has_a_line_and_ours_lie_on_top() {
        for svg in [success(&report(&[false, true, true])).unwrap(), precision(&report(&[false, true, true])).unwrap()]
        {
            let series: Vec<_> = strokes(&svg).into_iter().filter(|s| s.starts_with("#0100")).collect();
            assert_eq!(series, ["#010002", "#010001", "#010000"]);
            assert!(svg.contains("share of frames"));
        }
    }

    #[test]
    fn calibration_is_shown_of_those_who_have_it() {
        assert!(calibration(&report(&[true])).unwrap().is_none());
        let svg = calibration(&report(&[false, true])).unwrap().unwrap();
        assert!(svg.contains("#020002") && !svg.contains("#010001"));
    }

    #[test]
    fn a_story_shades_absences_and_losses_and_interrupts_the_line() {
        let told = Story {
            overlaps: vec![Some(1.0), Some(0.5), None, None, Some(0.5), Some(0.7)],
            visible: vec![true, true, false, false, true, true],
            lost: vec![false, false, false, true, true, false],
            moments: vec![2],
        };
        let svg = story(&told).unwrap();
        assert_eq!(strokes(&svg).iter().filter(|s| **s == "#020005").count(), 2);
        assert_eq!(svg.matches("fill=\"#020003\"").count(), 1);
        assert_eq!(svg.matches("fill=\"#020004\"").count(), 1);
        assert_eq!(svg.matches("<circle").count(), 1);
        assert_eq!(runs(&[true, false, true, true]), [(0, 1), (2, 4)]);
        assert!(runs(&[]).is_empty());
    }
}
