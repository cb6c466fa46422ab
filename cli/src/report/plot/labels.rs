//! Finds places for labels that overlap neither the drawing nor other labels.

use std::ops::Range;

type Place = (i32, i32);

/// A box: its upper left and lower right corner (pixels).
type Area = (Place, Place);

/// The area for labels, and the parts of it that are taken.
pub(super) struct Labels {
    inside: Area,
    taken: Vec<Area>,
    segments: Vec<(Place, Place)>,
}

impl Labels {
    pub(super) fn new(columns: Range<i32>, rows: Range<i32>) -> Self {
        Self { inside: ((columns.start, rows.start), (columns.end, rows.end)), taken: Vec::new(), segments: Vec::new() }
    }

    pub(super) fn keep_off_path(&mut self, path: &[Place]) {
        self.segments.extend(path.windows(2).map(|pair| (pair[0], pair[1])));
    }

    pub(super) fn keep_off_mark(&mut self, (x, y): Place) {
        self.taken.push(((x - 5, y - 5), (x + 5, y + 5)));
    }

    /// The upper left corner for a label of this size beside a mark; `None` if there is no room. The place is taken
    /// from then on.
    pub(super) fn free(&mut self, (x, y): Place, (width, height): (i32, i32)) -> Option<Place> {
        let (left, right, above, below) = (x - width - 6, x + 7, y - height - 4, y + 5);
        let corners = [
            (right, above),
            (left, below),
            (left, above),
            (right, below),
            (x - width / 2, above - 3),
            (x - width / 2, below + 3),
            (right, y - height / 2),
            (left, y - height / 2),
        ];
        let fits = |corner: &Place| {
            let area = (*corner, (corner.0 + width, corner.1 + height));
            let ((left, upper), (right, lower)) = self.inside;
            area.0.0 >= left
                && area.0.1 >= upper
                && area.1.0 <= right
                && area.1.1 <= lower
                && !self.taken.iter().any(|other| overlap(area, *other))
                && !self.segments.iter().any(|&segment| crosses(segment, area))
        };
        let corner = corners.into_iter().find(fits)?;
        // Keep some space to the next label.
        self.taken.push(((corner.0 - 3, corner.1), (corner.0 + width + 3, corner.1 + height)));
        Some(corner)
    }
}

fn overlap(a: Area, b: Area) -> bool {
    a.0.0 < b.1.0 && b.0.0 < a.1.0 && a.0.1 < b.1.1 && b.0.1 < a.1.1
}

/// Whether a segment comes within two pixels of an area.
fn crosses(((ax, ay), (bx, by)): (Place, Place), area: Area) -> bool {
    const SPACE: i32 = 2;
    let (low, high) = ((area.0.0 - SPACE, area.0.1 - SPACE), (area.1.0 + SPACE, area.1.1 + SPACE));
    // The interval of the segment, as shares of its length, between each pair of sides.
    let within = |from: i32, to: i32, low: i32, high: i32| {
        let [from, to, low, high] = [from, to, low, high].map(f64::from);
        let shares = if from == to {
            if (low..=high).contains(&from) { (0.0, 1.0) } else { (1.0, 0.0) }
        } else {
            let (a, b) = ((low - from) / (to - from), (high - from) / (to - from));
            (a.min(b), a.max(b))
        };
        (f64::max(shares.0, 0.0), f64::min(shares.1, 1.0))
    };
    let (x, y) = (within(ax, bx, low.0, high.0), within(ay, by, low.1, high.1));
    x.0.max(y.0) <= x.1.min(y.1)
}

/// Ascending places, moved as little as possible until they are `space` apart and within `range`, if they all fit
/// there.
pub(super) fn apart(places: &[i32], space: i32, range: Range<i32>) -> Vec<i32> {
    let mut all = places.to_vec();
    let mut least = range.start;
    for place in &mut all {
        *place = (*place).max(least);
        least = *place + space;
    }
    let mut most = range.end;
    for place in all.iter_mut().rev() {
        *place = (*place).min(most);
        most = *place - space;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_on_no_mark_no_line_and_no_other_label() {
        let mut labels = Labels::new(0..100, 0..100);
        labels.keep_off_mark((50, 50));
        assert_eq!(labels.free((50, 50), (20, 10)), Some((57, 36)));
        // The second label avoids the first.
        assert_eq!(labels.free((50, 50), (20, 10)), Some((24, 55)));
        labels.keep_off_path(&[(0, 40), (48, 40), (48, 0)]);
        assert_eq!(labels.free((50, 50), (20, 10)), Some((57, 55)), "not above on the left, where a line is");
        // There is no room to the left, to the right or above a mark in the corner of a full picture.
        let mut full = Labels::new(0..100, 0..100);
        full.keep_off_path(&[(0, 12), (30, 12), (0, 0)]);
        assert_eq!(full.free((4, 4), (30, 10)), None);
    }

    #[test]
    fn slanted_lines_count_where_they_are() {
        let area = ((10, 10), (20, 20));
        assert!(crosses(((0, 30), (30, 0)), area) && !crosses(((0, 60), (60, 0)), area));
        assert!(crosses(((15, 0), (15, 9)), area) && !crosses(((15, 0), (15, 7)), area));
    }

    #[test]
    fn names_are_moved_apart_as_little_as_needed() {
        assert_eq!(apart(&[10, 50, 52], 15, 0..100), [10, 50, 65]);
        assert_eq!(apart(&[95, 96, 97], 15, 0..100), [70, 85, 100]);
        assert!(apart(&[], 15, 0..100).is_empty());
    }
}
