//! One island: its needs and its next class.

use crate::constants::{DESCENT_SHARE, DESCENT_STEPS};
use crate::stats::EFFORT_CLASSES;

/// The facts that decide the class of an island.
#[derive(Clone, Copy, Debug)]
pub struct Island {
    /// The largest need of its contacts.
    pub largest_need: f32,
    /// The largest load that its bodies and the drives of its joints can cause (N).
    pub load: f32,
    /// The largest need of its joints and of unbalanced bodies. It is not shared among contacts.
    pub whole_need: f32,
    pub contacts: u32,
    pub bodies: u32,
    /// The speed of its fastest body (m/s).
    pub fastest: f32,
    /// The highest class of its bodies, and the fewest steps of any towards a lower class.
    pub class: u8,
    pub descent_steps: u8,
    /// Likewise the class with which the step first ran.
    pub first_class: u8,
    /// The largest gap that the step left in a joint in class 0, over the promised gap.
    pub opening: f32,
    /// Whether shorter substeps did not reduce the gap of a joint.
    pub is_stuck: bool,
}

impl Island {
    /// An island without bodies.
    pub const NONE: Self = Self {
        largest_need: 0.0,
        load: 0.0,
        whole_need: 0.0,
        contacts: 0,
        bodies: 0,
        fastest: 0.0,
        class: 0,
        descent_steps: u8::MAX,
        first_class: 0,
        opening: 0.0,
        is_stuck: false,
    };

    /// The need of the contacts that counts. A column passes its load on through one contact for each body, and sways
    /// if this contact is soft. If each body has several contacts, the load has several ways, and the others remain
    /// when one yields.
    fn counted(&self) -> f32 {
        let ways = (self.bodies as f32 / self.contacts.max(1) as f32).min(1.0);
        self.largest_need * ways * ways
    }

    /// The class with which the step is taken again, and the number of steps so far towards a lower one.
    pub fn corrected(&self, highest: u8) -> (u8, u8) {
        let wanted = class_for(self.opening).min(highest);
        let least = if self.is_stuck { self.first_class } else { self.class };
        if wanted > self.class { (wanted, 0) } else { (wanted.max(least), self.descent_steps) }
    }

    /// The next class, and the number of steps so far towards a lower one. `highest` is the highest class that the
    /// settings allow. Above the class `long_from`, fewer steps suffice.
    pub fn next(&self, highest: u8, long_from: u8) -> (u8, u8) {
        let class = self.class.min(highest);
        let need = self.counted().max(self.whole_need);
        let wanted = class_for(need).min(highest);
        if wanted >= class {
            return (wanted, 0);
        }
        // From `long_from` on, every class waits for the same number of substeps.
        let steps = u32::from(self.descent_steps) + (1 << class.saturating_sub(long_from));
        match need > DESCENT_SHARE * sag_factor(class - 1) {
            true => (class, 0),
            false if steps >= DESCENT_STEPS => (class - 1, 0),
            false => (class, steps as u8),
        }
    }
}

/// The highest class of all.
pub const HIGHEST: u8 = EFFORT_CLASSES as u8 - 1;

/// The lowest class that keeps the promise.
fn class_for(need: f32) -> u8 {
    (0..HIGHEST).find(|&class| need <= sag_factor(class)).unwrap_or(HIGHEST)
}

/// The sag of a contact in class 0 over its sag in this class.
fn sag_factor(class: u8) -> f32 {
    (1_u32 << (2 * class)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_class_is_the_lowest_that_keeps_the_promise() {
        for (need, class) in [(0.0, 0), (1.0, 0), (1.01, 1), (4.0, 1), (4.1, 2), (16.0, 2), (1e30, HIGHEST)] {
            assert_eq!(class_for(need), class, "{need}");
        }
    }

    fn island(need: f32, class: u8, descent_steps: u8) -> Island {
        Island { largest_need: need, contacts: 2, bodies: 2, class, descent_steps, ..Island::NONE }
    }

    /// The next class and the steps towards a lower one.
    fn next(island: Island, highest: u8) -> (u8, u8) {
        island.next(highest, 3)
    }

    #[test]
    fn a_class_rises_at_once_and_falls_after_half_a_second_of_calm() {
        assert_eq!(next(island(20.0, 0, 0), 3), (3, 0));
        assert_eq!(next(island(1e9, 0, 0), 3), (3, 0), "no higher than the settings allow");
        assert_eq!(next(island(80.0, 5, 0), 3).0, 3, "as high as the settings allow now");
        assert_eq!(next(island(0.0, 5, 0), 3), (3, 1), "and no lower at once");
        assert_eq!(next(island(2.1, 2, 10), 3), (2, 0), "class 1 would be near its limit");
        assert_eq!(next(island(1.9, 2, 10), 3), (2, 11));
        assert_eq!(next(island(1.9, 2, 29), 3), (1, 0));
        assert_eq!(next(island(0.0, 0, 9), 3), (0, 0));
        assert_eq!(next(island(0.0, 7, 0), 7), (7, 16));
        assert_eq!([13, 14].map(|descent_steps| next(island(0.0, 7, descent_steps), 7)), [(7, 29), (6, 0)]);
    }

    #[test]
    fn a_load_with_several_ways_needs_less_than_a_column() {
        let counted = |contacts: u32| Island { contacts, ..island(8.0, 0, 0) }.counted();
        assert_eq!([1, 2, 4, 8].map(counted), [8.0, 8.0, 2.0, 0.5]);
        let class = |whole_need: f32| next(Island { whole_need, contacts: 8, ..island(8.0, 0, 0) }, 7).0;
        assert_eq!([2.0, 5.0].map(class), [1, 2]);
    }
}
