//! The types of a scene file: version 1 of the format, and the source of its JSON Schema.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use drystone::{BodyKind, CombineRule, Groups};

/// The content of a scene file, version 1. Parsing checks only its form.
///
/// Units are SI, and the axes are right-handed. Numbers are stored in single precision; lengths can be up to 1e9 m. A
/// missing key takes its default. An unknown key is refused.
///
/// ```
/// let text = r#"{"version": 1, "bodies": [{"shapes": [{"type": "ball", "radius": 0.5}]}]}"#;
/// let scene = drystone_scenes::SceneFile::parse(text)?.into_scene("one ball")?;
/// assert_eq!(scene.world.dynamic_count(), 1);
/// # Ok::<(), drystone::Error>(())
/// ```
///
/// ```
/// use drystone_scenes::{
///     AdditionalMassFile, AxisFile, BodyFile, BodyRef, DriverFile, Geometry, JointFile, JointKind, LeavesFile, MassFile,
///     MaterialFile, MotorFile, SceneFile, ShapeFile, SpawnerFile, SpringFile,
/// };
///
/// let text = r#"{"version": 1,
///     "bodies": [
///         {"name": "door", "position": [0.5, 1, 0], "leaves": {"after": 9},
///          "mass_properties": {"mass": 20, "principal_inertia": [1, 1, 1]},
///          "shapes": [{"type": "cuboid", "half_extents": [0.5, 1, 0.02]}]},
///         {"name": "lamp", "position": [3, 1, 0], "additional_mass": {"mass": 2},
///          "shapes": [{"type": "ball", "radius": 0.1, "material": {"friction": 0.1}}]}],
///     "joints": [
///         {"type": "hinge", "bodies": ["door"], "anchor": [0, 1, 0], "axis": [0, 1, 0], "motor": {"speed": 1, "max_load": 9}},
///         {"type": "generic", "bodies": [1], "anchor": [3, 2, 0], "linear": [{}, {"spring": {"frequency": 2}}, {}], "angular": [{}, {}, {}]}],
///     "spawners": [{"every": 60, "body": {"shapes": [{"type": "ball", "radius": 0.3}]}}]}"#;
/// let file = SceneFile::parse(text)?;
/// let [BodyFile { leaves, mass_properties, shapes, .. }, lamp] = &file.bodies[..] else { panic!("two bodies") };
/// let BodyFile { additional_mass, shapes: of_lamp, .. } = lamp;
/// assert!(matches!(leaves, Some(LeavesFile { after: Some(9.0), below: None })));
/// assert!(matches!(mass_properties, Some(MassFile { mass: 20.0, .. })));
/// assert!(matches!(additional_mass, Some(AdditionalMassFile { mass: 2.0, principal_inertia: [0.0, 0.0, 0.0], .. })));
/// assert!(matches!(&shapes[..], [ShapeFile { geometry: Geometry::Cuboid { .. }, sensor: false, .. }]));
/// assert!(matches!(of_lamp[0].material, Some(MaterialFile { friction: 0.1, restitution: 0.0, .. })));
/// let [door, lamp]: &[JointFile; 2] = file.joints[..].try_into().expect("two joints");
/// assert!(matches!(&door.bodies[..], [BodyRef::Name(name)] if name == "door"));
/// assert!(matches!(&door.kind, JointKind::Hinge { motor: Some(MotorFile { speed: 1.0, .. }), .. }));
/// let JointKind::Generic { linear, .. } = &lamp.kind else { panic!("a generic joint") };
/// assert!(matches!(linear[1], AxisFile { spring: Some(SpringFile { frequency: Some(2.0), .. }), .. }));
/// assert!(matches!(file.spawners[..], [SpawnerFile { every: 60, first: 0, .. }]));
/// assert_eq!(file.into_scene("room")?.world.dynamic_count(), 2);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Scene")]
pub struct SceneFile {
    /// Version of the format: 1.
    #[schemars(extend("const" = 1))]
    pub version: u32,
    /// Name of the scene; by default the file name without its extension.
    pub name: Option<String>,
    /// Acceleration of every dynamic body (m/s²), up to 1e9 along each axis.
    #[serde(default = "defaults::gravity")]
    pub gravity: [f64; 3],
    /// Length of a step (s), 1e-9 to 1.
    #[serde(default = "defaults::dt")]
    pub dt: f64,
    /// Default number of steps of a run.
    #[serde(default = "defaults::steps")]
    pub steps: u32,
    /// Lower and upper corner of the space that no dynamic body should leave (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub container: Option<[[f64; 3]; 2]>,
    /// The bodies.
    pub bodies: Vec<BodyFile>,
    /// The joints between them.
    #[serde(default)]
    pub joints: Vec<JointFile>,
    /// Spawners, which add bodies while the scene runs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spawners: Vec<SpawnerFile>,
    /// The body that a person drives by keyboard or touch.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub driver: Option<DriverFile>,
}

