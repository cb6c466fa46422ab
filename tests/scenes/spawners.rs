//! Scenes in which bodies come and go, and scene files written from worlds in motion.

use drystone::glam::Vec3;
use drystone::{Body, Error, Groups, Reference, Shape, Simulation, SolverConfig, World};
use drystone_scenes::{Leaves, Scene, SceneFile, Spawner, Spawners};

fn read(text: &str) -> Result<Scene, Error> {
    SceneFile::parse(text)?.into_scene("unnamed")
}

/// A floor, a box that leaves after half a second, and two spawners above.
const RAIN: &str = r#"{"version": 1, "bodies": [
    {"name": "floor", "kind": "fixed", "shapes": [{"type": "half_space", "normal": [0, 1, 0]}]},
    {"name": "box", "position": [3, 0.5, 0], "leaves": {"after": 0.5}, "groups": {"membership": 1},
     "shapes": [{"type": "cuboid", "half_extents": [0.5, 0.5, 0.5]}]}],
  "spawners": [
    {"every": 10, "body": {"name": "drop", "position": [0, 2, 0], "leaves": {"below": 1}, "groups": {"membership": 2, "filter": 1}, "shapes": [{"type": "ball", "radius": 0.1}]}},
    {"every": 7, "first": 3, "count": 4, "body": {"position": [9, 5, 0], "torque": [0, 1, 0], "gravity_scale": 0.5,
     "linear_velocity": [3, 0, 0], "shapes": [{"type": "cuboid", "half_extents": [0.1, 0.2, 0.3]}]}}]}"#;

/// Runs a scene and tells before each step who is there.
fn run(scene: &Scene, steps: u32, mut tell: impl FnMut(&World, &Spawners)) -> (Simulation, Spawners) {
    let mut spawners = Spawners::new(scene);
    let backend = Box::new(Reference::<f32>::new());
    let mut simulation = Simulation::with(scene.world.clone(), SolverConfig::default(), backend).expect("a good scene");
    for _ in 0..steps {
        spawners.before_step(&mut simulation.world, scene.dt);
        tell(&simulation.world, &spawners);
        simulation.step(scene.dt).expect("a step");
    }
    (simulation, spawners)
}

fn names(world: &World) -> Vec<&str> {
    world.bodies.handles().map(|handle| &*world.bodies[handle.index()].name).collect()
}

#[test]
fn bodies_come_every_so_many_steps_and_leave_below_a_height_or_after_a_time() {
    let scene = read(RAIN).expect("a good scene");
    let mut step = 0;
    let mut counts = Vec::new();
    let (simulation, spawners) = run(&scene, 61, |world, spawners| {
        let count = |name: &str| names(world).iter().filter(|n| **n == name).count();
        assert_eq!(count("box"), usize::from(step < 30), "step {step}");
        counts.push(count(""));
        assert_eq!(spawners.came(), 1 + step / 10 + if step < 3 { 0 } else { (1 + (step - 3) / 7).min(4) });
        // A drop falls by a meter in 27 steps, and its center is below 1 m after them.
        assert!(count("drop") <= 3, "step {step}: {}", count("drop"));
        step += 1;
    });
    assert_eq!((counts[2], counts[3], counts[10], counts[60]), (0, 1, 2, 4));
    // The box, and the drops that came before steps 0, 10, 20 and 30.
    assert_eq!(spawners.left(), 5);
    assert!(simulation.world.bodies.iter().all(|body| body.name != "drop" || body.position.y > 0.9));
}

/// A ball of 0.3 m falls out of its own place in 0.35 s; in a pipe that is closed below there is room for five.
#[test]
fn a_spawner_waits_while_its_place_is_taken() {
    let mut scene = Scene::new("pipe", World::new(), 600);
    scene.world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for (x, z) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
        let wall = Body::fixed().shape(Shape::cuboid(0.6, 5.0, 0.6));
        scene.world.insert(wall.position(0.95 * x, 5.0, 0.95 * z));
    }
    let group = |bit: u32| Groups { membership: bit, filter: bit };
    let ball = Body::dynamic().shape(Shape::ball(0.3)).position(0.0, 3.0, 0.0).groups(group(1));
    scene.spawners.push(Spawner { count: Some(20), ..Spawner::new(ball, 1) });
    // Fixed bodies, sensors and bodies of other groups do not block it.
    scene.world.insert(Body::fixed().sensor(Shape::ball(5.0)));
    scene.world.insert(Body::fixed().shape(Shape::ball(0.1)).position(0.0, 3.39, 0.0));
    let other = Body::kinematic().shape(Shape::ball(0.3)).position(0.0, 3.0, 0.0);
    scene.world.insert(other.groups(group(2)));
    let (mut came, mut deepest) = (Vec::new(), 0.0_f64);
    let (_, spawners) = run(&scene, 600, |world, spawners| {
        came.push(spawners.came());
        deepest = deepest.max(drystone::metrics::Penetration::of_world(world, &SolverConfig::default()).max);
    });
    let second = came.iter().position(|&came| came == 2).expect("a second ball");
    assert!((20..24).contains(&second) && came[0] == 1, "the second ball comes before step {second}");
    assert!((4..7).contains(&spawners.came()), "{} balls", spawners.came());
    assert!(deepest < 0.02, "{deepest} m deep");
    // In a file that is written meanwhile it waits as well.
    let (left, _) = spawners.remaining(scene.dt);
    assert_eq!((left[0].first, left[0].count), (0, Some(20 - spawners.came())));
}

