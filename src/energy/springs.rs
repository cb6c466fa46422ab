//! The energy in the springs of joints and contacts, and the work of driven bodies and drives.

use glam::{Quat, Vec3};

use super::{Entry, can_move, ends};
use crate::config::SolverConfig;
use crate::kernels::Rules;
use crate::kernels::axis::{axis_inverse_mass, axis_speed};
use crate::kernels::pair::relative_movement;
use crate::kernels::rows::{Axis, Body as BodyOf, Joint, Pair};
use crate::math::dot3;
use crate::openings::{frames_of, gap_after, motion_of, pair_of};
use crate::problem::{BodyRow, ContactRow, JointImpulseRow, JointRow, StepProblem, Substep, drive_count, stiffness};
use crate::world::{Body, BodyKind, World};

/// Adds the energy that the springs of swept joints hold now, half of force times gap each. It can be regained. Sweeps
/// leave gaps that open and close while the bodies move. Direct solutions leave none, so their springs give nothing
/// back.
pub(super) fn add_springs(entries: &mut [Entry], problem: &StepProblem, world: &World, substep: impl Fn(usize) -> f64) {
    for &row in problem.blocks.iter().flat_map(|block| problem.rows_of(&(block.joints[0]..block.direct))) {
        let joint = &problem.joints[row as usize];
        let Some(body) = ends(joint).into_iter().find(|&b| can_move(problem, b)) else { continue };
        let (of_joint, pair) = (Joint::<f64>::load(joint), pair_of(problem, joint));
        let mut energy = 0.0;
        if joint.is_loose == 0.0 {
            let gap = of_joint.gap + relative_movement(&pair, of_joint.r_a, of_joint.r_b);
            let force = Vec3::from(problem.joint_impulses[row as usize].linear).as_dvec3().length();
            energy += force * dot3(gap, gap).sqrt();
        }
        let frames = frames_of(&pair, &of_joint);
        for k in axes_of(joint).skip(drive_count(&world.joints[row as usize])) {
            let axis = Axis::<f64>::load(&problem.axes[k]);
            let gap = gap_after(&problem.axes[k], motion_of(&pair, &frames, &axis).moved);
            energy += (axis_impulse(problem, k, &problem.joint_impulses) * gap).abs();
        }
        let (energy, entry) = (0.5 * energy / substep(body as usize), &mut entries[body as usize]);
        (entry.springs, entry.slack) = (entry.springs + energy, entry.slack + energy);
    }
}

/// Adds the energy that the springs of joints of new bodies, and of new joints, held at the start of the step: m (w
/// gap)²/2, where m is the moved mass and w the frequency, but at most the energy at the separation speed `push_limit`.
/// `fresh` has the bodies in ascending order.
pub(super) fn add_springs_at_start(
    entries: &mut [Entry],
    problem: &StepProblem,
    world: &World,
    config: &SolverConfig,
    fresh: &[usize],
    substep: impl Fn(usize) -> f64,
) {
    let is_fresh = |end: u32| fresh.binary_search(&(end as usize)).is_ok();
    for &row in problem.rows_of(&problem.joint_colors()) {
        let joint = &problem.joints[row as usize];
        let Some(body) = ends(joint).into_iter().find(|&b| can_move(problem, b)) else { continue };
        if !ends(joint).into_iter().any(is_fresh) {
            continue;
        }
        let (of_joint, pair) = (Joint::<f64>::load(joint), pair_at_start(&pair_of(problem, joint), world, joint));
        let frequency = std::f64::consts::TAU * f64::from(config.joint_frequency) / substep(body as usize);
        let mass = (pair.mass_a.inv_mass + pair.mass_b.inv_mass).recip();
        let mut energy =
            if joint.is_loose == 0.0 { 0.5 * mass * frequency.powi(2) * dot3(of_joint.gap, of_joint.gap) } else { 0.0 };
        for k in axes_of(joint).skip(drive_count(&world.joints[row as usize])) {
            let axis = Axis::<f64>::load(&problem.axes[k]);
            let gap = gap_after(&problem.axes[k], 0.0);
            let motion = motion_of(&pair, &frames_of(&pair, &of_joint), &axis);
            energy += 0.5 * (frequency * gap).powi(2) / axis_inverse_mass(&pair, &motion);
        }
        entries[body as usize].work += energy.min(0.5 * mass * f64::from(config.push_limit).powi(2));
    }
}

