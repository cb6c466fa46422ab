//! The functions that docs/derivation.md names, against finite differences of the constraints and the dense product
//! G M⁻¹ Gᵀ, in f64 where they are written over a lane.

use drystone::config::FrictionRule;
use drystone::glam::{DMat3, DQuat, DVec3, Mat3, Vec3};
use drystone::stages::kernels::joint_column;
use drystone::stages::kernels::{
    Axis, Body, Contact, Impulse, Joint, Mass, Pair, Point, Rules, SoftnessOf, StepParams, Sym3,
};
use drystone::stages::kernels::{Frames, axis_motion};
use drystone::stages::kernels::{current_separation, normal_movement, restitute_contact, solve_contact, warm_start};
use drystone::stages::kernels::{relative_movement, relative_velocity};
use drystone::stages::kernels::{solve_friction, solve_twist};
use drystone::stages::math::{Quat, Vec3 as LaneVec3, vec3};
use drystone::stages::problem::ContactRow;
use drystone::stages::problem::{EffectiveMass, InverseMass};

/// Some contact of two bodies in general position.
struct Case {
    normal: DVec3,
    r: [DVec3; 2],
    inverse_mass: [f64; 2],
    inverse_inertia: [DMat3; 2],
}

fn case() -> Case {
    let tensor = |angle: f64, diagonal: DVec3| {
        let axes = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), angle));
        axes * DMat3::from_diagonal(diagonal) * axes.transpose()
    };
    Case {
        normal: DVec3::new(0.3, 0.9, -0.2).normalize(),
        r: [DVec3::new(0.4, 0.5, -0.1), DVec3::new(-0.2, -0.6, 0.3)],
        inverse_mass: [0.5, 2.0],
        inverse_inertia: [tensor(0.4, DVec3::new(3.0, 1.0, 2.0)), tensor(1.3, DVec3::new(0.5, 4.0, 1.5))],
    }
}

impl Case {
    /// The 12 numbers of a row of G for direction `d`: -d, -(r_a x d), d, r_b x d.
    fn row(&self, d: DVec3) -> [DVec3; 4] {
        [-d, -self.r[0].cross(d), d, self.r[1].cross(d)]
    }

    /// The entry of G M⁻¹ Gᵀ for directions d and e, by the dense product.
    fn dense(&self, d: DVec3, e: DVec3) -> f64 {
        let (g, h) = (self.row(d), self.row(e));
        (0..2)
            .map(|i| {
                self.inverse_mass[i] * g[2 * i].dot(h[2 * i]) + g[2 * i + 1].dot(self.inverse_inertia[i] * h[2 * i + 1])
            })
            .sum()
    }

    fn masses(&self) -> [InverseMass; 2] {
        [0, 1].map(|i| InverseMass {
            mass: self.inverse_mass[i] as f32,
            locks: 0.0,
            inertia: self.inverse_inertia[i].as_mat3(),
        })
    }

    fn contact_row(&self) -> ContactRow {
        let normal = self.normal.as_vec3();
        let tangent = normal.any_orthonormal_vector();
        ContactRow { normal: normal.to_array(), tangent: tangent.to_array(), ..ContactRow::default() }
    }

    /// The pair with body `moved` displaced by `dp` and turned by the rotation vector `turn`.
    fn pair(&self, moved: usize, dp: DVec3, turn: DVec3) -> Pair<f64> {
        let body = |i: usize| {
            let (dp, turn) = if i == moved { (dp, turn) } else { (DVec3::ZERO, DVec3::ZERO) };
            let q = DQuat::from_scaled_axis(turn);
            Body { dp: lane(dp), dq: Quat { axis: vec3(q.x, q.y, q.z), w: q.w }, ..Body::default() }
        };
        let mass = |i: usize| Mass {
            locks: 0.0,
            inv_inertia: symmetric(&self.inverse_inertia[i]),
            inv_mass: self.inverse_mass[i],
            acceleration: lane(DVec3::ZERO),
        };
        Pair { a: body(0), b: body(1), mass_a: mass(0), mass_b: mass(1), ..Pair::default() }
    }

