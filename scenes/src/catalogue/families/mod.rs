//! Families of random worlds. Statics or a closed form gives the law of each world. A family and a seed determine one
//! world, the same on every machine.

mod dominoes;
mod draw;
mod moving;
mod standing;

use glam::{DVec3, Vec3};

use self::draw::Draw;
use crate::scene::Scene;
use drystone::stages::error::input;
use drystone::{Result, named};

/// A family of random worlds whose outcome follows from statics or a closed form.
///
/// ```
/// use drystone_scenes::Family;
///
/// let family: Family = "slopes".parse()?;
/// assert!(Family::ALL.contains(&family) && family.summary().contains("friction"));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Family {
    /// Boxes of random sizes and densities on top of each other.
    Stacks,
    /// Equal boxes, each shifted the same way.
    LeanedTowers,
    /// Semicircular arches of wedges.
    Arches,
    /// Houses of cards.
    CardHouses,
    /// Towers of planks.
    PlankTowers,
    /// Rows of dominoes.
    Dominoes,
    /// Chains and nets with a heavy end.
    Chains,
    /// A block on a slope near the angle of friction.
    Slopes,
    /// A block that a force near the friction limit pushes.
    PushedBlocks,
    /// Piles of six shapes in a container.
    Piles,
}

named!(Family {
    Stacks = "stacks",
    LeanedTowers = "leaned-towers",
    Arches = "arches",
    CardHouses = "card-houses",
    PlankTowers = "plank-towers",
    Dominoes = "dominoes",
    Chains = "chains",
    Slopes = "slopes",
    PushedBlocks = "pushed-blocks",
    Piles = "piles",
});

/// The law of a member of a family.
///
/// ```
/// use drystone_scenes::{Family, Law};
///
/// let tower = Family::LeanedTowers.member(1)?;
/// assert_eq!((tower.law, tower.scene.stands), (Law::Stands, true));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Law {
    /// Every body keeps its place and is at rest at the end.
    Stands,
    /// The movable body stays in place.
    Sticks,
    /// The movable body has this acceleration from the first step on (m/s²).
    Slides(DVec3),
    /// The dynamic bodies fall one after another in a wave of this speed (m/s). A body has fallen when it leans by
    /// `angle` (rad).
    Topples {
        /// Speed of the wave (m/s).
        speed: f64,
        /// Angle from the vertical at which a body meets the next one (rad).
        angle: f64,
    },
    /// Joints stay closed, and energy does not grow.
    Swings {
        /// Reference length for gaps (m).
        link: f64,
        /// Reference energy for gains: half of the energy that the bodies release between upside down and hanging (J).
        energy: f64,
    },
    /// No body leaves the container, and all come to rest.
    Settles,
}

/// A world of a family.
///
/// ```
/// use drystone_scenes::{Family, Member};
///
/// let Member { scene, .. } = Family::Stacks.member(7)?;
/// assert!((4..=40).contains(&scene.world.dynamic_count()));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Member {
    /// The scene `family:kind=KIND,seed=SEED`.
    pub scene: Scene,
    /// Its law.
    pub law: Law,
}

/// Gravity of the Earth (m/s²). Members multiply it by a factor.
const EARTH: f64 = 9.81;
/// Duration of a run under the gravity of the Earth (s).
const TIME: f64 = 10.0;

impl Family {
    /// One line: the worlds of the family, and their law.
    pub const fn summary(self) -> &'static str {
        match self {
            Self::Stacks => {
                "4 to 40 boxes of random sizes, densities and rotations, dropped by up to 0.2 % of their heights: they stand"
            }
            Self::LeanedTowers => {
                "2 to 30 equal boxes, each shifted the same way, to 80 % of the static limit: they stand"
            }
            Self::Arches => "semicircles of 7 to 31 wedges, 1.1 to 2 times as thick as statics requires: they stand",
            Self::CardHouses => {
                "1 to 5 storeys of cards with at least 1.25 times the friction that they need: they stand"
            }
            Self::PlankTowers => "1 to 8 storeys of planks, every load directly above its support: they stand",
            Self::Dominoes => {
                "30 to 60 dominoes without friction between them: all fall, at the speed of a train that leans and pushes"
            }
            Self::Chains => {
                "chains of 3 to 60 links and nets of 4 to 12 balls a side, ends up to 1000 times heavier: joints stay closed"
            }
            Self::Slopes => {
                "a block at 0.98 or 1.02 of the angle of friction: it stays, or slides with g (sin - mu cos)"
            }
            Self::PushedBlocks => {
                "a block pushed with 0.98 or 1.02 of the friction limit: it stays, or slides with 0.02 mu g"
            }
            Self::Piles => "20 to 120 bodies of six shapes in a container: none leaves, and all come to rest",
        }
    }

    /// The world of a seed. A step takes 1/480 to 1/30 s, gravity is 0.1 to 10 times that of the Earth, and the
    /// duration of the run scales like that of a fall: 10 s under the gravity of the Earth.
    ///
    /// # Errors
    /// No error is known: every drawn world can be simulated.
    pub fn member(self, seed: u64) -> Result<Member> {
        let draw = &mut Draw::new(self as u64, seed);
        let dt = 1.0 / draw.log_uniform(30.0, 480.0);
        let factor = draw.log_uniform(0.1, 10.0);
        let g = EARTH * factor;
        let (scene, law) = match self {
            Self::Stacks => (standing::stack(draw), Law::Stands),
            Self::LeanedTowers => (standing::leaned(draw), Law::Stands),
            Self::Arches => (standing::arch(draw)?, Law::Stands),
            Self::CardHouses => (standing::card_house(draw), Law::Stands),
            Self::PlankTowers => (standing::plank_tower(draw), Law::Stands),
            Self::Dominoes => dominoes::row(draw, g),
            Self::Chains => moving::chain(draw, g),
            Self::Slopes => moving::slope(draw, g),
            Self::PushedBlocks => moving::pushed(draw, g),
            Self::Piles => (moving::pile(draw)?, Law::Settles),
        };
        // A domino wave needs steps of at most a quarter of the time from one domino to the next. The law does not hold
        // for longer steps.
        let dt = if let Law::Topples { speed, .. } = law { dt.min(0.25 * dominoes::pitch(&scene) / speed) } else { dt };
        let time = match law {
            Law::Topples { speed, .. } => dominoes::time(&scene, speed, g),
            _ => TIME / factor.sqrt(),
        };
        let mut scene = Scene {
            dt: dt as f32,
            steps: (time / dt).ceil() as u32,
            stands: matches!(law, Law::Stands | Law::Sticks),
            ..scene
        };
        scene.name = "family".to_owned();
        scene.world.gravity = Vec3::new(0.0, -g as f32, 0.0);
        Ok(Member { scene, law })
    }

    /// The world of a seed as a scene argument, for commands and [`Scene::find_spec`].
    ///
    /// ```
    /// # use drystone_scenes::{Family, Scene};
    /// assert_eq!(Family::Arches.spec(7), "family:kind=arches,seed=7");
    /// assert_eq!(Scene::find_spec(&Family::Arches.spec(7))?.dt, Family::Arches.member(7)?.scene.dt);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn spec(self, seed: u64) -> String {
        format!("family:kind={self},seed={seed}")
    }
}

