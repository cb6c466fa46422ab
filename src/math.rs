//! Arithmetic with the same bits on every platform: only + - * and comparisons, in a fixed order.
//!
//! The functions are generic over [`Lane`]: one text is both the scalar reference (`f32`) and the high-precision path
//! (`f64`). Branches are `select`s, as in WGSL. Every function here is the twin of one in `shaders/lib/math.wgsl`, with
//! the same name and the same order of operations; `tests/gpu/kernels.rs` compares the two.
//!
//! Functions are `#[inline(always)]` and use no closures: a helper that is not inlined loses the instruction set of its
//! caller.

pub mod angles;
pub mod effective_mass;
mod movement;
pub mod rotation;

pub use movement::NormalMovement;

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A number, or several that are processed side by side.
pub trait Lane:
    Copy
    + Debug
    + Default
    + PartialEq
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
{
    /// The result of a comparison of two lanes.
    type Mask: Copy;
    /// Number of values to compute in a column of three. A fourth value lets a column of single numbers fill a
    /// register.
    const COLUMN: usize = 3;
    /// The same constant in every lane.
    fn constant(x: f64) -> Self;
    /// Whether `self > other`; false for NaN.
    fn gt(self, other: Self) -> Self::Mask;
    /// Whether both masks are true.
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// The same truth value in every lane.
    fn mask(value: bool) -> Self::Mask;
    /// Whether the mask is true in any lane.
    fn any(mask: Self::Mask) -> bool;
    /// `if_true` in lanes where the mask is true. Arguments are in WGSL's order.
    fn select(if_false: Self, if_true: Self, mask: Self::Mask) -> Self;
    /// The larger of two; `b` if they are equal or either is NaN.
    #[inline(always)]
    fn larger(a: Self, b: Self) -> Self {
        Self::select(b, a, a.gt(b))
    }
    /// The smaller of two; `b` if they are equal or either is NaN.
    #[inline(always)]
    fn smaller(a: Self, b: Self) -> Self {
        Self::select(b, a, b.gt(a))
    }
    /// 1/sqrt(x) for normal positive x. In `f32` it has the bits of the shader, with an error of about 1 ulp.
    fn inverse_sqrt(self) -> Self;
    /// The inverse of the power of two in x: the product of both is between 1 and 2 in size. For normal x of either
    /// sign, in `f32` below 2^127.
    fn inverse_power(self) -> Self;
}

/// A lane of one number, with conversion to and from `f32` storage.
pub trait Scalar: Lane + PartialOrd + From<f32> {
    /// Converts to storage, rounded to nearest.
    fn to_f32(self) -> f32;
}

/// This constant, minus half the bits of a positive number, gives the bits of a first guess of the inverse square root.
pub(crate) const INVERSE_SQRT_GUESS: u32 = 0x5f37_5a86;

/// The bits of an exponent in a number.
pub(crate) const EXPONENT: u32 = 0x7f80_0000;
/// This constant, minus the exponent bits of a number, gives the bits of the opposite exponent.
pub(crate) const OPPOSITE_EXPONENT: u32 = 0x7f00_0000;

/// 1/sqrt(x) from a guess: three steps of Newton's method.
#[inline(always)]
pub(crate) fn newton_inverse_sqrt<L: Lane>(x: L, guess: L) -> L {
    let half_x = L::constant(0.5) * x;
    let three_halves = L::constant(1.5);
    let mut y = guess;
    y = y * (three_halves - half_x * y * y);
    y = y * (three_halves - half_x * y * y);
    y * (three_halves - half_x * y * y)
}

macro_rules! scalar_lane {
    ($t:ty) => {
        #[inline(always)]
        fn constant(x: f64) -> Self {
            x as $t
        }
        #[inline(always)]
        fn gt(self, other: Self) -> bool {
            self > other
        }
        #[inline(always)]
        fn and(a: bool, b: bool) -> bool {
            a && b
        }
        #[inline(always)]
        fn mask(value: bool) -> bool {
            value
        }
        #[inline(always)]
        fn any(mask: bool) -> bool {
            mask
        }
        #[inline(always)]
        fn select(if_false: Self, if_true: Self, mask: bool) -> Self {
            if mask { if_true } else { if_false }
        }
    };
}

impl Lane for f32 {
    type Mask = bool;
    const COLUMN: usize = 4;
    scalar_lane!(f32);
    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        let guess = Self::from_bits(INVERSE_SQRT_GUESS.wrapping_sub(self.to_bits() >> 1));
        newton_inverse_sqrt(self, guess)
    }
    #[inline(always)]
    fn inverse_power(self) -> Self {
        Self::from_bits(OPPOSITE_EXPONENT.wrapping_sub(self.to_bits() & EXPONENT))
    }
}

impl Lane for f64 {
    type Mask = bool;
    const COLUMN: usize = 4;
    scalar_lane!(f64);
    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        1.0 / self.sqrt()
    }
    #[inline(always)]
    fn inverse_power(self) -> Self {
        Self::from_bits(0x7fe0_0000_0000_0000_u64.wrapping_sub(self.to_bits() & 0x7ff0_0000_0000_0000))
    }
}

