//! Plots of points and lines as SVG text.

mod axis;
mod labels;
mod look;

use plotters::coord::Shift;
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::*;

pub use axis::Scale;
use axis::{Axis, plain};
use labels::{Labels, apart};
pub use look::{Look, engine_color};
use look::{dashes, mark};

pub struct Series {
    pub name: String,
    pub look: Look,
    pub points: Vec<(f64, f64, String)>,
    /// Corners of the line. They are connected straight if x is linear, else in stairs.
    pub line: Vec<(f64, f64)>,
}

pub struct Frame<'a> {
    pub title: &'a str,
    /// Quantities of the axes, with units.
    pub x: &'a str,
    pub y: &'a str,
    pub scales: (Scale, Scale),
    /// Width and height (pixels).
    pub size: (u32, u32),
}

pub fn svg(frame: &Frame, series: &[Series]) -> String {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, frame.size).into_drawing_area();
    let points = || series.iter().flat_map(|s| s.points.iter().map(|p| (p.0, p.1)).chain(s.line.iter().copied()));
    let (x, y) = (Axis::of(frame.scales.0, points().map(|p| p.0)), Axis::of(frame.scales.1, points().map(|p| p.1)));
    // Writing to memory cannot fail.
    let drawn = draw(&root, frame, series, x, y);
    debug_assert!(drawn.is_ok(), "{drawn:?}");
    drop(root);
    text
}

/// Pictures of one size in rows of `columns`.
pub fn grid(pictures: &[String], columns: usize) -> String {
    let size = |name: &str| {
        let of = |p: &String| p.split(&format!(" {name}=\"")).nth(1)?.split('"').next()?.parse::<usize>().ok();
        pictures.first().and_then(of).unwrap_or(0)
    };
    let (width, height) = (size("width"), size("height"));
    let rows = pictures.len().div_ceil(columns);
    let (w, h) = (width * columns.min(pictures.len()), height * rows);
    let mut all =
        format!("<svg width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" xmlns=\"http://www.w3.org/2000/svg\">\n");
    for (i, picture) in pictures.iter().enumerate() {
        let (x, y) = (i % columns * width, i / columns * height);
        all.push_str(&picture.replacen("<svg ", &format!("<svg x=\"{x}\" y=\"{y}\" "), 1));
    }
    all + "</svg>\n"
}

type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Pixels between the lines of the legend, and of its marks before the names.
const LINE: i32 = 15;
const SIGN: i32 = 34;

/// Height and mean width of a letter in fonts of 12 and 11 pixels (pixels).
const LETTER: (i32, f64) = (12, 6.6);
const SMALL: (i32, f64) = (11, 6.0);

fn width(text: &str, (_, letter): (i32, f64)) -> i32 {
    (text.chars().count() as f64 * letter).ceil() as i32
}

fn draw(root: &DrawingArea<SVGBackend, Shift>, frame: &Frame, series: &[Series], x: Axis, y: Axis) -> Drawn {
    root.fill(&WHITE)?;
    let right = x.range().end;
    let drawn = || series.iter().filter(|s| !(s.points.is_empty() && s.line.is_empty()));
    let names = drawn().map(|s| width(&s.name, LETTER)).max().unwrap_or(0);
    let mut chart = ChartBuilder::on(root)
        .caption(frame.title, ("sans-serif", 16))
        .margin(8)
        .margin_right(if names > 0 { names + SIGN + 12 } else { 16 })
        .x_label_area_size(40)
        .y_label_area_size(58)
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .x_desc(frame.x)
        .y_desc(frame.y)
        .x_label_formatter(&plain)
        .y_label_formatter(&plain)
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .label_style(("sans-serif", 12))
        .axis_desc_style(("sans-serif", 13))
        .draw()?;
    let path = |line: &[(f64, f64)]| match frame.scales {
        (Scale::Linear, _) => line.to_vec(),
        (_, y) => stairs(line, right, y == Scale::Share),
    };
    let paths: Vec<Vec<_>> =
        series.iter().map(|s| path(&s.line).iter().map(|point| chart.backend_coord(point)).collect()).collect();
    let places: Vec<Vec<_>> =
        series.iter().map(|s| s.points.iter().map(|p| chart.backend_coord(&(p.0, p.1))).collect()).collect();
    let (columns, rows) = chart.plotting_area().get_pixel_range();
    let mut labels = Labels::new(columns.clone(), rows.clone());
    paths.iter().for_each(|path| labels.keep_off_path(path));
    places.iter().flatten().for_each(|&place| labels.keep_off_mark(place));
    for ((Series { look, points, line, .. }, path), places) in series.iter().zip(&paths).zip(&places) {
        for piece in dashes(*look, path) {
            root.draw(&PathElement::new(piece, look.color().stroke_width(2)))?;
        }
        for ((px, py, label), &place) in points.iter().zip(places) {
            let best = line.contains(&(*px, *py));
            let style = if best { look.color().filled() } else { look.color().mix(0.35).stroke_width(1) };
            root.draw(&mark(*look, place, style))?;
            let free = if best { labels.free(place, (width(label, SMALL), SMALL.0)) } else { None };
            if let Some(at) = free.filter(|_| !label.is_empty()) {
                root.draw(&Text::new(label.clone(), at, ("sans-serif", SMALL.0).into_font().color(&look.text())))?;
            }
        }
    }
    // Beside the plot, each name stands where its curve ends.
    let ends = paths.iter().zip(&places).map(|(path, places)| path.last().or(places.last()).map(|end| end.1));
    let mut legend: Vec<_> = series.iter().zip(ends).filter_map(|(s, end)| Some((end?, s))).collect();
    legend.sort_by_key(|(end, _)| *end);
    let middles = apart(&legend.iter().map(|(end, _)| *end).collect::<Vec<_>>(), LINE, rows);
    for ((end, Series { name, look, .. }), middle) in legend.iter().zip(middles) {
        let (edge, sign) = (columns.end, (columns.end + SIGN - 10, middle));
        root.draw(&PathElement::new([(edge + 1, *end), (edge + 12, middle), (sign.0, middle)], look.color().mix(0.6)))?;
        root.draw(&mark(*look, sign, look.color().filled()))?;
        let style = ("sans-serif", LETTER.0).into_font().color(&look.text());
        root.draw(&Text::new(name.clone(), (sign.0 + 10, middle - 7), style))?;
    }
    root.present()?;
    Ok(())
}