/// Adds the work of driven bodies and of the drives of joints. The work of a motor is its impulse times the faster of
/// the two speeds of its axis, and at most its largest power. A spring of the caller gives back the energy of its
/// deflection.
pub(super) fn add_work_of_drives(
    entries: &mut [Entry],
    problem: &StepProblem,
    world: &World,
    dt: f64,
    substep: impl Fn(usize) -> f64,
) {
    let driver = |body: u32| world.bodies.get(body as usize).filter(|b| b.kind != BodyKind::Dynamic && b.is_driven());
    if !problem.totals.is_empty() {
        for contact in problem.swept_contacts() {
            for (from, to, sign) in [(contact.body_a, contact.body_b, 1.0), (contact.body_b, contact.body_a, -1.0)] {
                if let Some(driver) = driver(from).filter(|_| can_move(problem, to)) {
                    let work = sign * work_of_contact(driver, contact, from == contact.body_a, problem);
                    entries[to as usize].work += work.max(0.0);
                }
            }
        }
    }
    if problem.params.driven != 0 {
        for contact in problem.swept_contacts() {
            let body = if can_move(problem, contact.body_a) { contact.body_a } else { contact.body_b };
            entries[body as usize].work += work_of_surfaces(contact, problem);
        }
    }
    for &row in problem.rows_of(&problem.joint_colors()) {
        let joint = &problem.joints[row as usize];
        let of_world = &world.joints[row as usize];
        let drives = drive_count(of_world);
        if drives == 0 && ends(joint).into_iter().all(|end| driver(end).is_none()) {
            continue;
        }
        let Some(body) = ends(joint).into_iter().find(|&b| can_move(problem, b)) else { continue };
        let mut work = 0.0;
        for (end, arm, sign) in [(joint.body_a, joint.r_a, -1.0), (joint.body_b, joint.r_b, 1.0)] {
            if let Some(driver) = driver(end) {
                let pull = problem.joint_impulse(&problem.joint_totals, row as usize);
                let twist = problem.axis_impulse(&problem.joint_totals, row as usize, false);
                let velocity = driver.linear_velocity + driver.angular_velocity.cross(Vec3::from(arm));
                // The driver supplies the energy that the joint takes from it.
                work -= sign * f64::from(velocity.dot(pull) + driver.angular_velocity.dot(twist));
            }
        }
        let (of_joint, end) = (Joint::<f64>::load(joint), pair_of(problem, joint));
        let start = pair_at_start(&end, world, joint);
        for (number, k) in axes_of(joint).take(drives).enumerate() {
            let axis = Axis::<f64>::load(&problem.axes[k]);
            let motions = [&start, &end].map(|pair| (pair, motion_of(pair, &frames_of(pair, &of_joint), &axis)));
            let speeds = motions.each_ref().map(|(pair, motion)| axis_speed(Rules::default(), pair, motion));
            let h = substep(body as usize);
            if axis.impulse_scale > 0.0 {
                // Positions at the times of the velocities.
                let places = [0, 1].map(|i| axis.gap + motions[i].1.moved - 0.5 * h * speeds[i]);
                let stiffness = f64::from(stiffness(of_world, number, world));
                let [before, after] = places.map(|place| held_by_drive(stiffness, axis.max_impulse / h, place));
                let [at_start, at_end] = &mut entries[body as usize].drive_springs;
                (*at_start, *at_end) = (*at_start + before, *at_end + after);
            } else {
                let impulse = axis_impulse(problem, k, &problem.joint_totals);
                let most = axis.max_impulse / h * dt * axis.speed.abs();
                work += speeds.into_iter().map(|speed| impulse * speed).fold(0.0, f64::max).min(most);
            }
        }
        entries[body as usize].work += work;
    }
}

/// The energy in a spring of the caller with this stiffness and this largest load, at a deflection (J).
fn held_by_drive(stiffness: f64, most: f64, deflection: f64) -> f64 {
    let free = deflection.abs().min(most / stiffness);
    stiffness * free * (deflection.abs() - 0.5 * free)
}

fn axes_of(joint: &JointRow) -> std::ops::Range<usize> {
    joint.first_axis as usize..(joint.first_axis + joint.axis_count) as usize
}