impl Scalar for f32 {
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }
}

impl Scalar for f64 {
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self as f32
    }
}

/// The polynomial in s with these coefficients, that of the lowest power first.
#[inline(always)]
pub fn polynomial<L: Lane>(s: L, c: [f64; 6]) -> L {
    let mut sum = L::constant(c[5]);
    for k in [4, 3, 2, 1, 0] {
        sum = L::constant(c[k]) + s * sum;
    }
    sum
}

/// The larger of two; `b` if they are equal or either is NaN.
#[inline(always)]
pub fn larger<L: Lane>(a: L, b: L) -> L {
    L::larger(a, b)
}

/// The smaller of two; `b` if they are equal or either is NaN.
#[inline(always)]
pub fn smaller<L: Lane>(a: L, b: L) -> L {
    L::smaller(a, b)
}

/// 1/x for either sign, scaled so that no square leaves the range of single precision.
#[inline(always)]
pub fn reciprocal<L: Lane>(x: L) -> L {
    let scale = x.inverse_power();
    let scaled = x * scale;
    let y = (scaled * scaled).inverse_sqrt();
    scaled * (y * y) * scale
}

/// Three numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vec3<L> {
    /// First component.
    pub x: L,
    /// Second component.
    pub y: L,
    /// Third component.
    pub z: L,
}

/// Shorthand for a [`Vec3`].
#[inline(always)]
pub fn vec3<L>(x: L, y: L, z: L) -> Vec3<L> {
    Vec3 { x, y, z }
}

/// Component-wise operators, as in WGSL.
macro_rules! component_by_component {
    ($($Operator:ident $name:ident $sign:tt;)*) => {$(
        impl<L: Lane> $Operator for Vec3<L> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, o: Self) -> Self {
                vec3(self.x $sign o.x, self.y $sign o.y, self.z $sign o.z)
            }
        }
    )*};
}

component_by_component! { Add add +; Sub sub -; Mul mul *; }

impl<L: Lane> AddAssign for Vec3<L> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<L: Lane> SubAssign for Vec3<L> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<L: Lane> Mul<L> for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: L) -> Self {
        vec3(self.x * s, self.y * s, self.z * s)
    }
}

impl<L: Lane> Neg for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

impl<S: Scalar> Vec3<S> {
    /// Converts from storage.
    #[inline(always)]
    pub fn load(v: [f32; 3]) -> Self {
        let [x, y, z] = v.map(S::from);
        vec3(x, y, z)
    }

    /// Converts to storage.
    #[inline(always)]
    pub fn store(self) -> [f32; 3] {
        [self.x.to_f32(), self.y.to_f32(), self.z.to_f32()]
    }
}

/// `if_true` in lanes where the mask is true; WGSL's `select` of vectors.
#[inline(always)]
pub fn select3<L: Lane>(if_false: Vec3<L>, if_true: Vec3<L>, mask: L::Mask) -> Vec3<L> {
    vec3(
        L::select(if_false.x, if_true.x, mask),
        L::select(if_false.y, if_true.y, mask),
        L::select(if_false.z, if_true.z, mask),
    )
}

