//! Colors, marks and lines of series. An engine has the same look in every picture.

use plotters::prelude::*;

/// Colors that color-blind readers can distinguish too (Okabe and Ito).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// The engines, in the order of their colors and marks.
const ENGINES: [&str; 6] = ["drystone", "rapier", "box3d", "physx", "another", "bullet"];

/// Color of an engine in pictures: red, green and blue.
pub fn engine_color(name: &str) -> (u8, u8, u8) {
    let RGBColor(r, g, b) = Look::of_engine(name).color();
    (r, g, b)
}

/// Color and mark of a series, and whether its line is dashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    number: usize,
    dashed: bool,
}

impl Look {
    /// One of six different looks.
    pub const fn nth(k: usize) -> Self {
        Self { number: k % COLORS.len(), dashed: false }
    }

    /// The look of an engine.
    pub fn of_engine(name: &str) -> Self {
        let another = ENGINES.iter().position(|&engine| engine == "another");
        Self::nth(ENGINES.iter().position(|&engine| engine == name).or(another).unwrap_or(0))
    }

    /// The same color and mark with a dashed line, for other settings of the same engine.
    pub const fn dashed(self) -> Self {
        Self { dashed: true, ..self }
    }

    pub fn color(self) -> RGBColor {
        COLORS[self.number]
    }

    /// The color, darkened for text.
    pub(super) fn text(self) -> RGBColor {
        let RGBColor(r, g, b) = self.color();
        let [r, g, b] = [r, g, b].map(|channel| (f64::from(channel) * 0.75) as u8);
        RGBColor(r, g, b)
    }
}

/// The parts of a path to draw: all of it, or dashes.
pub(super) fn dashes(look: Look, path: &[(i32, i32)]) -> Vec<Vec<(i32, i32)>> {
    const DASH: f64 = 6.0;
    if !look.dashed {
        return vec![path.to_vec()];
    }
    let (mut pieces, mut walked) = (Vec::new(), 0.0);
    for pair in path.windows(2) {
        let [from, to] = [pair[0], pair[1]].map(|(x, y)| (f64::from(x), f64::from(y)));
        let length = (to.0 - from.0).hypot(to.1 - from.1);
        let at = |along: f64| {
            let share = along / length;
            ((from.0 + share * (to.0 - from.0)).round() as i32, (from.1 + share * (to.1 - from.1)).round() as i32)
        };
        // Every second interval of the whole path, clipped to this segment.
        let first = (walked / (2.0 * DASH)).floor() as i64;
        let last = ((walked + length) / (2.0 * DASH)).floor() as i64;
        for k in first..=last {
            let begin = (2.0 * DASH * k as f64 - walked).max(0.0);
            let end = (2.0 * DASH * k as f64 + DASH - walked).min(length);
            if begin < end {
                pieces.push(vec![at(begin), at(end)]);
            }
        }
        walked += length;
    }
    pieces
}

/// A circle, triangle, square, diamond, X or inverted triangle of about 8 pixels.
pub(super) fn mark<'a>(
    look: Look,
    at: (i32, i32),
    style: ShapeStyle,
) -> DynElement<'static, SVGBackend<'a>, (i32, i32)> {
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
    match look.number {
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
    fn engines_have_looks_of_their_own() {
        let looks = ENGINES.map(|name| Look::of_engine(name).number);
        assert_eq!(looks, [0, 1, 2, 3, 4, 5]);
        assert_eq!(Look::of_engine("unheard of"), Look::nth(4));
        assert_eq!(Look::of_engine("rapier").dashed().color(), Look::of_engine("rapier").color());
    }

    #[test]
    fn dashes_cover_half_of_a_path_around_its_corners() {
        let path = [(0, 0), (60, 0), (60, 30), (60, 30)];
        let length = |pieces: Vec<Vec<(i32, i32)>>| -> i32 {
            pieces.iter().flat_map(|p| p.windows(2)).map(|w| (w[1].0 - w[0].0).abs() + (w[1].1 - w[0].1).abs()).sum()
        };
        assert_eq!(length(dashes(Look::nth(0), &path)), 90);
        // 0 to 6, 12 to 18, ..., 84 to 90.
        assert_eq!(length(dashes(Look::nth(0).dashed(), &path)), 48);
        assert!(dashes(Look::nth(0).dashed(), &[]).is_empty());
    }
}
