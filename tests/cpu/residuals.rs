//! Residuals: nothing at a known solution, something beside it, and the same whatever the axes and the units.

use crate::common::contacts::{FRICTION, GRAVITY, STEP, bearing, tower};
use drystone_problems::ContactProblem;
use drystone_problems::contacts::{Operator, Velocity};
use drystone_problems::residuals::{Measure, Residuals};
use glam::{DQuat, DVec3};

/// A box that slides at 3 m/s: friction takes mu g h of it, and tilts the weight onto the front edge. Friction of
/// mu m g acts half an edge below the center, so the torque asks for a normal force of m g (1/4 ± mu/4) at each corner.
fn sliding() -> (ContactProblem, Vec<DVec3>) {
    let mut problem = tower(&[2.0]);
    let direction = DVec3::X;
    problem.bodies[0].free.linear += direction * 3.0;
    let weight = 2.0 * GRAVITY * STEP;
    let impulses = problem.contacts.iter().map(|c| {
        let normal = weight * (0.25 + 0.25 * FRICTION * c.r_b.dot(direction).signum());
        DVec3::new(normal, -FRICTION * normal, 0.0)
    });
    let impulses = impulses.collect();
    (problem, impulses)
}

fn tower_at_rest() -> (ContactProblem, Vec<DVec3>) {
    let masses = [1.0, 5.0, 0.2];
    (tower(&masses), bearing(&masses))
}

/// The numbers that must vanish.
fn numbers(r: &Residuals) -> [f64; 8] {
    [r.e_vel, r.e_fclib, r.vmax, r.pen_rate, r.compl, r.cone, r.diss, r.eom]
}

#[test]
fn nothing_is_left_at_a_known_solution() {
    for (problem, impulses) in [tower_at_rest(), sliding()] {
        let residuals = Residuals::of(&problem, &impulses);
        assert!(numbers(&residuals).iter().all(|x| x.abs() < 1e-14), "{}: {residuals:?}", problem.name);
    }
    let (problem, impulses) = sliding();
    let velocity = Operator::new(&problem).velocities(&impulses)[0];
    let expected = DVec3::X * (3.0 - FRICTION * GRAVITY * STEP);
    assert!(velocity.linear.distance(expected) < 1e-14 && velocity.angular.length() < 1e-14, "{velocity:?}");
}

#[test]
fn one_percent_too_much_is_seen() {
    for (problem, impulses) in [tower_at_rest(), sliding()] {
        for which in 0..impulses.len() {
            let mut wrong = impulses.clone();
            wrong[which] *= 1.01;
            let residuals = Residuals::of(&problem, &wrong);
            assert!(residuals.e_vel > 1e-5 && residuals.e_fclib > 1e-5, "{}: {residuals:?}", problem.name);
        }
    }
}

#[test]
fn each_number_sees_what_it_is_for() {
    let (problem, impulses) = sliding();
    let changed = |change: &dyn Fn(&mut DVec3)| {
        let mut changed = impulses.clone();
        changed.iter_mut().for_each(change);
        Residuals::of(&problem, &changed)
    };
    let free = Residuals::of(&problem, &[DVec3::ZERO; 4]);
    assert!((free.pen_rate - GRAVITY * STEP).abs() < 1e-14, "it falls: {free:?}");
    let lifted = changed(&|r| *r *= 2.0);
    assert!(lifted.compl > 0.01 && lifted.pen_rate == 0.0 && lifted.cone < 1e-15, "it is thrown up: {lifted:?}");
    let held = changed(&|r| r.y *= 1.5);
    assert!(held.cone > 0.01, "friction is too strong: {held:?}");
    let pulled = changed(&|r| *r = -*r);
    assert!(pulled.cone > 0.01, "it is pulled: {pulled:?}");
    let slippery = changed(&|r| r.y *= 0.5);
    assert!(slippery.diss > 0.05 && slippery.cone == 0.0, "friction is too weak: {slippery:?}");
    let measure = Measure::new(&problem);
    let still = [Velocity::default()];
    assert!(measure.of(&impulses, &still).eom > 0.9, "the box was said to stand");
}

#[test]
fn the_worst_contact_is_named_with_its_velocity() {
    let (problem, mut impulses) = tower_at_rest();
    let before = impulses[9];
    impulses[9].x = 0.0;
    let residuals = Residuals::of(&problem, &impulses);
    assert_eq!(residuals.worst_contact, Some(9), "{before} is missing there");
    assert!(residuals.vmax > 0.01 && residuals.vmax < 1.0, "{residuals:?}");
}

#[test]
fn a_number_that_is_none_spoils_all() {
    let (problem, impulses) = sliding();
    for bad in [f64::NAN, f64::INFINITY] {
        for component in 0..3 {
            let mut wrong = impulses.clone();
            wrong[2][component] = bad;
            let residuals = Residuals::of(&problem, &wrong);
            assert!(numbers(&residuals).iter().all(|x| x.is_nan()), "{residuals:?}");
        }
    }
    let carried = [Velocity { linear: DVec3::NAN, angular: DVec3::ZERO }];
    let residuals = Measure::new(&problem).of(&impulses, &carried);
    assert!(numbers(&residuals).iter().all(|x| x.is_nan()), "{residuals:?}");
}

/// Something unsolved in general: a tower pushed aside, with impulses that are all wrong.
fn unsolved() -> (ContactProblem, Vec<DVec3>) {
    let mut problem = tower(&[1.0, 3.0, 0.5]);
    problem.bodies[1].free.angular = DVec3::new(0.3, -0.2, 0.9);
    problem.bodies[2].free.linear += DVec3::new(0.4, 0.1, 0.0);
    let impulses = (0..12).map(|i| DVec3::new(0.05, 0.01, -0.02) * f64::from(i % 5)).collect();
    (problem, impulses)
}