/// The body that a person drives. Its x axis is forward, and its y axis up.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields, tag = "type", rename_all = "snake_case")]
#[schemars(title = "Driver")]
pub enum DriverFile {
    /// A kinematic body that walks.
    Character {
        /// The body, of one convex shape.
        body: BodyRef,
    },
    /// A vehicle with motors and steering.
    Vehicle {
        /// The chassis. Wheels are the first bodies of the joints to it: a motor of a joint's first angle turns its wheel,
        /// and limits of its second angle steer it.
        body: BodyRef,
    },
}

/// Adds equal bodies while a scene runs: one before a step, at a regular interval, or later if its place is occupied.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Spawner")]
pub struct SpawnerFile {
    /// The body at its start. Its key `leaves` determines when it leaves.
    pub body: BodyFile,
    /// Steps before the first body.
    #[serde(default)]
    pub first: u32,
    /// Steps from one body to the next, at least 1.
    #[schemars(range(min = 1))]
    pub every: u32,
    /// Total number of bodies; unlimited by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
}

/// When a body leaves the scene: as soon as one of the conditions holds.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Leaves")]
pub struct LeavesFile {
    /// Its center of mass is below this height (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
    /// Its age has reached this time (s), 0 or more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<f64>,
}

/// A body of a scene file.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields, default)]
#[schemars(title = "Body")]
pub struct BodyFile {
    /// Name for messages; by default "body N" for body N, counted from 0.
    pub name: Option<String>,
    /// How the body moves: fixed, kinematic or dynamic.
    pub kind: BodyKind,
    /// Origin of the body's frame (m).
    pub position: [f64; 3],
    /// Rotation of the body's frame: a quaternion x, y, z, w of length 1 within 0.001.
    pub rotation: [f64; 4],
    /// Velocity of the center of mass (m/s), up to 1e9 along each axis; zero for a fixed body.
    pub linear_velocity: [f64; 3],
    /// Angular velocity in world axes (rad/s), up to 1e9 along each axis; zero for a fixed body.
    pub angular_velocity: [f64; 3],
    /// Force through the center of mass, in addition to gravity (N); zero unless dynamic.
    pub force: [f64; 3],
    /// Torque in world axes (N m); zero unless dynamic.
    pub torque: [f64; 3],
    /// Factor on the gravity of a dynamic body: 0 floats, -1 rises as fast as others fall.
    pub gravity_scale: f64,
    /// The rate at which the linear velocity of a dynamic body decays (1/s), 0 to 1e9.
    pub linear_damping: f64,
    /// The rate at which the angular velocity of a dynamic body decays (1/s), 0 to 1e9.
    pub angular_damping: f64,
    /// Whether a dynamic body does not turn about the axes x, y and z of the world.
    pub locked_rotations: [bool; 3],
    /// World axes x, y, z along which the center of mass does not move. Only for dynamic bodies.
    #[serde(skip_serializing_if = "are_false")]
    pub locked_translations: [bool; 3],
    /// Largest speed of the center of mass (m/s), 0 or more; unlimited by default. Only for dynamic bodies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_linear_speed: Option<f64>,
    /// Largest angular speed (rad/s), likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_angular_speed: Option<f64>,
    /// Whether a dynamic body may fall asleep.
    pub can_sleep: bool,
    /// Density of all shapes (kg/m³), more than 0. The default is 1000 for a dynamic body without a mass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Total mass (kg), more than 0, instead of the density.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Mass, center and inertia, instead of the values from the shapes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_properties: Option<MassFile>,
    /// Mass added to that of the shapes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub additional_mass: Option<AdditionalMassFile>,
    /// Coulomb coefficient of the shapes without own material, 0 or more.
    pub friction: f64,
    /// Ratio of separation to approach velocity of the shapes without own material, 0 to 1.
    pub restitution: f64,
    /// How contacts combine friction. Of two rules the later one in the list counts; by default it is the geometric
    /// mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_rule: Option<CombineRule>,
    /// How contacts combine restitution, likewise; by default it is the larger value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub restitution_rule: Option<CombineRule>,
    /// Lever of rolling friction (m), 0 or more: the torque against rolling over the normal force of the contact. The
    /// larger value of two bodies counts.
    #[serde(skip_serializing_if = "is_zero")]
    pub rolling_friction: f64,
    /// Lever of spinning friction (m), 0 or more: the torque against spin about the normal, likewise.
    #[serde(skip_serializing_if = "is_zero")]
    pub spinning_friction: f64,
    /// Velocity of the surface relative to the body, as of a belt, in the axes of the body (m/s).
    #[serde(skip_serializing_if = "are_zero")]
    pub surface_velocity: [f64; 3],
    /// Collision groups: which bodies it collides with. 32 groups, one bit each.
    pub groups: Groups,
    /// Whether the body is a bullet, which does not pass through moving bodies.
    pub swept: bool,
    /// When the body leaves the scene; never by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves: Option<LeavesFile>,
    /// Shapes on the body; several make a compound.
    pub shapes: Vec<ShapeFile>,
}

