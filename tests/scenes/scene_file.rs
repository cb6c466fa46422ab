//! Scene files: what loads, and how each bad one is refused.

use std::path::Path;

use drystone::{BodyKind, CombineRule, Error, Joint, Material};
use drystone_scenes::{Scene, SceneFile, load, schema};
use glam::{Quat, Vec3};
use serde_json::{Value, json};

/// The scene of one text.
fn read(text: &str) -> Result<Scene, Error> {
    SceneFile::parse(text)?.into_scene("unnamed")
}

/// The line that refuses one text.
fn refusal(text: &str) -> String {
    let error = read(text).expect_err(text);
    assert!(matches!(error, Error::Input(_)), "{error:?}");
    let line = error.to_string();
    assert!(!line.contains('\n'), "{line}");
    line
}

fn with_body(body: &Value) -> String {
    json!({"version": 1, "bodies": [body]}).to_string()
}

/// The line that refuses a fixed unit cube named `b`, changed by `change`; without what says which body.
fn refused_body(change: Value) -> String {
    let mut body =
        json!({"name": "b", "kind": "fixed", "shapes": [{"type": "cuboid", "half_extents": [0.5, 0.5, 0.5]}]});
    merge(&mut body, change);
    let line = refusal(&with_body(&body));
    line.strip_prefix("body 0 \"b\": ").unwrap_or_else(|| panic!("{line}")).to_owned()
}

fn merge(body: &mut Value, change: Value) {
    let Value::Object(change) = change else { panic!("{change}") };
    body.as_object_mut().expect("an object").extend(change);
}

/// The line that refuses `shape` on a fixed body.
fn refused_shape(shape: Value) -> String {
    let line = refused_body(json!({"shapes": [{"type": "ball", "radius": 1}, shape]}));
    line.strip_prefix("shapes[1]: ").unwrap_or_else(|| panic!("{line}")).to_owned()
}

fn one_body(body: Value) -> drystone::Body {
    read(&with_body(&body)).expect("a good scene").world.bodies[0].clone()
}

