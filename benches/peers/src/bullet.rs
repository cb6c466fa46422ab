//! Bullet, from a drystone world and back.
//!
//! A body of Bullet's turns about the origin of its frame, in which its inertia is diagonal: frames are at the center of mass. Height
//! fields are given to it as meshes.

use drystone::glam::{Quat, Vec3};
use drystone::world::{BodyKind, Collider};
use drystone::{Body, Error, Result, World};
use drystone_scenes::Scene;
use drystone_cli::report::comparison::{Contender, Setting};
use rapier3d::parry::shape::{TriMesh, TypedShape};

use crate::entrant::BulletSolver;

/// The functions of `bullet.cpp`.
mod library {
    use std::ffi::c_int;

    #[repr(C)]
    pub(super) struct World {
        _opaque: [u8; 0],
    }

    unsafe extern "C" {
        pub(super) fn bullet_world(gravity: *const f32, solver: c_int, iterations: c_int) -> *mut World;
        pub(super) fn bullet_free(world: *mut World);
        pub(super) fn bullet_ball(world: *mut World, radius: f32) -> c_int;
        pub(super) fn bullet_box(world: *mut World, half: *const f32) -> c_int;
        pub(super) fn bullet_capsule(world: *mut World, radius: f32, half_height: f32) -> c_int;
        pub(super) fn bullet_cylinder(world: *mut World, radius: f32, half_height: f32) -> c_int;
        pub(super) fn bullet_cone(world: *mut World, radius: f32, half_height: f32) -> c_int;
        pub(super) fn bullet_hull(world: *mut World, points: *const f32, count: c_int) -> c_int;
        pub(super) fn bullet_half_space(world: *mut World, normal: *const f32) -> c_int;
        pub(super) fn bullet_mesh(
            world: *mut World,
            vertices: *const f32,
            vertex_count: c_int,
            indices: *const u32,
            triangle_count: c_int,
        ) -> c_int;
        pub(super) fn bullet_body(
            world: *mut World,
            pose: *const f32,
            mass: f32,
            inertia: *const f32,
            velocity: *const f32,
            friction: f32,
            restitution: f32,
            is_kinematic: c_int,
            count: c_int,
            shapes: *const c_int,
            places: *const f32,
        );
        pub(super) fn bullet_joint(
            world: *mut World,
            a: c_int,
            at_a: *const f32,
            b: c_int,
            at_b: *const f32,
            collide: c_int,
        );
        pub(super) fn bullet_force(world: *mut World, body: c_int, force: *const f32);
        pub(super) fn bullet_target(world: *mut World, body: c_int, pose: *const f32);
        pub(super) fn bullet_step(world: *mut World, dt: f32);
        pub(super) fn bullet_state(world: *const World, body: c_int, out: *mut f32);
    }
}

/// A place: where the origin is, and the turn.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    origin: Vec3,
    turn: Quat,
}

impl Place {
    const HERE: Self = Self { origin: Vec3::ZERO, turn: Quat::IDENTITY };

    fn of_body(body: &Body) -> Self {
        Self { origin: body.position, turn: body.rotation }
    }

    fn point(self, p: Vec3) -> Vec3 {
        self.origin + self.turn * p
    }

    fn then(self, inner: Self) -> Self {
        Self { origin: self.point(inner.origin), turn: self.turn * inner.turn }
    }

    fn inverse(self) -> Self {
        let turn = self.turn.inverse();
        Self { origin: turn * -self.origin, turn }
    }

    /// As the library reads it, with so many of its lengths for a meter.
    fn pose(self, scale: f32) -> [f32; 7] {
        let ([x, y, z], [i, j, k, w]) = ((scale * self.origin).to_array(), self.turn.to_array());
        [x, y, z, i, j, k, w]
    }
}

/// The kind of a body in Bullet's world.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// The frame of Bullet's body in that of drystone's.
    frame: Place,
    kind: BodyKind,
}

/// A scene in Bullet's hands.
pub(crate) struct Bullet {
    library: *mut library::World,
    bodies: Vec<Known>,
    solver: BulletSolver,
    iterations: u32,
    substeps: u32,
    dt: f32,
    /// Bullet's lengths for a meter.
    scale: f32,
    world: World,
}

impl Bullet {
    /// A scene with everything at the library's defaults, but that nothing sleeps or is damped. Things of `unit` meters are as large as things of
    /// 1 m are by default: the library's margins and thresholds are lengths.
    pub(crate) fn new(
        scene: &Scene,
        substeps: u32,
        (solver, iterations): (BulletSolver, u32),
        threads: usize,
        unit: f32,
    ) -> Result<Self> {
        if threads != 1 {
            return Err(Error::input(format!("bullet runs on one thread here, not on {threads}")));
        }
        let (world, scale) = (scene.world.clone(), 1.0 / unit);
        let gravity = (scale * world.gravity).to_array();
        // SAFETY: the library copies the numbers.
        let library = unsafe { library::bullet_world(gravity.as_ptr(), solver as i32, iterations as i32) };
        let bodies = Vec::new();
        let mut new = Self { library, bodies, solver, iterations, substeps, dt: scene.dt, scale, world };
        (0..new.world.bodies.len()).try_for_each(|index| new.insert(index))?;
        new.join();
        Ok(new)
    }

