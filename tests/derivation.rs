//! The functions that docs/derivation.md names, against finite differences of the constraints and the dense product
//! G M⁻¹ Gᵀ, in f64 where they are written over a lane.

use drystone::glam::{DMat3, DQuat, DVec3, Mat3, Vec3};
use drystone::kernels::contact::{current_separation, normal_movement};
use drystone::kernels::joint::joint_column;
use drystone::kernels::pair::relative_velocity;
use drystone::kernels::{Body, Contact, Mass, Pair, Point, Rules, Sym3};
use drystone::math::{Quat, Vec3 as LaneVec3, vec3};
use drystone::problem::ContactRow;
use drystone::problem::effective::{EffectiveMass, InverseMass};

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
        [0, 1].map(|i| InverseMass { mass: self.inverse_mass[i] as f32, inertia: self.inverse_inertia[i].as_mat3() })
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
            inv_inertia: symmetric(&self.inverse_inertia[i]),
            inv_mass: self.inverse_mass[i],
            acceleration: lane(DVec3::ZERO),
        };
        Pair { a: body(0), b: body(1), mass_a: mass(0), mass_b: mass(1), moving: 0.0 }
    }

    fn separation(&self, pair: &Pair<f64>) -> f64 {
        let point = Point { r_a: lane(self.r[0]), r_b: lane(self.r[1]), separation: 0.125, ..Point::default() };
        let contact = Contact { normal: lane(self.normal), ..Contact::default() };
        let movement = normal_movement(Rules::default(), pair, &contact);
        current_separation(&movement, &point)
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
    let u = relative_velocity(&pair, lane(case.r[0]), lane(case.r[1]));
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

#[test]
fn the_block_of_a_joint_is_the_dense_product() {
    let case = case();
    let pair = case.pair(0, DVec3::ZERO, DVec3::ZERO);
    let anchors = case.r.map(lane);
    for e in [DVec3::X, DVec3::Y, DVec3::Z] {
        let column = joint_column(&pair, anchors, lane(e));
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