/// Inner product, summed left to right.
#[inline(always)]
pub fn dot3<L: Lane>(a: Vec3<L>, b: Vec3<L>) -> L {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Vector product.
#[inline(always)]
pub fn cross3<L: Lane>(a: Vec3<L>, b: Vec3<L>) -> Vec3<L> {
    vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// A rotation as x i + y j + z k + w.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quat<L> {
    /// Vector part.
    pub axis: Vec3<L>,
    /// Scalar part.
    pub w: L,
}

impl<S: Scalar> Quat<S> {
    /// Converts from storage, x y z w.
    #[inline(always)]
    pub fn load(q: [f32; 4]) -> Self {
        let [x, y, z, w] = q.map(S::from);
        Self { axis: vec3(x, y, z), w }
    }

    /// Converts to storage, x y z w.
    #[inline(always)]
    pub fn store(self) -> [f32; 4] {
        let [x, y, z] = self.axis.store();
        [x, y, z, self.w.to_f32()]
    }
}

/// Product: b first, then a.
#[inline(always)]
pub fn quat_mul<L: Lane>(a: Quat<L>, b: Quat<L>) -> Quat<L> {
    let (p, q) = (a.axis, b.axis);
    Quat {
        axis: vec3(
            a.w * q.x + p.x * b.w + p.y * q.z - p.z * q.y,
            a.w * q.y - p.x * q.z + p.y * b.w + p.z * q.x,
            a.w * q.z + p.x * q.y - p.y * q.x + p.z * b.w,
        ),
        w: a.w * b.w - p.x * q.x - p.y * q.y - p.z * q.z,
    }
}

/// Displacement of the arm r by the rotation q: q r - r, without the cancellation of that difference.
#[inline(always)]
pub fn turned<L: Lane>(q: Quat<L>, r: Vec3<L>) -> Vec3<L> {
    let t = cross3(q.axis, r);
    (t * q.w + cross3(q.axis, t)) * L::constant(2.0)
}

/// The inverse rotation.
#[inline(always)]
pub fn conjugate<L: Lane>(q: Quat<L>) -> Quat<L> {
    Quat { axis: vec3(-q.axis.x, -q.axis.y, -q.axis.z), w: q.w }
}

/// The rotation by the vector r (rad), from the series of cos and sinc of half the angle (to 1e-5 at 4 rad). A longer
/// vector rotates by 4 rad: beyond that the series would leave the unit quaternions, and soon the finite numbers.
#[inline(always)]
pub fn exp_rotation<L: Lane>(r: Vec3<L>) -> Quat<L> {
    let half = r * L::constant(0.5);
    let square = dot3(half, half);
    let too_long = square.gt(L::constant(4.0));
    let u = half * L::select(L::constant(1.0), L::constant(2.0) * square.inverse_sqrt(), too_long);
    let s = L::select(square, L::constant(4.0), too_long);
    let cosine = polynomial(s, [1.0, -0.5, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40320.0, -1.0 / 3_628_800.0]);
    let sinc = polynomial(s, [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0, -1.0 / 39_916_800.0]);
    Quat { axis: vec3(u.x * sinc, u.y * sinc, u.z * sinc), w: cosine }
}

/// A nearly unit quaternion, brought closer to unit length by one Newton step.
#[inline(always)]
pub fn renormalized<L: Lane>(q: Quat<L>) -> Quat<L> {
    let a = q.axis;
    let s = L::constant(1.5) - L::constant(0.5) * (a.x * a.x + a.y * a.y + a.z * a.z + q.w * q.w);
    Quat { axis: vec3(a.x * s, a.y * s, a.z * s), w: q.w * s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_square_root_is_good_to_two_ulp_over_the_normal_range() {
        for exponent in -37..38 {
            for mantissa in 1..50 {
                let x = 10f32.powi(exponent) * (mantissa as f32 * 0.17);
                let exact = 1.0 / f64::from(x).sqrt();
                let error = (f64::from(x.inverse_sqrt()) / exact - 1.0).abs();
                assert!(error < 2.0 * f64::from(f32::EPSILON), "x = {x:e}: relative error {error:e}");
            }
        }
    }

    #[test]
    fn a_rotation_by_its_vector_agrees_with_sine_and_cosine() {
        for angle in [0.0_f64, 1e-6, 0.01, 1.0, 3.0] {
            let q = exp_rotation(vec3(0.0, angle, 0.0));
            let error = (q.axis.y - (0.5 * angle).sin()).abs().max((q.w - (0.5 * angle).cos()).abs());
            assert!(error < 1e-6, "angle {angle}: {error:e}");
        }
    }

    #[test]
    fn turned_is_the_rotated_arm_less_the_arm() {
        let q = glam::DQuat::from_rotation_z(0.7) * glam::DQuat::from_rotation_x(0.3);
        let r = glam::DVec3::new(1.0, -2.0, 0.5);
        let ours = turned(Quat { axis: vec3(q.x, q.y, q.z), w: q.w }, vec3(r.x, r.y, r.z));
        let exact = q * r - r;
        assert!((exact - glam::DVec3::new(ours.x, ours.y, ours.z)).length() < 1e-14);
    }

    #[test]
    fn the_reciprocal_keeps_the_sign() {
        assert!((reciprocal(-4.0_f32) + 0.25).abs() < 1e-7);
        assert!((reciprocal(0.5_f32) - 2.0).abs() < 1e-6);
    }

    #[test]
    fn the_reciprocal_is_good_to_four_ulp_over_the_normal_range() {
        for exponent in -37..38 {
            for mantissa in 1..50 {
                let x = 10f32.powi(exponent) * (mantissa as f32 * 0.17);
                let error = (f64::from(reciprocal(x)) * f64::from(x) - 1.0).abs();
                assert!(error < 4.0 * f64::from(f32::EPSILON), "x = {x:e}: relative error {error:e}");
                let scaled = x.inverse_power() * x;
                assert!(
                    (1.0..2.0).contains(&scaled) && (-x).inverse_power() == x.inverse_power(),
                    "x = {x:e}: {scaled}"
                );
            }
        }
        let tiny = 3.7e-200_f64;
        assert!((1.0..2.0).contains(&(tiny.inverse_power() * tiny)));
    }

    /// Scaling by powers of two causes no rounding.
    #[test]
    fn the_reciprocal_has_the_bits_that_it_has_unscaled() {
        for k in 1..100_000 {
            let x = k as f32 * 1.234_567e-3;
            let y = (x * x).inverse_sqrt();
            assert_eq!(reciprocal(x), x * (y * y), "{x}");
        }
    }
}
