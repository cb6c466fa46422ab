//! Box3D, from a drystone world and back.
//!
//! It has no half-space: a box 10 m thick, wide enough for the scene, stands for it. It has no cylinder and no cone: hulls of 32 sides
//! stand for them. Height fields are given to it as meshes.

use std::sync::Mutex;

use box3d_sys::*;
use drystone::glam::{Mat3, Quat, Vec3};
use drystone::world::{BodyKind, Collider};
use drystone::{Body, Error, Result, World};
use drystone_scenes::Scene;
use drystone_cli::report::comparison::{Contender, Setting};
use rapier3d::parry::shape::{TriMesh, TypedShape};

use crate::round::{cone, cylinder};
use crate::setting::setting;

/// Worlds are numbered in a table of the library that takes one caller at a time.
static TABLE: Mutex<()> = Mutex::new(());

/// A scene in Box3D's hands.
pub(crate) struct Box3d {
    id: b3WorldId,
    bodies: Vec<b3BodyId>,
    /// What shapes refer to for as long as they are there.
    meshes: Vec<*mut b3MeshData>,
    substeps: u32,
    hertz: f32,
    dt: f32,
    world: World,
}

impl Box3d {
    /// A scene with everything at the library's defaults, but that nothing sleeps.
    pub(crate) fn new(scene: &Scene, substeps: u32, hertz: f32, threads: usize) -> Result<Self> {
        let world = scene.world.clone();
        let one_at_a_time = TABLE.lock().unwrap_or_else(|e| e.into_inner());
        // SAFETY: definitions come from the library's own defaults, and nothing that they point to is dropped before the call returns.
        let mut new = unsafe {
            let mut def = b3DefaultWorldDef();
            def.gravity = vec3(world.gravity);
            def.enableSleep = false;
            def.contactHertz = hertz;
            def.workerCount = threads as u32;
            let id = b3CreateWorld(&def);
            Self { id, bodies: Vec::new(), meshes: Vec::new(), substeps, hertz, dt: scene.dt, world }
        };
        // Half a side of the box for a half-space: twice as far as anything is, and some.
        let reach = 2.0 * new.world.bodies.iter().map(|b| b.position.length()).fold(50.0, f32::max);
        let added = (0..new.world.bodies.len()).try_for_each(|index| new.insert(index, reach)).map(|()| new.join());
        // A world that is dropped takes the lock.
        drop(one_at_a_time);
        added.map(|()| new)
    }

    fn insert(&mut self, index: usize, reach: f32) -> Result<()> {
        let body = &self.world.bodies[index];
        // SAFETY: as above; hulls are copied by the library, meshes are kept until the world is gone.
        unsafe {
            let mut def = b3DefaultBodyDef();
            def.type_ = match body.kind {
                BodyKind::Fixed => b3BodyType_b3_staticBody,
                BodyKind::Kinematic => b3BodyType_b3_kinematicBody,
                BodyKind::Dynamic => b3BodyType_b3_dynamicBody,
                other => return Err(Error::input(format!("box3d has no kind like {other:?} of body {index}"))),
            };
            def.position = vec3(body.position);
            def.rotation = quat(body.rotation);
            def.enableSleep = false;
            let id = b3CreateBody(self.id, &def);
            self.bodies.push(id);
            for collider in &body.colliders {
                let shape = || Error::input(format!("box3d has no shape like {:?} of body {index}", collider.shape));
                let mesh = add_shape(id, body, collider, reach).ok_or_else(shape)?;
                self.meshes.extend(mesh);
            }
            if body.kind == BodyKind::Dynamic {
                let turned = Mat3::from_quat(body.mass.principal_frame);
                let inertia = turned * Mat3::from_diagonal(body.mass.principal_inertia) * turned.transpose();
                let [cx, cy, cz] = [inertia.x_axis, inertia.y_axis, inertia.z_axis].map(vec3);
                let (mass, center) = (body.mass.mass, vec3(body.mass.center));
                b3Body_SetMassData(id, b3MassData { mass, center, inertia: b3Matrix3 { cx, cy, cz } });
            }
            // Last, since it is meant for the center of mass.
            if body.kind != BodyKind::Fixed {
                b3Body_SetLinearVelocity(id, vec3(body.linear_velocity));
                b3Body_SetAngularVelocity(id, vec3(body.angular_velocity));
            }
        }
        Ok(())
    }

    fn join(&self) {
        // SAFETY: as above.
        unsafe {
            // The body that stands for the world in joints to it.
            let ground = (!self.world.joints.is_empty()).then(|| b3CreateBody(self.id, &b3DefaultBodyDef()));
            for joint in &self.world.joints {
                let mut def = b3DefaultSphericalJointDef();
                def.base.bodyIdA = self.bodies[joint.body_a.index()];
                let other = joint.body_b.map(|b| self.bodies[b.index()]);
                def.base.bodyIdB = other.unwrap_or_else(|| ground.expect("there are joints"));
                def.base.localFrameA = transform(joint.anchor_a, Quat::IDENTITY);
                def.base.localFrameB = transform(joint.anchor_b, Quat::IDENTITY);
                def.base.collideConnected = joint.collide;
                b3CreateSphericalJoint(self.id, &def);
            }
        }
    }
}