#[test]
fn the_axes_do_not_matter() {
    let (problem, impulses) = unsolved();
    let q = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.7).normalize(), 1.1);
    let mut turned = problem.clone();
    for body in &mut turned.bodies {
        let axes = glam::DMat3::from_quat(q);
        body.inertia = axes * body.inertia * axes.transpose();
        body.free = Velocity { linear: q * body.free.linear, angular: q * body.free.angular };
    }
    for c in &mut turned.contacts {
        (c.frame, c.r_a, c.r_b) = (c.frame.map(|d| q * d), q * c.r_a, q * c.r_b);
    }
    let (before, after) = (Residuals::of(&problem, &impulses), Residuals::of(&turned, &impulses));
    for (x, y) in numbers(&before).into_iter().zip(numbers(&after)) {
        assert!((x - y).abs() < 1e-13, "{before:?} became {after:?}");
    }
    turned.contacts[3].r_b = problem.contacts[3].r_b;
    let half_turned = Residuals::of(&turned, &impulses);
    assert!((before.e_vel - half_turned.e_vel).abs() > 1e-3, "one arm was not turned: {half_turned:?}");
}

#[test]
fn the_units_do_not_matter_to_the_error_to_steer_by() {
    let (problem, impulses) = unsolved();
    // Millimeters, grams and minutes.
    let (length, mass, time) = (1e3, 1e3, 1.0 / 60.0);
    let mut other = problem.clone();
    for body in &mut other.bodies {
        body.mass *= mass;
        body.inertia *= mass * length * length;
        body.free.linear *= length / time;
        body.free.angular /= time;
    }
    for c in &mut other.contacts {
        (c.r_a, c.r_b) = (c.r_a * length, c.r_b * length);
    }
    let momentum = mass * length / time;
    let scaled: Vec<_> = impulses.iter().map(|&r| r * momentum).collect();
    let (before, after) = (Residuals::of(&problem, &impulses), Residuals::of(&other, &scaled));
    assert!((after.e_vel / before.e_vel - 1.0).abs() < 1e-12, "{before:?} became {after:?}");
    assert!((after.vmax / before.vmax / (length / time) - 1.0).abs() < 1e-12, "{before:?} became {after:?}");
    assert!((after.e_fclib / before.e_fclib - 1.0).abs() > 0.1, "which that with rho = 1 cannot say: {after:?}");
}

/// Without friction nothing but the sign of its normal impulse is wrong with a contact that pulls.
#[test]
fn a_pull_is_outside_of_the_cone_even_without_friction() {
    let (mut problem, mut impulses) = tower_at_rest();
    problem.contacts.iter_mut().for_each(|c| c.friction = 0.0);
    assert_eq!(Residuals::of(&problem, &impulses).cone, 0.0);
    impulses[5] = DVec3::X * -0.25;
    assert_eq!(Residuals::of(&problem, &impulses).cone, 0.25);
}

/// One ball of 2 kg whose middle is pushed at: W = 1/m, so that rho = m. It parts at 3 m/s but for an impulse of 0.5 N s.
#[test]
fn what_pushes_while_it_parts_counts_by_its_impulse_or_by_its_velocity_whichever_is_less() {
    let mut problem = tower(&[2.0]);
    problem.contacts.truncate(1);
    problem.contacts[0].r_b = DVec3::ZERO;
    problem.bodies[0].free = Velocity { linear: DVec3::Z * 3.0, angular: DVec3::ZERO };
    let parting = 3.0 + 0.5 / 2.0;
    let of = Residuals::of(&problem, &[DVec3::X * 0.5]);
    // F/rho with rho = 2 is min(r / rho, u).
    assert!((of.vmax - 0.25).abs() < 1e-15 && (of.e_vel - 0.25 / 3.0).abs() < 1e-15, "{of:?}");
    assert!((of.e_fclib - 0.5 / 3.0).abs() < 1e-15 && (of.compl - 0.5 * parting).abs() < 1e-15, "{of:?}");
    // Pushed by 10 N s it parts at 8 m/s, which is less than 10 and more than 10/2.
    let of = Residuals::of(&problem, &[DVec3::X * 10.0]);
    assert!((of.vmax - 5.0).abs() < 1e-14 && (of.e_fclib - 8.0 / 3.0).abs() < 1e-14, "{of:?}");
}

#[test]
fn what_presses_while_it_closes_is_not_complementary_either() {
    let (problem, impulses) = tower_at_rest();
    let weaker: Vec<_> = impulses.iter().map(|r| *r * 0.5).collect();
    let of = Residuals::of(&problem, &weaker);
    assert!(of.compl > 1e-3 && of.pen_rate > 0.05, "it sinks in while it is pressed: {of:?}");
}

/// Twice the energy of a spin about z is I w², of the free fall m (g h)².
#[test]
fn a_spin_that_was_made_up_is_a_drift() {
    let (problem, impulses) = sliding();
    let measure = Measure::new(&problem);
    let right = Operator::new(&problem).velocities(&impulses);
    assert!(measure.of(&impulses, &right).eom < 1e-14);
    let spun = [Velocity { angular: right[0].angular + DVec3::Z, ..right[0] }];
    let whole = 2.0 * (3.0_f64.powi(2) + (GRAVITY * STEP).powi(2));
    let expected = (2.0 / 6.0 / whole).sqrt();
    assert!((measure.of(&impulses, &spun).eom - expected).abs() < 1e-14, "{}", measure.of(&impulses, &spun).eom);
}