    fn separation(&self, pair: &Pair<f64>) -> f64 {
        let point = Point { r_a: lane(self.r[0]), r_b: lane(self.r[1]), separation: 0.125, ..Point::default() };
        let contact = Contact { normal: lane(self.normal), ..Contact::default() };
        let movement = normal_movement(Rules::default(), pair, &contact);
        current_separation(&movement, &contact, &point)
    }
}

fn lane(v: DVec3) -> LaneVec3<f64> {
    vec3(v.x, v.y, v.z)
}

fn symmetric(m: &DMat3) -> Sym3<f64> {
    Sym3 { x: vec3(m.x_axis.x, m.x_axis.y, m.x_axis.z), yz: vec3(m.y_axis.y, m.y_axis.z, m.z_axis.z) }
}

/// Largest difference between the row `g` of G and the central differences of the separation.
fn worst_difference(case: &Case, g: [DVec3; 4]) -> f64 {
    let step = 1e-5;
    let mut worst = 0.0_f64;
    for body in 0..2 {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let e = axis * step;
            let difference = |dp: DVec3, turn: DVec3| {
                let (ahead, behind) = (case.pair(body, dp, turn), case.pair(body, -dp, -turn));
                (case.separation(&ahead) - case.separation(&behind)) / (2.0 * step)
            };
            worst = worst.max((difference(e, DVec3::ZERO) - g[2 * body].dot(axis)).abs());
            worst = worst.max((difference(DVec3::ZERO, e) - g[2 * body + 1].dot(axis)).abs());
        }
    }
    worst
}

#[test]
fn the_row_of_the_normal_is_the_gradient_of_the_separation() {
    let case = case();
    // Central differences: the error is of order step², 1e-10.
    assert!(worst_difference(&case, case.row(case.normal)) < 1e-9);
}

#[test]
fn a_row_with_a_wrong_arm_or_sign_is_found() {
    let case = case();
    let [a, wa, b, wb] = case.row(case.normal);
    assert!(worst_difference(&case, [a, -wa, b, wb]) > 0.1, "sign of an arm");
    assert!(worst_difference(&case, [a, wb, b, wa]) > 0.1, "swapped arms");
}

#[test]
fn the_relative_velocity_is_the_row_times_the_velocities() {
    let case = case();
    let mut pair = case.pair(0, DVec3::ZERO, DVec3::ZERO);
    let v =
        [DVec3::new(1.0, -2.0, 0.5), DVec3::new(0.3, 0.1, 4.0), DVec3::new(-1.0, 0.2, 0.7), DVec3::new(2.0, 1.0, -3.0)];
    (pair.a.v, pair.a.w, pair.b.v, pair.b.w) = (lane(v[0]), lane(v[1]), lane(v[2]), lane(v[3]));
    let u = relative_velocity(Rules::default(), &pair, lane(case.r[0]), lane(case.r[1]));
    for (axis, component) in [(DVec3::X, u.x), (DVec3::Y, u.y), (DVec3::Z, u.z)] {
        let dense: f64 = case.row(axis).iter().zip(v).map(|(g, v)| g.dot(v)).sum();
        assert!((component - dense).abs() < 1e-14);
    }
}

#[test]
fn effective_masses_are_entries_of_the_dense_product() {
    let case = case();
    let (inverse, row) = (case.masses(), case.contact_row());
    let effective = EffectiveMass { inverse: &inverse, row: &row };
    let [r_a, r_b] = case.r.map(|r| r.as_vec3());
    let (t_1, t_2) = row.tangents();
    let (n, d_1, d_2) = (case.normal, t_1.as_dvec3(), t_2.as_dvec3());
    // f32 sums of some ten products: 1e-6.
    let close = |x: f32, y: f64| assert!((f64::from(x) / y - 1.0).abs() < 1e-6, "{x} against {y}");
    close(effective.normal(r_a, r_b), 1.0 / case.dense(n, n));
    close(effective.entry(r_a, r_b, t_1, t_2), case.dense(d_1, d_2));
    close(effective.along(r_a, r_b, t_2), 1.0 / case.dense(d_2, d_2));
    // The largest eigenvalue of the tangential block, by the largest Rayleigh quotient over many directions.
    let quotient = |i: u32| {
        let (s, c) = (f64::from(i) * std::f64::consts::PI / 1e4).sin_cos();
        let d = d_1 * c + d_2 * s;
        case.dense(d, d)
    };
    close(effective.tangent(r_a, r_b), 1.0 / (0..10_000).map(quotient).fold(0.0, f64::max));
    // About the normal nothing but the inertias counts.
    let spin: f64 = case.inverse_inertia.iter().map(|i| n.dot(*i * n)).sum();
    close(effective.twist(), 1.0 / spin);
}