impl Default for BodyFile {
    fn default() -> Self {
        Self {
            name: None,
            kind: BodyKind::Dynamic,
            position: [0.0; 3],
            rotation: defaults::rotation(),
            linear_velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            force: [0.0; 3],
            torque: [0.0; 3],
            gravity_scale: 1.0,
            linear_damping: 0.0,
            angular_damping: 0.0,
            locked_rotations: [false; 3],
            locked_translations: [false; 3],
            max_linear_speed: None,
            max_angular_speed: None,
            can_sleep: true,
            density: None,
            mass: None,
            mass_properties: None,
            additional_mass: None,
            friction: 0.5,
            restitution: 0.0,
            friction_rule: None,
            restitution_rule: None,
            rolling_friction: 0.0,
            spinning_friction: 0.0,
            surface_velocity: [0.0; 3],
            groups: Groups::ALL,
            swept: false,
            leaves: None,
            shapes: Vec::new(),
        }
    }
}

/// Mass added to that of the shapes of a body, in the body's frame.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Additional mass")]
pub struct AdditionalMassFile {
    /// Mass (kg), more than 0.
    pub mass: f64,
    /// Its center (m).
    #[serde(default)]
    pub center: [f64; 3],
    /// Moments of inertia about its principal axes through its center (kg m²), 0 or more; 0 for a point mass.
    #[serde(default)]
    pub principal_inertia: [f64; 3],
    /// Rotation from its principal axes to the body's frame: a quaternion x, y, z, w.
    #[serde(default = "defaults::rotation")]
    pub principal_frame: [f64; 4],
}

/// Mass, center of mass and inertia of a body, in the body's frame.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Mass properties")]
pub struct MassFile {
    /// Mass (kg), more than 0.
    pub mass: f64,
    /// Center of mass (m).
    #[serde(default)]
    pub center: [f64; 3],
    /// Moments of inertia about the principal axes through the center of mass (kg m²), more than 0.
    pub principal_inertia: [f64; 3],
    /// Rotation from the principal axes to the body's frame: a quaternion x, y, z, w.
    #[serde(default = "defaults::rotation")]
    pub principal_frame: [f64; 4],
}

