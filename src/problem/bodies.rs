//! The rows of bodies, written from a world and stored back into it.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::damping::Decay;
use super::rows::{BodyRow, ContactRow, ConvergenceRow, InertiaRow, MassRow, MomentumRow, Params, TorqueRow};
use super::{Block, StepProblem};
use crate::config::{SolverConfig, Stabilization};
use crate::constants::MAX_ROUNDINGS;
use crate::effort::Effort;
use crate::math::rotation::{product, unit};
use crate::math::{self, Lane, exp_rotation, quat_mul, renormalized};
use crate::world::{Body, BodyKind, World};

/// Least number of bodies in one task.
pub(super) const MIN_BODIES: usize = 256;

/// Begins the problem of a step with the parameters and the rows of bodies. Bodies that are `asleep` get the rows of
/// bodies that nothing moves.
pub fn begin(world: &World, asleep: &[bool], config: &SolverConfig, problem: &mut StepProblem) {
    write_bodies(world, asleep, config, problem);
    problem.params = Params {
        restitution_threshold: config.restitution_threshold,
        body_count: problem.bodies.len() as u32,
        slop: if config.stabilization == Stabilization::Baumgarte { config.slop } else { 0.0 },
        relaxation: config.relaxation,
        tolerance: config.tolerance,
        ..Params::default()
    };
    problem.convergence = ConvergenceRow::default();
    problem.momentum = MomentumRow::default();
}

fn write_bodies(world: &World, asleep: &[bool], config: &SolverConfig, problem: &mut StepProblem) {
    let rests = |i: usize| asleep.get(i) == Some(&true);
    let state = |(i, b): (usize, &Body)| {
        let moves = b.kind != BodyKind::Fixed && !rests(i);
        let velocity = |v: Vec3| if moves { v.to_array() } else { [0.0; 3] };
        BodyRow {
            v: velocity(b.allowed_velocity(b.linear_velocity)),
            w: velocity(b.allowed_spin(b.angular_velocity)),
            ..BodyRow::AT_REST
        }
    };
    world.bodies.par_iter().with_min_len(MIN_BODIES).enumerate().map(state).collect_into_vec(&mut problem.bodies);
    let has_torques = AtomicBool::new(false);
    let mass = |(index, b): (usize, &Body)| {
        if b.kind != BodyKind::Dynamic || rests(index) {
            return MassRow::default();
        }
        if b.whole_torque() != Vec3::ZERO {
            has_torques.store(true, Ordering::Relaxed);
        }
        let acceleration = b.unlocked(world.gravity_at(index) + b.whole_force() / b.mass.mass).to_array();
        MassRow { acceleration, ..mass_row(b) }
    };
    world.bodies.par_iter().with_min_len(MIN_BODIES).enumerate().map(mass).collect_into_vec(&mut problem.masses);
    problem.torques.clear();
    if has_torques.into_inner() {
        let torque = |(i, b): (usize, &Body)| {
            if b.kind != BodyKind::Dynamic || rests(i) || b.whole_torque() == Vec3::ZERO {
                return TorqueRow::NONE;
            }
            let angular_acceleration = b.world_inverse_inertia() * b.whole_torque();
            TorqueRow { angular_acceleration: angular_acceleration.to_array(), ..TorqueRow::NONE }
        };
        problem.torques.extend(world.bodies.iter().enumerate().map(torque));
    }
    problem.inertias.clear();
    if config.gyroscopic {
        let turns = |b: &Body| b.kind == BodyKind::Dynamic && b.mass.is_anisotropic() && !b.has_locked_rotation();
        let row = |(i, b): (usize, &Body)| {
            let unit = b.mass.principal_inertia.max_element().inverse_power();
            let principal = b.mass.principal_inertia * unit;
            InertiaRow {
                principal: principal.to_array(),
                body: i as u32,
                inv_principal: principal.recip().to_array(),
                frame: product(b.rotation, b.mass.principal_frame).to_array(),
                ..InertiaRow::default()
            }
        };
        problem.inertias.extend(world.bodies.iter().enumerate().filter(|&(i, b)| turns(b) && !rests(i)).map(row));
    }
}

/// Inverse mass and inertia of a body that can be pushed.
pub(super) fn mass_row(body: &Body) -> MassRow {
    let i = body.world_inverse_inertia();
    MassRow {
        inv_inertia_x: [i.x_axis.x, i.x_axis.y, i.x_axis.z],
        inv_inertia_yz: [i.y_axis.y, i.y_axis.z, i.z_axis.z],
        inv_mass: 1.0 / body.mass.mass,
        locks: body.locks(),
        ..MassRow::default()
    }
}

