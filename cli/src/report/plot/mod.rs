//! Plots of points and lines as SVG text.

mod axis;

use plotters::coord::Shift;
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::*;

pub use axis::Scale;
use axis::{Axis, plain};

/// Colors that differ for the color-blind too (Okabe and Ito).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

pub struct Series {
    pub name: String,
    /// Number of color and marker.
    pub look: usize,
    pub points: Vec<(f64, f64, String)>,
    /// Corners of the line: straight from one to the next if x is linear, else in stairs.
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

fn draw(root: &DrawingArea<SVGBackend, Shift>, frame: &Frame, series: &[Series], x: Axis, y: Axis) -> Drawn {
    root.fill(&WHITE)?;
    let right = x.range().end;
    let mut chart = ChartBuilder::on(root)
        .caption(frame.title, ("sans-serif", 16))
        .margin(8)
        .margin_right(16)
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
    // Positions of the labels so far.
    let mut taken: Vec<(i32, i32)> = Vec::new();
    for Series { name, look, points, line } in series {
        let color = COLORS[look % COLORS.len()];
        let path = match frame.scales {
            (Scale::Linear, _) => line.clone(),
            (_, y) => stairs(line, right, y == Scale::Share),
        };
        chart
            .draw_series(LineSeries::new(path, color.stroke_width(2)))?
            .label(name)
            .legend(move |at| EmptyElement::at(at) + marker(*look, (10, 0), color.filled()));
        for (px, py, label) in points {
            let best = line.contains(&(*px, *py));
            let style = if best { color.filled() } else { color.mix(0.35).stroke_width(1) };
            chart.plotting_area().draw(&(EmptyElement::at((*px, *py)) + marker(*look, (0, 0), style)))?;
            let (x, y) = chart.backend_coord(&(*px, *py));
            let free = taken.iter().all(|t| (t.0 - x).abs() > 28 || (t.1 - y).abs() > 12);
            if best && free && !label.is_empty() {
                taken.push((x, y));
                let style = ("sans-serif", 11).into_font().color(&color);
                chart
                    .plotting_area()
                    .draw(&(EmptyElement::at((*px, *py)) + Text::new(label.clone(), (6, -13), style)))?;
            }
        }
    }
    let places = series.iter().flat_map(|s| &s.points).map(|p| chart.backend_coord(&(p.0, p.1)));
    let corner = if frame.scales.1 == Scale::Share {
        SeriesLabelPosition::LowerRight
    } else {
        emptiest(frame.size, &places.collect::<Vec<_>>())
    };
    chart
        .configure_series_labels()
        .position(corner)
        .label_font(("sans-serif", 12))
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.2))
        .draw()?;
    root.present()?;
    Ok(())
}

/// The corner with the fewest of these places for the legend; the upper right before others.
fn emptiest((width, height): (u32, u32), places: &[(i32, i32)]) -> SeriesLabelPosition {
    use SeriesLabelPosition::{LowerLeft, LowerRight, UpperLeft, UpperRight};
    let (right, left) = ((width * 3 / 5) as i32, (width / 2) as i32);
    let (upper, lower) = ((height * 2 / 5) as i32, (height / 2) as i32);
    let in_corner = |corner: &SeriesLabelPosition, &&(x, y): &&(i32, i32)| match corner {
        UpperRight => x > right && y < upper,
        LowerLeft => x < left && y > lower,
        LowerRight => x > right && y > lower,
        _ => x < left && y < upper,
    };
    let corners = [UpperRight, LowerLeft, LowerRight, UpperLeft];
    let count = |corner: &SeriesLabelPosition| places.iter().filter(|place| in_corner(corner, place)).count();
    corners.into_iter().min_by_key(count).unwrap_or(UpperRight)
}

/// Stairs through the corners along the axes, continued to the right end.
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

/// A circle, triangle, square, diamond, X or inverted triangle of some 8 pixels.
fn marker<'a>(look: usize, at: (i32, i32), style: ShapeStyle) -> DynElement<'static, SVGBackend<'a>, (i32, i32)> {
    let around = |corners: &[(i32, i32)]| corners.iter().map(|c| (at.0 + c.0, at.1 + c.1)).collect::<Vec<_>>();
    let closed = |corners: &[(i32, i32)]| {
        let mut corners = around(corners);
        if style.filled {
            Polygon::new(corners, style).into_dyn()
        } else {
            corners.push(corners[0]);
            PathElement::new(corners, style).into_dyn()
        }
    };
    match look % COLORS.len() {
        0 => Circle::new(at, 4, style).into_dyn(),
        1 => closed(&[(-5, 4), (5, 4), (0, -5)]),
        2 => closed(&[(-4, -4), (4, -4), (4, 4), (-4, 4)]),
        3 => closed(&[(-5, 0), (0, -5), (5, 0), (0, 5)]),
        4 => Cross::new(at, 4, style.stroke_width(2)).into_dyn(),
        _ => closed(&[(-5, -4), (5, -4), (0, 5)]),
    }
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
            let of = |name: &str, look| Series {
                name: name.into(),
                look,
                points: vec![(0.1, 0.2, "8x1".into()), (0.5, f64::NAN, String::new()), (2.0, 0.1, String::new())],
                line: vec![(0.1, 0.2)],
            };
            let all: Vec<_> = (0..6).map(|look| of(&format!("name {look}"), look)).collect();
            let text = svg(&frame, &all);
            for part in ["<svg", "T &amp; t", "time ms", "depth mm", "8x1", "name 0", "name 5"] {
                assert!(text.contains(part), "{part} is missing");
            }
            assert!(svg(&frame, &[]).contains("<svg"));
        }
    }
}