fn every_shape() -> Vec<Value> {
    vec![
        json!({"type": "ball", "radius": 0.5}),
        json!({"type": "cuboid", "half_extents": [0.5, 1, 2]}),
        json!({"type": "capsule", "half_height": 1, "radius": 0.5}),
        json!({"type": "cylinder", "half_height": 1, "radius": 0.5}),
        json!({"type": "cone", "half_height": 1, "radius": 0.5}),
        json!({"type": "convex_hull", "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]}),
        json!({"type": "voxels", "size": [1, 1, 1], "cells": [[0, 0, 0], [-1, 0, 0]]}),
        json!({"type": "half_space", "normal": [0, 1, 0]}),
        json!({"type": "mesh", "vertices": [[0, 0, 0], [0, 0, 1], [1, 0, 0]], "triangles": [[0, 1, 2]]}),
        json!({"type": "height_field", "heights": [[0, 0.1, 0], [0, 0.2, 0]], "scale": [4, 1, 2]}),
    ]
}

#[test]
fn every_shape_loads_on_the_bodies_that_can_have_it() {
    for (k, shape) in every_shape().into_iter().enumerate() {
        assert_eq!(one_body(json!({"kind": "fixed", "shapes": [shape]})).mass.mass, 0.0);
        for kind in ["dynamic", "kinematic"] {
            let text = with_body(&json!({"kind": kind, "shapes": [shape]}));
            // Seven have volume; mesh and height field also move with a kinematic body.
            let is_half_space = shape["type"] == "half_space";
            if k < 7 || kind == "kinematic" && !is_half_space {
                let mass = read(&text).expect(kind).world.bodies[0].mass.mass;
                assert_eq!(mass > 0.0, kind == "dynamic");
            } else {
                let line = refusal(&text);
                assert!(line.contains("shapes[0]: ") && line.contains("half-spaces"), "{line}");
            }
        }
    }
}

#[test]
fn what_is_left_out_takes_its_default() {
    let scene = read(&with_body(&json!({"shapes": [{"type": "cuboid", "half_extents": [0.5, 0.5, 0.5]}]})));
    let scene = scene.expect("a scene");
    assert_eq!((scene.name.as_str(), scene.steps, scene.dt, scene.container), ("unnamed", 600, 1.0 / 60.0, None));
    assert_eq!(scene.world.gravity, Vec3::new(0.0, -9.81, 0.0));
    let body = &scene.world.bodies[0];
    assert_eq!((body.name.as_str(), body.kind, body.mass.mass), ("body 0", BodyKind::Dynamic, 1000.0));
    assert_eq!((body.material.friction, body.material.restitution), (0.5, 0.0));
    assert_eq!((body.position, body.rotation, body.linear_velocity), (Vec3::ZERO, Quat::IDENTITY, Vec3::ZERO));
    assert!(read(r#"{"version": 1, "bodies": []}"#).expect("an empty scene").world.bodies.is_empty());
}

#[test]
fn what_is_given_is_taken() {
    let scene = read(
        r#"{"version": 1, "name": "s", "gravity": [0, 0, -1.62], "dt": 0.01, "steps": 7, "joints": [],
            "container": [[-1, -2, -3], [1, 2, 3]],
            "bodies": [{"name": "b", "kind": "kinematic", "position": [1, 2, 3], "rotation": [0.6, 0, 0, 0.8],
                "linear_velocity": [4, 5, 6], "angular_velocity": [7, 8, 9], "friction": 0, "restitution": 1,
                "shapes": [{"type": "ball", "radius": 2, "position": [0, 1, 0], "rotation": [0, 1, 0, 0]}]}]}"#,
    )
    .expect("a scene");
    assert_eq!((scene.name.as_str(), scene.steps, scene.dt), ("s", 7, 0.01));
    assert_eq!(scene.world.gravity, Vec3::new(0.0, 0.0, -1.62));
    assert_eq!(scene.container, Some((Vec3::new(-1.0, -2.0, -3.0), Vec3::new(1.0, 2.0, 3.0))));
    let body = &scene.world.bodies[0];
    assert_eq!((body.name.as_str(), body.kind), ("b", BodyKind::Kinematic));
    assert_eq!((body.position, body.rotation), (Vec3::new(1.0, 2.0, 3.0), Quat::from_xyzw(0.6, 0.0, 0.0, 0.8)));
    assert_eq!((body.linear_velocity, body.angular_velocity), (Vec3::new(4.0, 5.0, 6.0), Vec3::new(7.0, 8.0, 9.0)));
    assert_eq!((body.material.friction, body.material.restitution), (0.0, 1.0));
    let collider = &body.colliders[0];
    assert_eq!((collider.position, collider.rotation), (Vec3::Y, Quat::from_xyzw(0.0, 1.0, 0.0, 0.0)));
    assert_eq!(collider.shape.smallest_half_extent(), 2.0);

    let pushed = r#"{"version": 1, "bodies": [{"force": [1, 2, -3], "shapes": [{"type": "ball", "radius": 2}]}]}"#;
    assert_eq!(read(pushed).expect("a scene").world.bodies[0].force, Vec3::new(1.0, 2.0, -3.0));
}

#[test]
fn mass_comes_from_density_from_the_total_or_as_given() {
    let cube = json!({"type": "cuboid", "half_extents": [0.5, 0.5, 0.5]});
    assert_eq!(one_body(json!({"density": 500, "shapes": [cube]})).mass.mass, 500.0);
    assert_eq!(one_body(json!({"mass": 3, "shapes": [cube, cube]})).mass.mass, 3.0);
    let given = json!({"mass": 2, "center": [0, 1, 0], "principal_inertia": [1, 2, 3]});
    let mass = one_body(json!({"mass_properties": given})).mass;
    assert_eq!((mass.mass, mass.center, mass.principal_inertia), (2.0, Vec3::Y, Vec3::new(1.0, 2.0, 3.0)));
    assert_eq!(mass.principal_frame, Quat::IDENTITY);
}

#[test]
fn the_principal_frame_is_taken() {
    let frame = Quat::from_xyzw(0.5, -0.5, 0.5, 0.5);
    let given = json!({"mass": 2, "principal_inertia": [1, 2, 3], "principal_frame": frame.to_array()});
    let body = one_body(json!({"mass_properties": given}));
    assert_eq!(body.mass.principal_frame, frame);
    // About the world's axes: the first of its own lies along the turned x.
    let inertia = body.mass.world_inertia(Quat::IDENTITY);
    for (axis, moment) in [(Vec3::X, 1.0), (Vec3::Y, 2.0), (Vec3::Z, 3.0)] {
        let axis = frame * axis;
        assert!((inertia * axis).distance(axis * moment) < 1e-6, "{axis}: {inertia}");
    }
}

#[test]
fn a_compound_has_the_mass_and_center_of_its_parts() {
    let part = |x: f32| json!({"type": "cuboid", "half_extents": [0.5, 0.5, 0.5], "position": [x, 0, 0]});
    let body = one_body(json!({"shapes": [part(0.0), part(1.0), part(2.0)]}));
    assert_eq!((body.colliders.len(), body.mass.mass, body.mass.center), (3, 3000.0, Vec3::X));
}

#[test]
fn a_rotation_near_unit_length_is_normalized() {
    let body = one_body(json!({"kind": "fixed", "rotation": [0, 0, 0, 1.0009]}));
    assert_eq!(body.rotation, Quat::IDENTITY);
    let shape = json!({"type": "half_space", "normal": [0, 0.9995, 0]});
    let normal = one_body(json!({"kind": "fixed", "shapes": [shape]})).colliders[0].shape.clone();
    assert_eq!(format!("{normal:?}"), "HalfSpace");
}

#[test]
fn malformed_text_is_refused_with_line_and_column() {
    assert_eq!(refusal("{\n  \"version\": 1,\n  oops\n}"), "key must be a string at line 3 column 3");
    assert_eq!(refusal(""), "EOF while parsing a value at line 1 column 0");
    assert_eq!(refusal("3"), "invalid type: integer `3`, expected struct SceneFile at line 1 column 1");
    let twice = format!("{} 1", with_body(&json!({"kind": "fixed"})));
    assert!(refusal(&twice).starts_with("trailing characters at line 1 column"));
}

#[test]
fn a_number_beyond_double_precision_is_refused_where_it_stands() {
    let text = r#"{"version": 1, "bodies": [{"name": "b", "friction": 1e400}]}"#;
    assert_eq!(refusal(text), "body 0: friction: number out of range at line 1 column 57");
}

#[test]
fn another_version_is_refused_first() {
    assert_eq!(refusal(r#"{"version": 2, "bodies": []}"#), "version = 2: only version 1 is supported");
    assert_eq!(refusal(r#"{"version": 2, "worlds": []}"#), "version = 2: only version 1 is supported");
    assert_eq!(refusal(r#"{"version": "1.0"}"#), "version = \"1.0\": only version 1 is supported");
    assert!(refusal(r#"{"bodies": []}"#).starts_with("missing field `version`"));
}

#[test]
fn an_unknown_key_is_named() {
    assert!(refusal(r#"{"version": 1, "bodies": [], "wind": 3}"#).starts_with("wind: unknown field `wind`, expected"));
    // Of many names the nearest, and where all are listed.
    let far = refused_body(json!({"colour": "red"}));
    assert!(far.starts_with("colour: unknown field `colour`"), "{far}");
    assert!(far.ends_with("; `drystone scenes --schema` lists all") && far.len() < 120, "{far}");
    let near = refused_body(json!({"positon": [0, 0, 0]}));
    assert!(near.ends_with("; did you mean \"position\"? `drystone scenes --schema` lists all"), "{near}");
    assert!(refused_body(json!({"fric\ntion": 0})).contains("unknown field `fric tion`"));
    let shape = refused_shape(json!({"type": "ball", "radius": 1, "half_height": 2}));
    assert!(shape.starts_with("unknown field `half_height`, expected `radius`"), "{shape}");
    let shape = refused_shape(json!({"type": "torus"}));
    assert!(shape.starts_with("unknown variant `torus`, expected one of `ball`, `cuboid`"), "{shape}");
    let mass = refused_body(json!({"mass_properties": {"mass": 1, "principal_inertia": [1, 1, 1], "com": 0}}));
    assert!(mass.starts_with("mass_properties.com: unknown field `com`"), "{mass}");
}

#[test]
fn a_missing_or_mistyped_value_is_named() {
    assert!(refused_shape(json!({"type": "capsule", "radius": 1})).starts_with("missing field `half_height`"));
    assert!(refused_shape(json!({"radius": 1})).starts_with("missing field `type`"));
    assert!(
        refused_body(json!({"friction": "ice"})).starts_with("friction: invalid type: string \"ice\", expected f64")
    );
    assert!(refused_body(json!({"kind": "static"})).starts_with("kind: unknown variant `static`, expected one of"));
    assert!(refused_body(json!({"position": [1, 2]})).starts_with("position: invalid length 2"));
    assert!(refusal(r#"{"version": 1, "steps": -1, "bodies": []}"#).starts_with("steps: invalid value: integer `-1`"));
}

#[test]
fn the_body_is_named_by_index_and_name() {
    let bodies = |bad: Value| json!({"version": 1, "bodies": [{"kind": "fixed"}, bad]}).to_string();
    assert_eq!(refusal(&bodies(json!({"kind": "fixed", "friction": -1}))), "body 1: friction = -1: must be 0 or more");
    let named = json!({"name": "b\n3", "density": -1});
    assert_eq!(refusal(&bodies(named)), "body 1 \"b\\n3\": density = -1: must be positive");
    assert!(refusal(&bodies(json!({"name": "b\n3", "x": 1}))).starts_with("body 1 \"b\\n3\": x: unknown field `x`"));
}

#[test]
fn impossible_values_of_a_body_are_refused() {
    for (change, line) in [
        (json!({"density": 0}), "density = 0: must be positive"),
        (json!({"mass": -2.5}), "mass = -2.5: must be positive"),
        (json!({"mass": 1, "density": 1}), "density, mass and mass_properties: give only one of them"),
        (json!({"friction": -0.1}), "friction = -0.1: must be 0 or more"),
        (json!({"friction": 1e39}), "friction = 1e39: must be finite in single precision"),
        (json!({"restitution": 1.5}), "restitution = 1.5: must be 0 to 1"),
        (json!({"restitution": -1}), "restitution = -1: must be 0 to 1"),
        (json!({"rotation": [0, 0, 0, 2]}), "rotation = [0, 0, 0, 2]: must be of length 1, but has length 2"),
        (json!({"rotation": [0, 0, 0, 0]}), "rotation = [0, 0, 0, 0]: must be of length 1, but has length 0"),
        (json!({"position": [0, -1e10, 0]}), "position = [0, -10000000000, 0]: must be at most 1e9 m in size"),
        (json!({"position": [0, 1e39, 0]}), "position = [0, 1e39, 0]: must be finite in single precision"),
        (json!({"linear_velocity": [1, 0, 0]}), "linear_velocity = [1, 0, 0]: must be zero for a fixed body"),
        (json!({"force": [0, 0, 1]}), "force = [0, 0, 1]: must be zero unless the body is dynamic"),
        (json!({"kind": "dynamic", "force": [0, 1e39, 0]}), "force = [0, 1e39, 0]: must be finite in single precision"),
        (json!({"kind": "dynamic", "shapes": []}), "a dynamic body without shapes needs mass_properties"),
        (json!({"kind": "dynamic", "mass": 1, "shapes": []}), "a dynamic body without shapes needs mass_properties"),
        (
            json!({"angular_velocity": [0, 1e300, 0]}),
            "angular_velocity = [0, 1e300, 0]: must be finite in single precision",
        ),
        (
            json!({"mass_properties": {"mass": 0, "principal_inertia": [1, 1, 1]}}),
            "mass_properties: mass = 0: must be positive",
        ),
        (
            json!({"mass_properties": {"mass": 1, "principal_inertia": [1, 0, 1]}}),
            "mass_properties: principal_inertia = [1, 0, 1]: must be positive",
        ),
    ] {
        assert_eq!(refused_body(change), line);
    }
}

#[test]
fn a_mass_beyond_what_can_be_simulated_is_refused() {
    for (density, radius) in [(1e38, 1e9), (1e-38, 1e-3), (1000.0, 1e-10), (1000.0, 1e8), (1e12, 10.0), (1000.0, 5e-7)]
    {
        let shapes = json!([{"type": "ball", "radius": radius}]);
        let line = refused_body(json!({"kind": "dynamic", "density": density, "shapes": shapes}));
        assert!(line.starts_with("mass = ") && line.contains("must be 1e-15 to 1e15 kg"), "{line}");
    }
    for mass in [1e-16, 1e16] {
        let line = refused_body(json!({"kind": "dynamic", "mass": mass}));
        assert_eq!(line, format!("mass = {mass:e} kg: must be 1e-15 to 1e15 kg"));
    }
}

#[test]
fn impossible_shapes_are_refused() {
    for (shape, line) in [
        (json!({"type": "ball", "radius": 0}), "ball of radius 0: must be more than 0 and at most 1e9 m"),
        (
            json!({"type": "cone", "half_height": 1, "radius": -1}),
            "cone of radius -1: must be more than 0 and at most 1e9 m",
        ),
        (
            json!({"type": "cylinder", "half_height": 1e10, "radius": 1}),
            "cylinder of half height 10000000000: must be more than 0 and at most 1e9 m",
        ),
        (
            json!({"type": "cuboid", "half_extents": [0.5, -1, 0.5]}),
            "cuboid of half extent -1: must be more than 0 and at most 1e9 m",
        ),
        (json!({"type": "convex_hull", "points": []}), "convex hull of 0 points: the points must span a volume"),
        (
            json!({"type": "convex_hull", "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}),
            "convex hull of 4 points: the points must span a volume",
        ),
        (
            json!({"type": "convex_hull", "points": [[0, 0, 0], [1, 0, 1e39]]}),
            "points[1] = [1, 0, 1e39]: must be finite in single precision",
        ),
        (
            json!({"type": "half_space", "normal": [0, 2, 0]}),
            "normal = [0, 2, 0]: must be of length 1, but has length 2",
        ),
        (
            json!({"type": "mesh", "vertices": [[0, 0, 0], [1, 0, 0]], "triangles": [[0, 1, 2]]}),
            "mesh triangle [0, 1, 2] names a vertex beyond the last of 2",
        ),
        (
            json!({"type": "height_field", "heights": [[0, 0], [0, 1e9]], "scale": [1, 2, 1]}),
            "a height field, scaled by [1, 2, 1]: must be more than 0 and at most 1e9 m in size",
        ),
        (
            json!({"type": "height_field", "heights": [[0, 0], [0, 0]], "scale": [1, 0, 1]}),
            "a height field, scaled by [1, 0, 1]: must be more than 0 and at most 1e9 m in size",
        ),
        (
            json!({"type": "height_field", "heights": [[0, 0], [0]], "scale": [1, 1, 1]}),
            "a height field needs at least 2 rows of equal length with at least 2 heights",
        ),
        (
            json!({"type": "ball", "radius": 1, "position": [0, 0, 1e10]}),
            "position = [0, 0, 10000000000]: must be at most 1e9 m in size",
        ),
        (
            json!({"type": "ball", "radius": 1, "position": [0, 0, 1e38]}),
            "position = [0, 0, 1e38]: must be at most 1e9 m in size",
        ),
        (
            json!({"type": "ball", "radius": 1, "rotation": [1, 1, 0, 0]}),
            "rotation = [1, 1, 0, 0]: must be of length 1, but has length 1.4142135623730951",
        ),
    ] {
        assert_eq!(refused_shape(shape), line);
    }
    assert!(refused_shape(json!({"type": "mesh", "vertices": [], "triangles": []})).starts_with("mesh: "));
}

#[test]
fn impossible_values_of_a_scene_are_refused() {
    for (change, line) in [
        (json!({"dt": 0}), "dt = 0: must be 1e-9 to 1 seconds"),
        (json!({"dt": -0.1}), "dt = -0.1: must be 1e-9 to 1 seconds"),
        (json!({"dt": 1.5}), "dt = 1.5: must be 1e-9 to 1 seconds"),
        (json!({"dt": 1e-10}), "dt = 0.0000000001: must be 1e-9 to 1 seconds"),
        (
            json!({"gravity": [0, -2e19, 0]}),
            "gravity = [0, -20000000000000000000, 0]: must be at most 1e9 m/s² along every axis",
        ),
        (json!({"gravity": [0, 1e300, 0]}), "gravity = [0, 1e300, 0]: must be finite in single precision"),
        (
            json!({"container": [[0, 0, 0], [1, 0, 1]]}),
            "container[1] = [1, 0, 1]: must be above container[0] along every axis",
        ),
    ] {
        let mut scene = json!({"version": 1, "bodies": []});
        merge(&mut scene, change);
        assert_eq!(refusal(&scene.to_string()), line);
    }
}

/// A file of that name and text in a new folder.
fn file(name: &str, text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, text).expect("a file");
    (folder, path)
}

#[test]
fn a_refused_file_is_named() {
    let (_folder, path) = file("tower.json", &with_body(&json!({"name": "b3", "density": -1})));
    let line = load(&path).expect_err("a negative density").to_string();
    assert_eq!(line, format!("{}: body 0 \"b3\": density = -1: must be positive", path.display()));
    let missing = Path::new("no/such/scene.json");
    assert!(matches!(load(missing), Err(Error::File { .. })));
}

#[test]
fn a_scene_is_found_by_the_path_of_its_file_and_named_after_it() {
    let (_folder, path) = file("my tower.json", r#"{"version": 1, "bodies": []}"#);
    let path = path.to_str().expect("a path");
    assert_eq!(Scene::find(path, &[]).expect("a scene").name, "my tower");
    let line = Scene::find(path, &["n=3".to_owned()]).expect_err("a parameter").to_string();
    assert_eq!(line, format!("{path}: a scene file takes no parameter, such as \"n=3\""));
}

#[test]
fn what_is_neither_a_scene_nor_a_file_is_met_with_the_nearest_scene() {
    let line = Scene::find("piles", &[]).expect_err("no scene").to_string();
    let lists = "`drystone scenes` lists the scenes";
    assert_eq!(line, format!("\"piles\" is neither a scene nor a scene file; did you mean \"pile\"? {lists}"));
    let line = Scene::find("nowhere", &[]).expect_err("no scene").to_string();
    assert_eq!(line, format!("\"nowhere\" is neither a scene nor a scene file; {lists}"));
    assert!(matches!(Scene::find("piles.json", &[]), Err(Error::File { .. })));
}

/// Blocks in a grid are a mesh on the ground, and boxes with a mass on a body that falls.
#[test]
fn voxels_of_a_file_are_boxes_on_a_dynamic_body() {
    let stair = json!({"type": "voxels", "size": [1, 0.5, 2], "cells": [[0, 0, 0], [1, 0, 0], [1, 1, 0]], "position": [0, 3, 0],
        "rotation": [0, 0.6, 0, 0.8], "material": {"friction": 0.1}});
    let fixed = one_body(json!({"kind": "fixed", "shapes": [stair]}));
    let cells = [[0, 0, 0], [1, 0, 0], [1, 1, 0]].map(glam::IVec3::from_array);
    let size = Vec3::new(1.0, 0.5, 2.0);
    let [mesh] = &fixed.colliders[..] else { panic!("{} shapes", fixed.colliders.len()) };
    assert_eq!(mesh.shape.triangles(), drystone::Shape::voxels(size, &cells).expect("a stair").triangles());
    let dynamic = one_body(json!({"kind": "dynamic", "shapes": [stair]}));
    let boxes = drystone::Body::dynamic().voxels(size, &cells).expect("a stair").colliders;
    assert!(boxes.len() == 2 && dynamic.colliders.len() == 2 && (dynamic.mass.mass - 3000.0).abs() < 1e-2);
    for (part, own) in dynamic.colliders.iter().zip(boxes) {
        let place = Vec3::Y * 3.0 + mesh.rotation * own.position;
        assert!(part.position.distance(place) < 1e-6 && part.rotation == mesh.rotation, "{} m", part.position);
        assert_eq!(part.material.map(|material| material.friction), Some(0.1));
    }
    let line = refused_shape(json!({"type": "voxels", "size": [1, 1, 1], "cells": []}));
    assert!(line.contains("cell"), "{line}");
    let line = refused_shape(json!({"type": "voxels", "size": [1, 0, 1], "cells": [[0, 0, 0]]}));
    assert!(line.starts_with("voxels of [1, 0, 1] m: must be more than 0"), "{line}");
}

/// The cone of a file is that of the library, whatever the poses of the bodies.
#[test]
fn a_cone_of_a_file_holds_the_axis_of_the_world() {
    let read = |angle: &str| {
        let arm = r#"{"name": "arm", "position": [0, 0.5, 0], "rotation": [0, 0.6, 0, 0.8], "shapes": [{"type": "ball", "radius": 0.2}]}"#;
        let cone = format!(
            r#"{{"type": "cone", "bodies": ["arm"], "anchor": [0, 1, 0], "axis": [1, 0, 0], "angle": {angle}}}"#
        );
        let text = format!(r#"{{"version": 1, "bodies": [{arm}], "joints": [{cone}]}}"#);
        SceneFile::parse(&text).and_then(|file| file.into_scene("a"))
    };
    let scene = read("0.5").expect("a scene");
    let anchor = Vec3::Y;
    let arm = scene.world.bodies.handle(0).expect("the arm");
    let cone = Joint::to_world(arm, anchor, anchor).along(Vec3::X).in_world(&scene.world).cone(0.5);
    let joint = scene.world.joints[0];
    assert!(
        joint.anchor_a.distance(cone.anchor_a) < 1e-6 && joint.anchor_b.distance(cone.anchor_b) < 1e-6,
        "{joint:?}"
    );
    assert_eq!(joint.linear, cone.linear);
    // The anchor in the frame of the arm, and the end of an axis as long as its lever.
    let back = Quat::from_xyzw(0.0, -0.6, 0.0, 0.8);
    let lever = back * (anchor - Vec3::Y * 0.5);
    let end = lever + back * Vec3::X * lever.length();
    assert!(joint.anchor_a.distance(end) < 1e-6 && joint.anchor_b.distance(anchor + Vec3::X * 0.5) < 1e-6, "{joint:?}");
    for angle in ["0", "3.2", "-1"] {
        let line = read(angle).map(|_| ()).expect_err("a refusal").to_string();
        assert!(line.starts_with("joints[0]: angle = ") && line.ends_with("more than 0 and less than pi"), "{line}");
    }
}

/// Damping, locked axes and sleep of a body, there and back, and one line for each that is amiss.
#[test]
fn damping_and_locks_of_a_body_are_keys() {
    let file = |keys: &str| {
        format!(
            r#"{{"version": 1, "bodies": [{{"name": "b", "shapes": [{{"type": "ball", "radius": 0.5}}], {keys}}}]}}"#
        )
    };
    let read = |keys: &str| SceneFile::parse(&file(keys)).and_then(|file| file.into_scene("a"));
    let keys =
        r#""linear_damping": 0.5, "angular_damping": 2, "locked_rotations": [true, false, true], "can_sleep": false"#;
    let scene = read(keys).expect("a scene");
    let again = SceneFile::parse(&SceneFile::of(&scene).expect("a file").to_text()).expect("its text");
    for world in [scene.world, again.into_scene("a").expect("a scene").world] {
        let body = &world.bodies[0];
        assert_eq!((body.linear_damping, body.angular_damping), (0.5, 2.0));
        assert_eq!((body.locked_rotations, body.can_sleep), ([true, false, true], false));
    }
    let line = |keys: &str| read(keys).expect_err("a refusal").to_string();
    assert_eq!(line(r#""linear_damping": -1"#), "body 0 \"b\": linear_damping = -1: must be 0 to 1e9 1/s");
    assert!(line(r#""angular_damping": 1e300"#).starts_with("body 0 \"b\": angular_damping = "));
    assert!(line(r#""locked_rotations": [1, 0, 0]"#).starts_with("body 0 \"b\": locked_rotations[0]: "));
}

/// A file says the whole mass of a body that had some added.
#[test]
fn additional_mass_of_a_body_is_a_key() {
    let read = |keys: &str| {
        let shape = r#"{"type": "cuboid", "half_extents": [0.5, 0.5, 0.5]}"#;
        let text = format!(r#"{{"version": 1, "bodies": [{{"name": "b", "shapes": [{shape}], {keys}}}]}}"#);
        SceneFile::parse(&text).and_then(|file| file.into_scene("a"))
    };
    let scene = read(r#""mass": 6, "additional_mass": {"mass": 6, "center": [0, 2, 0]}"#).expect("a scene");
    let again = SceneFile::parse(&SceneFile::of(&scene).expect("a file").to_text()).expect("its text");
    for world in [scene.world, again.into_scene("a").expect("a scene").world] {
        let mass = world.bodies[0].mass;
        assert_eq!((mass.mass, mass.center), (12.0, glam::Vec3::Y));
        assert!((mass.principal_inertia - glam::Vec3::new(13.0, 1.0, 13.0)).length() < 1e-5);
    }
    let line = |keys: &str| read(keys).expect_err("a refusal").to_string();
    let negative = line(r#""additional_mass": {"mass": 1, "principal_inertia": [1, -1, 1]}"#);
    assert!(negative.starts_with("body 0 \"b\": additional_mass: principal_inertia = "), "{negative}");
    let whole = r#""mass_properties": {"mass": 1, "principal_inertia": [1, 1, 1]}, "additional_mass": {"mass": 1}"#;
    assert_eq!(line(whole), "body 0 \"b\": additional_mass: mass_properties give the whole mass");
}

#[test]
fn materials_of_shapes_and_their_rules_are_keys() {
    let read = |body: &str, shape: &str| {
        let shape = format!(r#"{{"type": "cuboid", "half_extents": [0.5, 0.5, 0.5]{shape}}}"#);
        let text = format!(r#"{{"version": 1, "bodies": [{{"name": "b", "shapes": [{shape}]{body}}}]}}"#);
        SceneFile::parse(&text).and_then(|file| file.into_scene("a"))
    };
    let body = r#", "friction": 0.2, "friction_rule": "geometric_mean", "restitution_rule": "average",
        "rolling_friction": 0.01, "spinning_friction": 0.02, "surface_velocity": [1, 0, -2]"#;
    let own = r#", "material": {"friction": 0.1, "friction_rule": "minimum", "rolling_friction": 0.03,
        "spinning_friction": 0.04, "surface_velocity": [0, 3, 0]}"#;
    let scene = read(body, own).expect("a scene");
    let again = SceneFile::parse(&SceneFile::of(&scene).expect("a file").to_text()).expect("its text");
    let own = Material {
        friction: 0.1,
        friction_rule: Some(CombineRule::Minimum),
        rolling_friction: 0.03,
        spinning_friction: 0.04,
        surface_velocity: Vec3::Y * 3.0,
        ..Material::default()
    };
    for world in [scene.world, again.into_scene("a").expect("a scene").world] {
        let body = &world.bodies[0];
        assert_eq!(body.colliders[0].material, Some(own));
        let rules = [body.material.friction_rule, body.material.restitution_rule];
        assert_eq!(rules, [Some(CombineRule::GeometricMean), Some(CombineRule::Average)]);
        let Material { friction, rolling_friction, spinning_friction, surface_velocity, .. } = body.material;
        assert_eq!([friction, rolling_friction, spinning_friction], [0.2, 0.01, 0.02]);
        assert_eq!(surface_velocity, Vec3::new(1.0, 0.0, -2.0));
    }
    assert_eq!(read("", "").expect("a scene").world.bodies[0].colliders[0].material, None);
    let line = |body: &str, shape: &str| read(body, shape).map(|_| ()).expect_err("a refusal").to_string();
    let bounce = line("", r#", "material": {"restitution": 2}"#);
    assert_eq!(bounce, "body 0 \"b\": shapes[0]: restitution = 2: must be 0 to 1");
    let huge = line("", r#", "material": {"friction": 1e300}"#);
    assert!(huge.starts_with("body 0 \"b\": shapes[0]: material: friction = 1e300"), "{huge}");
    let rolls = line(r#", "rolling_friction": -1"#, "");
    assert_eq!(rolls, "body 0 \"b\": rolling_friction = -1 m: must be 0 or more");
    let rule = line(r#", "friction_rule": "mean""#, "");
    assert!(rule.starts_with("body 0 \"b\": friction_rule: "), "{rule}");
}

#[test]
fn the_schema_describes_every_key() {
    let schema = schema();
    let keys = |object: &Value| {
        let mut keys: Vec<String> = object["properties"].as_object().expect("properties").keys().cloned().collect();
        keys.sort();
        keys.join(" ")
    };
    assert_eq!(schema["type"], "object");
    assert_eq!(schema["required"], json!(["version", "bodies"]));
    assert_eq!(schema["additionalProperties"], false);
    assert_eq!(keys(&schema), "bodies container driver dt gravity joints name spawners steps version");
    let body = &schema["$defs"]["BodyFile"];
    assert_eq!(
        keys(body),
        "additional_mass angular_damping angular_velocity can_sleep density force friction friction_rule gravity_scale groups kind leaves linear_damping linear_velocity locked_rotations locked_translations mass \
         mass_properties max_angular_speed max_linear_speed name position restitution restitution_rule rolling_friction rotation shapes spinning_friction surface_velocity swept torque"
    );
    assert_eq!(keys(&schema["$defs"]["SpawnerFile"]), "body count every first");
    assert_eq!(keys(&schema["$defs"]["LeavesFile"]), "after below");
    assert_eq!(keys(&schema["$defs"]["Groups"]), "filter membership");
    assert_eq!(keys(&schema["$defs"]["ShapeFile"]), "material position rotation sensor");
    assert_eq!(schema["$defs"]["ShapeFile"]["unevaluatedProperties"], false);
    let joint = &schema["$defs"]["JointFile"];
    assert_eq!(keys(joint), "anchor anchors bodies break_force collide enabled");
    assert_eq!((&joint["required"], &joint["unevaluatedProperties"]), (&json!(["bodies"]), &json!(false)));
    let kinds = joint["oneOf"].as_array().expect("kinds").iter();
    let kinds: Vec<_> = kinds.map(|kind| kind["properties"]["type"]["const"].clone()).collect();
    assert_eq!(kinds, ["ball", "fixed", "hinge", "slider", "distance", "cone", "generic"]);
    let types: Vec<_> = every_shape().iter().map(|s| s["type"].clone()).collect();
    let described: Vec<_> = schema["$defs"]["ShapeFile"]["oneOf"].as_array().expect("shapes").iter().collect();
    assert_eq!(described.iter().map(|s| s["properties"]["type"]["const"].clone()).collect::<Vec<_>>(), types);
}
