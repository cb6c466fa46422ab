//! One axis of a joint: its limits and its drive.

use crate::error::{Result, input};
use crate::saved::{Archive, Saved};

/// One way for body a of a joint to move against body b: along an axis (m, N), or about it (rad, N m).
///
/// ```
/// use drystone::Axis;
///
/// let suspension = Axis::limited(-0.1, 0.2).spring(0.0, 1.5, 0.3, f32::MAX);
/// let wheel = Axis::FREE.motor(20.0, 150.0);
/// # let _ = (suspension, wheel);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axis {
    /// Where it may be.
    pub bounds: Bounds,
    /// What drives it.
    pub drive: Drive,
}

/// Where an axis may be.
///
/// ```
/// use drystone::{Axis, Bounds};
///
/// assert_eq!([Axis::FREE, Axis::LOCKED].map(|axis| axis.bounds), [Bounds::Free, Bounds::Locked]);
/// assert_eq!(Axis::limited(-1.0, 2.0).bounds, Bounds::Between { min: -1.0, max: 2.0 });
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Bounds {
    /// Anywhere.
    #[default]
    Free,
    /// At zero.
    Locked,
    /// Between two places, which may be the same. Angles are -pi to pi: a joint does not count turns.
    Between {
        /// The least (m, rad); for a place or a distance it may be -infinity, without a lower limit.
        min: f32,
        /// The most (m, rad); for a place or a distance it may be infinity, without an upper limit.
        max: f32,
    },
}

/// What drives an axis.
///
/// ```
/// use drystone::{Axis, Drive};
///
/// let mut wheel = Axis::FREE.motor(20.0, 150.0);
/// assert_eq!(wheel.drive, Drive::Motor { speed: 20.0, max_load: 150.0 });
/// wheel.drive = Drive::None;
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Drive {
    /// Nothing.
    #[default]
    None,
    /// A motor that holds a speed.
    Motor {
        /// The speed (m/s, rad/s).
        speed: f32,
        /// The most that it pushes or pulls (N, N m).
        max_load: f32,
    },
    /// A spring and damper.
    Spring {
        /// Where it is at rest (m, rad).
        target: f32,
        /// How often a second the bodies would swing about the target without damper, turning about their centers of mass and shifting
        /// freely (Hz). A hinge away from a center has more inertia to turn and swings slower.
        frequency: f32,
        /// 0 without damping, 1 where it no longer swings.
        damping_ratio: f32,
        /// The most that spring and damper push or pull together (N, N m).
        max_load: f32,
    },
}

impl Axis {
    /// Free to move.
    pub const FREE: Self = Self { bounds: Bounds::Free, drive: Drive::None };
    /// Held at zero.
    pub const LOCKED: Self = Self { bounds: Bounds::Locked, drive: Drive::None };

    /// Free between two places: see [`Bounds::Between`].
    pub const fn limited(min: f32, max: f32) -> Self {
        Self { bounds: Bounds::Between { min, max }, drive: Drive::None }
    }

    /// Driven at `speed` (m/s, rad/s) by up to `max_load` (N, N m). With a speed of 0 it is dry friction. Limits of the axis hold against any load.
    pub const fn motor(self, speed: f32, max_load: f32) -> Self {
        Self { drive: Drive::Motor { speed, max_load }, ..self }
    }

    /// Pulled to `target` (m, rad) by a spring and damper with up to `max_load` (N, N m). An angle is pulled the shorter way around.
    pub const fn spring(self, target: f32, frequency: f32, damping_ratio: f32, max_load: f32) -> Self {
        Self { drive: Drive::Spring { target, frequency, damping_ratio, max_load }, ..self }
    }
}

crate::saved::fields!(Axis { bounds, drive });

/// A kind, and its numbers.
impl Saved for Bounds {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let (mut kind, mut numbers) = match *self {
            Self::Free => (0_u8, [0.0; 2]),
            Self::Locked => (1, [0.0; 2]),
            Self::Between { min, max } => (2, [min, max]),
        };
        kind.walk(archive)?;
        if kind == 2 {
            numbers.walk(archive)?;
        }
        *self = match kind {
            0 => Self::Free,
            1 => Self::Locked,
            2 => Self::Between { min: numbers[0], max: numbers[1] },
            _ => return Err(input!("bounds of kind {kind} are not known")),
        };
        Ok(())
    }
}

/// A kind, and its numbers.
impl Saved for Drive {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let (mut kind, mut numbers) = match *self {
            Self::None => (0_u8, [0.0; 4]),
            Self::Motor { speed, max_load } => (1, [speed, max_load, 0.0, 0.0]),
            Self::Spring { target, frequency, damping_ratio, max_load } => {
                (2, [target, frequency, damping_ratio, max_load])
            }
        };
        kind.walk(archive)?;
        if kind > 0 {
            numbers.walk(archive)?;
        }
        let [a, b, c, d] = numbers;
        *self = match kind {
            0 => Self::None,
            1 => Self::Motor { speed: a, max_load: b },
            2 => Self::Spring { target: a, frequency: b, damping_ratio: c, max_load: d },
            _ => return Err(input!("a drive of kind {kind} is not known")),
        };
        Ok(())
    }
}
