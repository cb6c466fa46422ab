//! PhysX with its TGS solver, from a drystone world and back.
//!
//! It has no cylinder and no cone: hulls of 32 sides stand for them. Height fields are given to it as meshes. Shapes take part in
//! simulation only, so that a step does not bring the structures of scene queries up to date.

use std::ffi::c_void;
use std::ptr::null_mut;
use std::sync::{LazyLock, Mutex, MutexGuard};

use drystone::glam::{Quat, Vec3};
use drystone::world::{BodyKind, Collider};
use drystone::{Body, Error, Result, World};
use drystone_scenes::Scene;
use drystone_cli::report::comparison::{Contender, Setting};
use physx_sys::*;
use rapier3d::parry::shape::{TriMesh, TypedShape};

use crate::round::{cone, cylinder};

/// Velocity iterations of a step: the library's default.
const VELOCITY_ITERATIONS: u32 = 1;

/// Most position iterations that the library takes.
const MAX_ITERATIONS: u32 = 255;

/// The library's only instance in this process, which makes all objects.
struct Sdk(*mut PxPhysics);

// SAFETY: the instance belongs to no thread, and the lock lets one thread at a time call it.
unsafe impl Send for Sdk {}

static SDK: LazyLock<Mutex<Sdk>> = LazyLock::new(|| {
    // SAFETY: the library is loaded once, and never unloaded.
    Mutex::new(Sdk(unsafe { physx_create_physics(physx_create_foundation()) }))
});

fn sdk() -> MutexGuard<'static, Sdk> {
    SDK.lock().unwrap_or_else(|e| e.into_inner())
}

/// A scene in PhysX's hands.
pub(crate) struct Physx {
    scene: *mut PxScene,
    dispatcher: *mut PxDefaultCpuDispatcher,
    actors: Vec<*mut PxRigidActor>,
    joints: Vec<*mut PxJoint>,
    /// One for each pair of friction and restitution.
    materials: Vec<([f32; 2], *mut PxMaterial)>,
    iterations: u32,
    dt: f32,
    world: World,
}

impl Physx {
    /// A scene with everything at the library's defaults, except that TGS solves it, gyroscopic forces act, and nothing sleeps or is
    /// damped.
    pub(crate) fn new(scene: &Scene, iterations: u32, threads: usize) -> Result<Self> {
        if iterations > MAX_ITERATIONS {
            return Err(Error::input(format!("{iterations} substeps: PhysX takes at most {MAX_ITERATIONS}")));
        }
        let world = scene.world.clone();
        let sdk = sdk();
        // SAFETY: the instance lives forever, and nothing that the calls point to is dropped before they return.
        let (made, dispatcher) = unsafe {
            // With no worker, all tasks run on the thread that calls `simulate`.
            let workers = if threads == 1 { 0 } else { threads as u32 };
            let wait = PxDefaultCpuDispatcherWaitForWorkMode::WaitForWork;
            let dispatcher = phys_PxDefaultCpuDispatcherCreate(workers, null_mut(), wait, 0);
            let mut desc = PxSceneDesc_new(PxPhysics_getTolerancesScale(sdk.0));
            desc.gravity = vec3(world.gravity);
            desc.cpuDispatcher = dispatcher.cast();
            desc.filterShader = get_default_simulation_filter_shader();
            desc.solverType = PxSolverType::Tgs;
            (PxPhysics_createScene_mut(sdk.0, &desc), dispatcher)
        };
        let (actors, joints, materials) = (Vec::new(), Vec::new(), Vec::new());
        let mut new = Self { scene: made, dispatcher, actors, joints, materials, iterations, dt: scene.dt, world };
        let added = (0..new.world.bodies.len()).try_for_each(|index| new.insert(&sdk, index)).map(|()| new.join(&sdk));
        // A scene that is dropped takes the lock.
        drop(sdk);
        added.map(|()| new)
    }

