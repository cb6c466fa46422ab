//! Joints of scene files: what loads, and how each bad one is refused.

use drystone::glam::Vec3;
use drystone::{Axis, Error, Joint, Linear};
use drystone_scenes::{Scene, SceneFile};
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
    let scene = read(&json!({"type": "ball", "bodies": ["a", 2], "anchors": [[1, 0, 0], [0, 1, 0]]}));
    let world = scene.expect("a good scene").world;
    let [a, twin] = [1, 2].map(|i| world.bodies.handle(i).expect("a ball"));
    assert_eq!(world.joints[0], Joint::new(a, Vec3::X, twin, Vec3::Y));
    let joint = one_joint(json!({"type": "ball", "bodies": ["a"], "anchors": [[1, 0, 0], [4, 5, 6]]}));
    assert_eq!(joint, Joint::to_world(a, Vec3::X, Vec3::new(4.0, 5.0, 6.0)));
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
        (json!([1, 4]), "body 4: must be less than 4, the number of bodies"),
        (json!([1, "a"]), "bodies 1 and \"a\": the same body twice"),
        (json!(["wall", 3]), "no body of the joint can move: at least one must be dynamic"),
        (json!([3]), "no body of the joint can move: at least one must be dynamic"),
        (json!([]), "0 bodies: a joint connects one or two"),
        (json!([0, 1, 2]), "3 bodies: a joint connects one or two"),
    ] {
        assert_eq!(refusal(json!({"type": "ball", "bodies": bodies, "anchor": [0, 0, 0]})), line);
    }
    for body in [json!(-1), json!(1.5), json!(null)] {
        let line =
            read(&json!({"type": "ball", "bodies": [body], "anchor": [0, 0, 0]})).expect_err("no body").to_string();
        let line = line.strip_prefix("joints[0].bodies[0]: ").expect("its place");
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
    let line = with(json!({"anchor": zero, "limit": 3}));
    assert!(line.starts_with("unknown field `limit`"), "{line}");
    let line = read(&json!({"type": "ball", "bodies": [1, 2], "anchors": [zero]})).expect_err("one anchor").to_string();
    assert!(line.starts_with("joints[0].anchors: invalid length 1"), "{line}");
    let line = read(&json!({"type": "weld", "bodies": [1], "anchor": zero})).expect_err("a weld").to_string();
    assert!(line.starts_with("joints[0]: unknown variant `weld`, expected one of `ball`, `fixed`"), "{line}");
}

/// A hinge of the world's z axis between bodies a and 2, of which a is turned by a quarter about z.
#[test]
fn every_kind_of_joint_is_read_with_its_limits_and_drives() {
    let with = |kind: Value| {
        let mut joint = json!({"bodies": [1, 2], "anchor": [2, 2, 3]});
        joint.as_object_mut().expect("an object").extend(kind.as_object().expect("an object").clone());
        let scene = read(&joint).expect("a good scene");
        let motion = scene.world.joint_motion(&scene.world.joints[0]);
        let has_angles = scene.world.joints[0].angular != [Axis::FREE; 3];
        assert!(!has_angles || motion.position[3..].iter().all(|angle| angle.abs() < 1e-6), "{motion:?}");
        let frame = scene.world.bodies[2].rotation * scene.world.joints[0].frame_b;
        (scene.world.joints[0], frame * Vec3::X)
    };
    let motor = json!({"speed": 2, "max_load": 30});
    let (hinge, axis) = with(json!({"type": "hinge", "axis": [0, 0, 1], "limits": [-0.5, 1], "motor": motor}));
    assert!(axis.distance(Vec3::Z) < 1e-6, "{axis}");
    let turn = Axis::limited(-0.5, 1.0).motor(2.0, 30.0);
    assert_eq!(hinge.linear, Linear::Axes([Axis::LOCKED; 3]));
    assert_eq!(hinge.angular, [turn, Axis::LOCKED, Axis::LOCKED]);
    let spring = json!({"target": 0.1, "frequency": 2, "damping_ratio": 0.5, "max_load": 9});
    let (slider, axis) = with(json!({"type": "slider", "axis": [0, 1, 0], "spring": spring}));
    assert!(axis.distance(Vec3::Y) < 1e-6, "{axis}");
    let shift = Axis::FREE.spring(0.1, 2.0, 0.5, 9.0);
    assert_eq!((slider.linear, slider.angular), (Linear::Axes([shift, Axis::LOCKED, Axis::LOCKED]), [Axis::LOCKED; 3]));
    let spring = json!({"target": 0.1, "stiffness": 200, "damping": 3});
    let (slider, _) = with(json!({"type": "slider", "axis": [0, 1, 0], "spring": spring, "enabled": false}));
    let shift = Axis::FREE.spring_damper(0.1, 200.0, 3.0, f32::MAX);
    assert_eq!((slider.linear, slider.enabled), (Linear::Axes([shift, Axis::LOCKED, Axis::LOCKED]), false));
    assert!(hinge.enabled);
    assert_eq!(with(json!({"type": "fixed"})).0.angular, [Axis::LOCKED; 3]);
    assert!(with(json!({"type": "ball"})).0.is_ball());
    let (rope, _) = with(json!({"type": "distance", "limits": [0, 2]}));
    assert_eq!(rope.linear, Linear::Distance(Axis::limited(0.0, 2.0)));
    let (any, axis) = with(json!({
        "type": "generic", "frame": [0, 0, 0.5_f64.sqrt(), 0.5_f64.sqrt()],
        "linear": [{"locked": true}, {"limits": [-1, 1]}, {}],
        "angular": [{"spring": {"frequency": 3}}, {"locked": true}, {"motor": {"speed": 0, "max_load": 1}}],
    }));
    assert!(axis.distance(Vec3::Y) < 1e-6, "{axis}");
    assert_eq!(any.linear, Linear::Axes([Axis::LOCKED, Axis::limited(-1.0, 1.0), Axis::FREE]));
    let swing = Axis::FREE.spring(0.0, 3.0, 1.0, f32::MAX);
    assert_eq!(any.angular, [swing, Axis::LOCKED, Axis::FREE.motor(0.0, 1.0)]);
}

