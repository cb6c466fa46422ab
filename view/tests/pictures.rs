//! Pictures without a display: contents, and comparison with a stored picture.

#[macro_use]
#[path = "../../tests/common/mod.rs"]
mod common;
mod compared;

use std::path::Path;

use compared::{PERCENT, difference, read_png};
use drystone::glam::Vec3;
use drystone::{Scene, Simulation, SolverConfig};
use drystone_view::{Canvas, ColorBy, Film, Look, Picture};

tests! {
    any_gpu {
        the_scene_with_every_shape_has_its_stored_picture,
        a_picture_with_one_moved_body_is_rejected,
        the_same_scene_gives_the_same_picture_to_the_last_bit,
        the_colors_of_bodies_show_the_chosen_quantity,
        a_body_casts_a_shadow_on_the_ground,
    }
}

const SIZE: (u32, u32) = (192, 128);
/// The default angles of `drystone render`.
const LOOK: Look = Look { yaw: 30.0_f32.to_radians(), pitch: 25.0_f32.to_radians() };

/// A picture of `scene` after `steps`.
fn picture(scene: &Scene, steps: u32, color: ColorBy) -> Picture {
    let reference = Box::new(drystone::Reference::<f32>::new());
    let mut simulation =
        Simulation::new(scene.world.clone(), SolverConfig::default().without_sleep(), reference).expect("a simulation");
    for _ in 0..steps {
        simulation.step(scene.dt).expect("a step");
    }
    let mut film = Film::new(scene.clone(), color);
    film.add(0.0, &mut simulation);
    let mut canvas = Canvas::new(&scene.world, SIZE).unwrap_or_else(|e| panic!("{e}"));
    let mut pictures = Vec::new();
    let keep = |p: &Picture| {
        pictures.push(p.clone());
        Ok(())
    };
    film.draw(&mut canvas, &LOOK, keep).expect("a picture");
    pictures.pop().expect("one picture")
}

fn scene(name: &str, parameters: &[&str]) -> Scene {
    Scene::find(name, &parameters.iter().map(|&p| p.to_owned()).collect::<Vec<_>>()).expect("a scene")
}

/// `drystone render drop --steps 60 --size 192x128 --out view/tests/pictures/drop.png` makes the picture again.
fn the_scene_with_every_shape_has_its_stored_picture() {
    let drawn = picture(&scene("drop", &[]), 60, ColorBy::Material);
    let kept = read_png(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pictures/drop.png"));
    let percent = difference(&drawn, &kept);
    assert!(percent <= PERCENT, "{percent:.2} % of the pixels differ");
}

fn a_picture_with_one_moved_body_is_rejected() {
    let before = scene("drop", &[]);
    let mut after = before.clone();
    let moved = after.world.bodies.iter().position(|b| b.name == "cuboid").expect("a cuboid");
    after.world.bodies[moved].position += Vec3::new(0.0, 0.0, 0.5);
    let (a, b) = (picture(&before, 0, ColorBy::Material), picture(&after, 0, ColorBy::Material));
    assert!(difference(&a, &b) > PERCENT, "{} %", difference(&a, &b));
}

fn the_same_scene_gives_the_same_picture_to_the_last_bit() {
    let pile = scene("pile", &["n=64"]);
    let draw = || picture(&pile, 30, ColorBy::Batch);
    assert_eq!(draw(), draw());
}

fn the_colors_of_bodies_show_the_chosen_quantity() {
    let tower = scene("tower", &[]);
    let all = [ColorBy::Material, ColorBy::Batch, ColorBy::Speed, ColorBy::Impulse];
    let drawn: Vec<_> = all.into_iter().map(|color| picture(&tower, 20, color)).collect();
    for (i, a) in drawn.iter().enumerate() {
        for b in &drawn[..i] {
            assert!(difference(a, b) > PERCENT);
        }
    }
}

fn a_body_casts_a_shadow_on_the_ground() {
    // Grays darker than both squares of the ground.
    let shaded = |scene: &Scene| {
        let drawn = picture(scene, 0, ColorBy::Material);
        let gray = |p: &&[u8]| p[0].abs_diff(p[2]) < 12 && p[0] < 150;
        drawn.rgba.chunks_exact(4).filter(gray).count()
    };
    let ball = scene("sphere-plane", &["height=1"]);
    let mut far_up = ball.clone();
    far_up.world.bodies.last_mut().expect("a ball").position.y = 1e3;
    let (near, far) = (shaded(&ball), shaded(&far_up));
    assert!(near > 100 && far == 0, "{near} pixels are in shadow, {far} below a ball that is far up");
}
