//! u = W r + q of a contact problem, in the form for sweeps and Newton's method.

use glam::{DMat3, DVec3};

/// A contact problem as velocities that are linear in the impulses: u = W r + q.
///
/// [`Self::factor`] and [`Self::solve`] are a direct solver of 1 + D W for any block diagonal D. With an approximate D
/// they can precondition other methods.
///
/// ```
/// # use drystone_problems::contacts::LocalProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let rows = vec![vec![(0, DMat3::IDENTITY * 0.5)]];
/// # let problem = LocalProblem { name: "one contact".into(), friction: vec![0.1], free: vec![DVec3::X * -3.0], rows };
/// use drystone_problems::solver::newton::{Blocks, System};
///
/// let mut system = Blocks::new(&problem);
/// assert_eq!((system.sequence(), system.cones()[0].mu), (&[0][..], 0.1));
/// assert_eq!(system.response(0, &[DVec3::X], &system.carried(&[DVec3::X])), DVec3::X * 0.5);
/// system.push(0, DVec3::X, &mut []);
/// let (factor, sweep) = system.work();
/// assert!(factor > sweep);
/// // (1 + 2 * 0.5) x = b, and W x = 0.5 x.
/// system.factor(&[DMat3::IDENTITY * 2.0]).expect("no pivot is singular");
/// assert_eq!(system.solve(&[DVec3::X * 4.0]), [DVec3::X]);
/// ```
pub trait System {
    /// The data of each contact.
    fn cones(&self) -> &[Cone];

    /// The order in which sweeps visit the contacts.
    fn sequence(&self) -> &[u32];

    /// The velocities of the bodies under impulses `r`, which [`Self::response`] needs in addition to `r`. Empty if W
    /// has blocks.
    fn carried(&self, r: &[DVec3]) -> Vec<f64>;

    /// W r at a contact (m/s): u without q, because small changes of u would be lost in q.
    fn response(&self, contact: usize, r: &[DVec3], carried: &[f64]) -> DVec3;

    /// Adds the effect of a change of a contact's impulse to `carried`.
    fn push(&self, contact: usize, change: DVec3, carried: &mut [f64]);

    /// Multiplications of one [`Self::factor`], and of one sweep. The first call computes the elimination order.
    fn work(&mut self) -> (f64, f64);

    /// Factors 1 + D W with D in 3x3 blocks, one for each contact (kg). Returns `None` if a pivot is singular.
    fn factor(&mut self, d: &[DMat3]) -> Option<()>;

    /// W x with (1 + D W) x = b, for the last factored D. The caller computes x = b - D W x, because it can have D in
    /// more digits than the blocks.
    ///
    /// # Panics
    /// Nothing was factored.
    fn solve(&self, b: &[DVec3]) -> Vec<DVec3>;
}

/// The data of one contact.
///
/// ```
/// use drystone::glam::{DMat3, DVec3};
/// use drystone_problems::solver::newton::Cone;
///
/// let cone = Cone::new(0.3, DVec3::ZERO, DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0)));
/// assert_eq!((cone.rho, cone.tangent_step), (0.5, 1.0 / 3.0));
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Cone {
    /// Coulomb coefficient.
    pub mu: f64,
    /// u without impulses (m/s).
    pub q: DVec3,
    /// W_ii: the response of u to the contact's own impulse (1/kg).
    pub block: DMat3,
    /// 3/trace(W_ii): the step of `e_vel` (kg).
    pub rho: f64,
    /// The largest step along u_t that contracts in every direction (kg; docs/derivation.md, section 6).
    pub tangent_step: f64,
}

impl Cone {
    /// The data of a contact with this friction coefficient, q and W_ii.
    pub fn new(mu: f64, q: DVec3, block: DMat3) -> Self {
        let [[nn, _, _], [_, yy, yz], [_, zy, zz]] = block.to_cols_array_2d();
        let between = 0.5 * (yz + zy);
        let largest = 0.5 * (yy + zz + ((yy - zz).powi(2) + 4.0 * between * between).sqrt());
        Self { mu, q, block, rho: 3.0 / (nn + yy + zz), tangent_step: 1.0 / largest }
    }
}
