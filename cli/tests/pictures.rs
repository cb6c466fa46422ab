//! Pictures without a display: contents, comparison with stored pictures, and messages for bad requests.

#[macro_use]
#[path = "../../tests/common/mod.rs"]
mod common;

use std::path::Path;
use std::process::{Command, Output};

use drystone::glam::Vec3;
use drystone::{Scene, Simulation, SolverConfig};
use drystone_cli::view::{Canvas, ColorBy, Film, Look, Picture};

tests! {
    any_gpu {
        the_scene_with_every_shape_has_its_stored_picture,
        a_picture_with_one_moved_body_is_rejected,
        the_same_scene_gives_the_same_picture_to_the_last_bit,
        the_colors_of_bodies_show_the_chosen_quantity,
        a_body_casts_a_shadow_on_the_ground,
        bad_requests_are_refused_in_one_line_before_the_run,
        a_recorded_motion_gives_the_picture_of_the_run,
    }
    no_gpu {
        without_an_adapter_the_driver_package_is_named,
    }
}

const SIZE: (u32, u32) = (192, 128);
/// The default angles of `drystone render`.
const LOOK: Look = Look { yaw: 30.0_f32.to_radians(), pitch: 25.0_f32.to_radians() };

/// Pixels differ if a channel differs by more than this, as at an edge that another driver rounds differently.
const CHANNEL: u8 = 24;
/// Largest percentage of pixels that may differ: 50 of 24,576. The same software adapter gives 0.
const PERCENT: f64 = 0.2;

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

/// Percentage of pixels that differ.
fn difference(a: &Picture, b: &Picture) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let pairs = a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4));
    let differ = |(p, q): &(&[u8], &[u8])| p.iter().zip(*q).any(|(x, y)| x.abs_diff(*y) > CHANNEL);
    100.0 * pairs.filter(differ).count() as f64 / f64::from(a.width * a.height)
}

fn read_png(path: &Path) -> Picture {
    let file = std::fs::File::open(path).expect("a picture");
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let mut rgb = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut rgb).expect("a PNG");
    let rgba = rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
    Picture { width: info.width, height: info.height, rgba }
}

fn scene(name: &str, parameters: &[&str]) -> Scene {
    Scene::find(name, &parameters.iter().map(|&p| p.to_owned()).collect::<Vec<_>>()).expect("a scene")
}

/// `drystone render drop --steps 60 --size 192x128 --out tests/pictures/drop.png` makes the picture again.
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

/// Runs the command in `folder`.
fn drystone(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).current_dir(folder).output().expect("the command starts")
}

/// Fails unless the command ends with `code` and one line that names all of `parts`, and leaves nothing behind.
fn assert_refused(arguments: &str, adapter: Option<&str>, code: i32, parts: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("short.csv"), "step,time,body,px\n0,0,1,0\n").expect("a file");
    let header = "step,time,body,px,py,pz,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz\n";
    std::fs::write(folder.path().join("empty.csv"), header).expect("a file");
    let row = "0,0,99,0,0,0,0,0,0,1,0,0,0,0,0,0\n";
    std::fs::write(folder.path().join("other.csv"), [header, row].concat()).expect("a file");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    if let Some(adapter) = adapter {
        command.env("DRYSTONE_ADAPTER", adapter);
    }
    let output = command.args(arguments.split(' ')).current_dir(&folder).output().expect("the command starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments}: {message}");
    assert!(parts.iter().all(|part| message.contains(part)), "{arguments}: {message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 3, "{arguments} left something behind");
}

fn bad_requests_are_refused_in_one_line_before_the_run() {
    let none = None;
    assert_refused("render pile -p n=4000000 --out x.bmp", none, 2, &["x.bmp", ".png", ".gif"]);
    assert_refused("render pile -p n=8 --out nowhere/x.png", none, 2, &["nowhere/x.png"]);
    assert_refused("render pile -p n=8 --out x.png --frames 3", none, 2, &["--frames 3", ".gif"]);
    assert_refused("render tower --out x.png --from short.csv", none, 2, &["short.csv", "line 2"]);
    assert_refused("render tower --out x.png --from empty.csv", none, 2, &["empty.csv", "no motion"]);
    assert_refused("render tower --out x.png --from other.csv", none, 2, &["other.csv", "line 2", "body 99"]);
    assert_refused("render tower --out x.png --from other.csv --color batch", none, 2, &["contacts", "speed"]);
    assert_refused("render tower --out x.png --size 16384x16384", none, 2, &["16384x16384"]);
}

fn without_an_adapter_the_driver_package_is_named() {
    assert_refused("render tower --out x.png", Some("none"), 3, &["no adapter", "mesa-vulkan-drivers"]);
}

fn a_recorded_motion_gives_the_picture_of_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    for arguments in [
        "run tower -p offset=0.3 --steps 40 --every 10 --out motion.csv",
        "render tower -p offset=0.3 --steps 40 --size 192x128 --color speed --out run.png",
        "render tower -p offset=0.3 --size 192x128 --color speed --from motion.csv --out recorded.png",
        "render tower -p offset=0.3 --steps 40 --size 96x64 --frames 3 --out frames/",
        "render tower -p offset=0.3 --steps 40 --size 96x64 --frames 4 --out tower.gif",
    ] {
        let output = drystone(folder.path(), arguments);
        assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let png = |name: &str| read_png(&folder.path().join(name));
    let percent = difference(&png("run.png"), &png("recorded.png"));
    assert!(percent <= PERCENT, "{percent} % of the pixels differ");
    // Boxes topple: first and last picture differ.
    assert!(difference(&png("frames/00000.png"), &png("frames/00002.png")) > PERCENT);
    let gif = std::fs::File::open(folder.path().join("tower.gif")).expect("a GIF");
    let mut decoder = gif::DecodeOptions::new().read_info(gif).expect("a GIF");
    let mut frames = 0;
    while decoder.next_frame_info().expect("a frame").is_some() {
        frames += 1;
    }
    assert_eq!(frames, 4);
}