/// A thin rod at the angle q on a floor: mu 3 sin q cos q/(1 + 3 cos² q), which is 1 at mu = 4/3 and tan q = 2 and below 1 elsewhere.
#[test]
fn friction_jams_a_rod_as_painleve_says() {
    let ratio = |mu: f32, angle: f32| {
        let (sin, cos) = angle.sin_cos();
        let along = Vec3::new(cos, sin, 0.0);
        let across = Mat3::IDENTITY - Mat3::from_cols(along * along.x, along * along.y, along * along.z);
        let rod = InverseMass { mass: 2.0, locks: 0.0, inertia: across * (2.0 * 3.0) };
        let floor = InverseMass { mass: 0.0, locks: 0.0, inertia: Mat3::ZERO };
        let row = ContactRow { friction: mu, ..ContactRow::framed(Vec3::Y) };
        EffectiveMass { inverse: &[floor, rod], row: &row }.jamming(Vec3::ZERO, -along)
    };
    for (mu, angle) in [(1.5, 1.0), (3.0, 0.7), (0.6, 1.2_f32)] {
        let (sin, cos) = angle.sin_cos();
        let exact = mu * 3.0 * sin * cos / (1.0 + 3.0 * cos * cos);
        assert!((ratio(mu, angle) / exact - 1.0).abs() < 1e-5, "{mu}, {angle}: {} and not {exact}", ratio(mu, angle));
    }
    let critical = 2.0_f32.atan();
    assert!((ratio(4.0 / 3.0, critical) - 1.0).abs() < 1e-5);
    assert!([-0.1, 0.1].iter().all(|off| ratio(4.0 / 3.0, critical + off) < 0.999));
    assert_eq!(ratio(0.53, critical), 0.0, "too little friction for any solid");
}

#[test]
fn the_block_of_a_joint_is_the_dense_product() {
    let case = case();
    let pair = case.pair(0, DVec3::ZERO, DVec3::ZERO);
    let anchors = case.r.map(lane);
    let inverse_mass = pair.mass_a.inv_mass + pair.mass_b.inv_mass;
    for e in [DVec3::X, DVec3::Y, DVec3::Z] {
        let column = joint_column(&pair, anchors, lane(e), inverse_mass);
        for (d, entry) in [(DVec3::X, column.x), (DVec3::Y, column.y), (DVec3::Z, column.z)] {
            assert!((entry - case.dense(d, e)).abs() < 1e-14);
        }
    }
}

#[test]
fn friction_felt_by_the_bodies_is_the_same_row_by_row_and_as_one_vector() {
    let case = case();
    let row = case.contact_row();
    let (t_1, t_2) = row.tangents();
    let lambda = [0.7_f32, -1.9];
    let one_vector = t_1 * lambda[0] + t_2 * lambda[1];
    let inertia: Mat3 = case.inverse_inertia[1].as_mat3();
    let r_b = case.r[1].as_vec3();
    let by_rows: Vec3 = inertia * r_b.cross(t_1) * lambda[0] + inertia * r_b.cross(t_2) * lambda[1];
    assert!(by_rows.distance(inertia * r_b.cross(one_vector)) < 1e-5 * by_rows.length());
}

/// Friction at one point: a pair that slips, and what a sweep makes of it.
struct Slipping {
    case: Case,
    pair: Pair<f64>,
    contact: Contact<f64>,
    point: Point<f64>,
    params: StepParams<f64>,
    tangents: [DVec3; 2],
}

