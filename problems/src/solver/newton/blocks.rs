//! W in blocks of contacts, without bodies. It solves (1 + D W) x = b directly, with three unknowns a contact.

use glam::{DMat3, DVec3};

use super::factor::Factor;
use super::system::{Cone, System};
use crate::contacts::LocalProblem;

/// A problem in the form of its W.
///
/// ```
/// # use drystone_problems::contacts::LocalProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let rows = vec![vec![(0, DMat3::IDENTITY * 0.5)]];
/// # let problem = LocalProblem { name: "one contact".into(), friction: vec![0.1], free: vec![DVec3::X * -3.0], rows };
/// use drystone_problems::solver::newton::{Blocks, newton};
///
/// let solved = newton(&mut Blocks::new(&problem), 1e-8, 1000);
/// assert!((solved.impulses[0].x - 6.0).abs() < 1e-6);
/// ```
pub struct Blocks<'a> {
    problem: &'a LocalProblem,
    cones: Vec<Cone>,
    sequence: Vec<u32>,
    factor: Option<Factor<3>>,
}

impl<'a> Blocks<'a> {
    /// The system of a problem. Sweeps follow the colors of its contacts.
    pub fn new(problem: &'a LocalProblem) -> Self {
        let cone = |i: usize| Cone::new(problem.friction[i], problem.free[i], problem.block(i));
        let count = problem.rows.len();
        Self { problem, cones: (0..count).map(cone).collect(), sequence: problem.colors().concat(), factor: None }
    }

    /// The factor, with its elimination order computed.
    fn ordered(&mut self) -> Factor<3> {
        let rows = &self.problem.rows;
        let ties = (0..).zip(rows).flat_map(|(i, row)| row.iter().map(move |&(j, _)| [i, j]));
        self.factor.take().unwrap_or_else(|| Factor::new(rows.len(), ties))
    }
}

impl System for Blocks<'_> {
    fn cones(&self) -> &[Cone] {
        &self.cones
    }

    fn sequence(&self) -> &[u32] {
        &self.sequence
    }

    fn carried(&self, _: &[DVec3]) -> Vec<f64> {
        Vec::new()
    }

    fn response(&self, contact: usize, r: &[DVec3], _: &[f64]) -> DVec3 {
        self.problem.response(contact, r)
    }

    fn push(&self, _: usize, _: DVec3, _: &mut [f64]) {}

    fn work(&mut self) -> (f64, f64) {
        let factor = self.ordered();
        let blocks = self.problem.rows.iter().map(Vec::len).sum::<usize>() as f64;
        let work = (factor.multiplications() + 27.0 * blocks, 9.0 * blocks);
        self.factor = Some(factor);
        work
    }

    fn factor(&mut self, d: &[DMat3]) -> Option<()> {
        let mut factor = self.ordered();
        factor.clear();
        for ((i, &d), row) in (0..).zip(d).zip(&self.problem.rows) {
            for &(j, w) in row {
                let (block, add) = (factor.block_mut(i, j), d * w);
                (0..3).for_each(|row| (0..3).for_each(|column| block[row][column] += add.col(column)[row]));
            }
        }
        let done = factor.factor();
        self.factor = Some(factor);
        done
    }

    fn solve(&self, b: &[DVec3]) -> Vec<DVec3> {
        let mut x: Vec<_> = b.iter().map(DVec3::to_array).collect();
        self.factor.as_ref().expect("factored").solve(&mut x);
        let x: Vec<_> = x.into_iter().map(DVec3::from_array).collect();
        (0..x.len()).map(|i| self.problem.response(i, &x)).collect()
    }
}