/// A shape at a pose on a body.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[schemars(title = "Shape", extend("unevaluatedProperties" = false))]
pub struct ShapeFile {
    /// Position in the body's frame (m).
    #[serde(default)]
    pub position: [f64; 3],
    /// Rotation in the body's frame: a quaternion x, y, z, w of length 1 within 0.001.
    #[serde(default = "defaults::rotation")]
    pub rotation: [f64; 4],
    /// Whether the shape is a sensor. A sensor detects other shapes and has no contacts.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sensor: bool,
    /// The material of the shape, in place of that of the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<MaterialFile>,
    /// The geometry of the shape. An unknown key is refused.
    #[serde(flatten)]
    pub geometry: Geometry,
}

/// The material of a shape.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields, default)]
#[schemars(title = "Material")]
pub struct MaterialFile {
    /// Coulomb coefficient, 0 or more.
    pub friction: f64,
    /// Ratio of separation to approach velocity, 0 to 1.
    pub restitution: f64,
    /// How contacts combine friction: see the key of a body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_rule: Option<CombineRule>,
    /// How contacts combine restitution: see the key of a body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub restitution_rule: Option<CombineRule>,
    /// Lever of rolling friction (m), 0 or more: see the key of a body.
    #[serde(skip_serializing_if = "is_zero")]
    pub rolling_friction: f64,
    /// Lever of spinning friction (m), 0 or more: see the key of a body.
    #[serde(skip_serializing_if = "is_zero")]
    pub spinning_friction: f64,
    /// Velocity of the surface relative to the body, in the axes of the body (m/s).
    #[serde(skip_serializing_if = "are_zero")]
    pub surface_velocity: [f64; 3],
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

fn are_false(all: &[bool; 3]) -> bool {
    *all == [false; 3]
}

fn are_zero(x: &[f64; 3]) -> bool {
    *x == [0.0; 3]
}

impl Default for MaterialFile {
    fn default() -> Self {
        Self {
            friction: 0.5,
            restitution: 0.0,
            friction_rule: None,
            restitution_rule: None,
            rolling_friction: 0.0,
            spinning_friction: 0.0,
            surface_velocity: [0.0; 3],
        }
    }
}

/// A shape in its own frame. All lengths are in m and more than 0.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Geometry {
    /// A ball.
    Ball {
        /// Radius.
        radius: f64,
    },
    /// A box.
    Cuboid {
        /// Half of its sides along x, y, z.
        half_extents: [f64; 3],
    },
    /// A segment along y, swept by a radius.
    Capsule {
        /// Half of the segment's length.
        half_height: f64,
        /// Radius.
        radius: f64,
    },
    /// A cylinder along y.
    Cylinder {
        /// Half of its height.
        half_height: f64,
        /// Radius.
        radius: f64,
    },
    /// A cone along y, tip up.
    Cone {
        /// Half of its height.
        half_height: f64,
        /// Radius of its base.
        radius: f64,
    },
    /// The convex hull of points that are not all in one plane.
    ConvexHull {
        /// The points.
        points: Vec<[f64; 3]>,
    },
    /// Blocks in a grid: a mesh on a body that is not dynamic, and as few boxes as possible on a dynamic one.
    Voxels {
        /// Sides of a cell along x, y, z.
        size: [f64; 3],
        /// Numbers of the cells along x, y, z. Cell c begins at c times `size`.
        cells: Vec<[i32; 3]>,
    },
    /// All points p with p · normal <= 0; on fixed bodies only.
    HalfSpace {
        /// The outward normal, of length 1 within 0.001.
        normal: [f64; 3],
    },
    /// A triangle mesh; not on dynamic bodies.
    Mesh {
        /// The vertices.
        vertices: Vec<[f64; 3]>,
        /// Three indices of vertices each, counted from 0, counter-clockwise seen from outside.
        triangles: Vec<[u32; 3]>,
    },
    /// Heights over a rectangle of the xz plane around the origin; not on dynamic bodies.
    HeightField {
        /// Rows along z of heights along x, in units of the y component of `scale`.
        heights: Vec<Vec<f64>>,
        /// Length along x, unit of the heights, length along z.
        scale: [f64; 3],
    },
}

