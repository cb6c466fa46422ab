//! Random problems. Every row is valid, but the rows do not describe a scene.
#![allow(clippy::field_reassign_with_default)]

use glam::{Mat3, Quat, Vec3};

use drystone::stages::graph::{Coloring, ConstraintGraph, Edge, IMMOVABLE};
use drystone::stages::problem::StepProblem;
use drystone::stages::problem::softness;
use drystone::stages::problem::{
    AxisRow, BodyRow, ContactRow, ConvergenceRow, DampingRow, ImpulseRow, InertiaRow, JointImpulseRow, JointRow,
    MassRow, NO_LIMIT, NodeRow, Params, PointRow, Substep, TorqueRow, TurningRow,
};
use drystone::stages::random::SplitMix64;

/// SplitMix64 with the distributions that problems need.
pub struct Random(SplitMix64);

impl Random {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// A whole number below `end`.
    pub fn below(&mut self, end: u32) -> u32 {
        (self.bits() % u64::from(end)) as u32
    }

    /// Returns true with the probability `chance`.
    pub fn happens(&mut self, chance: f32) -> bool {
        self.within(0.0, 1.0) < chance
    }

    /// A number from `least` to `most`.
    pub fn within(&mut self, least: f32, most: f32) -> f32 {
        least + (most - least) * ((self.bits() >> 40) as f32 / (1 << 24) as f32)
    }

    /// A vector in a cube of half extent `size`.
    pub fn vector(&mut self, size: f32) -> Vec3 {
        Vec3::from_array([(); 3].map(|()| self.within(-size, size)))
    }

    /// A random rotation, not uniformly distributed.
    pub fn rotation(&mut self) -> Quat {
        let q = Quat::from_array([(); 4].map(|()| self.within(-1.0, 1.0)));
        if q.length() > 0.1 { q.normalize() } else { Quat::IDENTITY }
    }
}

/// Bodies of a random problem. One in five cannot move.
const BODIES: u32 = 200;
/// Contacts of a random problem. Some of its colors are then larger than a workgroup.
const CONTACTS: u32 = 600;
/// Contacts that take no part in the sweeps.
const IDLE: usize = 5;
/// Joints of a random problem.
const JOINTS: u32 = 300;
/// Largest number of joints that are solved at once. One thread factors them again and again, and llvmpipe ends the
/// loops of a program after 65,535 iterations.
const JOINTS_AT_ONCE: u32 = 60;

fn is_movable(body: u32) -> bool {
    !body.is_multiple_of(5)
}

/// A problem in color order with 1 to 4 points a contact, and patches if `patches`. Numbers are of order 1; a substep
/// turns bodies by up to 3 rad, so that every term of each series matters.
pub fn problem(seed: u64, patches: bool) -> StepProblem {
    let random = &mut Random::new(seed);
    let mut problem = StepProblem::default();
    for body in 0..BODIES {
        problem.bodies.push(body_row(random));
        problem.masses.push(if is_movable(body) { mass_row(random) } else { MassRow::default() });
        let mut torque = TorqueRow::NONE;
        if is_movable(body) && body % 3 == 0 {
            torque.angular_acceleration = [1.0, 0.3, -0.7].map(|x| x * (body as f32 - 70.0));
        }
        problem.torques.push(torque);
        problem.dampings.push(damping_row(body));
        if is_movable(body) && random.happens(0.5) {
            problem.inertias.push(inertia_row(random, body));
        }
    }
    let (contacts, coloring) = colored(random, CONTACTS);
    let contact_colors = coloring.color_count() as u32;
    (problem.order, problem.colors) = (coloring.order, coloring.offsets);
    // The last ones take no part in the sweeps.
    for bodies in contacts.into_iter().chain([[1, 2]; IDLE]) {
        let first_point = problem.points.len() as u32;
        let point_count = 1 + random.below(4);
        problem.contacts.push(contact_row(random, bodies, first_point, point_count));
        for row in 0..point_count + u32::from(patches) {
            problem.points.push(point_row(random, patches));
            problem.impulses.push(impulse_row(random, row == point_count));
        }
    }
    problem.totals = problem.impulses.iter().rev().copied().collect();
    let (joints, coloring) = colored(random, JOINTS);
    // The joints of the last colors are solved at once.
    let direct = coloring.offsets.iter().take_while(|&&first| JOINTS - first > JOINTS_AT_ONCE).count();
    let at_once = coloring.order[coloring.offsets[direct] as usize..].to_vec();
    problem.colors.extend(coloring.offsets[1..].iter().map(|end| end + CONTACTS));
    problem.order.extend(coloring.order);
    for bodies in joints {
        problem.joints.push(joint_row(random, bodies));
        let mut impulse = JointImpulseRow::default();
        impulse.linear = random.vector(1.0).to_array();
        problem.joint_impulses.push(impulse);
    }
    // A third of the joints are ball joints.
    for joint in 0..problem.joints.len() {
        let (first_axis, axis_count) = (problem.axes.len() as u32, random.below(3) * random.below(7));
        (problem.joints[joint].first_axis, problem.joints[joint].axis_count) = (first_axis, axis_count);
        for _ in 0..axis_count {
            let (axis, impulse) = axis_row(random);
            problem.axes.push(axis);
            let mut row = JointImpulseRow::default();
            row.linear[0] = impulse;
            problem.joint_impulses.push(row);
        }
        if axis_count > 0 && random.happens(0.3) {
            problem.joints[joint].is_loose = 1.0;
        }
    }
    problem.joint_totals = problem.joint_impulses.iter().rev().copied().collect();
    problem.convergence = ConvergenceRow { moving: random.below(2), done: 0, sweeps: 3, planned: 5 };
    problem.params = params(&problem, patches);
    solve_at_once(random, &mut problem, &at_once);
    problem.in_one_block(contact_colors, substep());
    problem.blocks[0].direct = contact_colors + direct as u32;
    problem
}