fn slipping() -> Slipping {
    let case = case();
    let tangent = case.normal.any_orthonormal_vector();
    let mut pair = case.pair(0, DVec3::ZERO, DVec3::ZERO);
    (pair.a.v, pair.a.w) = (lane(DVec3::new(1.0, -2.0, 0.5)), lane(DVec3::new(0.3, 0.1, 4.0)));
    (pair.b.v, pair.b.w) = (lane(DVec3::new(-1.0, 0.2, 0.7)), lane(DVec3::new(2.0, 1.0, -3.0)));
    let contact = Contact { normal: lane(case.normal), tangent: lane(tangent), friction: 0.5, ..Contact::default() };
    let (sin, cos) = 0.7_f64.sin_cos();
    let (r_a, r_b) = (lane(case.r[0]), lane(case.r[1]));
    let point = Point { r_a, r_b, normal_mass: 0.3, tangent_mass: 0.2, slip_1: cos, slip_2: sin, ..Point::default() };
    let params = StepParams { relaxation: 1.0, ..StepParams::default() };
    let tangents = [tangent, case.normal.cross(tangent)];
    Slipping { case, pair, contact, point, params, tangents }
}

impl Slipping {
    /// Velocity of the slip along both tangents.
    fn slip(&self) -> [f64; 2] {
        let u = relative_velocity(Rules::default(), &self.pair, self.point.r_a, self.point.r_b);
        self.tangents.map(|t| DVec3::new(u.x, u.y, u.z).dot(t))
    }

    /// One sweep with normal impulse `pressed` from the impulse `before`; the impulse after it.
    fn swept(&mut self, rules: Rules, pressed: f64, before: [f64; 2]) -> [f64; 2] {
        let mut impulse = Impulse { tangent_1: before[0], tangent_2: before[1], ..Impulse::default() };
        solve_friction(rules, &self.params, &mut self.pair, &self.contact, &self.point, pressed, &mut impulse);
        [impulse.tangent_1, impulse.tangent_2]
    }
}

fn with(friction: FrictionRule) -> Rules {
    Rules { friction, ..Rules::default() }
}

fn near(x: [f64; 2], y: [f64; 2]) {
    assert!((x[0] - y[0]).hypot(x[1] - y[1]) < 1e-14, "{x:?}, not {y:?}");
}

#[test]
fn friction_takes_the_step_of_its_mass_against_the_slip_within_what_its_rule_allows() {
    let before = [0.02, -0.03];
    let [u_1, u_2] = slipping().slip();
    let wanted = [before[0] - 0.2 * u_1, before[1] - 0.2 * u_2];
    let length = wanted[0].hypot(wanted[1]);
    assert!(length > 0.1 && wanted[0].abs() > 0.03 && wanted[1].abs() > 0.03, "{wanted:?}");
    for rule in [FrictionRule::Disc, FrictionRule::Box] {
        near(slipping().swept(with(rule), 100.0, before), wanted);
    }
    // mu N is half of N. A disc shortens, a box clamps each direction by itself, no pressure holds nothing.
    let limit = 0.5 * 0.04;
    near(slipping().swept(with(FrictionRule::Disc), 0.04, before), wanted.map(|x| x * limit / length));
    near(slipping().swept(with(FrictionRule::Box), 0.04, before), wanted.map(|x| limit.copysign(x)));
    near(slipping().swept(with(FrictionRule::Disc), 0.0, before), [0.0; 2]);
    // Slip has one direction, and the impulse along it.
    let d = [0.7_f64.cos(), 0.7_f64.sin()];
    let along = wanted[0] * d[0] + wanted[1] * d[1];
    near(slipping().swept(with(FrictionRule::Slip), 100.0, before), d.map(|d| along * d));
    near(slipping().swept(with(FrictionRule::Slip), 0.04, before), d.map(|d| limit.copysign(along) * d));
}

#[test]
fn a_belt_is_held_against_as_a_slip_is() {
    let (mut driven, still) = (slipping(), slipping().slip());
    (driven.point.slip_1, driven.point.slip_2) = (-still[0], -still[1]);
    // The bodies move as the belt does: nothing is to be done.
    near(driven.swept(Rules { driven: true, ..with(FrictionRule::Disc) }, 100.0, [0.0; 2]), [0.0; 2]);
}