#[test]
fn spawners_go_the_same_way_on_any_backend_and_in_worlds_beside_each_other() {
    let scene = read(RAIN).expect("a good scene");
    let (alone, _) = run(&scene, 50, |_, _| {});
    let mut spawners = Spawners::new(&scene);
    let mut lanes = Simulation::new(scene.world.clone()).expect("a world");
    for _ in 0..50 {
        spawners.before_step(&mut lanes.world, scene.dt);
        lanes.step(scene.dt).expect("a step");
    }
    let state =
        |world: &World, i: usize| (world.bodies[i].position, world.bodies[i].rotation, world.bodies[i].name.clone());
    assert_eq!(alone.world.bodies.len(), lanes.world.bodies.len());
    assert!((0..alone.world.bodies.len()).all(|i| state(&alone.world, i) == state(&lanes.world, i)));
    let path = std::env::temp_dir().join(format!("drystone-rain-{}.json", std::process::id()));
    std::fs::write(&path, RAIN).expect("a file");
    let both = Scene::find_worlds(path.to_str().expect("a path"), &[], 2, None).expect("two worlds");
    std::fs::remove_file(&path).expect("the file");
    let (both, _) = run(&both, 50, |_, _| {});
    let worlds = both.world.worlds();
    let [first, second] =
        [0, 1].map(|k| worlds[k].iter().map(|body| state(&both.world, body.index())).collect::<Vec<_>>());
    assert_eq!(first, second);
    let mut own: Vec<_> = alone.world.bodies.handles().map(|handle| state(&alone.world, handle.index())).collect();
    let mut first = first;
    for all in [&mut own, &mut first] {
        all.sort_by(|a, b| a.0.to_array().partial_cmp(&b.0.to_array()).expect("numbers"));
    }
    assert_eq!(own, first);
}

