//! drystone as a plugin of Bevy: components go in, [`Transform`](bevy_transform::components::Transform)s come out.
//!
//! ```
//! use bevy_app::prelude::*;
//! use bevy_drystone::prelude::*;
//! use bevy_ecs::prelude::*;
//! use bevy_math::Vec3;
//! use bevy_time::{TimePlugin, TimeUpdateStrategy};
//! use bevy_transform::prelude::*;
//!
//! let mut app = App::new();
//! app.add_plugins((TimePlugin, TransformPlugin, DrystonePlugin));
//! app.world_mut().spawn((RigidBody::Static, Collider::from(Shape::half_space(Vec3::Y))));
//! let crate_ = (RigidBody::Dynamic, Collider::from(Shape::cuboid(0.5, 0.5, 0.5)), Transform::from_xyz(0.0, 2.0, 0.0));
//! let crate_ = app.world_mut().spawn(crate_).id();
//! // Ten steps a frame, and ten frames.
//! app.insert_resource(TimeUpdateStrategy::FixedTimesteps(10));
//! (0..10).for_each(|_| app.update());
//! let place = app.world().get::<Transform>(crate_).expect("it is there").translation;
//! assert!((place.y - 0.5).abs() < 0.01, "{place}");
//! ```
//!
//! Each fixed step runs three [sets](PhysicsSystems) in `FixedPostUpdate`: `Read` takes over the components that a
//! program changed, `Step` runs [`Simulation::step`](drystone::Simulation::step), and `Write` sets the components that
//! the step changed. [`Physics`] owns the simulation.
//!
//! | to | use |
//! |---|---|
//! | make a body | [`RigidBody`], [`Collider`], and the other components of a body |
//! | connect two bodies | [`Joint`] |
//! | push a body | [`ConstantForce`], [`ConstantTorque`], [`LinearVelocity`], [`Physics::body_mut`] |
//! | move a body to another place | its `Transform` |
//! | learn of contacts and sensors | [`CollisionStart`] and the other messages, [`Physics::simulation`] to listen |
//! | find bodies by rays and shapes | [`SpatialQuery`] |
//! | go back in time | [`Physics::snapshot`], [`Physics::restore`] |
//! | show smooth motion at any frame rate | [`TransformInterpolation`] |
//! | draw shapes, contacts and joints | [`debug_lines`], or the feature `gizmos` |
//!
//! # Features
//!
//! - `gpu`: the backend of drystone on compute shaders.
//! - `gizmos`: `PhysicsGizmosPlugin` draws with Bevy's gizmos.

#![deny(unsafe_code)]
#![warn(missing_docs)]

mod components;
mod debug;
mod ease;
mod error;
mod events;
#[cfg(feature = "gizmos")]
mod gizmos;
mod joint;
mod observe;
mod physics;
mod query;
mod read;
mod rollback;
mod step;

pub use components::{
    AngularDamping, AngularVelocity, Collider, ColliderDensity, CollisionLayers, ConstantForce, ConstantTorque,
    ContactMaterial, GravityScale, LinearDamping, LinearVelocity, LockedAxes, Mass, MaxAngularSpeed, MaxLinearSpeed,
    Order, RigidBody, Sensor, Sleeping, SleepingDisabled, SweptCcd, TransformInterpolation,
};
pub use debug::{DebugLine, debug_lines};
pub use drystone;
pub use error::PhysicsError;
pub use events::{CollisionEnd, CollisionHit, CollisionStart, JointBreak, SensorEnter, SensorExit};
#[cfg(feature = "gizmos")]
pub use gizmos::{PhysicsGizmos, PhysicsGizmosPlugin};
pub use joint::Joint;
pub use physics::Physics;
pub use query::{SpatialFilter, SpatialHit, SpatialQuery, SpatialView};
pub use rollback::PhysicsSnapshot;

use bevy_app::prelude::*;
use bevy_ecs::prelude::*;
use bevy_time::{Fixed, Time};

/// Everything that most programs need, also of drystone.
pub mod prelude {
    pub use crate::{
        AngularDamping, AngularVelocity, Collider, ColliderDensity, CollisionEnd, CollisionHit, CollisionLayers,
        CollisionStart, ConstantForce, ConstantTorque, ContactMaterial, DrystonePlugin, GravityScale, Joint,
        JointBreak, LinearDamping, LinearVelocity, LockedAxes, Mass, MaxAngularSpeed, MaxLinearSpeed, Physics,
        PhysicsError, PhysicsSystems, RigidBody, Sensor, SensorEnter, SensorExit, Sleeping, SleepingDisabled,
        SpatialFilter, SpatialQuery, SweptCcd, TransformInterpolation,
    };
    pub use drystone::{Listen, Shape};
}

/// Steps physics in `FixedPostUpdate`, by the length of [`Time<Fixed>`].
///
/// Insert a [`Physics`] before the plugin to choose settings or a backend; else the plugin inserts the default. A
/// program also needs Bevy's `TimePlugin` and `TransformPlugin`, which are among the default plugins.
pub struct DrystonePlugin;

/// The parts of a step, in this order, in `FixedPostUpdate`.
///
/// ```
/// # use bevy_app::prelude::*;
/// # use bevy_drystone::prelude::*;
/// # use bevy_ecs::prelude::*;
/// # let mut app = App::new();
/// # app.add_plugins(DrystonePlugin);
/// fn report(physics: Res<Physics>) {
///     println!("{:016x}", physics.simulation.hash());
/// }
/// app.add_systems(FixedPostUpdate, report.after(PhysicsSystems::Write));
/// ```
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PhysicsSystems {
    /// Components that changed go into the world.
    Read,
    /// The world steps.
    Step,
    /// Poses and velocities of the world go into components; then messages and events of the step follow.
    Write,
}

impl Plugin for DrystonePlugin {
    fn build(&self, app: &mut App) {
        use PhysicsSystems::{Read, Step, Write};
        app.init_resource::<Physics>().init_resource::<Time<Fixed>>().add_message::<PhysicsError>();
        events::register(app);
        observe::register(app);
        app.configure_sets(FixedPostUpdate, (Read, Step, Write).chain());
        let read = (read::settings, read::motion, read::bodies, joint::read).chain();
        app.add_systems(
            FixedPostUpdate,
            (read.in_set(Read), step::step.in_set(Step), (step::write, events::tell).chain().in_set(Write)),
        );
        app.add_systems(FixedFirst, ease::undo);
        app.add_systems(RunFixedMainLoop, ease::show.in_set(RunFixedMainLoopSystems::AfterFixedMainLoop));
    }
}

/// The examples of the README, compiled and run with the other documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
