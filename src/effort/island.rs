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
    /// The deepest overlap of its contacts, over the promise, where it asks for more; else 0.
    pub overlap: f32,
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
    /// Its deepest overlap when its class changed in the hope of less; 0 where the class may rise.
    pub overlapped: f32,
}

impl Island {
    /// An island without bodies.
    pub const NONE: Self = Self {
        needs: Needs::NONE,
        overlap: 0.0,
        whole_need: 0.0,
        contacts: 0,
        bodies: 0,
        has_joints: false,
        is_heap: false,
        fastest: 0.0,
        class: 0,
        calm_for: u8::MAX,
        overlapped: 0.0,
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

    /// Whether its contacts ask for a class above its own.
    pub fn asks_for_more(&self, highest: u8) -> bool {
        let of_contacts = self.counted(self.needs);
        of_contacts > self.whole_need && class_for(of_contacts) > self.class.min(highest)
    }

    /// The next class, for how many steps the island has been calm or waited, and its deepest overlap when the class changed in the hope of less.
    /// `highest` is the highest class that the settings allow; from class `judged_from` on a class has to lessen the overlap.
    pub fn next(&self, highest: u8, judged_from: u8) -> (u8, u8, f32) {
        let (of_contacts, class) = (self.counted(self.needs), self.class.min(highest));
        let need = of_contacts.max(self.whole_need);
        let wanted = class_for(need);
        let is_last = self.calm_for + 1 >= CALM_STEPS;
        let (waits, before) =
            ((class, self.calm_for.saturating_add(1).min(CALM_STEPS), self.overlapped), self.overlapped);
        if wanted > class {
            let overlap =
                if of_contacts > self.whole_need && self.overlap > JUDGED_OVERLAP { self.overlap } else { 0.0 };
            let is_less = overlap < HELPS * before;
            let is_more = HELPS * overlap >= before && class < highest;
            return match overlap > 0.0 && before > 0.0 {
                true if self.calm_for < SETTLING_STEPS => waits,
                true if is_less && class == highest => waits,
                // More substeps do not help.
                true if !is_less && !is_more && is_last && class > 0 => (class - 1, 0, overlap),
                true if !is_less && !is_more => waits,
                _ if class == highest => (class, 0, before),
                _ => (wanted.min(highest), 0, if class + 1 >= judged_from { overlap } else { 0.0 }),
            };
        }
        if wanted == class {
            return (class, 0, if class > 0 { before } else { 0.0 });
        }
        // The same number of substeps in each of the classes that are judged.
        let calm = u32::from(self.calm_for) + (1 << class.saturating_sub(judged_from));
        match need > CALM_SHARE * sag_factor(class - 1) {
            true => (class, 0, before),
            false if calm >= CALM_STEPS.into() => (class - 1, 0, 0.0),
            false => (class, calm as u8, 0.0),
        }
    }
}

/// Contacts a body from which on an island is a heap, and below which it is none again. Pyramids, walls and towers of planks have 1 to 2.0
/// contacts a body, piles of equal boxes 3.3, piles of mixed boxes 2.5.
const HEAP_BEGINS: f32 = 2.25;
const HEAP_LEAVES: f32 = 2.1;
/// Steps after which an island goes down one class, from the lowest class that is judged or a class below; half as many from each class above.
const CALM_STEPS: u8 = 60;
/// Steps from a change of class until the overlap is judged.
const SETTLING_STEPS: u8 = 4;
/// The share of the promise that the lower class has to keep.
const CALM_SHARE: f32 = 0.5;
/// The overlap above which a class is judged by it, over the promise.
const JUDGED_OVERLAP: f32 = 0.1;
/// The share that a class may leave of the overlap of the class below. What bears a load overlaps by a quarter; bodies that others hold inside of each
/// other overlap as before, and what bears a load that grew overlaps by more.
const HELPS: f32 = 0.5;
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
        let (class, calm_for, _) = island.next(highest, 3);
        (class, calm_for)
    }

    #[test]
    fn a_class_rises_at_once_and_falls_after_a_second_of_calm() {
        assert_eq!(next(island(20.0, 0, 0), 3), (3, 0));
        assert_eq!(next(island(1e9, 0, 0), 3), (3, 0), "no higher than the settings allow");
        assert_eq!(next(island(80.0, 5, 0), 3).0, 3, "as high as the settings allow now");
        assert_eq!(next(island(0.0, 5, 0), 3), (3, 1), "and no lower at once");
        assert_eq!(next(island(2.1, 2, 30), 3), (2, 0), "class 1 would be near its limit");
        assert_eq!(next(island(1.9, 2, 30), 3), (2, 31));
        assert_eq!(next(island(1.9, 2, CALM_STEPS - 1), 3), (1, 0));
        assert_eq!(next(island(0.0, 0, 9), 3), (0, 0));
        assert_eq!(next(island(0.0, 7, 0), 7), (7, 16));
        assert_eq!([43, 44].map(|calm_for| next(island(0.0, 7, calm_for), 7)), [(7, 59), (6, 0)]);
    }

    /// What bears a load overlaps by a quarter in the next class, bodies that are held inside of each other overlap as before in any class.
    #[test]
    fn a_class_that_does_not_lessen_the_overlap_falls_again() {
        let asks = |overlap: f32, class: u8, overlapped: f32| Island {
            overlap,
            overlapped,
            ..island(2.0 * sag_factor(class), class, SETTLING_STEPS)
        };
        assert_eq!(asks(10.0, 1, 0.0).next(7, 3), (2, 0, 0.0), "below the class from which classes are judged");
        assert_eq!(asks(2.0, 2, 0.0).next(7, 3), (3, 0, 2.0));
        assert_eq!(Island { calm_for: 3, ..asks(2.5, 3, 10.0) }.next(7, 3), (3, 4, 10.0), "too soon to be judged");
        assert_eq!(asks(2.5, 3, 10.0).next(7, 3), (4, 0, 2.5), "a load");
        assert_eq!(asks(0.01, 3, 10.0).next(7, 3), (4, 0, 0.0), "a load that preloads lifted");
        assert_eq!(asks(2.5, 7, 10.0).next(7, 3), (7, 5, 10.0), "a load above the most");
        assert_eq!(asks(10.0, 3, 10.0).next(7, 3), (3, 5, 10.0), "held");
        assert_eq!(asks(30.0, 7, 10.0).next(7, 3), (7, 5, 10.0), "held, with the most substeps");
        let held = |class: u8| Island { calm_for: CALM_STEPS - 1, ..asks(9.0, class, 10.0) };
        assert_eq!([3, 2, 1].map(|class| held(class).next(7, 3)), [2, 1, 0].map(|class| (class, 0, 9.0)));
        assert_eq!(held(0).next(7, 3), (0, CALM_STEPS, 10.0));
        assert_eq!(asks(20.0, 0, 10.0).next(7, 3).0, 1, "a load that grew");
        let free = Island { overlapped: 10.0, ..island(0.9, 0, 0) };
        assert_eq!(free.next(7, 3), (0, 0, 0.0));
        let joined = Island { whole_need: 1e6, ..asks(10.0, 3, 10.0) };
        assert_eq!(joined.next(7, 3), (7, 0, 0.0), "joints are not judged by what contacts overlap");
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
