//! The camera that follows what moves.

use drystone::backend::BackendChoice;
use drystone::glam::{Vec2, Vec3};
use drystone::{Body, BodyKind, SolverConfig, World};
use drystone_scenes::{CATALOGUE, Scene};
use drystone_view::{Bounds, Camera, ColorBy, Eye, Live, Show as _};

const ASPECT: f32 = 1.5;

fn live(scene: Scene) -> Live {
    Live::new(scene, SolverConfig::default(), BackendChoice::Cpu, false, ColorBy::Batch).expect("a scene")
}

fn run(live: &mut Live, steps: u32) {
    (0..steps).for_each(|_| pollster::block_on(live.step_async()).expect("a step"));
}

/// The moving bodies that a camera does not show to their corners.
fn unseen(camera: &Camera, world: &World) -> Vec<String> {
    let projection = camera.projection(ASPECT, camera.distance);
    let is_seen = |at: Vec3| {
        let at = projection.project_point3(at);
        at.x.abs() <= 1.0 && at.y.abs() <= 1.0
    };
    let moving = world.bodies.iter().filter(|body| body.kind != BodyKind::Fixed);
    let corners = |body: &Body| {
        let boxes = body.colliders.iter().map(|c| c.bounds(body.position, body.rotation));
        boxes.fold(Bounds::EMPTY, |all, (low, high)| all.join(Bounds { low, high })).corners()
    };
    let unseen = moving.filter(|body| !corners(body).into_iter().all(is_seen));
    unseen.map(|body| format!("{} at {}", body.name, body.position)).collect()
}

#[test]
fn an_eye_sees_all_that_moves_in_every_scene_as_it_opens_and_as_it_runs() {
    let mut lost = Vec::new();
    for entry in CATALOGUE {
        // Hundreds of bodies show what thousands would.
        let n = entry.parameters.iter().find(|p| p.name == "n" && p.default > 300.0 && p.range.0 <= 200.0);
        let parameters = Vec::from_iter(n.map(|_| "n=200".to_owned()));
        let mut live = live(Scene::find(entry.name, &parameters).expect("a scene"));
        let mut eye = Eye::new(&live, ASPECT);
        for second in 0..4 {
            eye.follow(&live, ASPECT, 0.0);
            let unseen = unseen(&eye.camera, live.world());
            let count = live.world().dynamic_count();
            if let Some(first) = unseen.first() {
                lost.push(format!("{} after {second} s: {} of {count}, {first}", entry.name, unseen.len()));
            }
            run(&mut live, 60);
        }
    }
    assert!(lost.is_empty(), "{lost:#?}");
}

#[test]
fn an_eye_follows_until_a_hand_moves_it_and_again_when_it_is_asked_to() {
    let mut live = live(Scene::find("ragdoll", &[]).expect("a scene"));
    let mut eye = Eye::new(&live, ASPECT);
    let first = eye.camera;
    run(&mut live, 200);
    assert!(!unseen(&first, live.world()).is_empty(), "it falls out of the first picture");
    eye.orbit(Vec2::new(0.1, 0.0));
    let by_hand = eye.camera;
    eye.follow(&live, ASPECT, 0.0);
    assert!(eye.camera == by_hand && by_hand != first);
    eye.go_along();
    eye.follow(&live, ASPECT, 0.0);
    assert!(unseen(&eye.camera, live.world()).is_empty());
    // Beside a panel that covers a third of the picture.
    eye.follow(&live, ASPECT, ASPECT / 3.0);
    let projection = eye.camera.projection(ASPECT, eye.camera.distance);
    assert!(live.world().dynamic().all(|body| projection.project_point3(body.position).x < 1.0 / 3.0));
}
