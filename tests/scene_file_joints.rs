//! Joints of scene files: what loads, and how each bad one is refused.

use drystone::glam::Vec3;
use drystone::scenes::SceneFile;
use drystone::{Error, Joint, Scene};
use serde_json::{Value, json};

/// The scene with this joint and four bodies: a fixed `wall`, two dynamic balls `a` and `twin`, a kinematic `twin`.
fn read(joint: &Value) -> Result<Scene, Error> {
    let ball = json!([{"type": "ball", "radius": 0.5}]);
    let turned = [0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()];
    let text = json!({"version": 1, "joints": [joint], "bodies": [
        {"name": "wall", "kind": "fixed", "shapes": ball},
        {"name": "a", "position": [1, 2, 3], "rotation": turned, "shapes": ball},
        {"name": "twin", "position": [5, 0, 0], "shapes": ball},
        {"name": "twin", "kind": "kinematic", "shapes": ball},
    ]});
    SceneFile::parse(&text.to_string())?.into_scene("unnamed")
}

fn one_joint(joint: Value) -> Joint {
    read(&joint).expect("a good scene").world.joints[0]
}

/// The line that refuses a joint, without what says which joint.
fn refusal(joint: Value) -> String {
    let line = read(&joint).expect_err("a bad joint").to_string();
    assert!(!line.contains('\n'), "{line}");
    line.strip_prefix("joints[0]: ").unwrap_or_else(|| panic!("{line}")).to_owned()
}

#[test]
fn a_body_is_named_by_name_or_by_index() {
    let joint = one_joint(json!({"type": "ball", "bodies": ["a", 2], "anchors": [[1, 0, 0], [0, 1, 0]]}));
    assert_eq!(joint, Joint::new(1, Vec3::X, 2, Vec3::Y));
    let joint = one_joint(json!({"type": "ball", "bodies": ["a"], "anchors": [[1, 0, 0], [4, 5, 6]]}));
    assert_eq!(joint, Joint::to_world(1, Vec3::X, Vec3::new(4.0, 5.0, 6.0)));
}

#[test]
fn one_anchor_is_a_point_of_the_world_where_the_bodies_stand() {
    let point = Vec3::new(2.0, 2.0, 3.0);
    let scene = read(&json!({"type": "ball", "bodies": [1, 2], "anchor": point.to_array(), "collide": true}))
        .expect("a good scene");
    let joint = scene.world.joints[0];
    assert!(joint.collide);
    assert!(scene.world.anchors(&joint).iter().all(|p| p.distance(point) < 1e-6));
    // Body a is turned by a quarter about z: its own -y points along x.
    assert!(joint.anchor_a.distance(-Vec3::Y) < 1e-6, "{}", joint.anchor_a);
    let alone = one_joint(json!({"type": "ball", "bodies": [1], "anchor": point.to_array()}));
    assert_eq!((alone.body_b, alone.anchor_b, alone.collide), (None, point, false));
}

#[test]
fn a_joint_that_ties_nothing_is_refused_in_one_line() {
    for (bodies, line) in [
        (json!(["b", 1]), "body \"b\": no body has that name"),
        (json!([1, "twin"]), "body \"twin\": bodies 2 and 3 have that name; give an index"),
        (json!([1, 4]), "body 4: there are 4, counted from 0"),
        (json!([1, "a"]), "bodies 1 and \"a\": the same body twice"),
        (json!(["wall", 3]), "nothing that it ties can be moved: one of the bodies must be dynamic"),
        (json!([3]), "nothing that it ties can be moved: one of the bodies must be dynamic"),
        (json!([]), "0 bodies: a joint ties one or two"),
        (json!([0, 1, 2]), "3 bodies: a joint ties one or two"),
    ] {
        assert_eq!(refusal(json!({"type": "ball", "bodies": bodies, "anchor": [0, 0, 0]})), line);
    }
    for body in [json!(-1), json!(1.5), json!(null)] {
        let line = refusal(json!({"type": "ball", "bodies": [body], "anchor": [0, 0, 0]}));
        assert!(line.starts_with("a body is named by its index from 0 or by its name"), "{line}");
    }
}

#[test]
fn an_impossible_anchor_is_refused_in_one_line() {
    let with = |mut joint: Value| {
        let fields = joint.as_object_mut().expect("an object");
        fields.extend([("type".to_owned(), json!("ball")), ("bodies".to_owned(), json!([1, 2]))]);
        refusal(joint)
    };
    let zero = [0, 0, 0];
    assert_eq!(with(json!({})), "anchor and anchors: give one of them");
    assert_eq!(with(json!({"anchor": zero, "anchors": [zero, zero]})), "anchor and anchors: give one of them");
    assert_eq!(with(json!({"anchor": [0, 1e39, 0]})), "anchor = [0, 1e39, 0]: must be finite in single precision");
    assert_eq!(
        with(json!({"anchors": [zero, [0, -1e10, 0]]})),
        "anchors[1] = [0, -10000000000, 0]: must be at most 1e9 m in size"
    );
    assert!(with(json!({"anchor": zero, "limit": 3})).starts_with("unknown field `limit`, expected"));
    assert!(with(json!({"anchors": [zero]})).starts_with("invalid length 1"));
    let line = read(&json!({"type": "hinge", "bodies": [1]})).expect_err("a hinge").to_string();
    assert!(line.starts_with("joints[0].type: unknown variant `hinge`, expected `ball`"), "{line}");
}
