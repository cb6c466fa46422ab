//! The bodies of an island as one rigid body, in a step: its momentum, and the changes that conserve it.

use glam::{DMat3, DQuat, DVec3, Quat, Vec3};

use super::{lag, turn_of, weight};
use crate::constants::MAX_ROUNDINGS;
use crate::effort::Effort;
use crate::math::rotation::product;
use crate::math::{self, exp_rotation};
use crate::problem::StepProblem;
use crate::problem::damping::Decay;
use crate::world::World;

/// The motion of some bodies as one rigid body.
#[derive(Clone, Copy, Default)]
struct RigidMotion {
    center: DVec3,
    drift: DVec3,
    spin: DVec3,
    /// The energy of the spin (J).
    turning: f64,
}

/// The mass of some bodies, their center of mass, momentum, angular momentum about the center, inertia about it, and the
/// sum of their inertias, each about its own center.
#[derive(Clone, Copy, Debug)]
pub(super) struct Momenta {
    mass: f64,
    center: DVec3,
    linear: DVec3,
    angular: DVec3,
    inertia: DMat3,
    own: DMat3,
}

impl Momenta {
    /// Sums over bodies. Each has its center of mass, its velocities, and its rotation in the step.
    fn of(world: &World, bodies: impl Iterator<Item = (usize, DVec3, [DVec3; 2], Quat)> + Clone) -> Self {
        let [center, linear, angular] = [DVec3::ZERO; 3];
        let mut all = Self { mass: 0.0, center, linear, angular, inertia: DMat3::ZERO, own: DMat3::ZERO };
        for (i, place, [v, _], _) in bodies.clone() {
            let m = f64::from(world.bodies[i].mass.mass);
            all.mass += m;
            all.center += m * place;
            all.linear += m * v;
        }
        all.center /= all.mass;
        for (i, place, [v, w], turn) in bodies {
            let body = &world.bodies[i];
            let m = f64::from(body.mass.mass);
            let r = place - all.center;
            let own = body.mass.world_inertia(product(turn, body.rotation)).as_dmat3();
            all.angular += m * r.cross(v) + own * w;
            let outer = DMat3::from_cols(r * r.x, r * r.y, r * r.z);
            all.own += own;
            all.inertia += own + (DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer) * m;
        }
        all
    }

    fn rigid(&self) -> RigidMotion {
        let spin = self.inertia.inverse() * self.angular;
        let spin = if spin.is_finite() { spin } else { DVec3::ZERO };
        let drift = self.linear / self.mass;
        RigidMotion { center: self.center, drift, spin, turning: 0.5 * spin.dot(self.inertia * spin) }
    }

    /// The same bodies with the momentum of other ones.
    fn with_momentum(self, Self { linear, angular, .. }: &Self) -> Self {
        Self { linear: *linear, angular: *angular, ..self }
    }
}

/// The bodies of an island after a step of `dt` seconds that `problem` has run. `world` is the world before the step.
pub(super) struct Island<'a> {
    pub world: &'a World,
    pub problem: &'a mut StepProblem,
    /// Pairs of the island and the index of a body.
    pub members: &'a [(u32, u32)],
    pub dt: f64,
}