/// A joint of a scene file. It needs `anchor` or `anchors`.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[schemars(title = "Joint", extend("unevaluatedProperties" = false))]
pub struct JointFile {
    /// One body, tied to the world, or two bodies. At least one has to be dynamic. Positions, angles and speeds of a
    /// joint are those of the first body relative to the second.
    #[schemars(length(min = 1, max = 2))]
    pub bodies: Vec<BodyRef>,
    /// The anchor in the world, at the initial poses of the bodies (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anchor: Option<[f64; 3]>,
    /// The anchor in the frame of each body (m); with one body, the second anchor is in the world.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anchors: Option<[[f64; 3]; 2]>,
    /// Whether the two bodies still collide with each other.
    #[serde(default)]
    pub collide: bool,
    /// Whether the joint acts.
    #[serde(default = "defaults::enabled", skip_serializing_if = "Clone::clone")]
    pub enabled: bool,
    /// The force at which the joint breaks (N), averaged over a step, more than 0; by default the joint never breaks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub break_force: Option<f64>,
    /// The kind of joint. An unknown key is refused.
    #[serde(flatten)]
    pub kind: JointKind,
}

/// Reads limits. Null is an infinite limit: JSON has no infinity, and the writer writes null for it.
fn limits_or_null<'de, D: Deserializer<'de>>(reader: D) -> Result<Option<[f64; 2]>, D::Error> {
    let limits = Option::<[Option<f64>; 2]>::deserialize(reader)
        .map_err(|e| serde::de::Error::custom(format_args!("limits: {e}")))?;
    Ok(limits.map(|[min, max]| [min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY)]))
}

/// The free axes of a joint. Angles are zero at the initial poses of the bodies.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
#[schemars(title = "Kind of joint")]
#[non_exhaustive]
pub enum JointKind {
    /// Keeps the points together.
    Ball {},
    /// No free axis.
    Fixed {},
    /// Rotation about an axis.
    Hinge {
        /// Direction of the axis in the world, at the initial poses of the bodies; of length 1 within 0.001.
        axis: [f64; 3],
        /// Least and largest angle (rad). The joint counts turns if one of them is half a turn or more.
        #[serde(default, deserialize_with = "limits_or_null", skip_serializing_if = "Option::is_none")]
        #[schemars(with = "Option<[Option<f64>; 2]>")]
        limits: Option<[f64; 2]>,
        /// A motor about the axis (rad/s, N m), instead of a spring.
        #[serde(skip_serializing_if = "Option::is_none")]
        motor: Option<MotorFile>,
        /// A spring about the axis (rad, N m).
        #[serde(skip_serializing_if = "Option::is_none")]
        spring: Option<SpringFile>,
    },
    /// Translation along an axis.
    Slider {
        /// Direction of the axis in the world, at the initial poses of the bodies; of length 1 within 0.001.
        axis: [f64; 3],
        /// Smallest and largest position (m); null for no limit on that side.
        #[serde(default, deserialize_with = "limits_or_null", skip_serializing_if = "Option::is_none")]
        #[schemars(with = "Option<[Option<f64>; 2]>")]
        limits: Option<[f64; 2]>,
        /// A motor along the axis (m/s, N), instead of a spring.
        #[serde(skip_serializing_if = "Option::is_none")]
        motor: Option<MotorFile>,
        /// A spring along the axis (m, N).
        #[serde(skip_serializing_if = "Option::is_none")]
        spring: Option<SpringFile>,
    },
    /// Only the distance of the anchors is restricted: a rope, a rod or a spring.
    Distance {
        /// Smallest and largest distance (m), equal for a rod; null for no limit on that side.
        #[serde(default, deserialize_with = "limits_or_null", skip_serializing_if = "Option::is_none")]
        #[schemars(with = "Option<[Option<f64>; 2]>")]
        limits: Option<[f64; 2]>,
        /// A winch (m/s, N), instead of a spring.
        #[serde(skip_serializing_if = "Option::is_none")]
        motor: Option<MotorFile>,
        /// A spring (m, N).
        #[serde(skip_serializing_if = "Option::is_none")]
        spring: Option<SpringFile>,
    },
    /// The angle between the axis on the first body and on the second is limited, in all directions alike. Nothing else
    /// is: a shoulder is a ball joint and a cone with the same anchor.
    Cone {
        /// Direction of the axis in the world, at the initial poses of the bodies; of length 1 within 0.001.
        axis: [f64; 3],
        /// Largest angle (rad), more than 0 and less than pi.
        angle: f64,
    },
    /// Each axis has its own settings.
    Generic {
        /// Rotation from the axes of the joint to the world, at the initial poses of the bodies: a quaternion x, y, z,
        /// w of length 1 within 0.001.
        #[serde(default = "defaults::rotation")]
        frame: [f64; 4],
        /// Rotations from the axes of the joint to the frame of each body, instead of `frame`; with one body, the
        /// second rotation is to the world. Angles are zero where both agree.
        #[serde(skip_serializing_if = "Option::is_none")]
        frames: Option<[[f64; 4]; 2]>,
        /// Translations along the three axes (m).
        linear: Box<[AxisFile; 3]>,
        /// Rotations about the three axes (rad).
        angular: Box<[AxisFile; 3]>,
    },
}

