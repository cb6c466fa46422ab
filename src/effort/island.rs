//! One island: its needs, whether it is a heap, and its next class.

use crate::stats::EFFORT_CLASSES;

/// Numbers of the contacts of an island.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Needs {
    pub largest: f32,
    /// The sum of their squares.
    pub squares: f32,
}

impl Needs {
    const NONE: Self = Self { largest: 0.0, squares: 0.0 };

    pub fn add(&mut self, need: f32) {
        self.largest = self.largest.max(need);
        self.squares += need * need;
    }
}

/// What decides the class of an island.
#[derive(Clone, Copy, Debug)]
pub struct Island {
    /// The needs of its contacts.
    pub needs: Needs,
    /// What its bodies and the drives of its joints can be as a load (N).
    pub load: f32,
    /// The largest need of its joints, and of restless bodies: no other contact takes load from them.
    pub whole_need: f32,
    pub contacts: u32,
    pub bodies: u32,
    pub has_joints: bool,
    /// Whether any of its bodies was part of a heap.
    pub is_heap: bool,
    /// The speed of its fastest body (m/s).
    pub fastest: f32,
    /// The highest class of its bodies, and the fewest steps for which any was calm.
    pub class: u8,
    pub calm_for: u8,
}

impl Island {
    /// An island without bodies.
    pub const NONE: Self = Self {
        needs: Needs::NONE,
        load: 0.0,
        whole_need: 0.0,
        contacts: 0,
        bodies: 0,
        has_joints: false,
        is_heap: false,
        fastest: 0.0,
        class: 0,
        calm_for: u8::MAX,
    };

    /// The need that counts. A column hands its load on through one contact a body and sways where that contact is soft; with several
    /// contacts a body, the load of a contact has other ways. A heap stands with any springs, and its root mean square counts.
    fn counted(&self, needs: Needs) -> f32 {
        let contacts = self.contacts.max(1) as f32;
        if self.is_heap {
            (needs.squares / contacts).sqrt()
        } else {
            needs.largest * (self.bodies as f32 / contacts).min(1.0)
        }
    }

    /// Whether it is a heap now. Islands with joints are none.
    pub fn becomes_heap(&self) -> bool {
        let least = if self.is_heap { HEAP_LEAVES } else { HEAP_BEGINS };
        !self.has_joints && self.contacts as f32 > least * self.bodies as f32
    }

    /// The next class, and for how many steps the island has been calm. `highest` is the highest class that the settings allow; above class
    /// `long_from` fewer steps suffice.
    pub fn next(&self, highest: u8, long_from: u8) -> (u8, u8) {
        let class = self.class.min(highest);
        let need = self.counted(self.needs).max(self.whole_need);
        let wanted = class_for(need).min(highest);
        if wanted >= class {
            return (wanted, 0);
        }
        // The same number of substeps in each of the classes from `long_from` on.
        let calm = u32::from(self.calm_for) + (1 << class.saturating_sub(long_from));
        match need > CALM_SHARE * sag_factor(class - 1) {
            true => (class, 0),
            false if calm >= CALM_STEPS => (class - 1, 0),
            false => (class, calm as u8),
        }
    }
}

/// Contacts a body from which on an island is a heap, and below which it is none again. Pyramids, walls and towers of planks have 1 to 2.0
/// contacts a body, piles of equal boxes 3.3, piles of mixed boxes 2.5.
const HEAP_BEGINS: f32 = 2.25;
const HEAP_LEAVES: f32 = 2.1;
/// Steps after which an island goes down one class, up to the class from which on fewer suffice; half as many from each class above.
const CALM_STEPS: u32 = 60;
/// The share of the promise that the lower class has to keep.
const CALM_SHARE: f32 = 0.5;
/// The highest class of all.
pub const HIGHEST: u8 = EFFORT_CLASSES as u8 - 1;

/// The lowest class that keeps the promise.
fn class_for(need: f32) -> u8 {
    (0..HIGHEST).find(|&class| need <= sag_factor(class)).unwrap_or(HIGHEST)
}

/// How much deeper a contact would sag in class 0 than in this class.
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

    fn needs(of_all: f32, contacts: u32) -> Needs {
        Needs { largest: of_all, squares: contacts as f32 * of_all * of_all }
    }

    fn island(need: f32, class: u8, calm_for: u8) -> Island {
        Island { needs: needs(need, 2), contacts: 2, bodies: 2, class, calm_for, ..Island::NONE }
    }

    /// The next class and the steps of calm.
    fn next(island: Island, highest: u8) -> (u8, u8) {
        island.next(highest, 3)
    }

    #[test]
    fn a_class_rises_at_once_and_falls_after_a_second_of_calm() {
        assert_eq!(next(island(20.0, 0, 0), 3), (3, 0));
        assert_eq!(next(island(1e9, 0, 0), 3), (3, 0), "no higher than the settings allow");
        assert_eq!(next(island(80.0, 5, 0), 3).0, 3, "as high as the settings allow now");
        assert_eq!(next(island(0.0, 5, 0), 3), (3, 1), "and no lower at once");
        assert_eq!(next(island(2.1, 2, 30), 3), (2, 0), "class 1 would be near its limit");
        assert_eq!(next(island(1.9, 2, 30), 3), (2, 31));
        assert_eq!(next(island(1.9, 2, 59), 3), (1, 0));
        assert_eq!(next(island(0.0, 0, 9), 3), (0, 0));
        assert_eq!(next(island(0.0, 7, 0), 7), (7, 16));
        assert_eq!([43, 44].map(|calm_for| next(island(0.0, 7, calm_for), 7)), [(7, 59), (6, 0)]);
    }

    /// Contacts that come and go change nothing, and joints hold what is no heap.
    #[test]
    fn many_contacts_a_body_make_a_heap() {
        let island = |contacts: u32, is_heap: bool| Island { contacts, bodies: 100, is_heap, ..Island::NONE };
        assert!(!island(225, false).becomes_heap() && island(226, false).becomes_heap());
        assert!(island(211, true).becomes_heap() && !island(209, true).becomes_heap());
        assert!(!Island { has_joints: true, ..island(400, true) }.becomes_heap());
        let squares = 9.0 * 400.0;
        assert_eq!(island(400, true).counted(Needs { largest: 60.0, squares }), 3.0);
    }

    #[test]
    fn a_heap_needs_less_than_a_column() {
        let counted = |contacts: u32| Island { contacts, ..island(8.0, 0, 0) }.counted(needs(8.0, contacts));
        assert_eq!([1, 2, 8].map(counted), [8.0, 8.0, 2.0]);
        let class = |whole_need: f32| next(Island { whole_need, contacts: 8, ..island(8.0, 0, 0) }, 7).0;
        assert_eq!([2.0, 5.0].map(class), [1, 2]);
    }
}
