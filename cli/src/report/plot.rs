//! Line plots as SVG text.

use plotters::prelude::*;

/// Colors that differ for the color-blind too (Okabe and Ito).
pub(super) const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// One line of a plot.
pub struct Line {
    /// What the legend calls it.
    pub name: String,
    /// Its points.
    pub points: Vec<(f64, f64)>,
}

/// Axes of a plot.
pub struct Axes<'a> {
    /// Title.
    pub title: &'a str,
    /// What x is, with its unit.
    pub x: &'a str,
    /// What y is, with its unit.
    pub y: &'a str,
    /// Whether y is logarithmic; values of 0 and less are left out then.
    pub log_y: bool,
}

/// Draws the lines into one picture, 760 by 420 pixels.
pub fn svg(axes: &Axes, lines: &[Line]) -> String {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, (760, 420)).into_drawing_area();
    // Writing to memory does not fail.
    if axes.log_y {
        draw_log(&root, axes, lines)
    } else {
        draw_linear(&root, axes, lines)
    }
    drop(root);
    text
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// Smallest and largest of the values, a little apart.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low < high {
        (low, high)
    } else if low == high {
        (low - 0.5, high + 0.5)
    } else {
        (0.0, 1.0)
    }
}

macro_rules! draw {
    ($name:ident, $y:expr, $keep:expr) => {
        fn $name(root: &Area, axes: &Axes, lines: &[Line]) {
            let keep: fn(&(f64, f64)) -> bool = $keep;
            let kept = || lines.iter().flat_map(|l| &l.points).copied().filter(keep);
            let (x_low, x_high) = range(kept().map(|p| p.0));
            let (y_low, y_high) = range(kept().map(|p| p.1));
            let to_y: fn(f64, f64) -> _ = $y;
            let drawn = (|| -> Result<(), Box<dyn std::error::Error>> {
                root.fill(&WHITE)?;
                let mut chart = ChartBuilder::on(root)
                    .caption(axes.title, ("sans-serif", 18))
                    .margin(12)
                    .x_label_area_size(42)
                    .y_label_area_size(64)
                    .build_cartesian_2d(x_low..x_high, to_y(y_low, y_high))?;
                chart.configure_mesh().x_desc(axes.x).y_desc(axes.y).light_line_style(WHITE).draw()?;
                for (i, line) in lines.iter().enumerate() {
                    let color = COLORS[i % COLORS.len()];
                    let points = line.points.iter().copied().filter(keep);
                    chart
                        .draw_series(LineSeries::new(points, color.stroke_width(2)))?
                        .label(&line.name)
                        .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
                }
                chart
                    .configure_series_labels()
                    .position(SeriesLabelPosition::UpperRight)
                    .background_style(WHITE.mix(0.85))
                    .border_style(BLACK.mix(0.3))
                    .draw()?;
                root.present()?;
                Ok(())
            })();
            debug_assert!(drawn.is_ok(), "{drawn:?}");
        }
    };
}

draw!(draw_linear, |low, high| low..high + 0.05 * (high - low), |p| p.0.is_finite() && p.1.is_finite());
draw!(draw_log, |low, high| (low..high * 1.5).log_scale(), |p| p.0.is_finite() && p.1 > 0.0 && p.1.is_finite());

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_names_its_axes_and_its_lines() {
        let line = |name: &str| Line { name: name.into(), points: vec![(0.0, 0.0), (1.0, 0.1), (2.0, 10.0)] };
        for log_y in [false, true] {
            let text = svg(&Axes { title: "T", x: "time s", y: "depth mm", log_y }, &[line("soft"), line("hard")]);
            for part in ["<svg", "time s", "depth mm", "soft", "hard"] {
                assert!(text.contains(part), "{part} is missing");
            }
        }
    }

    #[test]
    fn an_empty_plot_is_drawn_all_the_same() {
        assert!(svg(&Axes { title: "T", x: "x", y: "y", log_y: true }, &[]).contains("<svg"));
    }
}
