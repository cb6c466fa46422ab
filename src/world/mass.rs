//! Mass, center of mass and inertia.

use std::ops::RangeInclusive;

use glam::{DMat3, DQuat, DVec3, Mat3, Quat, Vec3};
use parry3d::mass_properties::MassProperties as ParryMass;
use parry3d::mass_properties::details::tetrahedron_unit_inertia_tensor_wrt_point;
use parry3d::math::Pose;
use parry3d::shape::{ConvexPolyhedron, Tetrahedron};

use super::body::Collider;
use super::limits::{is_place, is_rotation};
use super::shape::pose;
use crate::error::{Result, ensure};
use crate::math::rotation::product;
use crate::stats::largest;

/// Mass, center of mass and inertia of a body, in the body's frame. All are zero for a body of infinite mass.
///
/// ```
/// use drystone::{Body, MassProperties, Shape, glam::{Mat3, Quat}};
///
/// let plate = Body::dynamic().shape(Shape::cuboid(0.5, 0.1, 0.5)).total_mass(12.0).mass;
/// assert!(plate.is_anisotropic() && MassProperties::MASSES.contains(&plate.mass));
/// let turned = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
/// // 12 kg (1² + 0.2²) / 12 across the plate, and 12 kg (1² + 1²) / 12 about its normal.
/// let tensor = plate.world_inertia(turned);
/// assert!((tensor.x_axis.x - 2.0).abs() < 1e-4 && (tensor.y_axis.y - 1.04).abs() < 1e-4);
/// assert!((tensor * plate.world_inverse_inertia(turned)).abs_diff_eq(Mat3::IDENTITY, 1e-5));
/// assert_eq!(Body::fixed().mass, MassProperties::IMMOVABLE);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Mass (kg).
    pub mass: f32,
    /// Center of mass in the body's frame (m).
    pub center: Vec3,
    /// Moments of inertia about the principal axes (kg m²).
    pub principal_inertia: Vec3,
    /// Rotation from the principal axes to the body's frame.
    pub principal_frame: Quat,
}

crate::saved::fields!(MassProperties { mass, center, principal_inertia, principal_frame });

impl MassProperties {
    /// Infinite mass: contacts cannot move the body.
    pub const IMMOVABLE: Self =
        Self { mass: 0.0, center: Vec3::ZERO, principal_inertia: Vec3::ZERO, principal_frame: Quat::IDENTITY };

    /// Range of masses that can be simulated (kg). Squares of impulses and of inverse masses stay finite in single
    /// precision.
    pub const MASSES: RangeInclusive<f32> = 1e-15..=1e15;
    /// Range of moments of inertia that can be simulated (kg m²).
    pub(crate) const MOMENTS: RangeInclusive<f32> = 1e-30..=1e30;
    /// Largest ratio of two moments of a body. For a rod the ratio is (length / radius)² / 6.
    pub(crate) const MAX_RATIO: f32 = 1e12;

    /// Largest ratio of m r² to a moment of inertia that a simulation accepts, where r is the lever of the shapes about
    /// that axis. The ratio is 3 for boxes, 2.5 for balls and at most 15 for cones. From about 100 on, sweeps that
    /// solve one point at a time never bring a body to rest (docs/derivation.md, section 3).
    pub const MAX_LEVERAGE: f32 = 32.0;

    /// A mass (kg) at a point of the body's frame (m): without inertia of its own.
    pub const fn point(mass: f32, center: Vec3) -> Self {
        Self { mass, center, ..Self::IMMOVABLE }
    }

    /// The mass properties of two parts of one body: the sum of their masses, their common center of mass, and the
    /// inertia of both about it.
    ///
    /// ```
    /// use drystone::{MassProperties, glam::Vec3};
    ///
    /// // Two masses at the ends of a light rod of 2 m.
    /// let [a, b] = [-1.0, 3.0].map(|x| MassProperties::point(if x < 0.0 { 3.0 } else { 1.0 }, Vec3::X * x));
    /// let both = a.plus(&b);
    /// assert_eq!((both.mass, both.center, both.principal_inertia), (4.0, Vec3::ZERO, Vec3::new(0.0, 12.0, 12.0)));
    /// ```
    pub fn plus(&self, other: &Self) -> Self {
        if self.mass == 0.0 || other.mass == 0.0 {
            return if other.mass == 0.0 { *self } else { *other };
        }
        let [own, others] = [self, other].map(|one| f64::from(one.mass));
        let mass = own + others;
        let center = (self.center.as_dvec3() * own + other.center.as_dvec3() * others) / mass;
        let about = |one: &Self| {
            let out = one.center.as_dvec3() - center;
            tensor(one.principal_inertia, one.principal_frame) + across(out) * f64::from(one.mass)
        };
        let sum = about(self) + about(other);
        let (principal_inertia, principal_frame) = diagonalized(sum);
        Self { mass: mass as f32, center: center.as_vec3(), principal_inertia, principal_frame }
    }

