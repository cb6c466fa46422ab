//! One axis of a joint: its bounds and its drive.

use std::f32::consts::{PI, TAU};

use super::limits::MAX_SPEED;
use crate::error::{Result, input};
use crate::saved::{Archive, Saved};

/// One degree of freedom of body a against body b: a translation along an axis (m, N), or a rotation about it (rad, N
/// m).
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
    /// Which positions the axis can take.
    pub bounds: Bounds,
    /// The motor or spring of the axis.
    pub drive: Drive,
}

/// Which positions an axis can take.
///
/// ```
/// use drystone::{Axis, Bounds};
///
/// assert_eq!([Axis::FREE, Axis::LOCKED].map(|axis| axis.bounds), [Bounds::Free, Bounds::Locked]);
/// assert_eq!(Axis::limited(-1.0, 2.0).bounds, Bounds::Between { min: -1.0, max: 2.0 });
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Bounds {
    /// Any position.
    #[default]
    Free,
    /// Only zero.
    Locked,
    /// Any position between two limits. Equal limits lock the axis, and its drive then has no effect. The first angle of
    /// a joint counts turns if one of its limits is half a turn or more; other angles range from -pi to pi.
    Between {
        /// The lower limit (m, rad). A translation, a distance or a first angle can have -infinity for no lower limit.
        min: f32,
        /// The upper limit (m, rad). A translation, a distance or a first angle can have infinity for no upper limit.
        max: f32,
    },
}

/// The motor or spring of an axis.
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
    /// No drive.
    #[default]
    None,
    /// A motor that holds a speed.
    Motor {
        /// The speed (m/s, rad/s).
        speed: f32,
        /// The largest force or torque (N, N m).
        max_load: f32,
    },
    /// A spring and damper. It yields to a constant load exactly as far as its stiffness says. With substeps of h seconds,
    /// its period is too long by the share pi h times frequency and damping ratio.
    Spring {
        /// The rest position (m, rad).
        target: f32,
        /// Frequency f at which two free bodies would swing about the target without the damper (Hz). The spring has the
        /// constant stiffness m (2 π f)². For an angle, m is the inertia of the bodies about the axis; for a translation
        /// or a distance, it is their mass at the anchors, with the mean over all directions of its inverse. A hinge away
        /// from a center of mass turns more inertia and swings slower.
        frequency: f32,
        /// Damping ratio: 0 is undamped, 1 is critically damped.
        damping_ratio: f32,
        /// The largest total force or torque of spring and damper (N, N m).
        max_load: f32,
    },
    /// A spring and damper with constants of their own, independent of the mass that they move; as exact as
    /// [`Self::Spring`].
    SpringDamper {
        /// The rest position (m, rad).
        target: f32,
        /// Force by distance, or torque by angle, above 0 (N/m, N m/rad).
        stiffness: f32,
        /// Force by speed, or torque by angular speed, 0 or more (N s/m, N m s/rad).
        damping: f32,
        /// The largest total force or torque of spring and damper (N, N m).
        max_load: f32,
    },
}

impl Axis {
    /// Free to move.
    pub const FREE: Self = Self { bounds: Bounds::Free, drive: Drive::None };
    /// Held at zero.
    pub const LOCKED: Self = Self { bounds: Bounds::Locked, drive: Drive::None };

    /// Free between two limits: see [`Bounds::Between`].
    pub const fn limited(min: f32, max: f32) -> Self {
        Self { bounds: Bounds::Between { min, max }, drive: Drive::None }
    }

    /// Whether the axis has one position only.
    pub(crate) fn is_locked(&self) -> bool {
        match self.bounds {
            Bounds::Free => false,
            Bounds::Locked => true,
            Bounds::Between { min, max } => min == max,
        }
    }

    /// Whether a motor or spring acts on the axis. None moves a locked one.
    pub(crate) fn has_drive(&self) -> bool {
        self.drive != Drive::None && !self.is_locked()
    }

    /// Whether an angle counts turns: one of its limits is half a turn or more.
    pub(crate) fn counts_turns(&self) -> bool {
        matches!(self.bounds, Bounds::Between { min, max } if min <= -PI || max >= PI)
    }