    fn insert(&mut self, sdk: &Sdk, index: usize) -> Result<()> {
        let body = &self.world.bodies[index];
        let pose = transform(body.position, body.rotation);
        // SAFETY: the instance and the scene are there; an actor keeps its shapes, and a shape its material and mesh.
        unsafe {
            let actor: *mut PxRigidActor = match body.kind {
                BodyKind::Fixed => PxPhysics_createRigidStatic_mut(sdk.0, &pose).cast(),
                BodyKind::Kinematic | BodyKind::Dynamic => PxPhysics_createRigidDynamic_mut(sdk.0, &pose).cast(),
                other => return Err(Error::input(format!("PhysX has no kind like {other:?} of body {index}"))),
            };
            self.actors.push(actor);
            let material = self.material(sdk, index);
            let body = &self.world.bodies[index];
            for collider in &body.colliders {
                let unfit = || Error::input(format!("PhysX has no shape like {:?} of body {index}", collider.shape));
                add_shape(sdk, actor, material, body, collider).ok_or_else(unfit)?;
            }
            match body.kind {
                BodyKind::Kinematic => {
                    PxRigidBody_setRigidBodyFlag_mut(actor.cast(), PxRigidBodyFlag::Kinematic, true);
                }
                BodyKind::Dynamic => set_motion(actor, body, self.iterations),
                _ => {}
            }
            PxScene_addActor_mut(self.scene, actor.cast(), null_mut());
        }
        Ok(())
    }

    /// The material of a body. The library multiplies friction, so that a body gets the root of its own and a pair the geometric mean.
    fn material(&mut self, sdk: &Sdk, index: usize) -> *mut PxMaterial {
        let of = &self.world.bodies[index].material;
        let key = [of.friction, of.restitution];
        if let Some((_, known)) = self.materials.iter().find(|(other, _)| *other == key) {
            return *known;
        }
        // SAFETY: the instance is there.
        let material = unsafe {
            let root = of.friction.sqrt();
            let material = PxPhysics_createMaterial_mut(sdk.0, root, root, of.restitution);
            PxMaterial_setFrictionCombineMode_mut(material, PxCombineMode::Multiply);
            PxMaterial_setRestitutionCombineMode_mut(material, PxCombineMode::Max);
            material
        };
        self.materials.push((key, material));
        material
    }

    fn join(&mut self, sdk: &Sdk) {
        for joint in &self.world.joints {
            let [a, b] = [joint.anchor_a, joint.anchor_b].map(|anchor| transform(anchor, Quat::IDENTITY));
            // The null actor is the world.
            let other = joint.body_b.map_or(null_mut(), |b| self.actors[b.index()]);
            // SAFETY: the instance and both actors are there.
            unsafe {
                let made = phys_PxSphericalJointCreate(sdk.0, self.actors[joint.body_a.index()], &a, other, &b).cast();
                PxJoint_setConstraintFlag_mut(made, PxConstraintFlag::CollisionEnabled, joint.collide);
                self.joints.push(made);
            }
        }
    }
}

/// Gives a dynamic actor mass, velocity and iterations.
///
/// # Safety
/// The actor is there, and dynamic.
unsafe fn set_motion(actor: *mut PxRigidActor, body: &Body, iterations: u32) {
    // SAFETY: of the caller.
    unsafe {
        PxRigidBody_setMass_mut(actor.cast(), body.mass.mass);
        PxRigidBody_setMassSpaceInertiaTensor_mut(actor.cast(), &vec3(body.mass.principal_inertia));
        PxRigidBody_setCMassLocalPose_mut(actor.cast(), &transform(body.mass.center, body.mass.principal_frame));
        PxRigidBody_setRigidBodyFlag_mut(actor.cast(), PxRigidBodyFlag::EnableGyroscopicForces, true);
        PxRigidBody_setLinearDamping_mut(actor.cast(), 0.0);
        PxRigidBody_setAngularDamping_mut(actor.cast(), 0.0);
        PxRigidDynamic_setSleepThreshold_mut(actor.cast(), 0.0);
        PxRigidDynamic_setSolverIterationCounts_mut(actor.cast(), iterations, VELOCITY_ITERATIONS);
        PxRigidDynamic_setLinearVelocity_mut(actor.cast(), &vec3(body.linear_velocity), false);
        PxRigidDynamic_setAngularVelocity_mut(actor.cast(), &vec3(body.angular_velocity), false);
    }
}

