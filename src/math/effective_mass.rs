//! The rows of a contact, from its manifold and from the masses and poses of its bodies. The functions of effective
//! masses are the twins of `shaders/lib/prepare.wgsl`. Only the processor computes separations.

use super::{Lane, NormalMovement, Quat, Vec3, cross3, dot3, reciprocal, vec3};
use crate::constants::MIN_JAMMING;

/// A symmetric 3x3 matrix: the upper triangle, row by row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sym3<L> {
    /// xx xy xz.
    pub x: Vec3<L>,
    /// yy yz zz.
    pub yz: Vec3<L>,
}

impl<L: Lane> Sym3<L> {
    /// Twin of `inv_inertia_times`.
    #[inline(always)]
    pub fn times(self, u: Vec3<L>) -> Vec3<L> {
        let (p, q) = (self.x, self.yz);
        vec3(dot3(p, u), p.y * u.x + q.x * u.y + q.y * u.z, p.z * u.x + q.y * u.y + q.z * u.z)
    }
}

/// Twin of the WGSL struct `Mass`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mass<L> {
    /// Inverse inertia, world axes.
    pub inv_inertia: Sym3<L>,
    /// Inverse mass.
    pub inv_mass: L,
    /// The axes along which nothing moves the body: the sum of 1 for x, 2 for y and 4 for z.
    pub locks: L,
    /// Gravity plus force over mass.
    pub acceleration: Vec3<L>,
}

impl<L: Lane> Mass<L> {
    /// A vector without its components along locked axes. Twin of the WGSL function of this name.
    #[inline(always)]
    pub fn unlocked(&self, v: Vec3<L>) -> Vec3<L> {
        unlocked(self.locks, v)
    }
}

/// A vector without its components along the axes of `locks`.
#[inline(always)]
pub fn unlocked<L: Lane>(locks: L, v: Vec3<L>) -> Vec3<L> {
    let zero = L::constant(0.0);
    let z = locks.gt(L::constant(3.5));
    let rest = locks - L::select(zero, L::constant(4.0), z);
    let y = rest.gt(L::constant(1.5));
    let x = (rest - L::select(zero, L::constant(2.0), y)).gt(L::constant(0.5));
    vec3(L::select(v.x, zero, x), L::select(v.y, zero, y), L::select(v.z, zero, z))
}

/// 1/x, to half an ulp for most x; 0 if x is not positive.
#[inline(always)]
pub fn inverse_or_zero<L: Lane>(x: L) -> L {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let is_positive = x.gt(zero);
    let x = L::select(one, x, is_positive);
    let y = reciprocal(x);
    // One more step of Newton's method makes the inverses of powers of two exact.
    L::select(zero, y + y * (one - x * y), is_positive)
}

/// The square root of x; 0 if x is not above 1e-30.
#[inline(always)]
pub fn square_root<L: Lane>(x: L) -> L {
    let is_normal = x.gt(L::constant(1e-30));
    let x = L::select(L::constant(1.0), x, is_normal);
    L::select(L::constant(0.0), x * x.inverse_sqrt(), is_normal)
}

/// A unit vector perpendicular to a unit normal (Duff et al., "Building an orthonormal basis, revisited", 2017).
#[inline(always)]
pub fn tangent_of<L: Lane>(n: Vec3<L>) -> Vec3<L> {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let sign = L::select(one, -one, zero.gt(n.z));
    let a = -(sign * inverse_or_zero(one + sign * n.z));
    vec3(n.x * n.y * a, sign + n.y * n.y * a, -n.y)
}

/// Contribution of one body to the entry (d, e) of G M⁻¹ Gᵀ at the arm r. `locked`: some body has locked axes.
#[inline(always)]
fn entry_of<L: Lane>(locked: bool, mass: &Mass<L>, r: Vec3<L>, d: Vec3<L>, e: Vec3<L>) -> L {
    let moved = if locked { mass.unlocked(d) } else { d };
    mass.inv_mass * dot3(moved, e) + dot3(cross3(r, d), mass.inv_inertia.times(cross3(r, e)))
}

/// The entry (d, e) of G M⁻¹ Gᵀ at the arms of a and b.
#[inline(always)]
pub fn entry<L: Lane>(locked: bool, [a, b]: [&Mass<L>; 2], [r_a, r_b]: [Vec3<L>; 2], d: Vec3<L>, e: Vec3<L>) -> L {
    entry_of(locked, a, r_a, d, e) + entry_of(locked, b, r_b, d, e)
}