/// The position and the rotation of a body after the step that its row has made.
pub(crate) fn pose_after(body: &Body, row: &BodyRow) -> (Vec3, Quat) {
    let center = body.center_of_mass() + Vec3::from_array(row.dp);
    let rotation =
        if body.has_fixed_rotation() { body.rotation } else { unit(product(Quat::from_array(row.dq), body.rotation)) };
    (center - rotation * body.mass.center, rotation)
}

/// Puts the bodies on which no constraint has acted onto their exact paths. A substep h moves a body by its velocity at
/// the end, so a step in which the velocity changes by u moves it by u h/2 too far. With the mean of both velocities a
/// body falls along its parabola, to rounding. So does a body on which only impacts act: those that a surface threw
/// are `thrown`. Bodies that are `jointed` keep the paths of the substeps.
pub fn follow_parabolas(
    world: &World,
    effort: &Effort,
    [jointed, thrown]: [&[bool]; 2],
    dt: f32,
    problem: &mut StepProblem,
) {
    let StepProblem { bodies, masses, blocks, .. } = problem;
    let rows = bodies.par_iter_mut().zip(&*masses).zip(world.bodies.par_iter()).enumerate().with_min_len(MIN_BODIES);
    rows.for_each(|(i, ((row, mass), body))| {
        if mass.inv_mass <= 0.0 || jointed[i] {
            return;
        }
        let Block { substeps, substep, .. } = &blocks[effort.block_of(i)];
        let half = 0.5 * substep.length;
        let [v, w] = [row.v, row.w].map(Vec3::from_array);
        let v_0 = body.allowed_velocity(body.linear_velocity);
        let decay = Decay::of(body.linear_damping, dt.into());
        let free = v_0 * (1.0 - decay.loss as f32) + Vec3::from_array(mass.acceleration) * decay.gain as f32;
        // The impulses of the step before, with which a step begins, round the velocities as well.
        let roundings = 4.0 * (*substeps as f32).min(MAX_ROUNDINGS as f32);
        if v.distance(free) > roundings * f32::EPSILON * v.length().max(v_0.length()) {
            if thrown.get(i) == Some(&true) {
                row.dp = (Vec3::from_array(row.dp) - half * (free - v_0)).to_array();
            }
            return;
        }
        let turn = w - body.allowed_spin(body.angular_velocity);
        row.dp = (Vec3::from_array(row.dp) - half * (v - v_0)).to_array();
        // A body with unequal moments has turned by the midpoint spin.
        if turn != Vec3::ZERO && !body.mass.is_anisotropic() {
            let back = exp_rotation(math::Vec3::<f32>::load((turn * -half).to_array()));
            row.dq = renormalized(quat_mul(back, math::Quat::load(row.dq))).store();
        }
    });
}

/// Finds the bodies that a surface with restitution may have thrown, and that no contact presses at the end of the step;
/// none if no surface bounces.
pub fn find_thrown(problem: &StepProblem, thrown: &mut Vec<bool>) {
    thrown.clear();
    if problem.params.bounces == 0 {
        return;
    }
    let contacts = problem.swept_contacts();
    let mut mark = |contact: &ContactRow, is_thrown: bool| {
        thrown.resize(problem.bodies.len(), false);
        [contact.body_a, contact.body_b].iter().for_each(|&body| thrown[body as usize] = is_thrown);
    };
    contacts.clone().filter(|contact| contact.restitution > 0.0).for_each(|contact| mark(contact, true));
    if thrown.is_empty() {
        return;
    }
    for contact in contacts {
        let first = contact.first_point as usize;
        let own = &problem.impulses[first..first + contact.point_count as usize];
        if own.iter().any(|impulse| impulse.normal > 0.0) {
            [contact.body_a, contact.body_b].iter().for_each(|&body| thrown[body as usize] = false);
        }
    }
}

/// Writes poses and velocities into the world, except for bodies that are asleep. Impulses stay in their rows for the
/// next step.
pub fn store(problem: &StepProblem, asleep: &[bool], world: &mut World) {
    let bodies = world.bodies.as_mut_slice().par_iter_mut().with_min_len(MIN_BODIES).zip(&problem.bodies);
    bodies.enumerate().for_each(|(i, (body, row))| {
        if body.kind == BodyKind::Fixed || asleep.get(i) == Some(&true) {
            return;
        }
        body.forget_applied_forces();
        (body.position, body.rotation) = pose_after(body, row);
        body.linear_velocity = body.allowed_velocity(Vec3::from_array(row.v));
        body.angular_velocity = body.allowed_spin(Vec3::from_array(row.w));
    });
}