/// One axis of a generic joint; free by default.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields, default)]
#[schemars(title = "Axis")]
pub struct AxisFile {
    /// Whether the axis is held at zero; it then has no limits.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub locked: bool,
    /// Smallest and largest position (m) or angle (rad); null for no limit of a position on that side.
    #[serde(deserialize_with = "limits_or_null", skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<[Option<f64>; 2]>")]
    pub limits: Option<[f64; 2]>,
    /// A motor, instead of a spring.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor: Option<MotorFile>,
    /// A spring.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spring: Option<SpringFile>,
}

/// A motor of a joint.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Motor")]
pub struct MotorFile {
    /// The target speed (m/s, rad/s). 0 makes dry friction.
    pub speed: f64,
    /// The largest force or torque (N, N m).
    pub max_load: f64,
}

/// A spring and damper of a joint.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Spring")]
pub struct SpringFile {
    /// The rest position (m, rad).
    #[serde(default)]
    pub target: f64,
    /// Frequency of the moved mass without damping (Hz), more than 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency: Option<f64>,
    /// Damping ratio with a frequency: 0 is undamped, 1, the default, is critically damped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_ratio: Option<f64>,
    /// Force by distance, or torque by angle, instead of a frequency (N/m, N m/rad), more than 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Force by speed, or torque by angular speed, with a stiffness (N s/m, N m s/rad); 0 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping: Option<f64>,
    /// The largest force or torque (N, N m); unlimited by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_load: Option<f64>,
}

/// A body of the scene.
#[derive(Clone, Debug, Deserialize, JsonSchema, Serialize)]
#[serde(untagged, expecting = "a body is named by its index from 0 or by its name")]
pub enum BodyRef {
    /// Its index, counted from 0.
    Index(usize),
    /// Its name, which has to be unique.
    Name(String),
}

mod defaults {
    pub(super) fn enabled() -> bool {
        true
    }

    pub(super) fn gravity() -> [f64; 3] {
        [0.0, -9.81, 0.0]
    }

    pub(super) fn dt() -> f64 {
        1.0 / 60.0
    }

    pub(super) fn steps() -> u32 {
        600
    }

    pub(super) fn rotation() -> [f64; 4] {
        [0.0, 0.0, 0.0, 1.0]
    }
}
