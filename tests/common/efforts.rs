//! A world whose islands take different numbers of substeps.

use drystone::glam::Vec3;
use drystone::{Body, Joint, Shape};
use drystone_scenes::Scene;

/// A pile of boxes that fall, a tower under a top 1000 times as heavy, one under a top 100 times as heavy, a rod on a joint, and two
/// chains with a heavy end, one of which lies on boxes.
pub fn islands() -> Scene {
    let mut scene = Scene::find("pile", &["n=60".into()]).expect("a scene of the catalogue");
    for (x, ratio) in [(20.0, "1000"), (30.0, "100")] {
        let tower =
            Scene::find("tower", &["n=6".into(), format!("top_ratio={ratio}")]).expect("a scene of the catalogue");
        for mut body in tower.world.bodies {
            body.position.x += x;
            scene.world.insert(body);
        }
    }
    let hung = scene.world.insert(Body::dynamic().shape(Shape::cuboid(0.05, 0.3, 0.1)).position(40.0, 5.0, 0.0));
    scene.world.insert_joint(Joint::to_world(hung, 0.3 * Vec3::Y, Vec3::new(40.0, 5.3, 0.0)));
    add_chain(&mut scene, Vec3::new(50.0, 40.0, 0.0));
    // Of this one the heavy end presses on a box that lies on a box.
    add_chain(&mut scene, Vec3::new(70.0, 1.2, 0.0));
    for level in 0..2 {
        let cube = Body::dynamic().shape(Shape::cuboid(0.25, 0.25, 0.25)).density(100.0);
        scene.world.insert(cube.position(70.0 + LINKS as f32 * LINK + ARM, 0.25 + 0.5 * level as f32, 0.0));
    }
    scene
}

/// Links of a chain.
const LINKS: usize = 30;
/// Length of a link (m).
const LINK: f32 = 0.3;

/// From the last joint to the middle of the ball, which touches no link (m).
const ARM: f32 = 0.25;

/// A level chain from an anchor to a ball of 1000 times the mass of a link: its joints are solved at once.
fn add_chain(scene: &mut Scene, anchor: Vec3) {
    let link = Body::dynamic().shape(Shape::cuboid(0.5 * LINK, 0.05, 0.05));
    let mut before = None;
    for k in 0..LINKS {
        let Vec3 { x, y, z } = anchor + (k as f32 + 0.5) * LINK * Vec3::X;
        let body = scene.world.insert(link.clone().position(x, y, z));
        scene.world.insert_joint(match before {
            None => Joint::to_world(body, -0.5 * LINK * Vec3::X, anchor),
            Some(before) => Joint::new(before, 0.5 * LINK * Vec3::X, body, -0.5 * LINK * Vec3::X),
        });
        before = Some(body);
    }
    let Vec3 { x, y, z } = anchor + (LINKS as f32 * LINK + ARM) * Vec3::X;
    let ball = Body::dynamic().shape(Shape::ball(0.2)).total_mass(1000.0 * link.mass.mass).position(x, y, z);
    let end = scene.world.insert(ball);
    scene.world.insert_joint(Joint::new(before.expect("a link"), 0.5 * LINK * Vec3::X, end, -ARM * Vec3::X));
}