/// Puts some joints into one system, and lets the inertia of half of the bodies rotate.
fn solve_at_once(random: &mut Random, problem: &mut StepProblem, joints: &[u32]) {
    let mut nodes = Vec::new();
    for &joint in joints {
        let row = &problem.joints[joint as usize];
        let axes = &problem.axes[row.first_axis as usize..(row.first_axis + row.axis_count) as usize];
        let bounds = (0..).zip(axes).filter(|(_, axis)| axis.is_lock() || axis.is_limit());
        let bounds: Vec<(u32, bool)> = bounds.map(|(k, axis)| (k, axis.is_limit())).collect();
        nodes.extend(bounds.chunks(3).map(|bounds| (joint, NodeRow::rows_of(bounds))));
        nodes.extend(Some((joint, NodeRow::ANCHORS)).filter(|_| row.is_loose == 0.0));
    }
    let side = |body: u32| Some(body).filter(|&body| is_movable(body));
    let sides = |joint: u32| {
        let row = &problem.joints[joint as usize];
        [side(row.body_a), side(row.body_b)]
    };
    assert!(problem.systems.add(&nodes, sides, usize::MAX));
    // There are more joints than the bodies can satisfy. Without softness, S would be nearly singular.
    problem.systems.softness[0] = 1.0;
    for body in (0..BODIES).filter(|&body| is_movable(body)) {
        if random.happens(0.5) {
            let MassRow { inv_inertia_x, inv_inertia_yz, .. } = mass_row(random);
            problem.turning.push(TurningRow { inv_inertia_x, body, inv_inertia_yz, ..TurningRow::default() });
        }
    }
}

/// The same problem with all velocities, accelerations, impulses, separations and gaps scaled by `scale`.
pub fn scaled(mut problem: StepProblem, scale: f32) -> StepProblem {
    let scale = |x: &mut f32| *x *= scale;
    for row in &mut problem.bodies {
        row.v.iter_mut().chain(&mut row.w).chain(&mut row.dp).for_each(scale);
    }
    problem.masses.iter_mut().flat_map(|row| &mut row.acceleration).for_each(scale);
    problem.torques.iter_mut().flat_map(|row| &mut row.angular_acceleration).for_each(scale);
    problem.dampings.iter_mut().flat_map(|row| row.linear_gain.iter_mut().chain(&mut row.angular_gain)).for_each(scale);
    problem.points.iter_mut().flat_map(|row| [&mut row.separation, &mut row.pull]).for_each(scale);
    problem.joints.iter_mut().flat_map(|row| &mut row.gap).for_each(scale);
    problem.axes.iter_mut().flat_map(|row| [&mut row.gap, &mut row.speed, &mut row.max_impulse]).for_each(scale);
    problem.axes.iter_mut().filter(|row| row.left > NO_LIMIT).map(|row| &mut row.left).for_each(scale);
    bytemuck::cast_slice_mut(&mut problem.impulses).iter_mut().for_each(scale);
    bytemuck::cast_slice_mut(&mut problem.totals).iter_mut().for_each(scale);
    bytemuck::cast_slice_mut(&mut problem.joint_impulses).iter_mut().for_each(scale);
    bytemuck::cast_slice_mut(&mut problem.joint_totals).iter_mut().for_each(scale);
    [&mut problem.params.slop, &mut problem.params.tolerance].into_iter().for_each(scale);
    problem
}