#[test]
fn friction_changes_the_velocities_by_its_rows() {
    let mut after = slipping();
    let (case, before) = (case(), slipping());
    let impulse = after.swept(with(FrictionRule::Disc), 100.0, [0.0; 2]);
    // M⁻¹ Gᵀ λ, body by body.
    let rows = before.tangents.map(|t| case.row(t));
    let felt = |k: usize| rows[0][k] * impulse[0] + rows[1][k] * impulse[1];
    let wide = |v: LaneVec3<f64>| DVec3::new(v.x, v.y, v.z);
    let bodies = [(before.pair.a, after.pair.a), (before.pair.b, after.pair.b)];
    for (i, (was, is)) in bodies.into_iter().enumerate() {
        let linear = wide(is.v) - wide(was.v) - felt(2 * i) * case.inverse_mass[i];
        let angular = wide(is.w) - wide(was.w) - case.inverse_inertia[i] * felt(2 * i + 1);
        assert!(linear.length() < 1e-14 && angular.length() < 1e-13, "body {i}: {linear} {angular}");
    }
    assert!(after.case.normal.dot(felt(0)).abs() < 1e-14, "friction does not push along the normal");
}

#[test]
fn relaxation_scales_the_step_of_friction_and_of_twist() {
    let whole = slipping().swept(with(FrictionRule::Disc), 100.0, [0.0; 2]);
    let mut half = slipping();
    half.params.relaxation = 0.5;
    near(half.swept(with(FrictionRule::Disc), 100.0, [0.0; 2]), whole.map(|x| 0.5 * x));
    let twisted = |relaxation: f64| {
        let mut s = slipping();
        s.params.relaxation = relaxation;
        let mut impulse = Impulse::default();
        solve_twist(Rules::default(), &s.params, &mut s.pair, &s.contact, &s.point, 100.0, &mut impulse);
        impulse.normal
    };
    assert!(twisted(1.0).abs() > 0.1 && (twisted(0.5) - 0.5 * twisted(1.0)).abs() < 1e-15);
}

#[test]
fn twist_takes_the_spin_about_the_normal_within_mu_times_the_lever() {
    let spin = |s: &Slipping| {
        let w = s.pair.b.w - s.pair.a.w;
        DVec3::new(w.x, w.y, w.z).dot(s.case.normal)
    };
    let twisted = |lever: f64| {
        let mut s = slipping();
        s.point.normal_mass =
            1.0 / s.case.inverse_inertia.iter().map(|i| s.case.normal.dot(*i * s.case.normal)).sum::<f64>();
        let before = spin(&s);
        let mut impulse = Impulse::default();
        solve_twist(Rules::default(), &s.params, &mut s.pair, &s.contact, &s.point, lever, &mut impulse);
        (before, spin(&s), impulse.normal, s.point.normal_mass)
    };
    let (before, after, impulse, mass) = twisted(100.0);
    assert!(before.abs() > 1.0 && after.abs() < 1e-14 && (impulse + mass * before).abs() < 1e-14, "{before} {after}");
    let (before, after, impulse, mass) = twisted(0.1);
    let limited = -(0.05_f64).copysign(before);
    assert!((impulse - limited).abs() < 1e-15 && (after - before - limited / mass).abs() < 1e-14, "{impulse}");
}

#[test]
fn friction_that_changes_a_velocity_by_more_than_the_tolerance_is_noted() {
    let change = slipping().swept(with(FrictionRule::Disc), 100.0, [0.0; 2]);
    let largest = change[0].abs().max(change[1].abs()) / 0.2;
    for (tolerance, noted) in [(0.99 * largest, 1.0), (1.01 * largest, 0.0)] {
        let mut s = slipping();
        s.params.tolerance = tolerance;
        s.swept(Rules { measured: true, ..with(FrictionRule::Disc) }, 100.0, [0.0; 2]);
        assert_eq!(s.pair.moving, noted, "{largest} m/s, tolerance {tolerance}");
        // Nothing is noted where nobody asks.
        let mut s = slipping();
        s.params.tolerance = tolerance;
        s.swept(with(FrictionRule::Disc), 100.0, [0.0; 2]);
        assert_eq!(s.pair.moving, 0.0);
    }
}