fn axis_impulse(problem: &StepProblem, axis: usize, impulses: &[JointImpulseRow]) -> f64 {
    f64::from(impulses[problem.joints.len() + axis].linear[0])
}

/// The bodies of a joint at the start of the step.
fn pair_at_start(pair: &Pair<f64>, world: &World, joint: &JointRow) -> Pair<f64> {
    let body = |end: u32| {
        let mut row = BodyRow::AT_REST;
        if let Some(body) = world.bodies.get(end as usize) {
            (row.v, row.w) = (body.linear_velocity.to_array(), body.angular_velocity.to_array());
        }
        BodyOf::load(&row)
    };
    let [a, b] = ends(joint).map(body);
    Pair { a, b, ..*pair }
}

/// The work of a driven body through a contact, from the impulse of the whole step (J).
fn work_of_contact(driver: &Body, contact: &ContactRow, is_a: bool, problem: &StepProblem) -> f64 {
    let (t_1, t_2) = contact.tangents();
    let normal = Vec3::from(contact.normal);
    let first = contact.first_point as usize;
    let points = first..first + contact.point_count as usize;
    let (patch, rolls) = (problem.has_patches().then_some(points.end), problem.params.rolls != 0);
    let mut work = 0.0;
    for k in points.chain(patch) {
        let (total, point) = (&problem.totals[k], &problem.points[k]);
        let arm = Vec3::from(if is_a { point.r_a } else { point.r_b });
        let velocity = driver.linear_velocity + driver.angular_velocity.cross(arm);
        let slip = t_1 * total.tangent_1 + t_2 * total.tangent_2;
        // The normal impulse of a patch is that of its twist, and with rolling friction all are angular.
        work += f64::from(match Some(k) == patch {
            true if rolls => driver.angular_velocity.dot(normal * total.normal + slip),
            true => velocity.dot(slip) + driver.angular_velocity.dot(normal) * total.normal,
            false => velocity.dot(normal * total.normal + slip),
        });
    }
    work
}

/// The work of the drives that move the surfaces of a contact, as a belt (J).
fn work_of_surfaces(contact: &ContactRow, problem: &StepProblem) -> f64 {
    let end = (contact.first_point + contact.point_count) as usize;
    let rows = if problem.has_friction_at_patches() { end..end + 1 } else { contact.first_point as usize..end };
    let totals = problem.totals[rows.clone()].iter().zip(&problem.points[rows]);
    // Friction on b does work on both bodies together and on the slip.
    -totals.map(|(t, p)| f64::from(t.tangent_1 * p.slip_1 + t.tangent_2 * p.slip_2)).sum::<f64>()
}

/// Energy of the springs of a contact at the start of the step, and now (J): m v²/2 with v = w s at the overlap s, at
/// most `push_limit`.
pub(super) fn held_by_contact(problem: &StepProblem, contact: &ContactRow, substep: &Substep) -> [f64; 2] {
    let both = can_move(problem, contact.body_a) && can_move(problem, contact.body_b);
    let softness = if both { substep.movable } else { substep.fixed };
    let compliance = f64::from(softness.compliance() * substep.length);
    let frequency = if compliance > 0.0 { compliance.sqrt().recip() } else { softness.bias_rate.into() };
    let most = f64::from(softness.push_limit);
    let [a, b] = [contact.body_a, contact.body_b].map(|body| &problem.bodies[body as usize]);
    let normal = Vec3::from(contact.normal);
    // A rotated arm moves along the normal by its component along the difference between the back-rotated normal and
    // the normal.
    let [back_a, back_b] = [a, b].map(|row| Quat::from_array(row.dq).inverse() * normal - normal);
    let shift = normal.dot(Vec3::from(b.dp) - Vec3::from(a.dp));
    let mut held = [0.0; 2];
    for k in contact.first_point as usize..(contact.first_point + contact.point_count) as usize {
        let point = &problem.points[k];
        let moved = shift + Vec3::from(point.r_b).dot(back_b) - Vec3::from(point.r_a).dot(back_a);
        let before = point.separation - contact.preload;
        for (held, separation) in held.iter_mut().zip([before, before + moved]) {
            let speed = (frequency * f64::from(-separation).max(0.0)).min(most);
            *held += 0.5 * f64::from(point.normal_mass) * speed * speed;
        }
    }
    held
}