/// The same problem with masses and impulses `factor` times as large.
pub fn heavier(mut problem: StepProblem, factor: f32) -> StepProblem {
    let lighter = |x: &mut f32| *x *= 1.0 / factor;
    let scale = |x: &mut f32| *x *= factor;
    for row in &mut problem.masses {
        row.inv_inertia_x.iter_mut().chain(&mut row.inv_inertia_yz).chain([&mut row.inv_mass]).for_each(lighter);
    }
    for row in &mut problem.turning {
        row.inv_inertia_x.iter_mut().chain(&mut row.inv_inertia_yz).for_each(lighter);
    }
    problem.points.iter_mut().flat_map(|row| [&mut row.normal_mass, &mut row.tangent_mass]).for_each(scale);
    problem.axes.iter_mut().map(|row| &mut row.max_impulse).for_each(scale);
    // The rate of a spring is an impulse.
    problem.axes.iter_mut().filter(|row| row.impulse_scale > 0.0).map(|row| &mut row.rate).for_each(scale);
    bytemuck::cast_slice_mut(&mut problem.impulses).iter_mut().for_each(scale);
    bytemuck::cast_slice_mut(&mut problem.totals).iter_mut().for_each(scale);
    bytemuck::cast_slice_mut(&mut problem.joint_impulses).iter_mut().for_each(scale);
    bytemuck::cast_slice_mut(&mut problem.joint_totals).iter_mut().for_each(scale);
    problem
}

/// The same problem with spins `factor` times as fast and moments of inertia of other ratios: some are possible for a
/// solid, others are up to 1:1000.
pub fn faster(mut problem: StepProblem, factor: f32) -> StepProblem {
    problem.bodies.iter_mut().flat_map(|row| &mut row.w).for_each(|w| *w *= factor);
    for (k, row) in problem.inertias.iter_mut().enumerate() {
        let thin = [1.0, 0.1, 0.01, 0.001][k % 4];
        row.principal[k % 3] *= thin;
        row.inv_principal[k % 3] *= 1.0 / thin;
    }
    problem
}

fn substep() -> Substep {
    let mut substep = Substep::default();
    substep.length = 0.1;
    substep.inverse_length = 1.0 / substep.length;
    substep.movable = softness(1.5, 2.0, substep.length, 0.5);
    substep.fixed = softness(3.0, 2.0, substep.length, 0.5);
    substep.joint = softness(2.0, 1.0, substep.length, 0.5);
    substep
}

fn params(problem: &StepProblem, patches: bool) -> Params {
    let mut params = Params::default();
    params.restitution_threshold = 1.0;
    params.bounces = problem.contacts.iter().any(|contact| contact.restitution > 0.0).into();
    params.body_count = problem.bodies.len() as u32;
    params.point_count = problem.points.len() as u32;
    params.joint_count = problem.joints.len() as u32;
    params.axis_count = problem.axes.len() as u32;
    params.patches = patches.into();
    params.slop = 0.02;
    params.relaxation = 0.9;
    params.tolerance = 0.5;
    params
}

/// The bodies of `count` random constraints in color order, the start of each color, and the end of the last one.
fn colored(random: &mut Random, count: u32) -> (Vec<[u32; 2]>, Coloring) {
    let pairs: Vec<_> = (0..count).map(|_| random_pair(random)).collect();
    let place = |body: u32| if is_movable(body) { body } else { IMMOVABLE };
    let mut edges: Vec<_> =
        pairs.iter().map(|&[a, b]| Edge { a: place(a), b: place(b), color: None, rank: 0 }).collect();
    let coloring = ConstraintGraph::default().color(BODIES as usize, &mut edges, 64);
    (pairs, coloring)
}

fn random_pair(random: &mut Random) -> [u32; 2] {
    loop {
        let (a, b) = (random.below(BODIES), random.below(BODIES));
        if a != b && (is_movable(a) || is_movable(b)) {
            return [a, b];
        }
    }
}

fn body_row(random: &mut Random) -> BodyRow {
    let mut row = BodyRow::AT_REST;
    row.v = random.vector(5.0).to_array();
    row.w = random.vector(17.0).to_array();
    row.dp = random.vector(0.1).to_array();
    row.time = 4e-3;
    row.dq = random.rotation().to_array();
    row
}

fn mass_row(random: &mut Random) -> MassRow {
    let axes = Mat3::from_quat(random.rotation());
    let inverse = (Vec3::splat(1.1) + random.vector(1.0)) * 0.5;
    let i = axes * Mat3::from_diagonal(inverse) * axes.transpose();
    let mut row = MassRow::default();
    row.inv_inertia_x = [i.x_axis.x, i.x_axis.y, i.x_axis.z];
    row.inv_inertia_yz = [i.y_axis.y, i.y_axis.z, i.z_axis.z];
    row.inv_mass = random.within(0.1, 1.0);
    row.acceleration = random.vector(10.0).to_array();
    row
}