/// The world of a seed in the family at an index.
pub(super) fn drawn(kind: usize, seed: u64) -> Result<Scene> {
    let family = Family::ALL.get(kind).ok_or_else(|| input!("kind = {kind}: must be below {}", Family::ALL.len()))?;
    Ok(family.member(seed)?.scene)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drystone::World;

    fn bits(world: &World) -> Vec<u32> {
        let numbers = world.bodies.iter().flat_map(|b| {
            let places = [
                b.position.extend(b.mass.mass).to_array(),
                b.rotation.to_array(),
                b.force.extend(b.material.friction).to_array(),
            ];
            places.into_iter().flatten()
        });
        numbers.chain([world.gravity.y]).map(f32::to_bits).collect()
    }

    #[test]
    fn a_family_and_a_seed_make_one_world() {
        for family in Family::ALL {
            let member = |seed| family.member(seed).expect("a member");
            let (one, same, other) = (member(3), member(3), member(4));
            let all = |m: &Member| (bits(&m.scene.world), m.scene.dt.to_bits(), m.scene.steps);
            assert!(all(&one) == all(&same) && one.law == same.law, "{family}");
            assert_ne!(all(&one), all(&other), "{family}");
            let scene = Scene::find_spec(&family.spec(3)).expect("a scene of the catalogue");
            assert_eq!((bits(&scene.world), scene.dt.to_bits(), scene.steps), all(&one), "{family}");
        }
    }

    /// The worlds of a seed are the same on every machine and in every version. These are hashes of the worlds of seed
    /// 1.
    #[test]
    fn the_worlds_of_a_seed_are_pinned() {
        let hash = |family: Family| {
            let bits = bits(&family.member(1).expect("a member").scene.world);
            bits.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
        };
        let hashes = Family::ALL.map(hash);
        let pinned = [
            0x7720_98f4_e5b1_481f,
            0x0620_f098_67c9_dca0,
            0xc7bf_bdbf_129d_249e,
            0x06f1_ec99_5871_8887,
            0xae9b_3b16_5ded_0f57,
            0x2c23_4a9f_a3da_30b8,
            0xcd3f_2a46_dcbf_eba6,
            0x0824_cf1d_018f_75d1,
            0x6fee_a9dd_923e_1d3b,
            0xfbd3_3d24_5e5a_e621,
        ];
        assert_eq!(hashes, pinned, "{hashes:#x?}");
    }

    #[test]
    fn steps_and_gravity_fill_their_ranges() {
        let scenes: Vec<_> = (0..200).map(|seed| Family::Slopes.member(seed).expect("a member").scene).collect();
        let ends = |of: &dyn Fn(&Scene) -> f32| {
            scenes.iter().map(of).fold((f32::MAX, 0.0_f32), |(a, b), x| (a.min(x), b.max(x)))
        };
        let (shortest, longest) = ends(&|s| s.dt);
        let (least, most) = ends(&|s| -s.world.gravity.y);
        assert!((1.0 / 481.0..1.0 / 450.0).contains(&shortest) && (1.0 / 32.0..1.0 / 29.9).contains(&longest));
        assert!((0.98..1.1).contains(&least) && (90.0..98.2).contains(&most));
        assert!(scenes.iter().all(|s| {
            (f64::from(-s.world.gravity.y) * (f64::from(s.dt) * f64::from(s.steps)).powi(2) / 981.0 - 1.0).abs() < 0.1
        }));
    }
}