/// Normal velocity after one sweep of a point at `separation` that approached at 3 m/s, and its impulse, from `before`.
fn pressed(rules: Rules, params: &StepParams<f64>, separation: f64, before: f64) -> (f64, f64) {
    let case = case();
    let mut pair = case.pair(0, DVec3::ZERO, DVec3::ZERO);
    pair.b.v = lane(case.normal * -3.0);
    let contact = Contact { normal: lane(case.normal), ..Contact::default() };
    let normal_mass = 1.0 / case.dense(case.normal, case.normal);
    let point = Point { r_a: lane(case.r[0]), r_b: lane(case.r[1]), separation, normal_mass, ..Point::default() };
    let mut impulses = [Impulse { normal: before, ..Impulse::default() }];
    solve_contact(rules, params, &mut pair, &contact, &mut (&[point][..], &mut impulses[..]));
    let u = relative_velocity(Rules::default(), &pair, point.r_a, point.r_b);
    (DVec3::new(u.x, u.y, u.z).dot(case.normal), impulses[0].normal)
}

fn hard(bias_rate: f64, push_limit: f64) -> SoftnessOf<f64> {
    SoftnessOf { bias_rate, mass_scale: 1.0, impulse_scale: 0.0, push_limit }
}

#[test]
fn a_sweep_leaves_the_normal_velocity_that_closes_a_gap_or_pushes_out_overlap() {
    let params = StepParams {
        inverse_substep: 100.0,
        relaxation: 1.0,
        slop: 0.004,
        movable: hard(50.0, 0.4),
        ..StepParams::default()
    };
    let (biased, relax) = (Rules { biased: true, ..Rules::default() }, Rules::default());
    for (rules, separation, expected) in [
        // A gap may be closed within the substep, 0.01 s.
        (biased, 0.02, -2.0),
        (relax, 0.02, -2.0),
        // Overlap goes at its rate, but for the slop, and no faster than the limit.
        (biased, -0.01, 50.0 * 0.006),
        (biased, -0.003, 0.0),
        (biased, -0.1, 0.4),
        (relax, -0.01, 0.0),
    ] {
        let (u, impulse) = pressed(rules, &params, separation, 0.0);
        assert!((u - expected).abs() < 1e-13 && impulse > 0.0, "{rules:?}, {separation} m: {u}, not {expected} m/s");
    }
    // A contact with a larger gap than it closes has no impulse, and no contact pulls.
    assert_eq!(pressed(biased, &params, 0.04, 0.0).1, 0.0);
    let half = StepParams { relaxation: 0.5, ..params };
    assert!((pressed(relax, &half, -0.01, 0.0).0 + 1.5).abs() < 1e-13, "half of the correction");
}

/// A spring that would push faster than the limit pushes with the limit, whatever the load: it gives nothing of its impulse back.
#[test]
fn a_contact_at_its_limit_of_speed_bears_its_whole_load() {
    let softness = SoftnessOf { bias_rate: 50.0, mass_scale: 0.75, impulse_scale: 0.25, push_limit: 2.0 };
    let params = StepParams { inverse_substep: 100.0, relaxation: 1.0, movable: softness, ..StepParams::default() };
    let case = case();
    let mass = 1.0 / case.dense(case.normal, case.normal);
    for load in [0.0, 0.2, 7.0] {
        let (_, impulse) = pressed(Rules { biased: true, ..Rules::default() }, &params, -10.0, load);
        let change = 0.75 * mass * (3.0 + 2.0);
        assert!((impulse - load - change).abs() < 1e-14 * (1.0 + load), "{load}: {impulse}");
    }
}