/// One over the largest eigenvalue of the tangential block with the entries s_11, s_22 and s_12; 0 if the block is
/// zero.
#[inline(always)]
pub fn tangent_mass<L: Lane>(s_11: L, s_22: L, s_12: L) -> L {
    // The squares of the entries of a light body would leave single precision.
    let scale = (s_11 + s_22).inverse_power();
    let (s_11, s_22, s_12) = (s_11 * scale, s_22 * scale, s_12 * scale);
    let apart = s_11 - s_22;
    let root = square_root(apart * apart + L::constant(4.0) * s_12 * s_12);
    scale * inverse_or_zero(L::constant(0.5) * (s_11 + s_22 + root))
}

/// The ratio of two changes of the normal velocity by a unit normal impulse: the largest change by its friction, over
/// the change by the impulse itself. Above a ratio of 1, sliding friction can press the surfaces together faster than
/// the normal impulse parts them (Painlevé). `parted` is the normal entry, and `pressed_1` and `pressed_2` are the
/// entries of the normal with each tangent. The ratio is 0 for friction up to [`MIN_JAMMING`].
#[inline(always)]
pub fn jamming<L: Lane>(friction: L, parted: L, pressed_1: L, pressed_2: L) -> L {
    let scale = parted.inverse_power();
    let (pressed_1, pressed_2) = (pressed_1 * scale, pressed_2 * scale);
    let pressed = square_root(pressed_1 * pressed_1 + pressed_2 * pressed_2);
    let ratio = friction * pressed * inverse_or_zero(parted * scale);
    L::select(L::constant(0.0), ratio, friction.gt(L::constant(MIN_JAMMING.into())))
}

/// The share of a normal step that a sweep takes. If friction changes the normal velocity more than the normal impulse
/// does, full steps of the two in turn oscillate about the solution. Shorter steps of the impulse end the oscillation.
#[inline(always)]
pub fn normal_step<L: Lane>(jamming: L) -> L {
    let one = L::constant(1.0);
    L::select(one, inverse_or_zero(one + jamming), jamming.gt(one))
}

/// One over the sum of the inverse inertias of both bodies about the normal.
#[inline(always)]
pub fn twist_mass<L: Lane>(n: Vec3<L>, a: &Mass<L>, b: &Mass<L>) -> L {
    inverse_or_zero(dot3(n, a.inv_inertia.times(n)) + dot3(n, b.inv_inertia.times(n)))
}

/// The normal and the tangents of a manifold, and its friction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Frame<L> {
    /// Unit normal from a to b.
    pub normal: Vec3<L>,
    /// First unit tangent.
    pub tangent: Vec3<L>,
    /// Coulomb coefficient.
    pub friction: L,
}

/// The effective masses of a contact point, and how far it jams.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointMasses<L> {
    /// Along the normal; smaller if the point jams.
    pub normal: L,
    /// In the tangential plane.
    pub tangent: L,
    /// The ratio of [`jamming`].
    pub jamming: L,
}

/// The facts about all bodies and surfaces that effective masses depend on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointKinds {
    /// Whether friction has two directions.
    pub tangents: bool,
    /// Whether some surface has more friction than [`MIN_JAMMING`].
    pub jams: bool,
    /// Whether some body has locked axes.
    pub locked: bool,
}

/// The effective masses of a point at the arms `r_a` and `r_b`.
#[inline(always)]
pub fn point_masses<L: Lane>(
    kinds: PointKinds,
    frame: &Frame<L>,
    masses: [&Mass<L>; 2],
    arms: [Vec3<L>; 2],
) -> PointMasses<L> {
    let PointKinds { tangents, jams, locked } = kinds;
    let (n, t_1) = (frame.normal, frame.tangent);
    let t_2 = cross3(n, t_1);
    // No closure: a compiler may leave it out of line, without the instructions of the lanes.
    let parted = entry(locked, masses, arms, n, n);
    let mut own = PointMasses { normal: inverse_or_zero(parted), ..PointMasses::default() };
    if jams {
        let pressed_1 = entry(locked, masses, arms, n, t_1);
        own.jamming = jamming(frame.friction, parted, pressed_1, entry(locked, masses, arms, n, t_2));
        own.normal = own.normal * normal_step(own.jamming);
    }
    if tangents {
        let (s_11, s_22) = (entry(locked, masses, arms, t_1, t_1), entry(locked, masses, arms, t_2, t_2));
        own.tangent = tangent_mass(s_11, s_22, entry(locked, masses, arms, t_1, t_2));
    }
    own
}