/// Adds the shape to the actor; none if the library has no shape like it.
///
/// # Safety
/// Actor and material are there.
unsafe fn add_shape(
    sdk: &Sdk,
    actor: *mut PxRigidActor,
    material: *mut PxMaterial,
    body: &Body,
    collider: &Collider,
) -> Option<()> {
    let turned = |rotation| transform(collider.position, collider.rotation * rotation);
    // SAFETY: of the caller; meshes and geometries outlive the call that copies or counts them.
    unsafe {
        let add = |geometry: *const PxGeometry, place: PxTransform| {
            let shape = PxPhysics_createShape_mut(sdk.0, geometry, material, true, PxShapeFlags::SimulationShape);
            (!shape.is_null()).then(|| {
                PxShape_setLocalPose_mut(shape, &place);
                PxRigidActor_attachShape_mut(actor, shape);
                PxShape_release_mut(shape);
            })
        };
        let cooking = PxCookingParams_new(PxPhysics_getTolerancesScale(sdk.0));
        let insertion = PxPhysics_getPhysicsInsertionCallback_mut(sdk.0);
        let add_hull = |points: &[Vec3]| {
            let mut desc = PxConvexMeshDesc_new();
            desc.points = data(points);
            desc.flags = PxConvexFlags::ComputeConvex;
            let hull = phys_PxCreateConvexMesh(&cooking, &desc, insertion, null_mut());
            (!hull.is_null()).then(|| {
                let flags = PxConvexMeshGeometryFlags::empty();
                let geometry = PxConvexMeshGeometry_new(hull, &PxMeshScale_new(), flags);
                let added = add((&raw const geometry).cast(), turned(Quat::IDENTITY));
                PxRefCounted_release_mut(hull.cast());
                added
            })?
        };
        let add_mesh = |mesh: &TriMesh| {
            let mut desc = PxTriangleMeshDesc_new();
            desc.points = data(mesh.vertices());
            desc.triangles = data(mesh.indices());
            // The library lets meshes stay or follow their targets, but not move freely.
            let cooked = (body.kind != BodyKind::Dynamic)
                .then(|| phys_PxCreateTriangleMesh(&cooking, &desc, insertion, null_mut()))
                .filter(|mesh| !mesh.is_null())?;
            let geometry = PxTriangleMeshGeometry_new(cooked, &PxMeshScale_new(), PxMeshGeometryFlags::empty());
            let added = add((&raw const geometry).cast(), turned(Quat::IDENTITY));
            PxRefCounted_release_mut(cooked.cast());
            added
        };
        match collider.shape.parry().as_typed_shape() {
            TypedShape::Ball(ball) => {
                let geometry = PxSphereGeometry_new(ball.radius);
                add((&raw const geometry).cast(), turned(Quat::IDENTITY))
            }
            TypedShape::Capsule(capsule) => {
                let (segment, radius) = (capsule.segment, capsule.radius);
                // The library's capsules lie along X about their middle.
                let turn = Quat::from_rotation_arc(Vec3::X, (segment.b - segment.a).normalize_or(Vec3::X));
                let middle = collider.position + collider.rotation * (0.5 * (segment.a + segment.b));
                let geometry = PxCapsuleGeometry_new(radius, 0.5 * segment.length());
                add((&raw const geometry).cast(), transform(middle, collider.rotation * turn))
            }
            TypedShape::Cuboid(cuboid) => {
                let half = cuboid.half_extents;
                let geometry = PxBoxGeometry_new(half.x, half.y, half.z);
                add((&raw const geometry).cast(), turned(Quat::IDENTITY))
            }
            TypedShape::HalfSpace(plane) => {
                // The library's planes look along X.
                let geometry = PxPlaneGeometry_new();
                add((&raw const geometry).cast(), turned(Quat::from_rotation_arc(Vec3::X, plane.normal)))
            }
            TypedShape::Cylinder(of) => add_hull(&cylinder(of.radius, of.half_height)),
            TypedShape::Cone(of) => add_hull(&cone(of.radius, of.half_height)),
            TypedShape::ConvexPolyhedron(hull) => add_hull(hull.points()),
            TypedShape::TriMesh(mesh) => add_mesh(mesh),
            TypedShape::HeightField(field) => {
                let (vertices, triangles) = field.to_trimesh();
                add_mesh(&TriMesh::new(vertices, triangles).ok()?)
            }
            _ => None,
        }
    }
}

impl Contender for Physx {
    fn setting(&self) -> Setting {
        Setting {
            engine: "physx".into(),
            backend: "cpu".into(),
            substeps: self.iterations,
            sweeps: 1,
            method: "plain".into(),
            friction: "disc".into(),
            more: "TGS".into(),
        }
    }

