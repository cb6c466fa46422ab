//! Tests with a shape whose contacts cannot be computed, as after a bug in parry.

use glam::Vec3;
use parry3d::bounding_volume::{Aabb, BoundingSphere};
use parry3d::mass_properties::MassProperties;
use parry3d::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use parry3d::shape::{Ball, FeatureId, Shape, ShapeType, SharedShape, SupportMap, TypedShape};

use crate::error::{Error, Result};
use crate::simulation::{Event, Listen, Simulation};
use crate::stats::StepStats;
use crate::world::{Body, World};

/// A ball that panics when it is asked for its surface.
#[derive(Clone)]
struct Bad(Ball);

impl Shape for Bad {
    fn compute_local_aabb(&self) -> Aabb {
        self.0.compute_local_aabb()
    }
    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.0.compute_local_bounding_sphere()
    }
    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }
    fn scale_dyn(&self, _: Vec3, _: u32) -> Option<Box<dyn Shape>> {
        None
    }
    fn mass_properties(&self, density: f32) -> MassProperties {
        self.0.mass_properties(density)
    }
    fn shape_type(&self) -> ShapeType {
        ShapeType::Custom
    }
    fn as_typed_shape(&self) -> TypedShape<'_> {
        TypedShape::Custom(self)
    }
    fn ccd_thickness(&self) -> f32 {
        0.5
    }
    fn ccd_angular_thickness(&self) -> f32 {
        1.0
    }
    fn as_support_map(&self) -> Option<&dyn SupportMap> {
        panic!("no surface")
    }
}

impl RayCast for Bad {
    fn cast_local_ray_and_get_normal(&self, ray: &Ray, most: f32, solid: bool) -> Option<RayIntersection> {
        self.0.cast_local_ray_and_get_normal(ray, most, solid)
    }
}

impl PointQuery for Bad {
    fn project_local_point(&self, point: Vec3, solid: bool) -> PointProjection {
        self.0.project_local_point(point, solid)
    }
    fn project_local_point_and_get_feature(&self, point: Vec3) -> (PointProjection, FeatureId) {
        self.0.project_local_point_and_get_feature(point)
    }
}

const DT: f32 = 1.0 / 60.0;

/// A tower on a slab, and a bad ball that falls onto the slab beside it.
fn begun() -> Simulation {
    let mut world = World::new();
    world
        .insert(Body::fixed().shape(crate::world::Shape::cuboid(5.0, 0.5, 5.0)).position(0.0, -0.5, 0.0).named("slab"));
    for k in 0_u8..4 {
        let cube = Body::dynamic().shape(crate::world::Shape::cuboid(0.5, 0.5, 0.5));
        world.insert(cube.position(0.0, 0.5 + f32::from(k), 0.0));
    }
    let ball = crate::world::Shape::ball(0.5);
    let mut falls = Body::dynamic().shape(ball).position(3.0, 1.0, 0.0).named("culprit");
    falls.colliders[0].shape.0 = SharedShape::new(Bad(Ball::new(0.5)));
    world.insert(falls);
    let mut simulation = Simulation::new(world).expect("a world");
    simulation.listen(Listen { contacts: true, ..Listen::default() }).expect("no speed");
    simulation
}

/// The number of steps before the first one that fails, and its error.
fn failed(simulation: &mut Simulation) -> (u32, Error) {
    let mut step = |_: &u32| -> Option<Result<StepStats>> { Some(simulation.step(DT)) };
    (0..60).find_map(|k| step(&k)?.err().map(|error| (k, error))).expect("the bad ball meets the slab")
}

#[test]
fn a_shape_that_cannot_be_computed_is_an_error_that_names_its_body_and_leaves_the_world() {
    let mut lines = Vec::new();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let mut simulation = begun();
            let (steps, error) = failed(&mut simulation);
            let hash = simulation.hash();
            let line = error.to_string();
            assert!(steps > 0 && matches!(error, Error::Panicked(_)) && error.exit_code() == 1, "{steps}: {line}");
            assert!(
                line.contains("\"slab\"") && line.contains("5 \"culprit\"") && line.ends_with("no surface"),
                "{line}"
            );
            // The same step fails again, and nothing moved.
            assert_eq!(simulation.step(DT).expect_err("as before").to_string(), line);
            assert!(simulation.next_problem(DT).is_err_and(|error| error.to_string() == line));
            assert_eq!(simulation.hash(), hash);
            lines.push((steps, line, hash));
        });
    }
    assert_eq!(lines[0], lines[1]);
}

/// After the bad body is removed, the run continues like a run that starts there.
#[test]
fn a_run_goes_on_without_what_could_not_be_computed() {
    let mut simulation = begun();
    failed(&mut simulation);
    let culprit = simulation.world.bodies.handle(5).expect("the culprit");
    simulation.world.remove(culprit);
    let mut other = Simulation::new(simulation.world.clone()).expect("it");
    let mut began = 0;
    for step in 0..60 {
        simulation.step(DT).expect("nothing is bad any more");
        other.step(DT).expect("nothing is bad any more");
        assert_eq!(simulation.hash(), other.hash(), "step {step}");
        began += simulation.events().iter().filter(|event| matches!(event, Event::Began { .. })).count();
    }
    assert_eq!(began, 4, "the contacts of the tower are told of again");
    assert!((simulation.world.bodies[4].position.y - 3.5).abs() < 2e-3);
}