/// Stairs through the corners along the axes, extended to the right end.
fn stairs(line: &[(f64, f64)], right: f64, rising: bool) -> Vec<(f64, f64)> {
    let mut stairs = Vec::new();
    for (i, &(x, y)) in line.iter().enumerate() {
        match (i.checked_sub(1), rising) {
            (Some(before), _) => stairs.push((x, line[before].1)),
            (None, true) => stairs.push((x, 0.0)),
            (None, false) => {}
        }
        stairs.push((x, y));
    }
    stairs.extend(line.last().map(|&(_, y)| (right, y)));
    stairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stairs_go_along_the_axes() {
        assert_eq!(stairs(&[(1.0, 4.0), (2.0, 3.0)], 9.0, false), [(1.0, 4.0), (2.0, 4.0), (2.0, 3.0), (9.0, 3.0)]);
        assert_eq!(stairs(&[(1.0, 0.5)], 9.0, true), [(1.0, 0.0), (1.0, 0.5), (9.0, 0.5)]);
        assert!(stairs(&[], 9.0, true).is_empty());
    }

    #[test]
    fn a_picture_names_its_axes_and_series_and_skips_nan() {
        use Scale::{Decades, Linear, Share};
        for scales in [(Decades, Decades), (Decades, Share), (Linear, Linear), (Linear, Decades)] {
            let frame = Frame { title: "T & t", x: "time ms", y: "depth mm", scales, size: (400, 300) };
            let of = |name: &str, look: Look| Series {
                name: name.into(),
                look,
                points: vec![(0.1, 0.2, "8x1".into()), (0.5, f64::NAN, String::new()), (2.0, 0.1, String::new())],
                line: vec![(0.1, 0.2)],
            };
            let all: Vec<_> = (0..6).map(|k| of(&format!("name {k}"), Look::nth(k))).collect();
            let text = svg(&frame, &all);
            for part in ["<svg", "T &amp; t", "time ms", "depth mm", "8x1", "name 0", "name 5"] {
                assert!(text.contains(part), "{part} is missing");
            }
            assert!(svg(&frame, &[]).contains("<svg"));
        }
    }

    /// Each name appears once beside the plot, in the order of the ends of the curves.
    #[test]
    fn names_stand_beside_the_ends_of_their_curves() {
        let frame = Frame { title: "t", x: "x", y: "y", scales: (Scale::Linear, Scale::Linear), size: (400, 300) };
        let of = |name: &str, look, end| {
            let line = vec![(0.0, 1.0), (1.0, end)];
            Series { name: name.into(), look, points: Vec::new(), line }
        };
        let all = [("low", 0.0), ("high", 9.0), ("also high", 9.0)];
        let all: Vec<_> = (0..).zip(all).map(|(k, (name, end))| of(name, Look::nth(k), end)).collect();
        let text = svg(&frame, &all);
        let place = |name: &str| {
            let before = text.split(&format!("\n{name}\n</text>")).next().expect("a name");
            let tag = &before[before.rfind("<text").expect("a tag")..];
            let of = |key: &str| tag.split(&format!("{key}=\"")).nth(1)?.split('"').next()?.parse::<i32>().ok();
            (of(" x").expect("a place"), of(" y").expect("a place"))
        };
        let (low, high, also) = (place("low"), place("high"), place("also high"));
        assert!(low.0 == high.0 && high.0 > 280, "{low:?} {high:?}");
        assert!(high.1 < 60 && low.1 > 200 && also.1 - high.1 >= LINE, "{high:?} {also:?} {low:?}");
    }
}