/// u + bias_rate s + r / (mass ...) = 0: the share of the mass that acts, and the impulse that is given back.
#[test]
fn a_soft_sweep_takes_its_share_and_gives_its_impulse_back() {
    let softness = SoftnessOf { bias_rate: 50.0, mass_scale: 0.75, impulse_scale: 0.25, push_limit: 10.0 };
    let params = StepParams { inverse_substep: 100.0, relaxation: 1.0, movable: softness, ..StepParams::default() };
    let case = case();
    let mass = 1.0 / case.dense(case.normal, case.normal);
    let (u, impulse) = pressed(Rules { biased: true, ..Rules::default() }, &params, -0.01, 0.2);
    let change = -0.75 * mass * (-3.0 - 0.5) - 0.25 * 0.2;
    assert!((impulse - 0.2 - change).abs() < 1e-14 && (u - (change / mass - 3.0)).abs() < 1e-13, "{u} {impulse}");
    // The impulse of a sweep may shrink the sum, down to nothing and no further; or each counts by itself.
    let pushed = |accumulated| {
        let rules = Rules { accumulated, bounces: true, ..Rules::default() };
        let parting = StepParams { movable: hard(0.0, 0.0), ..params };
        let mut pair = case.pair(0, DVec3::ZERO, DVec3::ZERO);
        pair.b.v = lane(case.normal);
        let contact = Contact { normal: lane(case.normal), ..Contact::default() };
        let (r_a, r_b) = (lane(case.r[0]), lane(case.r[1]));
        let point = Point { r_a, r_b, separation: -0.01, normal_mass: mass, ..Point::default() };
        let mut impulses = [Impulse { normal: 0.1, bounce: 0.3, ..Impulse::default() }];
        solve_contact(rules, &parting, &mut pair, &contact, &mut (&[point][..], &mut impulses[..]));
        assert_eq!(impulses[0].bounce, 0.3, "sweeps keep the bounce");
        impulses[0].normal
    };
    assert!(mass > 0.11, "{mass}");
    assert_eq!((pushed(true), pushed(false)), (0.0, 0.1));
}

/// Of the contact point: the relative velocity after a substep `h` with an impact, the separation at its end, and the
/// impulse. `gap` and `start` are the separation and the velocity on the true path at the start of the substep, and
/// `elapsed` is the time since the step began.
fn bounced([gap, start, pull]: [f64; 3], [elapsed, h]: [f64; 2], restitution: f64) -> [f64; 3] {
    let case = case();
    let mass = 1.0 / case.dense(case.normal, case.normal);
    let params = StepParams { substep: h, restitution_threshold: 1.0, ..StepParams::default() };
    let mut pair = case.pair(0, DVec3::ZERO, DVec3::ZERO);
    // Substeps move a free body too far by half a substep times the change of its velocity.
    let ahead = 0.5 * pull * h;
    (pair.a.time, pair.b.time) = (elapsed, elapsed);
    pair.b.v = lane(case.normal * (start + pull * h));
    let contact = Contact { normal: lane(case.normal), restitution, ..Contact::default() };
    let (r_a, r_b) = (lane(case.r[0]), lane(case.r[1]));
    let point = Point { r_a, r_b, separation: gap + ahead * elapsed, normal_mass: mass, pull, ..Point::default() };
    let mut impulses = [Impulse::default()];
    let rules = Rules::default();
    restitute_contact(rules, &params, &mut pair, &contact, &mut (&[point][..], &mut impulses[..]));
    assert_eq!(impulses[0].normal, 0.0, "a bounce is no part of the impulses that the next substep begins with");
    let u = relative_velocity(rules, &pair, r_a, r_b);
    let u = DVec3::new(u.x, u.y, u.z).dot(case.normal);
    let s = current_separation(&normal_movement(rules, &pair, &contact), &contact, &point);
    [u, s + u * h - ahead * (elapsed + h), impulses[0].bounce / mass]
}

