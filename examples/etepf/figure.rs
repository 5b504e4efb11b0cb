//! The paths as curves over time, a row for each axis and a column for each method: the paper's figure 3.

use std::error::Error;
use std::path::Path;

use long_term_tracker::Rect;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1200, 520);
const FOUND: RGBColor = RGBColor(0, 90, 200);
const TRUE: RGBColor = RGBColor(120, 120, 120);
const AXES: [&str; 2] = ["u / px", "v / px"];

/// Draws the centres of the boxes of each method (blue) over the true ones (grey).
pub fn draw(path: &Path, methods: &[(&str, &[Rect])], truth: &[Option<Rect>]) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let cells = root.split_evenly((AXES.len(), methods.len()));
    for (index, cell) in cells.iter().enumerate() {
        let (axis, (name, boxes)) = (index / methods.len(), methods[index % methods.len()]);
        // One scale for all methods.
        let found = methods.iter().flat_map(|(_, boxes)| boxes.iter());
        let top = truth.iter().flatten().chain(found).map(|r| r.centre()[axis]).fold(0.0, f64::max);
        let mut chart = ChartBuilder::on(cell)
            .caption(if axis == 0 { name } else { "" }, ("sans-serif", 18))
            .margin(8)
            .margin_right(24)
            .x_label_area_size(36)
            .y_label_area_size(44)
            .build_cartesian_2d(0..truth.len(), 0.0..1.05 * top)?;
        let description = if axis + 1 == AXES.len() { "frame" } else { "" };
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .x_desc(description)
            .y_desc(AXES[axis])
            .x_labels(6)
            .y_labels(6)
            .label_style(("sans-serif", 13))
            .draw()?;
        let wanted = truth.iter().enumerate().filter_map(|(i, t)| t.map(|t| (i + 1, t.centre()[axis])));
        chart
            .draw_series(LineSeries::new(wanted, TRUE.stroke_width(2)))?
            .label("truth")
            .legend(|(x, y)| line(x, y, TRUE));
        let found = boxes.iter().enumerate().map(|(i, b)| (i + 1, b.centre()[axis]));
        chart.draw_series(LineSeries::new(found, FOUND))?.label("estimate").legend(|(x, y)| line(x, y, FOUND));
        if index == 0 {
            let mut legend = chart.configure_series_labels();
            legend.position(SeriesLabelPosition::LowerRight);
            legend
                .label_font(("sans-serif", 13))
                .border_style(BLACK.mix(0.3))
                .background_style(WHITE.mix(0.8))
                .draw()?;
        }
    }
    root.present()?;
    Ok(())
}

/// The sample of a line in the legend.
fn line(x: i32, y: i32, colour: RGBColor) -> PathElement<(i32, i32)> {
    PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(2))
}