impl<'a> Island<'a> {
    /// The indices of its bodies.
    pub fn members(&self) -> impl Iterator<Item = usize> + Clone + use<'a> {
        self.members.iter().map(|(_, body)| *body as usize)
    }

    /// The size of the weight and forces of its bodies (N).
    pub fn weight(&self) -> f64 {
        self.members().map(|i| weight(&self.problem.masses[i])).sum()
    }

    /// The bodies after the step.
    fn now(&self) -> Momenta {
        let body = |i: usize| {
            let row = &self.problem.bodies[i];
            let [v, w, way] = [row.v, row.w, row.dp].map(|u| Vec3::from(u).as_dvec3());
            (i, self.world.bodies[i].center_of_mass().as_dvec3() + way, [v, w], turn_of(row))
        };
        Momenta::of(self.world, self.members().map(body))
    }

    /// The bodies before the step, plus the effect of forces and torques during the step. A force acts halfway along the
    /// path.
    pub fn before(&self) -> Momenta {
        let halfway = |i: usize| 0.5 * Vec3::from(self.problem.bodies[i].dp).as_dvec3();
        let spin_decay = |i: usize| Decay::of(self.world.bodies[i].angular_damping, self.dt);
        let body = |i: usize| {
            let body = &self.world.bodies[i];
            let [place, w] = [body.center_of_mass(), body.angular_velocity].map(|u| u.as_dvec3());
            (i, place, [self.untouched(i)[0], w * (1.0 - spin_decay(i).loss)], Quat::IDENTITY)
        };
        let mut all = Momenta::of(self.world, self.members().map(body));
        let mass = |i: usize| f64::from(self.world.bodies[i].mass.mass);
        let center = self.members().map(|i| mass(i) * halfway(i)).sum::<DVec3>() / all.mass;
        for i in self.members() {
            let torque = self.world.bodies[i].whole_torque().as_dvec3() * spin_decay(i).gain;
            all.angular += torque + mass(i) * (halfway(i) - center).cross(self.untouched(i)[1]);
        }
        all
    }

    /// Whether contacts changed the velocity of any of its bodies.
    pub fn is_pushed(&self) -> bool {
        self.members().any(|i| {
            let [free, gained] = self.untouched(i);
            let changed = Vec3::from(self.problem.bodies[i].v).as_dvec3().distance(free);
            changed > MAX_ROUNDINGS * f64::from(f32::EPSILON) * (free.length() + gained.length())
        })
    }

    /// The velocity that a body would have after the step without constraints, and the part of it that forces gave.
    fn untouched(&self, i: usize) -> [DVec3; 2] {
        let decay = Decay::of(self.world.bodies[i].linear_damping, self.dt);
        let gained = Vec3::from(self.problem.masses[i].acceleration).as_dvec3() * decay.gain;
        [self.world.bodies[i].linear_velocity.as_dvec3() * (1.0 - decay.loss) + gained, gained]
    }

    /// Whether no body moved further in the step than the sum of three parts: twice the distance that the fastest of
    /// them could move, the distance by which stabilization moves it, and the longest lever (m) of the joints.
    pub fn is_in_reach(&self, lever: f64, push_limit: f64) -> bool {
        let speed = |i: usize| {
            let fallen = Vec3::from(self.problem.masses[i].acceleration).as_dvec3() * self.dt;
            self.world.bodies[i].linear_velocity.as_dvec3().length() + fallen.length()
        };
        let fastest = self.members().map(speed).fold(0.0, f64::max);
        let reach = (2.0 * fastest + push_limit) * self.dt + lever;
        self.members().all(|i| Vec3::from(self.problem.bodies[i].dp).as_dvec3().length() <= reach)
    }

    /// Adds the rigid motion that gives the bodies this momentum.
    pub fn move_with(&mut self, momentum: &Momenta) {
        let motions = self.rigid_motions(Some(momentum));
        self.slow_down(motions, 1.0);
    }

    /// Changes all spins alike, so that the bodies get this angular momentum. Contacts without joints change linear
    /// momentum by no more than rounding, and spins by impulses whose arms stay within the step.
    pub fn spin_with(&mut self, momentum: &Momenta) {
        let now = self.now();
        let change = now.own.inverse() * (momentum.angular - now.angular);
        for i in self.members().filter(|_| change.is_finite()) {
            let row = &mut self.problem.bodies[i];
            row.w = (Vec3::from(row.w).as_dvec3() + change).as_vec3().to_array();
        }
    }

    /// Moves the bodies as one to the parabola of their center. Substeps leave the places of each body ahead of its
    /// velocity by its [`lag`].
    pub fn follow_parabola(&mut self, jointed: &[bool], effort: &Effort) {
        let (mut mass, mut ahead) = (0.0, DVec3::ZERO);
        for i in self.members() {
            let body = &self.world.bodies[i];
            let (m, v) = (f64::from(body.mass.mass), Vec3::from(self.problem.bodies[i].v).as_dvec3());
            mass += m;
            ahead += m * lag(jointed, self.problem, effort, i) * (v - body.linear_velocity.as_dvec3());
        }
        self.shift(-ahead / mass);
    }

    /// Shifts all bodies (m).
    fn shift(&mut self, by: DVec3) {
        for i in self.members() {
            let row = &mut self.problem.bodies[i];
            row.dp = (Vec3::from(row.dp).as_dvec3() + by).as_vec3().to_array();
        }
    }

    /// Removes the energy `over` (J) from the motion of the bodies, which have `kinetic` in total. If nothing holds
    /// them, momentum is conserved: they get the momentum of the `start`, and their motion relative to the rigid motion of
    /// all slows down. If even the rigid motion has more energy than is left, the result is false. If
    /// something holds the bodies, their whole motion slows down.
    pub fn brake(&mut self, [over, kinetic]: [f64; 2], start: Option<&Momenta>) -> bool {
        let left = (kinetic - over).max(0.0);
        if let Some(start) = start {
            self.turn_back(start, left);
        }
        let [from, to] = self.rigid_motions(start);
        if to.turning > left * (1.0 + f64::from(f32::EPSILON)) {
            return false;
        }
        let inner = kinetic - from.turning;
        let scale = if inner > 0.0 { ((left - to.turning) / inner).clamp(0.0, 1.0).sqrt() } else { 1.0 };
        self.slow_down([from, to], scale);
        true
    }

    /// Turns the bodies about their center until the rigid motion with the momentum of the `start` has the energy `left`
    /// (J). A small turn d changes the energy of the angular momentum l and the spin w by -d·(l x w). The bodies turn
    /// back by less than the spin turns them in the step; otherwise they stay.
    fn turn_back(&mut self, start: &Momenta, left: f64) {
        let mut whole = DVec3::ZERO;
        for _ in 0..4 {
            let [from, to] = self.rigid_motions(Some(start));
            let slope = start.angular.cross(to.spin);
            let turn = slope * ((to.turning - left) / slope.length_squared());
            whole += turn;
            if !(to.turning > left && whole.length() < to.spin.length() * self.dt) {
                return;
            }
            self.turn(&from, rotation_by(turn));
        }
    }

    /// Turns the bodies about the center of a rigid motion, with their velocities relative to its drift.
    fn turn(&mut self, RigidMotion { center, drift, .. }: &RigidMotion, turn: DQuat) {
        for i in self.members() {
            let row = &mut self.problem.bodies[i];
            let [way, v, w] = [row.dp, row.v, row.w].map(|u| Vec3::from(u).as_dvec3());
            let arm = self.world.bodies[i].center_of_mass().as_dvec3() + way - center;
            row.dp = (way + turn * arm - arm).as_vec3().to_array();
            row.v = (drift + turn * (v - drift)).as_vec3().to_array();
            row.w = (turn * w).as_vec3().to_array();
            row.dq = (turn * turn_of(row).as_dquat()).as_quat().to_array();
        }
    }

    /// The rigid motion of the bodies now, and the one with the momentum of the `start`. Both are zero if something holds
    /// the bodies.
    fn rigid_motions(&self, start: Option<&Momenta>) -> [RigidMotion; 2] {
        let Some(start) = start else { return [RigidMotion::default(); 2] };
        let now = self.now();
        [now, now.with_momentum(start)].map(|momenta| momenta.rigid())
    }

    /// Scales the motion of the bodies relative to one rigid motion, and replaces that rigid motion by another one.
    fn slow_down(&mut self, [from, to]: [RigidMotion; 2], scale: f64) {
        for i in self.members() {
            let row = &mut self.problem.bodies[i];
            let [way, v, w] = [row.dp, row.v, row.w].map(|u| Vec3::from(u).as_dvec3());
            let place = self.world.bodies[i].center_of_mass().as_dvec3() + way;
            let at = |motion: &RigidMotion| motion.drift + motion.spin.cross(place - motion.center);
            row.v = (at(&to) + (v - at(&from)) * scale).as_vec3().to_array();
            row.w = (to.spin + (w - from.spin) * scale).as_vec3().to_array();
        }
    }

    /// Moves the bodies from their poses before the step as one rigid body, with the momentum that forces give them. If
    /// something holds them, they stand still. If `is_kept`, they keep their velocities relative to each other.
    pub fn move_rigidly(&mut self, is_held: bool, is_kept: bool) {
        let share = if is_kept { 1.0 } else { 0.0 };
        self.go_back();
        if is_held {
            return self.slow_down(self.rigid_motions(None), share);
        }
        let start = self.before();
        let [from, to] = self.rigid_motions(Some(&start));
        let (now, half) = (self.now(), DMat3::from_quat(rotation_by(0.5 * self.dt * to.spin)));
        let halfway = Momenta { inertia: half * now.inertia * half.transpose(), ..now.with_momentum(&start) };
        self.turn(&from, rotation_by(self.dt * halfway.rigid().spin));
        self.turn_back(&start, to.turning);
        let [_, turned] = self.rigid_motions(Some(&start));
        if turned.turning > to.turning * (1.0 + f64::from(f32::EPSILON)) {
            // The step is too long for the rotation.
            self.go_back();
        }
        self.slow_down(self.rigid_motions(Some(&start)), share);
        self.shift(0.5 * self.dt * (from.drift + to.drift));
    }

    /// Moves the bodies back to their poses and velocities before the step.
    fn go_back(&mut self) {
        for i in self.members() {
            let (body, row) = (&self.world.bodies[i], &mut self.problem.bodies[i]);
            (row.dp, row.dq) = ([0.0; 3], Quat::IDENTITY.to_array());
            (row.v, row.w) = (body.linear_velocity.to_array(), body.angular_velocity.to_array());
        }
    }
}