fn inertia_row(random: &mut Random, body: u32) -> InertiaRow {
    let principal = Vec3::splat(3.0) + random.vector(1.0);
    let mut row = InertiaRow::default();
    row.principal = principal.to_array();
    row.body = body;
    row.inv_principal = principal.recip().to_array();
    row.frame = random.rotation().to_array();
    row
}

fn contact_row(random: &mut Random, [body_a, body_b]: [u32; 2], first_point: u32, point_count: u32) -> ContactRow {
    let axes = Mat3::from_quat(random.rotation());
    let mut or_zero = |chance: f32| if random.happens(chance) { 0.0 } else { random.within(0.1, 1.0) };
    let mut row = ContactRow::default();
    row.normal = axes.x_axis.to_array();
    row.friction = or_zero(0.2);
    row.tangent = axes.y_axis.to_array();
    row.restitution = or_zero(0.5);
    row.body_a = body_a;
    row.body_b = body_b;
    row.first_point = first_point;
    row.point_count = point_count;
    row.radius_a = or_zero(0.5);
    row.radius_b = or_zero(0.5);
    row
}

/// The damping of a body: of no velocity, of one, or of both.
fn damping_row(body: u32) -> DampingRow {
    let mut row = DampingRow::default();
    if is_movable(body) && !body.is_multiple_of(4) {
        row.linear_gain = [0.2, -0.4, 0.1].map(|x| x * (body as f32 / 50.0 - 1.0));
        row.linear_loss = body as f32 / 200.0;
    }
    if is_movable(body) && body % 4 > 1 {
        row.angular_gain = [-0.3, 0.1, 0.5].map(|x| x * (body as f32 / 50.0 - 2.0));
        row.angular_loss = 1.0 - body as f32 / 300.0;
    }
    row
}

fn point_row(random: &mut Random, patches: bool) -> PointRow {
    // A slip direction for a point without patches, else a distance from the center of the patch, or the levers of a
    // patch that resists rolling.
    let (sin, cos) = random.within(0.0, std::f32::consts::TAU).sin_cos();
    let [slip_1, slip_2] = if patches { [sin.abs(), cos.abs()] } else { [sin, cos] };
    PointRow {
        r_a: random.vector(1.0).to_array(),
        separation: random.within(-0.3, 0.3),
        r_b: random.vector(1.0).to_array(),
        normal_mass: random.within(0.1, 0.5),
        tangent_mass: random.within(0.1, 0.5),
        pull: random.within(-10.0, 10.0),
        slip_1,
        slip_2,
    }
}

/// The impulse of a point, which is not negative, or of a patch, which can twist in either direction.
fn impulse_row(random: &mut Random, patch: bool) -> ImpulseRow {
    let least = if patch { -2.0 } else { 0.0 };
    let normal = if random.happens(0.3) { 0.0 } else { random.within(least, 2.0) };
    let (tangent_1, tangent_2) = (random.within(-1.0, 1.0), random.within(-1.0, 1.0));
    ImpulseRow { normal, tangent_1, tangent_2, bounce: 0.0 }
}

fn joint_row(random: &mut Random, [body_a, body_b]: [u32; 2]) -> JointRow {
    let mut row = JointRow::default();
    row.r_a = random.vector(1.0).to_array();
    row.body_a = body_a;
    row.r_b = random.vector(1.0).to_array();
    row.body_b = body_b;
    row.gap = random.vector(0.1).to_array();
    (row.frame_a, row.frame_b) = (random.rotation().to_array(), random.rotation().to_array());
    row
}

/// A lock, a limit, a motor or a spring in a random direction, and its impulse.
fn axis_row(random: &mut Random) -> (AxisRow, f32) {
    let mut row = AxisRow::default();
    row.direction = (random.rotation() * Vec3::X).to_array();
    row.coordinate = if random.happens(0.5) { AxisRow::SHIFT } else { AxisRow::TURN };
    row.gap = random.within(-0.2, 0.2);
    row.left = NO_LIMIT;
    row.max_impulse = f32::MAX;
    row.start = if random.happens(0.3) { random.within(0.5, 2.0) } else { 0.0 };
    if random.happens(0.2) {
        row.coordinate = AxisRow::angle(random.below(8) as usize);
        row.start = random.within(-1.5, 1.5);
    }
    let impulse = random.within(-1.0, 1.0);
    match random.below(4) {
        0 => row.left = random.within(0.0, 0.5) - row.gap,
        1 => (row.speed, row.mass_scale, row.max_impulse) = (random.within(-2.0, 2.0), 1.0, random.within(0.1, 1.0)),
        2 => {
            row.impulse_scale = random.within(0.2, 1.0);
            row.mass_scale = 1.0 - row.impulse_scale;
            row.rate = random.within(0.1, 5.0);
            row.max_impulse = random.within(0.1, 3.0);
        }
        _ => {}
    }
    (row, if random.happens(0.2) { 0.0 } else { impulse })
}
