//! One contact problem at the level of velocities, in f64: the input of a solver after detection.
//!
//! Let J be the rows of all contacts and M the masses. A solver computes impulses r so that
//!
//! ```text
//! v = v_free + M⁻¹ Jᵀ r        u = J v + w        for each contact, with r = (r_n, r_t) and u = (u_n, u_t):
//! 0 <= u_n,  0 <= r_n,  u_n r_n = 0               Signorini: they push, and only where they touch
//! |r_t| <= mu r_n,  r_t = -mu r_n u_t/|u_t| where |u_t| > 0                       Coulomb
//! ```
//!
//! The rows are those of docs/derivation.md, sections 2 and 6. The text format is described in docs/contacts-format.md.
//! The HDF5 format is FCLIB's global form. FCLIB's local form has u = W r + q in place of the first line:
//! [`LocalProblem`].

#[cfg(feature = "fclib")]
mod fclib;
mod format;
mod local;
mod operator;
mod step;

pub use local::LocalProblem;
pub use operator::Operator;

use glam::{DMat3, DVec3};

/// Movable bodies, and their contacts with each other and with fixed bodies.
///
/// ```
/// use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
/// use drystone_problems::ContactProblem;
/// use drystone::glam::{DMat3, DVec3};
/// let free = Velocity { linear: DVec3::new(1.0, -3.0, 0.0), angular: DVec3::ZERO };
/// let ball = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// let frame = [DVec3::Y, DVec3::Z, DVec3::X];
/// let (offset, r_a, r_b) = (DVec3::ZERO, DVec3::ZERO, DVec3::Y * -0.5);
/// let contact = PointContact { a: None, b: Some(0), friction: 0.1, offset, frame, r_a, r_b };
/// let problem = ContactProblem { name: "a ball".into(), bodies: vec![ball], contacts: vec![contact] };
/// // Convert to text and back.
/// assert_eq!(ContactProblem::parse(&problem.to_text())?, problem);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactProblem {
    /// Its name, on one line.
    pub name: String,
    /// The movable bodies.
    pub bodies: Vec<FreeBody>,
    /// Their contacts, each with one point.
    pub contacts: Vec<PointContact>,
}

/// A movable body.
///
/// ```
/// use drystone_problems::contacts::{FreeBody, Velocity};
/// use drystone::glam::{DMat3, DVec3};
///
/// let free = Velocity { linear: DVec3::X, angular: DVec3::ZERO };
/// let body = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// assert_eq!(body.free.linear, DVec3::X);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeBody {
    /// Mass (kg).
    pub mass: f64,
    /// Inertia about the center of mass, world axes (kg m²).
    pub inertia: DMat3,
    /// Its velocity at the end of the step without contacts, including all forces.
    pub free: Velocity,
}

/// Linear and angular velocity of a body.
///
/// ```
/// use drystone_problems::contacts::Velocity;
///
/// assert_eq!(Velocity::default().linear.length(), 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Velocity of the center of mass (m/s).
    pub linear: DVec3,
    /// Angular velocity in world axes (rad/s).
    pub angular: DVec3,
}

/// One contact point between two bodies.
///
/// ```
/// # use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
/// # use drystone_problems::ContactProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let free = Velocity { linear: DVec3::new(1.0, -3.0, 0.0), angular: DVec3::ZERO };
/// # let ball = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// # let frame = [DVec3::Y, DVec3::Z, DVec3::X];
/// # let (offset, r_a, r_b) = (DVec3::ZERO, DVec3::ZERO, DVec3::Y * -0.5);
/// # let contact = PointContact { a: None, b: Some(0), friction: 0.1, offset, frame, r_a, r_b };
/// # let problem = ContactProblem { name: "a ball".into(), bodies: vec![ball], contacts: vec![contact] };
/// // The first coordinate is along the normal.
/// let r = contact.coordinates(DVec3::Y * 6.0);
/// assert_eq!((r, contact.impulse(r)), (DVec3::X * 6.0, DVec3::Y * 6.0));
/// # let _ = problem;
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointContact {
    /// The body that the normal points away from, or `None` if it is fixed.
    pub a: Option<u32>,
    /// The body that the normal points to, or `None` if it is fixed.
    pub b: Option<u32>,
    /// Coulomb coefficient mu.
    pub friction: f64,
    /// A velocity that is added to the relative velocity, in the contact's coordinates (m/s): restitution, or gap
    /// divided by step length.
    pub offset: DVec3,
    /// The coordinate axes of the contact: unit normal from a to b, first and second tangent, in world axes. Tangents
    /// are used unchanged, even if they are not orthonormal.
    pub frame: [DVec3; 3],
    /// From the center of mass of a to the point, in world axes (m); without effect if a is fixed.
    pub r_a: DVec3,
    /// From the center of mass of b to the point, in world axes (m); without effect if b is fixed.
    pub r_b: DVec3,
}

impl PointContact {
    /// A world vector in the contact's coordinates: normal, first and second tangent.
    pub fn coordinates(&self, x: DVec3) -> DVec3 {
        DVec3::from_array(self.frame.map(|d| d.dot(x)))
    }

    /// The impulse on b in world axes (N s) with the coordinates `r`.
    pub fn impulse(&self, r: DVec3) -> DVec3 {
        self.frame[0] * r.x + self.frame[1] * r.y + self.frame[2] * r.z
    }
}

/// A contact problem in either form.
///
/// ```
/// # use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
/// # use drystone_problems::ContactProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let free = Velocity { linear: DVec3::new(1.0, -3.0, 0.0), angular: DVec3::ZERO };
/// # let ball = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// # let frame = [DVec3::Y, DVec3::Z, DVec3::X];
/// # let (offset, r_a, r_b) = (DVec3::ZERO, DVec3::ZERO, DVec3::Y * -0.5);
/// # let contact = PointContact { a: None, b: Some(0), friction: 0.1, offset, frame, r_a, r_b };
/// # let problem = ContactProblem { name: "a ball".into(), bodies: vec![ball], contacts: vec![contact] };
/// use drystone_problems::contacts::Problem;
///
/// let path = std::env::temp_dir().join(format!("drystone-{}.contacts", std::process::id()));
/// std::fs::write(&path, problem.to_text()).map_err(drystone::Error::file(&path))?;
/// assert_eq!(Problem::read(&path)?, Problem::Bodies(problem));
/// # std::fs::remove_file(&path).map_err(drystone::Error::file(&path))?;
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Problem {
    /// A problem with bodies.
    Bodies(ContactProblem),
    /// A problem without bodies: W in blocks of contacts.
    Blocks(LocalProblem),
}

#[cfg(not(feature = "fclib"))]
const NO_HDF5: &str = "an HDF5 file needs the feature fclib, but drystone was built without it";

#[cfg(not(feature = "fclib"))]
impl ContactProblem {
    fn from_fclib(_: Vec<u8>) -> drystone::Result<Self> {
        Err(drystone::Error::input(NO_HDF5))
    }
}

#[cfg(not(feature = "fclib"))]
impl Problem {
    fn from_fclib(_: Vec<u8>) -> drystone::Result<Self> {
        Err(drystone::Error::input(NO_HDF5))
    }
}

/// Whether a symmetric matrix is positive definite: all pivots of its elimination are positive.
fn is_positive_definite(m: DMat3) -> bool {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = m.to_cols_array_2d();
    let (p_yy, p_yz, p_zz) = (yy - xy * xy / xx, yz - xy * xz / xx, zz - xz * xz / xx);
    xx > 0.0 && p_yy > 0.0 && p_zz - p_yz * p_yz / p_yy > 0.0
}