    /// Refuses a mass that cannot be added to the mass of shapes.
    pub(super) fn check_additional(&self) -> Result<()> {
        let Self { mass, principal_inertia, .. } = *self;
        let moments = principal_inertia.to_array();
        let fits = (0.0..=*Self::MASSES.end()).contains(&mass)
            && moments.iter().all(|i| (0.0..=*Self::MOMENTS.end()).contains(i));
        ensure(fits, || {
            format!("mass = {mass:e} kg, inertia = {moments:?} kg m²: must be 0 to 1e15 kg and 0 to 1e30 kg m²")
        })?;
        self.check_frame()
    }

    /// Refuses a mass or an inertia that no dynamic body can have.
    pub(crate) fn check(&self) -> Result<()> {
        self.check_frame()?;
        let Self { mass, principal_inertia, .. } = *self;
        let moments = principal_inertia.to_array();
        let fits = Self::MASSES.contains(&mass)
            && moments.iter().all(|i| Self::MOMENTS.contains(i))
            && principal_inertia.max_element() <= Self::MAX_RATIO * principal_inertia.min_element();
        ensure(fits, || {
            format!(
                "mass = {mass:e} kg, inertia = {moments:?} kg m²: must be 1e-15 to 1e15 kg, 1e-30 to 1e30 kg m² and moments within \
                 1e12 of each other"
            )
        })
    }

    /// Refuses a center of mass that is out of range, and a frame that is not a rotation.
    pub(super) fn check_frame(&self) -> Result<()> {
        let Self { center, principal_frame, .. } = *self;
        let message = || {
            format!(
                "center of mass = {center}, principal frame = {principal_frame}: must be within 1e9 m and a unit quaternion"
            )
        };
        ensure(is_place(center) && is_rotation(principal_frame), message)
    }

    /// Mass properties of some colliders with volume. Parry stores inverses. They are computed at density 1 and scaled
    /// here, so that the mass of a box of 1 m³ equals its density to the last bit.
    ///
    /// Parry's principal axes are used only if the principal axes of the solids are parallel to the axes of the body:
    /// other directions need a sine, and platforms compute it differently. Parry also finds wrong axes in two cases: if
    /// the two smaller moments are equal and their plane is not that of x, or if moments are below 1e-5 kg m².
    /// Therefore its tensor is compared with the sum of the tensors of the solids.
    pub(super) fn of_solids(solids: &[&Collider], density: f32) -> Self {
        let solids: Vec<_> = solids.iter().map(|c| (Solid::of(c), pose(c.position, c.rotation))).collect();
        let all: ParryMass = solids.iter().map(|(solid, at)| solid.mass.transform_by(at)).sum();
        let own = |(solid, at): &(Solid, Pose)| {
            let axes = axes_of(at.rotation);
            let center = *at * solid.mass.local_com;
            let out = (all.local_com - center).as_dvec3();
            axes * solid.tensor * axes.transpose() + across(out) * f64::from(solid.mass.mass())
        };
        let (mut exact, mut is_aligned) = (DMat3::ZERO, true);
        for tensor in solids.iter().map(own) {
            exact += tensor;
            is_aligned &= tensor == DMat3::from_diagonal(diagonal(&tensor));
        }
        let (mut moments, mut frame) = (all.principal_inertia(), all.principal_inertia_local_frame);
        let size = |m: DMat3| largest(0.0, m.abs().to_cols_array());
        let is_right = size(tensor(moments, frame) - exact) <= 1e-4 * size(exact);
        if !is_aligned || !is_right {
            (moments, frame) = diagonalized(exact);
        }
        Self {
            mass: all.mass() * density,
            center: all.local_com,
            principal_inertia: moments * density,
            principal_frame: frame,
        }
    }

    /// Inverse inertia about the center of mass in world axes (1/(kg m²)), for a body with this rotation.
    pub fn world_inverse_inertia(&self, rotation: Quat) -> Mat3 {
        self.world_tensor(rotation, self.principal_inertia.map(|i| if i > 0.0 { 1.0 / i } else { 0.0 }))
    }