#[test]
fn a_bounce_acts_when_the_surfaces_meet_and_gives_back_its_share_of_their_speed() {
    let (start, h, e) = (-3.0_f64, 1e-3, 0.5);
    for (gap, pull, elapsed) in [(1e-3, 0.0, 0.0), (1e-3, -400.0, 0.0), (1e-3, -400.0, 0.01), (2e-3, 300.0, 0.002)] {
        let speed = (start * start - 2.0 * pull * gap).sqrt();
        let left = h - 2.0 * gap / (speed - start);
        let [u, s, impulse] = bounced([gap, start, pull], [elapsed, h], e);
        let expected = [e * speed + pull * left, e * speed * left + 0.5 * pull * left * left, (1.0 + e) * speed];
        for (is, wanted) in [u, s, impulse].into_iter().zip(expected) {
            assert!((is - wanted).abs() < 1e-5 * (1.0 + wanted.abs()).min(0.2), "{gap} {pull}: {is}, not {wanted}");
        }
    }
    // Surfaces that do not meet in the substep, meet too slowly, or do not bounce.
    for (state, e) in [([4e-3, start, 0.0], e), ([1e-4, -0.99, 0.0], e), ([1e-3, start, 0.0], 0.0)] {
        assert_eq!(bounced(state, [0.0, h], e)[2], 0.0, "{state:?}");
    }
}

/// M⁻¹ Gᵀ λ of the impulses that are carried over: of each point, or of the points and their patch.
#[test]
fn a_warm_start_is_the_impulses_times_their_rows() {
    let s = slipping();
    let (case, [t_1, t_2]) = (case(), s.tangents);
    let impulse = Impulse { normal: 0.3, tangent_1: 0.2, tangent_2: -0.1, bounce: 0.0 };
    let patch_impulse = Impulse { normal: -0.4, tangent_1: 0.05, tangent_2: 0.15, bounce: 0.0 };
    let friction = |i: Impulse<f64>| t_1 * i.tangent_1 + t_2 * i.tangent_2;
    for patch in [false, true] {
        let mut pair = s.pair;
        let (points, mut impulses) = ([s.point; 2], [impulse, patch_impulse]);
        let (rules, count) = (Rules { patch, ..with(FrictionRule::Disc) }, 1 + usize::from(patch));
        warm_start(rules, &mut pair, &s.contact, &(&points[..count], &mut impulses[..count]));
        let linear = case.normal * impulse.normal + friction(if patch { patch_impulse } else { impulse });
        let twist = if patch { case.normal * patch_impulse.normal } else { DVec3::ZERO };
        for (i, (was, is, sign)) in [(s.pair.a, pair.a, -1.0), (s.pair.b, pair.b, 1.0)].into_iter().enumerate() {
            let wide = |v: LaneVec3<f64>| DVec3::new(v.x, v.y, v.z);
            let moved = wide(is.v) - wide(was.v) - sign * linear * case.inverse_mass[i];
            let spun = wide(is.w) - wide(was.w) - sign * (case.inverse_inertia[i] * (case.r[i].cross(linear) + twist));
            assert!(moved.length() < 1e-14 && spun.length() < 1e-13, "patch {patch}, body {i}: {moved} {spun}");
        }
    }
}

#[test]
fn anchors_move_as_far_as_their_bodies_moved_and_turned() {
    let case = case();
    let (dp, turn) = (DVec3::new(0.1, -0.2, 0.3), DVec3::new(0.4, 0.7, -0.2));
    for (moved, sign) in [(0, -1.0), (1, 1.0)] {
        let pair = case.pair(moved, dp, turn);
        let way = relative_movement(&pair, lane(case.r[0]), lane(case.r[1]));
        let arm = case.r[moved];
        let expected = (dp + DQuat::from_scaled_axis(turn) * arm - arm) * sign;
        assert!(DVec3::new(way.x, way.y, way.z).distance(expected) < 1e-14, "body {moved}");
    }
}

#[test]
fn the_axis_of_a_joint_turns_with_its_second_body() {
    let case = case();
    let turn = DVec3::new(0.4, 0.7, -0.2);
    for (moved, turned) in [(0, DQuat::IDENTITY), (1, DQuat::from_scaled_axis(turn))] {
        let pair = case.pair(moved, DVec3::ZERO, turn);
        let axis = Axis { direction: lane(case.normal), ..Axis::default() };
        let joint = Joint::default();
        let about = axis_motion(&pair, &Frames::of(&pair, &joint), &axis).about_a;
        assert!(DVec3::new(about.x, about.y, about.z).distance(turned * case.normal) < 1e-14, "body {moved}");
    }
}
