//! Converts numbers of a scene file to single precision. Every refusal is one line.

use std::fmt::Display;

use glam::Quat;

use drystone::stages::error::input;
use drystone::world::MAX_LENGTH;
use drystone::{Error, Result};

/// Tolerance for the length of a quaternion or a normal. Within it, the value is normalized.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Largest error of the length of a quaternion by rounding to single precision.
const ROUNDING: f64 = 3.0 * f32::EPSILON as f64;

/// The values in single precision, if all of them are finite and `fits` accepts each. Otherwise an error with the
/// requirement `must`.
pub(super) fn checked<const N: usize>(
    name: impl Display,
    values: [f64; N],
    must: &str,
    fits: impl Fn(f32) -> bool,
) -> Result<[f32; N]> {
    let rounded = values.map(|x| x as f32);
    if !rounded.iter().all(|x| x.is_finite()) {
        return Err(refusal(name, &values, "finite in single precision"));
    }
    if rounded.iter().all(|&x| fits(x)) { Ok(rounded) } else { Err(refusal(name, &values, must)) }
}

/// Converts numbers whose range the world checks.
pub(super) fn finite<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "", |_| true)
}

pub(super) fn zero<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "zero for a fixed body", |x| x == 0.0)
}

pub(super) fn positive<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "positive", |x| x > 0.0)
}

/// Coordinates (m).
pub(super) fn lengths<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "at most 1e9 m in size", |x| x.abs() <= MAX_LENGTH)
}

pub(super) fn rotation(name: &str, values: [f64; 4]) -> Result<Quat> {
    unit(name, values).map(Quat::from_array)
}

/// A direction or a quaternion, normalized.
pub(super) fn unit<const N: usize>(name: &str, values: [f64; N]) -> Result<[f32; N]> {
    let length = values.iter().map(|x| x * x).sum::<f64>().sqrt();
    // A value that was normalized in single precision is read unchanged.
    if (length - 1.0).abs() <= ROUNDING {
        return Ok(values.map(|x| x as f32));
    }
    if (length - 1.0).abs() <= UNIT_TOLERANCE {
        Ok(values.map(|x| (x / length) as f32))
    } else {
        Err(refusal(name, &values, &format!("of length 1, but has length {}", shown(&[length]))))
    }
}

/// One line: the name of a value, the value, and the requirement.
pub(super) fn refusal(name: impl Display, values: &[f64], must: &str) -> Error {
    input!("{name} = {}: must be {must}", shown(values))
}

/// Numbers as in the file: `-1`, `1e39`, `[0.5, 0, 0]`.
fn shown(values: &[f64]) -> String {
    let texts = values.iter().map(|x| {
        let text = format!("{x:?}");
        text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
    });
    let list = texts.collect::<Vec<_>>().join(", ");
    if values.len() == 1 { list } else { format!("[{list}]") }
}
