//! Pictures without a display: contents, and comparison with a stored picture.

#[macro_use]
#[path = "../../tests/common/mod.rs"]
mod common;
mod compared;

use std::path::Path;

use compared::{PERCENT, difference, read_png};
use drystone::glam::Vec3;
use drystone::{Simulation, SolverConfig};
use drystone_scenes::Scene;
use drystone_view::{Bounds, Camera, Canvas, ColorBy, Film, Look, Picture, Shades, Shot, poses, wgpu};

tests! {
    any_gpu {
        the_scene_with_every_shape_has_its_stored_picture,
        a_picture_with_one_moved_body_is_rejected,
        the_same_scene_gives_the_same_picture_to_the_last_bit,
        the_colors_of_bodies_show_the_chosen_quantity,
        a_body_casts_a_shadow_on_the_ground,
        dark_shades_change_the_ground_and_what_is_behind_it_and_no_body,
        the_limits_of_webgl2_give_the_same_picture,
        a_renderer_takes_over_another_world,
    }
}

fn main() -> std::process::ExitCode {
    common::harness::run_in_turn([tests()])
}

const SIZE: (u32, u32) = (192, 128);
/// The default angles of `drystone render`.
const LOOK: Look = Look { yaw: 30.0_f32.to_radians(), pitch: 25.0_f32.to_radians() };

fn write_png(path: &Path, picture: &Picture) {
    let mut encoder = png::Encoder::new(std::fs::File::create(path).expect("a file"), picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgb);
    let rgb: Vec<u8> = picture.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    encoder.write_header().and_then(|mut writer| writer.write_image_data(&rgb)).expect("a PNG");
}

/// A picture of `scene` after `steps`.
fn picture(scene: &Scene, steps: u32, color: ColorBy) -> Picture {
    let reference = Box::new(drystone::Reference::<f32>::new());
    let mut simulation = Simulation::with(scene.world.clone(), SolverConfig::default().without_sleep(), reference)
        .expect("a simulation");
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

/// The picture shows the start of the scene, so that it does not depend on the solver. `UPDATE_GOLDEN=1` writes it again.
fn the_scene_with_every_shape_has_its_stored_picture() {
    let drawn = picture(&scene("drop", &[]), 0, ColorBy::Material);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pictures/drop.png");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        write_png(&path, &drawn);
    }
    let percent = difference(&drawn, &read_png(&path));
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
    far_up.world.bodies.iter_mut().next_back().expect("a ball").position.y = 1e3;
    let (near, far) = (shaded(&ball), shaded(&far_up));
    assert!(near > 100 && far == 0, "{near} pixels are in shadow, {far} below a ball that is far up");
}

/// A picture of `scene` as it begins, drawn on `canvas`.
fn drawn_on(canvas: &mut Canvas, scene: &Scene) -> Picture {
    let world = &scene.world;
    let (poses, bounds) = (poses(world), Bounds::of(world));
    let camera = Camera::framing(&bounds, Vec3::Y, LOOK.yaw, LOOK.pitch, canvas.aspect());
    let colors = ColorBy::Material.paint(world, &vec![0.0; world.bodies.len()], 1.0);
    let shot = Shot { poses: &poses, colors: &colors, camera: &camera, bounds, container: None, lines: &[] };
    canvas.draw(&shot).expect("a picture")
}

fn canvas(scene: &Scene) -> Canvas {
    Canvas::new(&scene.world, SIZE).unwrap_or_else(|e| panic!("{e}"))
}

fn dark_shades_change_the_ground_and_what_is_behind_it_and_no_body() {
    let scene = scene("sphere-plane", &["height=1"]);
    let mut canvas = canvas(&scene);
    let light = drawn_on(&mut canvas, &scene);
    canvas.renderer.shades = Shades::DARK;
    let dark = drawn_on(&mut canvas, &scene);
    let pairs = || light.rgba.chunks_exact(4).zip(dark.rgba.chunks_exact(4));
    let same = pairs().filter(|(a, b)| a == b).count();
    let darker = pairs().filter(|(a, b)| (0..3).all(|k| b[k] < a[k])).count();
    // The ball stays as it is; pixels that mix it with the ground are darker too.
    let all = pairs().count();
    assert!(same > 1000 && darker > 20_000 && same + darker == all, "{same} same, {darker} darker of {all}");
    let is_background = |p: &[u8]| (0..3).all(|k| (f32::from(p[k]) / 255.0 - Shades::DARK.background[k]).abs() < 0.01);
    assert!(is_background(&dark.rgba[..4]), "{:?}", &dark.rgba[..4]);
    // The color of other fixed bodies is none of the half-space.
    canvas.renderer.shades = Shades { fixed: [255, 0, 0, 255], ..Shades::DARK };
    assert!(drawn_on(&mut canvas, &scene).rgba == dark.rgba, "the ground has another color");
    // The mesh and the height field of this scene are fixed, and gray.
    let drop = self::scene("drop", &[]);
    let mut canvas = self::canvas(&drop);
    let mut grays = |shades| {
        canvas.renderer.shades = shades;
        let gray = |p: &&[u8]| p[0].abs_diff(p[2]) < 20 && p[0] > 140;
        drawn_on(&mut canvas, &drop).rgba.chunks_exact(4).filter(gray).count()
    };
    let (in_light, in_dark) = (grays(Shades::LIGHT), grays(Shades::DARK));
    assert!(in_light > 10_000 && in_dark < 100, "{in_light} light gray pixels, {in_dark} before a dark background");
}

/// A browser without WebGPU gives no more than these.
fn the_limits_of_webgl2_give_the_same_picture() {
    let scene = scene("drop", &[]);
    let (device, queue) = pollster::block_on(async {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapters = instance.enumerate_adapters(wgpu::Backends::PRIMARY).await;
        let adapter = adapters.into_iter().next().expect("an adapter");
        let required_limits = wgpu::Limits::downlevel_webgl2_defaults();
        let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
        adapter.request_device(&descriptor).await.expect("a device")
    });
    assert_eq!(device.limits().max_storage_buffers_per_shader_stage, 0);
    let mut limited = Canvas::on(device, queue, &scene.world, SIZE).unwrap_or_else(|e| panic!("{e}"));
    let percent = difference(&drawn_on(&mut limited, &scene), &drawn_on(&mut canvas(&scene), &scene));
    assert!(percent <= PERCENT, "{percent} % of the pixels differ");
}

/// The handles of its bodies may be those of the world before.
fn a_renderer_takes_over_another_world() {
    let (ball, cube) = (scene("sphere-plane", &["height=1"]), scene("stack", &["n=1"]));
    assert!(ball.world.bodies.handles().eq(cube.world.bodies.handles()));
    let mut canvas = canvas(&ball);
    let before = drawn_on(&mut canvas, &ball);
    canvas.renderer.replace(&cube.world);
    let after = drawn_on(&mut canvas, &cube);
    assert_eq!(after, drawn_on(&mut self::canvas(&cube), &cube));
    assert!(difference(&before, &after) > PERCENT);
}