#[test]
fn an_impossible_axis_is_refused_in_one_line() {
    let refused = |kind: Value| {
        let mut joint = json!({"bodies": [1], "anchor": [0, 0, 0]});
        joint.as_object_mut().expect("an object").extend(kind.as_object().expect("an object").clone());
        let line = read(&joint).expect_err("a bad joint").to_string();
        assert!(!line.contains('\n'), "{line}");
        line
    };
    let hinge = |key: &str, value: Value| refused(json!({"type": "hinge", "axis": [0, 0, 1], key: value}));
    for (line, part) in [
        (refused(json!({"type": "hinge", "axis": [0, 0, 2]})), "axis = [0, 0, 2]: must be of length 1"),
        (hinge("limits", json!([1, 0])), "angular: limits 1 and 0: must ascend"),
        (hinge("limits", json!([0, 1e4])), "angular: limits 0 and 10000: must ascend, within"),
        (hinge("limits", json!([0, 1e39])), "limits = [0, 1e39]: must be finite"),
        (hinge("limits", json!([0])), "limits: invalid length 1"),
        (hinge("motor", json!({"speed": 1, "max_load": -1})), "angular: max_load = -1: must be at least 0"),
        (hinge("spring", json!({"frequency": 0})), "angular: frequency = 0: must be above 0"),
        (hinge("spring", json!({"frequency": 1, "damping_ratio": -1})), "angular: damping_ratio = -1: must be 0"),
        (hinge("spring", json!({})), "spring: give frequency, with damping_ratio, or stiffness, with damping"),
        (hinge("spring", json!({"frequency": 1, "damping": 1})), "spring: give frequency, with damping_ratio, or"),
        (hinge("spring", json!({"stiffness": -1})), "angular: stiffness = -1: must be above 0"),
        (hinge("locked", json!(true)), "unknown field `locked`"),
        (refused(json!({"type": "distance", "limits": [-1, 1]})), "distance: limits -1 and 1: must ascend"),
        (
            refused(json!({"type": "distance", "motor": {"speed": 1, "max_load": 1}, "spring": {"frequency": 1}})),
            "motor and spring: give one of them",
        ),
        (
            refused(
                json!({"type": "generic", "linear": [{}, {"locked": true, "limits": [0, 1]}, {}], "angular": [{}, {}, {}]}),
            ),
            "linear[1].locked and linear[1].limits: give one of them",
        ),
    ] {
        assert!(line.contains(part), "{line}");
        assert!(line.starts_with("joint"), "{line}");
    }
}

#[test]
fn a_limit_that_is_null_is_none_on_that_side_and_is_written_so() {
    for (limits, min, max) in [
        (json!([null, 5.0]), f32::NEG_INFINITY, 5.0),
        (json!([-5.0, null]), -5.0, f32::INFINITY),
        (json!([null, null]), f32::NEG_INFINITY, f32::INFINITY),
    ] {
        let slider =
            json!({"type": "slider", "bodies": ["a"], "anchor": [0, 0, 0], "axis": [1, 0, 0], "limits": limits});
        let axes = json!([{"limits": limits}, {"locked": true}, {"locked": true}]);
        let generic =
            json!({"type": "generic", "bodies": ["a"], "anchor": [0, 0, 0], "linear": axes, "angular": [{}, {}, {}]});
        for joint in [slider, generic] {
            let scene = read(&joint).expect("a good scene");
            let Linear::Axes([axis, ..]) = scene.world.joints[0].linear else { panic!("axes") };
            assert_eq!(axis, Axis::limited(min, max));
            let text = SceneFile::of(&scene).expect("a file").to_text();
            let written: Value = serde_json::from_str(&text).expect("JSON");
            assert_eq!(written["joints"][0]["linear"][0]["limits"], limits);
            let again = SceneFile::parse(&text).and_then(|file| file.into_scene("again")).expect("the same scene");
            assert_eq!(again.world.joints[0], scene.world.joints[0]);
        }
    }
}

#[test]
fn springs_of_a_stiffness_and_joints_that_are_off_are_written_so() {
    let spring = json!({"target": 0.25, "stiffness": 200, "damping": 3, "max_load": 9});
    let joint = json!({"type": "distance", "bodies": ["a"], "anchor": [0, 0, 0], "spring": spring, "enabled": false});
    let scene = read(&joint).expect("a good scene");
    let expected = Axis::FREE.spring_damper(0.25, 200.0, 3.0, 9.0);
    assert_eq!((scene.world.joints[0].linear, scene.world.joints[0].enabled), (Linear::Distance(expected), false));
    let text = SceneFile::of(&scene).expect("a file").to_text();
    let written: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(
        written["joints"][0]["spring"],
        json!({"target": 0.25, "stiffness": 200.0, "damping": 3.0, "max_load": 9.0})
    );
    let again = SceneFile::parse(&text).and_then(|file| file.into_scene("again")).expect("the same scene");
    assert_eq!(again.world.joints[0], scene.world.joints[0]);
}