    fn step(&mut self) -> Result<()> {
        // SAFETY: scene and actors are there until this is dropped.
        unsafe {
            for (body, &actor) in self.world.bodies.iter_mut().zip(&self.actors) {
                if body.kind == BodyKind::Kinematic {
                    body.position += self.dt * body.linear_velocity;
                    body.rotation = Quat::from_scaled_axis(self.dt * body.angular_velocity) * body.rotation;
                    let target = transform(body.position, body.rotation);
                    PxRigidDynamic_setKinematicTarget_mut(actor.cast(), &target);
                } else if body.force != Vec3::ZERO {
                    // A force lasts for one step.
                    PxRigidBody_addForce_mut(actor.cast(), &vec3(body.force), PxForceMode::Force, true);
                }
            }
            let mut errors = 0;
            PxScene_simulate_mut(self.scene, self.dt, null_mut(), null_mut(), 0, true);
            PxScene_fetchResults_mut(self.scene, true, &mut errors);
            match errors {
                0 => Ok(()),
                code => Err(Error::input(format!("PhysX stopped with code {code}"))),
            }
        }
    }

    fn world(&mut self) -> &World {
        for (body, &actor) in self.world.bodies.iter_mut().zip(&self.actors) {
            if body.kind == BodyKind::Dynamic {
                // SAFETY: as above.
                let (pose, v, w) = unsafe {
                    let (v, w) =
                        (PxRigidBody_getLinearVelocity(actor.cast()), PxRigidBody_getAngularVelocity(actor.cast()));
                    (PxRigidActor_getGlobalPose(actor), v, w)
                };
                body.position = Vec3::new(pose.p.x, pose.p.y, pose.p.z);
                body.rotation = Quat::from_xyzw(pose.q.x, pose.q.y, pose.q.z, pose.q.w);
                body.linear_velocity = Vec3::new(v.x, v.y, v.z);
                body.angular_velocity = Vec3::new(w.x, w.y, w.z);
            }
        }
        &self.world
    }
}

impl Drop for Physx {
    fn drop(&mut self) {
        let _sdk = sdk();
        // SAFETY: all were made by the library, and nobody else has them.
        unsafe {
            self.joints.iter().for_each(|&joint| PxJoint_release_mut(joint));
            self.actors.iter().for_each(|&actor| PxActor_release_mut(actor.cast()));
            self.materials.iter().for_each(|&(_, material)| PxRefCounted_release_mut(material.cast()));
            PxScene_release_mut(self.scene);
            PxDefaultCpuDispatcher_release_mut(self.dispatcher);
        }
    }
}

/// Elements as the library reads them.
fn data<T>(elements: &[T]) -> PxBoundedData {
    // SAFETY: the constructor reads nothing.
    let mut data = unsafe { PxBoundedData_new() };
    (data.stride, data.count) = (size_of::<T>() as u32, elements.len() as u32);
    data.data = elements.as_ptr().cast::<c_void>();
    data
}

fn vec3(v: Vec3) -> PxVec3 {
    PxVec3 { x: v.x, y: v.y, z: v.z }
}

fn transform(position: Vec3, rotation: Quat) -> PxTransform {
    let [x, y, z, w] = rotation.to_array();
    PxTransform { q: PxQuat { x, y, z, w }, p: vec3(position) }
}

#[cfg(test)]
mod tests {
    use std::hint::black_box;

    use super::*;

    #[test]
    fn tgs_runs_on_the_calling_thread_with_the_iterations_asked_for() {
        let scene = Scene::find("tower", &[]).unwrap();
        let mut physx = Physx::new(&scene, 7, 1).unwrap();
        physx.step().unwrap();
        let body = scene.world.bodies.iter().position(|b| b.kind == BodyKind::Dynamic).unwrap();
        let (mut positions, mut velocities) = (0, 0);
        // SAFETY: the scene is there.
        let (solver, workers) = unsafe {
            PxRigidDynamic_getSolverIterationCounts(physx.actors[body].cast(), &mut positions, &mut velocities);
            (PxScene_getSolverType(physx.scene), PxCpuDispatcher_getWorkerCount(physx.dispatcher.cast()))
        };
        assert_eq!((solver, workers, positions, velocities), (PxSolverType::Tgs, 0, 7, VELOCITY_ITERATIONS));
        // Numbers below the normal ones stay what they are for the other engines of the process.
        assert!(black_box(1e-40_f32) * black_box(1.0) > 0.0);
    }
}
