//! Time against error as SVG, and performance profiles.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;

use super::super::plot::COLORS;

/// Points of one kind, and the line along the best of them.
pub struct Series {
    /// What the legend calls it.
    pub name: String,
    /// Which color and marker.
    pub look: usize,
    /// All points, with what is written beside them.
    pub points: Vec<(f64, f64, String)>,
    /// Corners of the line.
    pub line: Vec<(f64, f64)>,
}

/// What a picture is of.
pub struct Frame<'a> {
    /// Title.
    pub title: &'a str,
    /// What x is, with its unit.
    pub x: &'a str,
    /// What y is, with its unit.
    pub y: &'a str,
    /// Whether y goes from 0 to 1 instead of over decades.
    pub share: bool,
    /// Width and height (pixels).
    pub size: (u32, u32),
}

/// An axis over decades, with a key point at each and at its half.
struct Decades(Range<f64>);

/// Most decades that have a key point each.
const MOST_DECADES: usize = 12;

/// An axis from 0 to 1.
struct Share;

impl Ranged for Decades {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let (low, high) = (self.0.start.log10(), self.0.end.log10());
        // What lies beyond the axis, such as infinity, is drawn at its end: pixels have no room for more.
        let value = value.clamp(self.0.start, self.0.end);
        limit.0 + ((value.log10() - low) / (high - low) * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, _: H) -> Vec<f64> {
        let decades = |r: &Range<f64>| (r.start.log10().floor() as i32, r.end.log10().ceil() as i32);
        let (low, high) = decades(&self.0);
        // Between decades only where there are few of them, and some decades only where there are many.
        let steps: &[f64] = if high - low <= 3 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let every = ((high - low) as usize).div_ceil(MOST_DECADES).max(1);
        let all = (low..=high).step_by(every).flat_map(|k| steps.iter().map(move |s| s * 10_f64.powi(k)));
        all.filter(|x| *x >= 0.999 * self.0.start && *x <= 1.001 * self.0.end).collect()
    }

    fn range(&self) -> Range<f64> {
        self.0.clone()
    }
}

impl Ranged for Share {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        limit.0 + (value * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, _: H) -> Vec<f64> {
        vec![0.0, 0.25, 0.5, 0.75, 1.0]
    }

    fn range(&self) -> Range<f64> {
        0.0..1.0
    }
}

/// Draws the series into one picture. Both axes are over decades, but for shares.
pub fn svg(frame: &Frame, series: &[Series]) -> String {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, frame.size).into_drawing_area();
    let points = || series.iter().flat_map(|s| s.points.iter().map(|p| (p.0, p.1)).chain(s.line.iter().copied()));
    let x = decades(points().map(|p| p.0));
    // Writing to memory does not fail.
    let drawn = match frame.share {
        true => draw(&root, frame, series, x, Share),
        false => draw(&root, frame, series, x, decades(points().map(|p| p.1))),
    };
    debug_assert!(drawn.is_ok(), "{drawn:?}");
    drop(root);
    text
}

/// From a little below the least to a little above the largest of the values.
fn decades(values: impl Iterator<Item = f64>) -> Decades {
    let fit = values.filter(|v| *v > 0.0 && v.is_finite());
    let (low, high) = fit.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    // Both ends stay numbers that have a logarithm: 1.8e308 times 1.3 is infinite, and 1e-323 has lost its digits.
    let ends = || (low / 1.3).max(f64::MIN_POSITIVE)..(high * 1.3).min(f64::MAX);
    if low <= high { Decades(ends()) } else { Decades(0.1..10.0) }
}

type Drawn = Result<(), Box<dyn std::error::Error>>;

fn draw<'a, Y>(root: &DrawingArea<SVGBackend<'a>, Shift>, frame: &Frame, series: &[Series], x: Decades, y: Y) -> Drawn
where
    Y: Ranged<ValueType = f64, FormatOption = DefaultFormatting>,
{
    root.fill(&WHITE)?;
    let right = x.0.end;
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
    // Where labels stand already.
    let mut taken: Vec<(i32, i32)> = Vec::new();
    for Series { name, look, points, line } in series {
        let color = COLORS[look % COLORS.len()];
        let stairs = stairs(line, right, frame.share);
        chart
            .draw_series(LineSeries::new(stairs, color.stroke_width(2)))?
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
    let corner =
        if frame.share { SeriesLabelPosition::LowerRight } else { emptiest(frame.size, &places.collect::<Vec<_>>()) };
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

/// The corner for the legend in which the fewest of these places are, the upper right before others.
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

/// From corner to corner along the axes: at an error, nothing faster is known. It goes on to the right end.
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

/// A circle, a triangle, a square, a diamond, an X, a cross, of some 8 pixels.
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

/// A number as people write it: 0.001, 0.5, 20, 1e12.
fn plain(x: &f64) -> String {
    if (1e-9..1e9).contains(x) || *x == 0.0 { format!("{}", (x * 1e9).round() / 1e9) } else { format!("{x:.0e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_labelled_with_what_lies_between_their_ends() {
        let keys = |low: f64, high: f64| {
            Decades(low..high)
                .key_points(plotters::coord::ranged1d::BoldPoints(10))
                .iter()
                .map(plain)
                .collect::<Vec<_>>()
        };
        assert_eq!(keys(0.015, 0.6), ["0.02", "0.05", "0.1", "0.2", "0.5"]);
        assert_eq!(keys(1e-3, 1e3), ["0.001", "0.01", "0.1", "1", "10", "100", "1000"]);
        assert_eq!(Decades(1e-3..1e3).map(&1.0, (0, 600)), 300);
        assert_eq!(keys(1e-30, 1e6).len(), 13, "every third of 36 decades");
    }

    #[test]
    fn an_axis_holds_the_least_and_the_largest_number() {
        let Decades(ends) = decades([f64::MAX, f64::from_bits(1), f64::INFINITY].into_iter());
        assert_eq!(ends, f64::MIN_POSITIVE..f64::MAX);
        let axis = Decades(ends);
        assert!(axis.key_points(plotters::coord::ranged1d::BoldPoints(10)).len() <= 13);
        assert_eq!([0.0, 1e-320, 1.0, f64::MAX, f64::INFINITY].map(|x| axis.map(&x, (0, 616))), [0, 0, 308, 616, 616]);
    }

    #[test]
    fn stairs_go_along_the_axes() {
        assert_eq!(stairs(&[(1.0, 4.0), (2.0, 3.0)], 9.0, false), [(1.0, 4.0), (2.0, 4.0), (2.0, 3.0), (9.0, 3.0)]);
        assert_eq!(stairs(&[(1.0, 0.5)], 9.0, true), [(1.0, 0.0), (1.0, 0.5), (9.0, 0.5)]);
        assert!(stairs(&[], 9.0, true).is_empty());
    }

    #[test]
    fn a_picture_names_its_series_and_survives_what_is_not_a_number() {
        for share in [false, true] {
            let frame = Frame { title: "T & t", x: "ms", y: "mm", share, size: (400, 300) };
            let of = |name: &str, look| Series {
                name: name.into(),
                look,
                points: vec![(0.1, 0.2, "8x1".into()), (0.5, f64::NAN, String::new()), (2.0, 0.1, String::new())],
                line: vec![(0.1, 0.2)],
            };
            let all: Vec<_> = (0..6).map(|look| of(&format!("name {look}"), look)).collect();
            let text = svg(&frame, &all);
            for part in ["<svg", "T &amp; t", "8x1", "name 0", "name 5"] {
                assert!(text.contains(part), "{part} is missing");
            }
            assert!(svg(&frame, &[]).contains("<svg"));
        }
    }
}