#[test]
fn a_spawner_that_makes_no_sense_is_refused_in_one_line() {
    for (before, after, line) in [
        (r#""every": 10"#, r#""every": 0"#, "spawners[0]: every = 0: must be at least 1 step"),
        (r#""every": 7"#, r#""evry": 7"#, "spawners[1].evry: unknown field `evry`"),
        (r#"{"below": 1}"#, r#"{"below": 1e39}"#, "spawners[0]: body: leaves.below = 1e39: must be finite"),
        (r#"{"after": 0.5}"#, r#"{"after": -1}"#, "body 1 \"box\": leaves.after = -1: must be 0 or more"),
        (r#""radius": 0.1"#, r#""radius": -0.1"#, "spawners[0]: body: shapes[0]: ball of radius -0.1"),
        (
            r#""torque": [0, 1, 0]"#,
            r#""torque": [0, 1e39, 0]"#,
            "spawners[1]: body: torque = [0, 1e39, 0]: must be finite",
        ),
        (r#""name": "floor","#, r#""torque": [1, 0, 0],"#, "body 0: torque = [1, 0, 0]: must be zero unless the body"),
        (r#"{"membership": 1}"#, r#"{"membership": -1}"#, "body 1 \"box\": groups.membership: invalid value"),
    ] {
        let text = RAIN.replacen(before, after, 1);
        assert_ne!(text, RAIN, "{before}");
        let error = read(&text).expect_err(line).to_string();
        assert!(error.starts_with(line) && !error.contains('\n'), "{error}, not {line}");
    }
}

#[test]
fn a_scene_file_says_the_same_as_the_world_that_it_was_written_from() {
    let every_shape = r#"{"version": 1, "gravity": [0, -1.62, 0.1], "dt": 0.01, "steps": 7, "container": [[-9, 0, -9], [9, 9, 9]], "bodies": [
        {"kind": "fixed", "shapes": [{"type": "half_space", "normal": [0.6, 0.8, 0]}]},
        {"kind": "kinematic", "angular_velocity": [0, 1, 0], "shapes": [
          {"type": "mesh", "vertices": [[0, 0, 0], [0, 0, 1], [1, 0, 0]], "triangles": [[0, 1, 2]]},
          {"type": "height_field", "heights": [[0, 0.1, 0], [0.2, 0.3, 0], [0, 0.7, 0.1]], "scale": [3, 0.5, 4]}]},
        {"position": [0.1, 5, 0.3], "rotation": [0.1, 0.7, 0.1, 0.7], "friction": 0.3, "restitution": 0.1, "gravity_scale": -0.3, "force": [1, 2, 3],
         "torque": [0.1, 0.2, 0.3], "groups": {"membership": 3, "filter": 4294967294}, "shapes": [
          {"type": "ball", "radius": 0.3}, {"type": "cuboid", "half_extents": [0.1, 0.2, 0.3], "position": [0.7, 0, 0]},
          {"type": "capsule", "half_height": 0.7, "radius": 0.1, "rotation": [0.6, 0, 0, 0.8]}]},
        {"position": [3, 5, 0], "density": 700, "shapes": [{"type": "cylinder", "half_height": 0.3, "radius": 0.7}]},
        {"position": [6, 5, 0], "mass": 3.3, "shapes": [{"type": "cone", "half_height": 0.3, "radius": 0.7}]},
        {"position": [-3, 5, 0], "shapes": [{"type": "convex_hull", "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]}]}],
      "joints": [{"type": "ball", "bodies": [2, 3], "anchor": [1.5, 5, 0]}, {"type": "ball", "bodies": [4], "anchor": [6, 6, 0]}]}"#;
    let catalogue = ["pile", "bridge", "arch", "drop", "chain"].map(|name| Scene::find(name, &[]));
    let files = [every_shape, RAIN].map(read);
    for scene in catalogue.into_iter().chain(files).map(|scene| scene.expect("a good scene")) {
        let begun = SceneFile::of(&scene).expect("a file");
        let text = begun.to_text();
        let again = read(&text).expect("the file is good");
        assert_eq!(SceneFile::of(&again).expect("a file").to_text(), text, "{}", scene.name);
        // In motion as well, with bodies that came and went.
        let (simulation, spawners) = run(&scene, 40, |_, _| {});
        let (now, leaving) = spawners.remaining(scene.dt);
        let moved = Scene { world: simulation.world.clone(), spawners: now, leaving, ..scene.clone() };
        let text = SceneFile::of(&moved).expect("a file").to_text();
        let again = read(&text).expect("the file is good");
        assert_eq!(SceneFile::of(&again).expect("a file").to_text(), text, "{}", scene.name);
        let (ours, theirs) = (&moved.world, &again.world);
        assert_eq!(ours.bodies.count(), theirs.bodies.len(), "{}", scene.name);
        for (a, b) in ours.bodies.handles().map(|handle| &ours.bodies[handle.index()]).zip(&theirs.bodies) {
            let motion = |b: &Body| (b.position, b.rotation, b.linear_velocity, b.angular_velocity);
            assert_eq!(motion(a), motion(b), "{}", scene.name);
            assert_eq!((a.mass, a.material, a.groups), (b.mass, b.material, b.groups), "{}", scene.name);
            assert_eq!((a.force, a.torque, a.gravity_scale), (b.force, b.torque, b.gravity_scale), "{}", scene.name);
        }
        assert_eq!(ours.joints.len(), theirs.joints.len());
    }
}

#[test]
fn a_run_of_the_written_file_brings_the_bodies_that_were_still_to_come() {
    let scene = read(RAIN).expect("a good scene");
    let (whole, all) = run(&scene, 60, |_, _| {});
    let (half, spawners) = run(&scene, 25, |_, _| {});
    let (now, leaving) = spawners.remaining(scene.dt);
    let moved = Scene { world: half.world.clone(), spawners: now, leaving, ..scene };
    let again = read(&SceneFile::of(&moved).expect("a file").to_text()).expect("a good file");
    let (rest, then) = run(&again, 35, |_, _| {});
    assert_eq!((spawners.came() + then.came(), spawners.left() + then.left()), (all.came(), all.left()));
    let sorted = |world: &World| {
        let mut names: Vec<String> = names(world).into_iter().map(str::to_owned).collect();
        names.sort();
        names
    };
    assert_eq!(sorted(&whole.world), sorted(&rest.world));
}

#[test]
fn what_a_scene_file_cannot_say_is_refused_in_one_line() {
    let mut scene = Scene::find("tower", &[]).expect("a scene");
    let refusal = |scene: &Scene| SceneFile::of(scene).expect_err("a refusal").to_string();
    scene.world.beside(&World::new());
    assert_eq!(refusal(&scene), "a scene file has room for one world, but this scene has 2");
    let mut scene = Scene::find("tower", &[]).expect("a scene");
    scene.world.bodies[2].position.y = f32::NAN;
    let line = refusal(&scene);
    assert!(
        line.starts_with("body 2 ") && line.ends_with("its numbers are not finite: a scene file cannot represent them"),
        "{line}"
    );
}

#[test]
fn a_body_that_someone_else_removed_is_no_trouble() {
    let mut scene = Scene::new("rain", World::new(), 60);
    let drop = Body::dynamic().shape(Shape::ball(0.1)).position(0.0, 1.0, 0.0);
    let leaves = Leaves { below: None, after: Some(0.1) };
    scene.spawners.push(Spawner { leaves, count: Some(2), ..Spawner::new(drop, 1) });
    let mut spawners = Spawners::new(&scene);
    spawners.before_step(&mut scene.world, scene.dt);
    let first = scene.world.bodies.handle(0).expect("it came");
    scene.world.remove(first);
    let other = scene.world.insert(Body::dynamic().shape(Shape::ball(0.1)));
    (0..20).for_each(|_| spawners.before_step(&mut scene.world, scene.dt));
    assert_eq!((spawners.came(), spawners.left()), (2, 1));
    assert!(scene.world.body(other).is_some_and(|body| body.position == Vec3::ZERO));
}