/// The rotation by a rotation vector.
fn rotation_by(turn: DVec3) -> DQuat {
    let math::Quat { axis, w } = exp_rotation(math::vec3(turn.x, turn.y, turn.z));
    DQuat::from_xyzw(axis.x, axis.y, axis.z, w).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{BodyRow, MassRow, store};
    use crate::world::{Body, Shape};

    fn two_balls() -> World {
        let mut world = World::new();
        for x in [-1.0, 1.0] {
            world.insert(Body::dynamic().shape(Shape::ball(0.1)).total_mass(1.0).position(x, 0.0, 0.0));
        }
        world
    }

    /// Two balls of 1 kg part at 1 m/s each. A quarter of their energy leaves half of their speeds, relative to the
    /// motion of both that the momentum of the start has.
    #[test]
    fn balls_that_part_keep_a_quarter_of_their_energy_and_the_momentum_of_the_start() {
        let world = two_balls();
        for drift in [None, Some(3.0_f64)] {
            let row = |x: f32| BodyRow { v: [x, 0.0, 0.0], ..BodyRow::AT_REST };
            let mut problem = StepProblem { bodies: vec![row(-1.0), row(1.0)], ..StepProblem::default() };
            let mut island = Island { world: &world, problem: &mut problem, members: &[(0, 0), (0, 1)], dt: 1.0 };
            let start = drift.map(|drift| Momenta { linear: DVec3::X * 2.0 * drift, ..island.now() });
            assert!(island.brake([0.75, 1.0], start.as_ref()));
            for (row, relative) in problem.bodies.iter().zip([-0.5, 0.5]) {
                let expected = Vec3::X * (drift.unwrap_or(0.0) as f32 + relative);
                assert!(Vec3::from(row.v).distance(expected) < 1e-5, "{:?}, not {expected} m/s", row.v);
            }
        }
    }

    /// A dumbbell with a third ball beside it, in the motion that has the spin w. A round is a step without constraints.
    #[test]
    fn a_dumbbell_that_tumbles_keeps_its_energy_and_momentum() {
        let (mut world, w) = (two_balls(), DVec3::new(7.0, 2.0, -1.0));
        world.insert(Body::dynamic().shape(Shape::ball(0.1)).total_mass(0.5).position(0.5, 0.7, 0.0));
        let [a, b, c] = [DVec3::NEG_X, DVec3::X, DVec3::new(0.5, 0.7, 0.0)];
        let center = (a + b + 0.5 * c) / 2.5;
        for (body, place) in world.bodies.as_mut_slice().iter_mut().zip([a, b, c]) {
            (body.linear_velocity, body.angular_velocity) = (w.cross(place - center).as_vec3(), w.as_vec3());
        }
        let own = 0.4 * 0.01 * 2.5 * w;
        let momentum = |m: f64, place: DVec3| m * (place - center).cross(w.cross(place - center));
        let angular = own + momentum(1.0, a) + momentum(1.0, b) + momentum(0.5, c);
        let energy = 0.5 * w.dot(angular);

        let rows = vec![BodyRow::AT_REST; 3];
        let mut problem = StepProblem { bodies: rows, masses: vec![MassRow::default(); 3], ..StepProblem::default() };
        let mut swing = 0.0_f32;
        for _ in 0..600 {
            let mut island =
                Island { world: &world, problem: &mut problem, members: &[(0, 0), (0, 1), (0, 2)], dt: 1.0 / 60.0 };
            island.move_rigidly(false, true);
            store(&problem, &[], &mut world);
            swing = swing
                .max(world.bodies.iter().map(|body| body.angular_velocity.distance(w.as_vec3())).fold(0.0, f32::max));
        }
        let mut island = Island { world: &world, problem: &mut problem, members: &[(0, 0), (0, 1), (0, 2)], dt: 0.0 };
        island.move_rigidly(true, true);
        let (now, rigid) = (island.now(), island.now().rigid());
        assert!((now.angular - angular).length() < 1e-4 * angular.length(), "{} for {angular}", now.angular);
        assert!((rigid.turning - energy).abs() < 1e-4 * energy, "{} J for {energy} J", rigid.turning);
        assert!(now.center.distance(center) < 1e-4, "{}", now.center);
        assert!(swing > 1.0, "the spin changed by {swing} rad/s at most");
    }

    /// The rows of a step that was torn apart are not numbers.
    #[test]
    fn an_island_that_is_torn_apart_keeps_its_momentum() {
        let mut world = two_balls();
        for (body, z) in world.bodies.as_mut_slice().iter_mut().zip([-1.0, 1.0]) {
            body.linear_velocity = Vec3::new(2.0, 0.0, z);
        }
        let torn = BodyRow { dp: [f32::NAN; 3], v: [f32::NAN; 3], ..BodyRow::AT_REST };
        let mut problem =
            StepProblem { bodies: vec![torn; 2], masses: vec![MassRow::default(); 2], ..StepProblem::default() };
        let mut island = Island { world: &world, problem: &mut problem, members: &[(0, 0), (0, 1)], dt: 1.0 / 60.0 };
        island.move_rigidly(false, false);
        let now = island.now();
        let [linear, angular] = [DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, -2.0, 0.0)];
        assert!(now.linear.distance(linear) < 1e-5 && now.angular.distance(angular) < 1e-5, "{now:?}");
        assert!((now.center.x - 2.0 / 60.0).abs() < 1e-6, "{now:?}");
    }
}
