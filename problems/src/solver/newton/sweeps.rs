//! Sweeps over a system, contact by contact, in f64 (docs/derivation.md, sections 4, 6 and 9).

use glam::{DVec2, DVec3};

use super::cone::error;
use super::system::{Cone, System};
use drystone::config::Method;
use drystone::stages::kernels::Momentum;
use drystone::stages::kernels::StepLength;

/// Impulses, and the velocities that follow from them.
#[derive(Clone)]
struct State {
    r: Vec<DVec3>,
    carried: Vec<f64>,
}

/// The state of sweeps over a problem.
///
/// ```
/// # use drystone_problems::contacts::LocalProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let rows = vec![vec![(0, DMat3::IDENTITY * 0.5)]];
/// # let problem = LocalProblem { name: "one contact".into(), friction: vec![0.1], free: vec![DVec3::X * -3.0], rows };
/// use drystone::config::Method;
/// use drystone_problems::solver::newton::{Blocks, Sweeps};
///
/// let system = Blocks::new(&problem);
/// let mut sweeps = Sweeps::new(&system, Method::Plain, vec![DVec3::ZERO]);
/// assert!(sweeps.error(&system) > 0.5);
/// (0..30).for_each(|_| sweeps.advance(&system));
/// assert!(sweeps.error(&system) < 1e-8 && (sweeps.impulses()[0].x - 6.0).abs() < 1e-6);
/// ```
pub struct Sweeps {
    method: Method,
    /// The states after the last sweep, after the sweep before it, and at the start of the next.
    now: State,
    before: State,
    start: State,
    momentum: Momentum<f64>,
    /// Number of sweeps so far.
    pub count: u32,
}

impl Sweeps {
    /// Starts from given impulses, one for each contact (N s).
    pub fn new(system: &impl System, method: Method, r: Vec<DVec3>) -> Self {
        let state = State { carried: system.carried(&r), r };
        let mut momentum = Momentum::default();
        momentum.begin();
        Self { method, now: state.clone(), before: state.clone(), start: state, momentum, count: 0 }
    }

    /// The impulses after the last sweep, each in its contact's coordinates (N s).
    pub fn impulses(&self) -> &[DVec3] {
        &self.now.r
    }

    /// `e_vel` of the impulses.
    pub fn error(&self, system: &impl System) -> f64 {
        let Self { now: State { r, carried }, .. } = self;
        let velocities = system.cones().iter().enumerate().map(|(i, c)| c.q + system.response(i, r, carried));
        error(system.cones(), r, velocities)
    }

    /// One sweep.
    pub fn advance(&mut self, system: &impl System) {
        std::mem::swap(&mut self.now, &mut self.before);
        self.now.r.copy_from_slice(&self.start.r);
        self.now.carried.copy_from_slice(&self.start.carried);
        for &i in system.sequence() {
            let (i, State { r, carried }) = (i as usize, &mut self.now);
            let cone = &system.cones()[i];
            let change = corrected(cone, r[i], cone.q + system.response(i, r, carried)) - r[i];
            if change != DVec3::ZERO {
                r[i] += change;
                system.push(i, change, carried);
            }
        }
        self.count += 1;
        if self.method == Method::Plain {
            self.start.clone_from(&self.now);
            return;
        }
        let mut step = StepLength::default();
        for ((x, start), before) in self.now.r.iter().zip(&self.start.r).zip(&self.before.r) {
            step.square += (*x - *start).length_squared();
            step.along += (*x - *start).dot(*x - *before);
        }
        self.momentum.update(step);
        let factor = self.momentum.factor;
        let State { r, carried } = &mut self.start;
        for ((start, x), before) in r.iter_mut().zip(&self.now.r).zip(&self.before.r) {
            *start = *x + (*x - *before) * factor;
        }
        if factor == 0.0 {
            // The accumulated rounding ends with the momentum.
            *carried = system.carried(r);
            return;
        }
        for ((start, x), before) in carried.iter_mut().zip(&self.now.carried).zip(&self.before.carried) {
            *start = x + (x - before) * factor;
        }
    }
}

/// The corrected impulse of a contact with the velocity u: the normal first, then friction with the new normal.
fn corrected(cone: &Cone, r: DVec3, u: DVec3) -> DVec3 {
    let own = cone.block.x_axis;
    let normal = (r.x - u.x / own.x).max(0.0);
    let slip = DVec2::new(u.y, u.z) + DVec2::new(own.y, own.z) * (normal - r.x);
    let friction = (DVec2::new(r.y, r.z) - slip * cone.tangent_step).clamp_length_max(cone.mu * normal);
    DVec3::new(normal, friction.x, friction.y)
}