    /// A counted angle (rad): `angle`, from -pi to pi, plus the whole turns that bring it next to the angle of the last
    /// step, or next to its limits without one.
    pub(crate) fn counted(&self, angle: f32, before: Option<f32>) -> f32 {
        let near = before.unwrap_or(match self.bounds {
            Bounds::Between { min, max } => angle.max(min).min(max),
            Bounds::Free | Bounds::Locked => angle,
        });
        angle + TAU * ((near - angle) / TAU).round()
    }

    /// Adds a motor that holds `speed` (m/s, rad/s) with up to `max_load` (N, N m). With a speed of 0 the motor acts as
    /// dry friction. Limits of the axis hold against any load.
    pub const fn motor(self, speed: f32, max_load: f32) -> Self {
        Self { drive: Drive::Motor { speed, max_load }, ..self }
    }

    /// Pushes with a constant force or torque (N, N m), along the axis or, below zero, against it: a motor without a
    /// speed of its own.
    ///
    /// ```
    /// use drystone::{Axis, Body, Joint, Shape, Simulation, World, glam::Vec3, world::MAX_SPEED};
    ///
    /// // 10 N on 2 kg for a second: 5 m/s.
    /// let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    /// let cart = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.2, 0.3)).total_mass(2.0));
    /// assert_eq!(Axis::FREE.constant_load(-10.0), Axis::FREE.motor(-MAX_SPEED, 10.0));
    /// world.insert_joint(Joint::to_world(cart, Vec3::ZERO, Vec3::ZERO).slider(Vec3::X).constant_load(10.0));
    /// let mut simulation = Simulation::new(world)?;
    /// (0..60).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
    /// assert!((simulation.world.bodies[cart].linear_velocity.x - 5.0).abs() < 1e-4);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub const fn constant_load(self, load: f32) -> Self {
        let speed = if load < 0.0 { -MAX_SPEED } else { MAX_SPEED };
        self.motor(speed, load.abs())
    }

    /// Adds a spring and damper that pull to `target` (m, rad) with up to `max_load` (N, N m). A spring turns an angle
    /// the shorter way around, unless the angle counts turns ([`Bounds::Between`]).
    pub const fn spring(self, target: f32, frequency: f32, damping_ratio: f32, max_load: f32) -> Self {
        Self { drive: Drive::Spring { target, frequency, damping_ratio, max_load }, ..self }
    }
}

impl Axis {
    /// Adds a spring of `stiffness` (N/m, N m/rad) and a damper of `damping` (N s/m, N m s/rad) that pull to `target`
    /// (m, rad) with up to `max_load` (N, N m): [`Drive::SpringDamper`].
    ///
    /// ```
    /// use drystone::{Axis, Body, Joint, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
    ///
    /// // 2 kg on a spring of 400 N/m: it stretches by 2 g/400.
    /// let mut world = World::new();
    /// let lamp = world.insert(Body::dynamic().shape(Shape::ball(0.1)).total_mass(2.0));
    /// assert_eq!(Axis::FREE.spring_damper(0.0, 400.0, 40.0, f32::MAX).bounds, Axis::FREE.bounds);
    /// let slider = Joint::to_world(lamp, Vec3::ZERO, Vec3::ZERO).slider(Vec3::Y);
    /// world.insert_joint(slider.spring_damper(0.0, 400.0, 40.0));
    /// let mut simulation = Simulation::new(world)?;
    /// (0..180).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
    /// assert!((simulation.world.bodies[lamp].position.y + 0.04905).abs() < 1e-3);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub const fn spring_damper(self, target: f32, stiffness: f32, damping: f32, max_load: f32) -> Self {
        Self { drive: Drive::SpringDamper { target, stiffness, damping, max_load }, ..self }
    }
}

crate::saved::fields!(Axis { bounds, drive });

/// Writes the kind, then its numbers.
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
            _ => return Err(input!("unknown kind of bounds: {kind}")),
        };
        Ok(())
    }
}

/// Writes the kind, then its numbers.
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
            Self::SpringDamper { target, stiffness, damping, max_load } => (3, [target, stiffness, damping, max_load]),
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
            3 => Self::SpringDamper { target: a, stiffness: b, damping: c, max_load: d },
            _ => return Err(input!("unknown kind of drive: {kind}")),
        };
        Ok(())
    }
}
