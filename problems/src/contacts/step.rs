//! A contact problem from a step: the velocity conditions of its first substep, without springs and warm starting.

use glam::{DMat3, DVec3};

use super::operator::inverse;
use super::{ContactProblem, FreeBody, PointContact, Velocity};
use drystone::stages::problem::StepProblem;
use drystone::stages::problem::{BodyRow, ContactRow, MassRow};

impl ContactProblem {
    /// The hard problem of a substep, from zero impulses. Every contact is rigid and can close its gap within the
    /// substep, overlap is not corrected, and impulses begin at zero. `problem` has the velocities at the start of the
    /// sweeps of the substep, including gravity. Bodies without contacts are left out. The motion of kinematic bodies
    /// is part of the offsets. Joints are left out.
    ///
    /// ```
    /// use drystone_problems::ContactProblem;
    /// use drystone::Simulation;
    /// use drystone_scenes::Scene;
    ///
    /// let scene = Scene::find("tower", &["n=2".into()])?;
    /// let mut simulation = Simulation::new(scene.world)?;
    /// let (step, _) = simulation.next_problem(scene.dt)?;
    /// let problem = ContactProblem::of_step("two boxes".into(), &step);
    /// assert_eq!((problem.bodies.len(), problem.contacts.len()), (2, 8));
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn of_step(name: String, problem: &StepProblem) -> Self {
        let mut index = vec![None; problem.bodies.len()];
        let mut contacts = Self { name, ..Self::default() };
        let inverse_substep = problem.blocks.first().map_or(0.0, |block| block.substep.inverse_length);
        for row in problem.swept_contacts() {
            let [a, b] = [row.body_a, row.body_b].map(|body| {
                let (mass, place) = (&problem.masses[body as usize], &mut index[body as usize]);
                if mass.inv_mass > 0.0 && place.is_none() {
                    *place = Some(contacts.bodies.len() as u32);
                    contacts.bodies.push(free_body(&problem.bodies[body as usize], mass));
                }
                *place
            });
            let frame = frame(row);
            for point in &problem.points[row.first_point as usize..(row.first_point + row.point_count) as usize] {
                let (r_a, r_b) = (wide(point.r_a), wide(point.r_b));
                // The velocity at the point of a body that contacts cannot push.
                let driven = |body: u32, own: Option<u32>, arm: DVec3| match own {
                    Some(_) => DVec3::ZERO,
                    None => {
                        let Velocity { linear, angular } = velocity(&problem.bodies[body as usize]);
                        linear + angular.cross(arm)
                    }
                };
                let u = driven(row.body_b, b, r_b) - driven(row.body_a, a, r_a);
                let gap = f64::from((point.separation - row.preload).max(0.0) * inverse_substep);
                let arm = |own: Option<u32>, r: DVec3| if own.is_some() { r } else { DVec3::ZERO };
                contacts.contacts.push(PointContact {
                    a,
                    b,
                    friction: row.friction.into(),
                    offset: DVec3::from_array(frame.map(|d| d.dot(u))) + DVec3::X * gap,
                    frame,
                    r_a: arm(a, r_a),
                    r_b: arm(b, r_b),
                });
            }
        }
        contacts
    }
}

fn free_body(body: &BodyRow, mass: &MassRow) -> FreeBody {
    let ([xx, xy, xz], [yy, yz, zz]) = (mass.inv_inertia_x.map(f64::from), mass.inv_inertia_yz.map(f64::from));
    let inverse_inertia = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    FreeBody { mass: 1.0 / f64::from(mass.inv_mass), inertia: inverse(inverse_inertia), free: velocity(body) }
}

fn velocity(body: &BodyRow) -> Velocity {
    Velocity { linear: wide(body.v), angular: wide(body.w) }
}

/// The frame of a manifold, orthonormal to full precision.
fn frame(row: &ContactRow) -> [DVec3; 3] {
    let normal = wide(row.normal).normalize();
    let tangent = wide(row.tangent).reject_from_normalized(normal).normalize();
    [normal, tangent, normal.cross(tangent)]
}

fn wide(x: [f32; 3]) -> DVec3 {
    DVec3::from_array(x.map(f64::from))
}