/// Place of a body: its center of mass and its rotation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pose<L> {
    /// Center of mass.
    pub center: Vec3<L>,
    /// Rotation.
    pub rotation: Quat<L>,
}

/// The rotation from `then` to `now`. Its axis is exactly zero if the two are equal.
#[inline(always)]
pub fn turn_since<L: Lane>(now: Quat<L>, then: Quat<L>) -> Quat<L> {
    let axis = (now.axis * then.w - then.axis * now.w) - cross3(now.axis, then.axis);
    Quat { axis, w: now.w * then.w + dot3(now.axis, then.axis) }
}

/// Movement of two bodies along a normal since their manifold was computed. `a` and `b` are their poses now. The center
/// of b was then at `apart` from that of a, and `then` holds their rotations.
#[inline(always)]
pub fn movement_since<L: Lane>(
    normal: Vec3<L>,
    [radius_a, radius_b]: [L; 2],
    [a, b]: [Pose<L>; 2],
    apart: Vec3<L>,
    then: [Quat<L>; 2],
) -> NormalMovement<L> {
    let [turn_a, turn_b] = [turn_since(a.rotation, then[0]), turn_since(b.rotation, then[1])];
    let movement = NormalMovement::new(normal, (b.center - a.center) - apart, turn_a, turn_b);
    movement.round(normal, radius_a, radius_b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_that_did_not_turn_moves_no_arm_to_the_bit() {
        for k in 1..1000 {
            let q = glam::Quat::from_array([1.0, k as f32, 0.37 * k as f32, -0.2]).normalize();
            let q = Quat::<f32>::load(q.to_array());
            assert_eq!(turn_since(q, q).axis, Vec3::default());
        }
    }

    #[test]
    fn a_turn_is_the_rotation_between_two() {
        let (then, turn) = (glam::DQuat::from_rotation_x(0.7), glam::DQuat::from_rotation_z(0.02));
        let [now, then] = [turn * then, then].map(|q| Quat { axis: vec3(q.x, q.y, q.z), w: q.w });
        let apart = turn_since(now, then).axis - vec3(turn.x, turn.y, turn.z);
        assert!(dot3(apart, apart) < 1e-30, "{apart:?}");
    }

    #[test]
    fn inverses_of_powers_of_two_are_exact_and_of_others_to_an_ulp() {
        for k in 1..10_000 {
            let x = k as f32 * 0.013;
            let error = (f64::from(inverse_or_zero(x)) * f64::from(x) - 1.0).abs();
            assert!(error < 1.01 * f64::from(f32::EPSILON), "{x}: {error:e}");
        }
        for exponent in -30..30 {
            assert_eq!(inverse_or_zero(2_f32.powi(exponent)), 2_f32.powi(-exponent));
        }
        assert_eq!([0.0, -1.0, f32::NAN].map(inverse_or_zero), [0.0; 3]);
    }

    #[test]
    fn a_root_squared_is_the_number() {
        for k in 1..1000 {
            let x = k as f32 * 0.37;
            assert!((square_root(x).powi(2) / x - 1.0).abs() < 1e-6, "{x}");
        }
        assert_eq!([0.0, 1e-38].map(square_root::<f32>), [0.0; 2]);
    }

    /// Contacts of boxes on planes have tangents along the axes of the world.
    #[test]
    fn tangents_across_the_axes_are_axes_and_all_are_unit_vectors_across() {
        for n in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0_f32]] {
            let t = tangent_of(Vec3::<f32>::load(n)).store();
            assert_eq!(t.iter().filter(|x| x.abs() == 1.0).count(), 1, "{t:?}");
            assert_eq!(t.iter().filter(|x| **x == 0.0).count(), 2, "{t:?}");
        }
        for k in 0..1000 {
            let n = glam::Vec3::new((k as f32).sin(), (1.7 * k as f32).cos(), (0.3 * k as f32).sin()).normalize();
            let (n, t) = (Vec3::<f32>::load(n.to_array()), tangent_of(Vec3::load(n.to_array())));
            assert!(dot3(n, t).abs() < 3e-7 && (dot3(t, t) - 1.0).abs() < 1e-6, "{n:?}: {t:?}");
        }
    }
}