    /// Inertia about the center of mass in world axes (kg m²).
    pub fn world_inertia(&self, rotation: Quat) -> Mat3 {
        self.world_tensor(rotation, self.principal_inertia)
    }

    fn world_tensor(&self, rotation: Quat, principal: Vec3) -> Mat3 {
        // A rotation of an isotropic tensor only adds rounding errors.
        if principal.x == principal.y && principal.y == principal.z {
            return Mat3::from_diagonal(principal);
        }
        let axes = Mat3::from_quat(product(rotation, self.principal_frame));
        axes * Mat3::from_diagonal(principal) * axes.transpose()
    }

    /// Whether the moments differ. The axis of a free rotation then moves (gyroscopic term).
    pub fn is_anisotropic(&self) -> bool {
        let i = self.principal_inertia;
        i.max_element() - i.min_element() > 1e-6 * i.max_element()
    }
}

/// A shape of density 1, in its own frame.
struct Solid {
    mass: ParryMass,
    /// Inertia about the center of mass (kg m²).
    tensor: DMat3,
}

impl Solid {
    fn of(collider: &Collider) -> Self {
        let mass = collider.shape.0.mass_properties(1.0);
        let tensor = match collider.shape.0.as_convex_polyhedron() {
            Some(hull) => tensor_of_hull(hull, mass.local_com),
            None => tensor(mass.principal_inertia(), mass.principal_inertia_local_frame),
        };
        Self { mass, tensor }
    }
}

/// Inertia of a hull of density 1 about its center of mass. It sums the tetrahedra between the triangles and the
/// center.
fn tensor_of_hull(hull: &ConvexPolyhedron, center: Vec3) -> DMat3 {
    let (points, triangles) = hull.to_trimesh();
    let of_one = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| points[i as usize]);
        let volume = Tetrahedron::new(center, a, b, c).signed_volume();
        tetrahedron_unit_inertia_tensor_wrt_point(center, center, a, b, c) * volume
    };
    let whole: Mat3 = triangles.iter().map(of_one).fold(Mat3::ZERO, |sum, own| sum + own);
    // A hull with triangles that face inward has a negative volume.
    whole.as_dmat3() * f64::from(whole.x_axis.x.signum())
}

/// The axes of a frame in double precision.
fn axes_of(frame: Quat) -> DMat3 {
    DMat3::from_quat(frame.as_dquat().normalize())
}

/// The inertia tensor with these moments along the axes of a frame.
fn tensor(moments: Vec3, frame: Quat) -> DMat3 {
    let axes = axes_of(frame);
    axes * DMat3::from_diagonal(moments.as_dvec3()) * axes.transpose()
}

/// The inertia of a mass of 1 at a point, about the origin.
fn across(out: DVec3) -> DMat3 {
    DMat3::IDENTITY * out.length_squared() - DMat3::from_cols(out * out.x, out * out.y, out * out.z)
}

fn diagonal(tensor: &DMat3) -> DVec3 {
    DVec3::new(tensor.x_axis.x, tensor.y_axis.y, tensor.z_axis.z)
}

/// Principal moments of a symmetric tensor, and the rotation from its principal axes, by Jacobi's method. Each rotation
/// about one axis zeroes one off-diagonal entry and makes the others smaller.
fn diagonalized(tensor: DMat3) -> (Vec3, Quat) {
    const SWEEPS: usize = 8;
    let (mut diagonal, mut axes) = (tensor, DMat3::IDENTITY);
    for axis in (0..3).cycle().take(3 * SWEEPS) {
        let (p, q) = ((axis + 1) % 3, (axis + 2) % 3);
        let beside = diagonal.col(q)[p];
        if beside != 0.0 {
            let ratio = (diagonal.col(q)[q] - diagonal.col(p)[p]) / (2.0 * beside);
            let tan = ratio.signum() / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
            let cos = (tan * tan + 1.0).sqrt().recip();
            let mut turn = DMat3::IDENTITY;
            (turn.col_mut(p)[p], turn.col_mut(q)[q]) = (cos, cos);
            (turn.col_mut(q)[p], turn.col_mut(p)[q]) = (tan * cos, -tan * cos);
            diagonal = turn.transpose() * diagonal * turn;
            axes *= turn;
        }
    }
    (self::diagonal(&diagonal).as_vec3(), DQuat::from_mat3(&axes).normalize().as_quat())
}
