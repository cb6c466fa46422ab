//! A world whose islands take different numbers of substeps.

use drystone::glam::Vec3;
use drystone::{BallJoint, Body, Scene};

/// A pile of boxes that fall, a tower under a top 1000 times as heavy, one under a top 60 times as heavy, and a rod on a joint.
pub fn islands() -> Scene {
    let mut scene = Scene::find("pile", &["n=60".into()]).expect("a scene of the catalogue");
    for (x, ratio) in [(20.0, "1000"), (30.0, "60")] {
        let tower =
            Scene::find("tower", &["n=6".into(), format!("top_ratio={ratio}")]).expect("a scene of the catalogue");
        for mut body in tower.world.bodies {
            body.position.x += x;
            scene.world.add(body);
        }
    }
    let hung = scene.world.add(Body::dynamic().shape(drystone::Shape::cuboid(0.05, 0.3, 0.1)).position(40.0, 5.0, 0.0));
    scene.world.join(BallJoint::to_world(hung, 0.3 * Vec3::Y, Vec3::new(40.0, 5.3, 0.0)));
    scene
}
