//! Axes: linear, logarithmic, or from 0 to 1.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    Linear,
    Decades,
    /// From 0 to 1.
    Share,
}

pub(super) struct Axis {
    scale: Scale,
    ends: Range<f64>,
}

/// Largest number of decades with a key point each.
const MAX_DECADES: usize = 12;

impl Axis {
    /// The axis from the least to the largest value, with some margin.
    pub(super) fn of(scale: Scale, values: impl Iterator<Item = f64>) -> Self {
        let fits = |v: &f64| v.is_finite() && (scale != Scale::Decades || *v > 0.0);
        let ends =
            values.filter(fits).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let ends = match (scale, ends) {
            (Scale::Share, _) => 0.0..1.0,
            // Both ends must have a logarithm: 1.8e308 times 1.3 is infinite, and 1e-323 has lost its digits.
            (Scale::Decades, (low, high)) if low <= high => {
                (low / 1.3).max(f64::MIN_POSITIVE)..(high * 1.3).min(f64::MAX)
            }
            (Scale::Decades, _) => 0.1..10.0,
            (Scale::Linear, (low, high)) if low < high => low..high + 0.05 * (high - low),
            (Scale::Linear, (low, high)) if low == high => low - 0.5..high + 0.5,
            (Scale::Linear, _) => 0.0..1.0,
        };
        Self { scale, ends }
    }
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        // Values beyond the axis, such as infinity, are drawn at its end.
        let value = value.clamp(self.ends.start, self.ends.end);
        let place = |x: f64| if self.scale == Scale::Decades { x.log10() } else { x };
        let (low, high) = (place(self.ends.start), place(self.ends.end));
        limit.0 + ((place(value) - low) / (high - low) * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, hint: H) -> Vec<f64> {
        match self.scale {
            Scale::Linear => return RangedCoordf64::from(self.ends.clone()).key_points(hint),
            Scale::Share => return vec![0.0, 0.25, 0.5, 0.75, 1.0],
            Scale::Decades => {}
        }
        let (low, high) = (self.ends.start.log10().floor() as i32, self.ends.end.log10().ceil() as i32);
        // Few decades have key points between them; many decades have key points at every nth.
        let steps: &[f64] = if high - low <= 3 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let every = ((high - low) as usize).div_ceil(MAX_DECADES).max(1);
        let all = (low..=high).step_by(every).flat_map(|k| steps.iter().map(move |s| s * 10_f64.powi(k)));
        all.filter(|x| *x >= 0.999 * self.ends.start && *x <= 1.001 * self.ends.end).collect()
    }

    fn range(&self) -> Range<f64> {
        self.ends.clone()
    }
}

/// A number as a label: 0.001, 0.5, 20, 1e12.
pub(super) fn plain(x: &f64) -> String {
    if (1e-9..1e9).contains(x) || *x == 0.0 { format!("{}", (x * 1e9).round() / 1e9) } else { format!("{x:.0e}") }
}

#[cfg(test)]
mod tests {
    use plotters::coord::ranged1d::BoldPoints;

    use super::*;

    #[test]
    fn the_labels_of_an_axis_lie_between_its_ends() {
        let decades = |ends: Range<f64>| Axis { scale: Scale::Decades, ends };
        let keys = |ends| decades(ends).key_points(BoldPoints(10)).iter().map(plain).collect::<Vec<_>>();
        assert_eq!(keys(0.015..0.6), ["0.02", "0.05", "0.1", "0.2", "0.5"]);
        assert_eq!(keys(1e-3..1e3), ["0.001", "0.01", "0.1", "1", "10", "100", "1000"]);
        assert_eq!(decades(1e-3..1e3).map(&1.0, (0, 600)), 300);
        assert_eq!(keys(1e-30..1e6).len(), 13, "every third of 36 decades");
    }

    #[test]
    fn an_axis_holds_the_least_and_the_largest_number() {
        let axis = Axis::of(Scale::Decades, [f64::MAX, f64::from_bits(1), f64::INFINITY].into_iter());
        assert_eq!(axis.ends, f64::MIN_POSITIVE..f64::MAX);
        assert!(axis.key_points(BoldPoints(10)).len() <= 13);
        assert_eq!([0.0, 1e-320, 1.0, f64::MAX, f64::INFINITY].map(|x| axis.map(&x, (0, 616))), [0, 0, 308, 616, 616]);
        let axis = Axis::of(Scale::Linear, [0.0, f64::NAN, 20.0].into_iter());
        assert_eq!(([0.0, 10.5, 21.0].map(|x| axis.map(&x, (0, 100)))), [0, 50, 100]);
    }
}