/// Adds the shape and gives back the mesh that must be kept, if it took one; none if there is no shape like it.
///
/// # Safety
/// The body is there.
unsafe fn add_shape(id: b3BodyId, body: &Body, collider: &Collider, reach: f32) -> Option<Option<*mut b3MeshData>> {
    let (position, rotation) = (collider.position, collider.rotation);
    let place = |p: Vec3| vec3(position + rotation * p);
    // SAFETY: of the caller.
    unsafe {
        let mut def = b3DefaultShapeDef();
        def.density = 0.0;
        def.updateBodyMass = body.kind != BodyKind::Dynamic;
        def.baseMaterial.friction = body.material.friction;
        def.baseMaterial.restitution = body.material.restitution;
        let add_box = |half: Vec3, position: Vec3, rotation: Quat| {
            let hull = b3MakeTransformedBoxHull(half.x, half.y, half.z, transform(position, rotation));
            b3CreateHullShape(id, &def, &hull.base);
        };
        let add_hull = |points: &[Vec3]| {
            let points: Vec<_> = points.iter().map(|&p| place(p)).collect();
            let hull = b3CreateHull(points.as_ptr(), points.len() as i32, points.len() as i32);
            if !hull.is_null() {
                b3CreateHullShape(id, &def, hull);
                b3DestroyHull(hull);
            }
            (!hull.is_null()).then_some(None)
        };
        let add_mesh = |mesh: &TriMesh| {
            let mut vertices: Vec<_> = mesh.vertices().iter().map(|&p| place(p)).collect();
            let mut indices: Vec<_> = mesh.indices().iter().flatten().map(|&i| i as i32).collect();
            let mut of = b3MeshDef { identifyEdges: true, ..Default::default() };
            (of.vertices, of.vertexCount) = (vertices.as_mut_ptr(), vertices.len() as i32);
            (of.indices, of.triangleCount) = (indices.as_mut_ptr(), mesh.indices().len() as i32);
            let data = b3CreateMesh(&of, std::ptr::null_mut(), 0);
            b3CreateMeshShape(id, &def, data, vec3(Vec3::ONE));
            Some(Some(data))
        };
        match collider.shape.parry().as_typed_shape() {
            TypedShape::Ball(ball) => {
                b3CreateSphereShape(id, &def, &b3Sphere { center: vec3(position), radius: ball.radius });
            }
            TypedShape::Capsule(capsule) => {
                let [center1, center2] = [capsule.segment.a, capsule.segment.b].map(place);
                b3CreateCapsuleShape(id, &def, &b3Capsule { center1, center2, radius: capsule.radius });
            }
            TypedShape::Cuboid(cuboid) if position == Vec3::ZERO && rotation == Quat::IDENTITY => {
                let half = cuboid.half_extents;
                b3CreateHullShape(id, &def, &b3MakeBoxHull(half.x, half.y, half.z).base);
            }
            TypedShape::Cuboid(cuboid) => add_box(cuboid.half_extents, position, rotation),
            TypedShape::HalfSpace(plane) => {
                let turn = rotation * Quat::from_rotation_arc(Vec3::Y, plane.normal);
                add_box(Vec3::new(reach, 5.0, reach), position - turn * Vec3::new(0.0, 5.0, 0.0), turn);
            }
            TypedShape::Cylinder(of) => return add_hull(&cylinder(of.radius, of.half_height)),
            TypedShape::Cone(of) => return add_hull(&cone(of.radius, of.half_height)),
            TypedShape::ConvexPolyhedron(hull) => return add_hull(hull.points()),
            TypedShape::TriMesh(mesh) => return add_mesh(mesh),
            TypedShape::HeightField(field) => {
                let (vertices, triangles) = field.to_trimesh();
                return add_mesh(&TriMesh::new(vertices, triangles).ok()?);
            }
            _ => return None,
        }
    }
    Some(None)
}

impl Contender for Box3d {
    fn setting(&self) -> Setting {
        setting("box3d", self.substeps, self.hertz)
    }

    fn step(&mut self) -> Result<()> {
        // SAFETY: world and bodies are there until this is dropped.
        unsafe {
            // A force lasts for one step.
            for (body, &id) in self.world.bodies.iter().zip(&self.bodies).filter(|(b, _)| b.force != Vec3::ZERO) {
                b3Body_ApplyForceToCenter(id, vec3(body.force), true);
            }
            b3World_Step(self.id, self.dt, self.substeps as i32);
        }
        Ok(())
    }

    fn world(&mut self) -> &World {
        for (body, &id) in self.world.bodies.iter_mut().zip(&self.bodies).filter(|(b, _)| b.kind != BodyKind::Fixed) {
            // SAFETY: as above.
            let (p, q, v, w) = unsafe {
                let (p, q) = (b3Body_GetPosition(id), b3Body_GetRotation(id));
                (p, q, b3Body_GetLinearVelocity(id), b3Body_GetAngularVelocity(id))
            };
            body.position = Vec3::new(p.x, p.y, p.z);
            body.rotation = Quat::from_xyzw(q.v.x, q.v.y, q.v.z, q.s);
            body.linear_velocity = Vec3::new(v.x, v.y, v.z);
            body.angular_velocity = Vec3::new(w.x, w.y, w.z);
        }
        &self.world
    }
}

impl Drop for Box3d {
    fn drop(&mut self) {
        let _one_at_a_time = TABLE.lock().unwrap_or_else(|e| e.into_inner());
        // SAFETY: both were made by the library, and nobody else has them.
        unsafe {
            b3DestroyWorld(self.id);
            self.meshes.iter().for_each(|&mesh| b3DestroyMesh(mesh));
        }
    }
}

fn vec3(v: Vec3) -> b3Vec3 {
    b3Vec3 { x: v.x, y: v.y, z: v.z }
}

fn quat(q: Quat) -> b3Quat {
    b3Quat { v: b3Vec3 { x: q.x, y: q.y, z: q.z }, s: q.w }
}

fn transform(position: Vec3, rotation: Quat) -> b3Transform {
    b3Transform { p: vec3(position), q: quat(rotation) }
}
