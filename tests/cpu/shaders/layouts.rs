//! The rows in memory and in WGSL have the same layout.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::offset_of;

use super::parsed;
use drystone::stages::backend::shader::{JOINT_BLOCK, JOINT_NODE, ResidentParams, SCRATCH_ROW, WrittenContact};
use drystone::stages::problem::{
    AxisRow, BodyRow, ContactRow, ConvergenceRow, DampingRow, FreeRow, ImpulseRow, InertiaRow, JointImpulseRow,
    JointRow, MassRow, MomentumRow, Params, PassRow, PointRow, Softness, TorqueRow, TurningRow,
};
use drystone::stages::problem::{Preload, Written};

const TYPES: &str = include_str!("../../../shaders/lib/types.wgsl");

/// Size of a struct, and offset of each of its fields.
#[derive(Debug, PartialEq)]
struct Layout {
    size: usize,
    fields: BTreeMap<String, usize>,
}

macro_rules! layouts {
    (@offset $row:ident $field:ident) => { offset_of!($row, $field) };
    (@offset $row:ident $field:ident $outer:ident $inner:ident) => { offset_of!($row, $outer.$inner) };
    ($($twin:ident = $row:ident { $($field:ident $(: $outer:ident . $inner:ident)?)* })*) => {
        BTreeMap::from([$((
            stringify!($twin).to_owned(),
            Layout {
                size: size_of::<$row>(),
                fields: BTreeMap::from([$((stringify!($field).to_owned(), layouts!(@offset $row $field $($outer $inner)?))),*]),
            },
        )),*])
    };
}

/// Stays on the device: Rust knows only how long it is.
#[repr(C)]
struct ImpulseStep {
    before: [f32; 4],
    begin: [f32; 4],
}
/// These, too.
#[repr(C)]
struct JointNode {
    along: [[f32; 4]; 3],
    about_a: [[f32; 4]; 3],
    about_b: [[f32; 4]; 3],
    turn_a: [[f32; 4]; 3],
    turn_b: [[f32; 4]; 3],
    right: [f32; 3],
    softness: f32,
    mass_a: f32,
    mass_b: f32,
    locks_a: f32,
    locks_b: f32,
}
#[repr(C)]
struct JointBlock {
    lower: [[f32; 4]; 3],
    upper: [[f32; 4]; 3],
}
const _: () = assert!(size_of::<JointNode>() == JOINT_NODE && size_of::<JointBlock>() == JOINT_BLOCK);
const _: () = assert!(size_of::<FreeRow>() == SCRATCH_ROW && size_of::<ImpulseStep>() == SCRATCH_ROW);

/// The layout of each row, under the name of its twin.
fn in_rust() -> BTreeMap<String, Layout> {
    layouts! {
        Body = BodyRow { v w dp time dq }
        Free = FreeRow { v w }
        Mass = MassRow { inv_inertia_x inv_mass inv_inertia_yz locks acceleration }
        Torque = TorqueRow { angular_acceleration }
        Damping = DampingRow { linear_gain linear_loss angular_gain angular_loss }
        Inertia = InertiaRow { principal body inv_principal frame }
        Contact = ContactRow {
            normal friction tangent restitution body_a body_b first_point point_count radius_a radius_b
            preload substep_share
        }
        Point = PointRow { r_a separation r_b normal_mass tangent_mass pull slip_1 slip_2 }
        Joint = JointRow { r_a body_a r_b body_b gap is_loose first_axis axis_count frame_a frame_b }
        Axis = AxisRow {
            direction coordinate gap left speed max_impulse rate mass_scale impulse_scale start
        }
        JointImpulse = JointImpulseRow { linear }
        JointNode = JointNode { along about_a about_b turn_a turn_b right softness mass_a mass_b locks_a locks_b }
        JointBlock = JointBlock { lower upper }
        Turning = TurningRow { inv_inertia_x body inv_inertia_yz }
        Convergence = ConvergenceRow { moving done sweeps planned }
        ImpulseStep = ImpulseStep { before begin }
        Momentum = MomentumRow { t factor square restarts }
        Impulse = ImpulseRow { normal tangent_1 tangent_2 bounce }
        Softness = Softness { bias_rate mass_scale impulse_scale push_limit }
        Params = Params {
            restitution_threshold slop relaxation tolerance body_count point_count joint_count patches
            axis_count zero
        }
        PassRow = PassRow {
            first end substep: substep.length inverse_substep: substep.inverse_length
            movable: substep.movable fixed: substep.fixed joint: substep.joint
        }
        Preload = Preload { movable_compliance fixed_compliance share warm_start }
        ResidentParams = ResidentParams {
            preload body_count contact_count order written_count has_points tangents zero
        }
        Written = Written { row points_before }
        WrittenContact = WrittenContact {
            normal friction restitution radius_a radius_b substep_share body_a body_b point_count
        }
    }
}

/// The layout of each struct of `types`.
fn in_wgsl(types: &str) -> BTreeMap<String, Layout> {
    let module = parsed(types);
    let structs = module.types.iter().filter_map(|(_, t)| match &t.inner {
        naga::TypeInner::Struct { members, span } => Some((t.name.clone()?, members, *span)),
        _ => None,
    });
    let field = |m: &naga::StructMember| (m.name.clone().expect("a field has a name"), m.offset as usize);
    structs
        .map(|(name, members, span)| {
            (name, Layout { size: span as usize, fields: members.iter().map(field).collect() })
        })
        .collect()
}

/// Names of the structs whose two layouts differ. A uniform may be larger in Rust: it stands in no array.
fn differing(types: &str) -> Vec<String> {
    let (ours, theirs) = (in_rust(), in_wgsl(types));
    let names: BTreeSet<_> = ours.keys().chain(theirs.keys()).collect();
    let agree = |name: &str| match (ours.get(name), theirs.get(name)) {
        (Some(a), Some(b)) if name.ends_with("Params") => a.fields == b.fields && a.size >= b.size,
        (a, b) => a == b,
    };
    names.into_iter().filter(|name| !agree(name)).cloned().collect()
}

#[test]
fn every_row_has_the_layout_of_its_twin() {
    assert_eq!(differing(TYPES), [""; 0]);
}

#[test]
fn a_changed_twin_is_found() {
    for (before, after, name) in [
        ("v: vec3f, w: vec3f", "w: vec3f, v: vec3f", "Body"),
        ("first_point: u32, point_count: u32", "point_count: u32, first_point: u32", "Contact"),
        ("bounce: f32 }", "bounce: f32, more: f32 }", "Impulse"),
        ("push_limit: f32", "limit: f32", "Softness"),
        ("struct PassRow", "struct Row", "Row"),
    ] {
        let changed = TYPES.replace(before, after);
        assert_ne!(changed, TYPES, "{before} is not in the text");
        assert!(differing(&changed).iter().any(|n| n == name), "{after}");
    }
}