    fn insert(&mut self, index: usize) -> Result<()> {
        let body = &self.world.bodies[index];
        let unfit = |what: String| Error::input(format!("bullet has no {what} of body {index}"));
        let (mass, inertia, frame) = match (body.kind, &body.colliders[..]) {
            (BodyKind::Dynamic, _) => {
                let turn = body.mass.principal_frame;
                (body.mass.mass, body.mass.principal_inertia, Place { origin: body.mass.center, turn })
            }
            // One shape alone lies where its body does.
            (BodyKind::Fixed | BodyKind::Kinematic, [one]) => {
                (0.0, Vec3::ZERO, Place { origin: one.position, turn: one.rotation })
            }
            (BodyKind::Fixed | BodyKind::Kinematic, _) => (0.0, Vec3::ZERO, Place::HERE),
            (other, _) => return Err(unfit(format!("kind like {other:?}"))),
        };
        let (mut shapes, mut places) = (Vec::new(), Vec::new());
        for collider in &body.colliders {
            // Exactly where the frame is, if it is the frame, so that no compound is needed.
            let own = Place { origin: collider.position, turn: collider.rotation };
            let within = if own == frame { Place::HERE } else { frame.inverse().then(own) };
            let shape = self.shape(body, collider, within);
            let (shape, place) = shape.ok_or_else(|| unfit(format!("shape like {:?}", collider.shape)))?;
            shapes.push(shape);
            places.extend(place.pose(self.scale));
        }
        let pose = Place::of_body(body).then(frame).pose(self.scale);
        let inertia = (self.scale * self.scale * inertia).to_array();
        let [v, w] = [self.scale * body.linear_velocity, body.angular_velocity].map(|v| v.to_array());
        let velocity = [v, w].concat();
        // SAFETY: the world is there until this is dropped, and the library copies the numbers.
        unsafe {
            library::bullet_body(
                self.library,
                pose.as_ptr(),
                mass,
                inertia.as_ptr(),
                velocity.as_ptr(),
                body.material.friction,
                body.material.restitution,
                (body.kind == BodyKind::Kinematic).into(),
                shapes.len() as i32,
                shapes.as_ptr(),
                places.as_ptr(),
            );
        }
        self.bodies.push(Known { frame, kind: body.kind });
        Ok(())
    }

    /// The number of a new shape and its place in the body; none if the library has no shape like it.
    fn shape(&self, body: &Body, collider: &Collider, within: Place) -> Option<(i32, Place)> {
        let (library, scale) = (self.library, self.scale);
        let numbers = |points: &[Vec3]| points.iter().flat_map(|&p| (scale * p).to_array()).collect::<Vec<f32>>();
        let baked = |points: &[Vec3]| numbers(&points.iter().map(|&p| within.point(p)).collect::<Vec<_>>());
        let mesh = |mesh: &TriMesh| {
            // The library lets meshes stay or follow their targets, but not move freely.
            (body.kind != BodyKind::Dynamic).then(|| {
                let (vertices, indices) = (baked(mesh.vertices()), mesh.indices());
                // SAFETY: the library copies the numbers, three a vertex and a triangle.
                let shape = unsafe {
                    let [vertex_count, triangle_count] = [mesh.vertices().len(), indices.len()].map(|n| n as i32);
                    let indices = indices.as_ptr().cast();
                    library::bullet_mesh(library, vertices.as_ptr(), vertex_count, indices, triangle_count)
                };
                (shape, Place::HERE)
            })
        };
        // SAFETY: as above.
        let (shape, place) = unsafe {
            match collider.shape.parry().as_typed_shape() {
                TypedShape::Ball(ball) => (library::bullet_ball(library, scale * ball.radius), within),
                TypedShape::Cuboid(cuboid) => {
                    (library::bullet_box(library, numbers(&[cuboid.half_extents]).as_ptr()), within)
                }
                TypedShape::Capsule(capsule) => {
                    let segment = capsule.segment;
                    // The library's capsules lie along Y about their middle.
                    let turn = Quat::from_rotation_arc(Vec3::Y, (segment.b - segment.a).normalize_or(Vec3::Y));
                    let origin = 0.5 * (segment.a + segment.b);
                    let [radius, half] = [capsule.radius, 0.5 * segment.length()].map(|length| scale * length);
                    (library::bullet_capsule(library, radius, half), within.then(Place { origin, turn }))
                }
                TypedShape::Cylinder(of) => {
                    (library::bullet_cylinder(library, scale * of.radius, scale * of.half_height), within)
                }
                TypedShape::Cone(of) => {
                    (library::bullet_cone(library, scale * of.radius, scale * of.half_height), within)
                }
                TypedShape::ConvexPolyhedron(hull) => {
                    let points = baked(hull.points());
                    (library::bullet_hull(library, points.as_ptr(), hull.points().len() as i32), Place::HERE)
                }
                TypedShape::HalfSpace(plane) => {
                    (library::bullet_half_space(library, plane.normal.to_array().as_ptr()), within)
                }
                TypedShape::TriMesh(of) => mesh(of)?,
                TypedShape::HeightField(field) => {
                    let (vertices, triangles) = field.to_trimesh();
                    mesh(&TriMesh::new(vertices, triangles).ok()?)?
                }
                _ => return None,
            }
        };
        (shape >= 0).then_some((shape, place))
    }

