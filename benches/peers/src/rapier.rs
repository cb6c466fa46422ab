//! rapier3d, from a drystone world and back.

use drystone::world::{BodyKind, MassProperties as Mass};
use drystone::{Body, Error, Result, World};
use drystone_scenes::Scene;
use drystone_cli::report::comparison::{Contender, Setting};
use rapier3d::prelude::*;

use crate::setting::setting;

/// A scene in Rapier's hands.
pub(crate) struct Rapier {
    physics: PhysicsWorld,
    handles: Vec<RigidBodyHandle>,
    world: World,
}

impl Rapier {
    /// Contact springs between a body that moves and one that does not are twice as stiff, as they are by default.
    pub(crate) fn new(scene: &Scene, substeps: u32, hertz: f32, threads: usize) -> Result<Self> {
        let world = scene.world.clone();
        let mut physics = PhysicsWorld::new();
        physics.gravity = world.gravity;
        let parameters = &mut physics.integration_parameters;
        parameters.dt = scene.dt;
        parameters.num_solver_iterations = substeps as usize;
        parameters.contact_softness.natural_frequency = hertz;
        parameters.static_contact_softness.natural_frequency = 2.0 * hertz;
        set_threads(&mut physics, threads)?;

        let handles: Vec<_> = world.bodies.iter().map(|body| insert(&mut physics, body)).collect::<Result<_>>()?;
        // The body that stands for the world in joints to it.
        let ground = physics.insert_body(RigidBodyBuilder::fixed());
        for joint in &world.joints {
            let b = joint.body_b.map_or(ground, |b| handles[b.index()]);
            let anchors = SphericalJointBuilder::new().local_anchor1(joint.anchor_a).local_anchor2(joint.anchor_b);
            physics.insert_impulse_joint(handles[joint.body_a.index()], b, anchors.contacts_enabled(joint.collide));
        }
        Ok(Self { physics, handles, world })
    }

    /// Says how large things are [m]: margins and thresholds are as much smaller.
    pub(crate) fn length_unit(mut self, unit: f32) -> Self {
        self.physics.integration_parameters.length_unit = unit;
        self
    }
}

fn insert(physics: &mut PhysicsWorld, body: &Body) -> Result<RigidBodyHandle> {
    let builder = match body.kind {
        BodyKind::Fixed => RigidBodyBuilder::fixed(),
        // Any mass at its origin, which it turns about: colliders have none to say where its center is.
        BodyKind::Kinematic => RigidBodyBuilder::kinematic_velocity_based()
            .additional_mass_properties(MassProperties::new(Vector::ZERO, 1.0, Vector::ONE)),
        BodyKind::Dynamic => {
            let Mass { mass, center, principal_inertia, principal_frame } = body.mass;
            let mass = MassProperties::with_principal_inertia_frame(center, mass, principal_inertia, principal_frame);
            RigidBodyBuilder::dynamic().additional_mass_properties(mass)
        }
        other => return Err(Error::input(format!("Rapier has no kind like {other:?}"))),
    };
    let builder = builder.pose(Pose::from_parts(body.position, body.rotation)).can_sleep(false);
    let handle = physics.insert_body(builder.linvel(body.linear_velocity).angvel(body.angular_velocity));
    for collider in &body.colliders {
        let builder = ColliderBuilder::new(collider.shape.parry().clone())
            .position(Pose::from_parts(collider.position, collider.rotation))
            // The body has its mass already.
            .density(0.0)
            .friction(body.material.friction)
            .friction_combine_rule(CoefficientCombineRule::GeometricMean)
            .restitution(body.material.restitution)
            .restitution_combine_rule(CoefficientCombineRule::Max);
        physics.insert_collider(builder, Some(handle));
    }
    physics.bodies[handle].add_force(body.force, true);
    Ok(handle)
}

#[cfg(feature = "parallel")]
fn set_threads(physics: &mut PhysicsWorld, threads: usize) -> Result<()> {
    physics.configure_thread_pool(threads).map_err(|e| Error::input(format!("rapier: {e}")))
}

#[cfg(not(feature = "parallel"))]
fn set_threads(_physics: &mut PhysicsWorld, threads: usize) -> Result<()> {
    match threads {
        1 => Ok(()),
        _ => Err(Error::input("rapier was built for one thread; build with --features parallel")),
    }
}

impl Rapier {
    /// Brings poses and velocities of the world up to date.
    fn read_back(&mut self) {
        for (body, &handle) in self.world.bodies.iter_mut().zip(&self.handles) {
            let rapier = &self.physics.bodies[handle];
            (body.position, body.rotation) = (rapier.position().translation, rapier.position().rotation);
            (body.linear_velocity, body.angular_velocity) = (rapier.linvel(), rapier.angvel());
        }
    }
}

/// Moves a game's board and ball.
impl drystone_maze::Engine for Rapier {
    fn name(&self) -> String {
        let parameters = &self.physics.integration_parameters;
        let hertz = parameters.contact_softness.natural_frequency;
        format!("rapier, {} substeps, {hertz:.0} Hz", parameters.num_solver_iterations)
    }

    fn world(&self) -> &World {
        &self.world
    }

    fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    fn step(&mut self, _dt: f32) -> Result<()> {
        for (body, &handle) in self.world.bodies.iter().zip(&self.handles) {
            if body.kind == BodyKind::Kinematic {
                self.physics.bodies[handle].set_linvel(body.linear_velocity, true);
                self.physics.bodies[handle].set_angvel(body.angular_velocity, true);
            }
        }
        self.physics.step();
        self.read_back();
        Ok(())
    }
}

impl Contender for Rapier {
    fn setting(&self) -> Setting {
        let parameters = &self.physics.integration_parameters;
        let hertz = parameters.contact_softness.natural_frequency;
        setting("rapier", parameters.num_solver_iterations as u32, hertz)
    }

    fn step(&mut self) -> Result<()> {
        self.physics.step();
        Ok(())
    }

    fn world(&mut self) -> &World {
        self.read_back();
        &self.world
    }
}