    fn join(&self) {
        for joint in &self.world.joints {
            let a = joint.body_a.index();
            let b = joint.body_b.map(|b| b.index());
            let frame = |body: Option<usize>| body.map_or(Place::HERE, |body| self.bodies[body].frame.inverse());
            let [at_a, at_b] = [(Some(a), joint.anchor_a), (b, joint.anchor_b)]
                .map(|(body, anchor)| (self.scale * frame(body).point(anchor)).to_array());
            let b = b.map_or(-1, |b| b as i32);
            // SAFETY: both bodies are there.
            unsafe {
                let collide = joint.collide.into();
                library::bullet_joint(self.library, a as i32, at_a.as_ptr(), b, at_b.as_ptr(), collide);
            }
        }
    }

    /// A step in as many parts as there are substeps.
    fn advance(&mut self) {
        let dt = self.dt / self.substeps as f32;
        for _ in 0..self.substeps {
            for (index, (body, known)) in self.world.bodies.iter_mut().zip(&self.bodies).enumerate() {
                // SAFETY: the world and the body are there, and the library copies the numbers.
                unsafe {
                    if known.kind == BodyKind::Kinematic {
                        body.position += dt * body.linear_velocity;
                        body.rotation = Quat::from_scaled_axis(dt * body.angular_velocity) * body.rotation;
                        let target = Place::of_body(body).then(known.frame).pose(self.scale);
                        library::bullet_target(self.library, index as i32, target.as_ptr());
                    } else if body.force != Vec3::ZERO {
                        // A force lasts for one part.
                        let force = (self.scale * body.force).to_array();
                        library::bullet_force(self.library, index as i32, force.as_ptr());
                    }
                }
            }
            // SAFETY: the world is there.
            unsafe { library::bullet_step(self.library, dt) };
        }
    }

    /// Brings poses and velocities of the world up to date.
    fn read_back(&mut self) {
        for (index, (body, known)) in self.world.bodies.iter_mut().zip(&self.bodies).enumerate() {
            if known.kind != BodyKind::Dynamic {
                continue;
            }
            let mut state = [0.0_f32; 13];
            // SAFETY: the world and the body are there, and the state has room.
            unsafe { library::bullet_state(self.library, index as i32, state.as_mut_ptr()) };
            let [p, v, w] = [0, 7, 10].map(|k| Vec3::from_slice(&state[k..]));
            let at = Place { origin: p / self.scale, turn: Quat::from_slice(&state[3..]) };
            let at = at.then(known.frame.inverse());
            (body.position, body.rotation) = (at.origin, at.turn);
            (body.linear_velocity, body.angular_velocity) = (v / self.scale, w);
        }
    }
}

impl Contender for Bullet {
    fn setting(&self) -> Setting {
        Setting {
            engine: "bullet".into(),
            backend: "cpu".into(),
            substeps: self.substeps,
            sweeps: self.iterations,
            method: "plain".into(),
            friction: "disc".into(),
            more: self.solver.name().into(),
        }
    }

    fn step(&mut self) -> Result<()> {
        self.advance();
        Ok(())
    }

    fn world(&mut self) -> &World {
        self.read_back();
        &self.world
    }
}

/// Moves a game's board and ball.
impl drystone_maze::Engine for Bullet {
    fn name(&self) -> String {
        Contender::setting(self).label()
    }

    fn world(&self) -> &World {
        &self.world
    }

    fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    fn step(&mut self, _dt: f32) -> Result<()> {
        self.advance();
        self.read_back();
        Ok(())
    }
}

impl Drop for Bullet {
    fn drop(&mut self) {
        // SAFETY: the library made it, and nobody else has it.
        unsafe { library::bullet_free(self.library) };
    }
}
