//! Joints of a scene file: what the file says, and from there to joints of the world.

use std::fmt;

use schemars::JsonSchema;
use serde::Deserialize;

use super::check;
use crate::error::{Error, Result};
use crate::world::{BallJoint, BodyKind, World};

/// A joint of a scene file.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
#[schemars(title = "Joint")]
#[non_exhaustive]
pub enum JointFile {
    /// Keeps a point of one body together with a point of another, or of the world. Needs an anchor or anchors.
    Ball {
        /// One body, which is tied to the world, or two; at least one of them dynamic.
        #[schemars(length(min = 1, max = 2))]
        bodies: Vec<BodyRef>,
        /// The point where the bodies are tied as they stand, in the world (m).
        anchor: Option<[f64; 3]>,
        /// The point in the frame of each body (m); with one body, the second is in the world.
        anchors: Option<[[f64; 3]; 2]>,
        /// Whether the two bodies still collide with each other.
        #[serde(default)]
        collide: bool,
    },
}

/// Which body of the scene.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a body is named by its index from 0 or by its name")]
pub enum BodyRef {
    /// Its index, counted from 0.
    Index(usize),
    /// Its name, which no other body may have.
    Name(String),
}

impl fmt::Display for BodyRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => write!(f, "{name:?}"),
        }
    }
}

impl BodyRef {
    /// The index of the body in `world`.
    fn find(&self, world: &World) -> Result<usize> {
        let count = world.bodies.len();
        match self {
            Self::Index(index) if *index < count => Ok(*index),
            Self::Index(index) => Err(Error::input(format!("body {index}: there are {count}, counted from 0"))),
            Self::Name(name) => {
                let mut named = (0..count).filter(|&i| world.bodies[i].name == *name);
                match (named.next(), named.next()) {
                    (Some(index), None) => Ok(index),
                    (None, _) => Err(Error::input(format!("body {name:?}: no body has that name"))),
                    (Some(a), Some(b)) => {
                        Err(Error::input(format!("body {name:?}: bodies {a} and {b} have that name; give an index")))
                    }
                }
            }
        }
    }
}

/// The joint that `file` describes, between bodies of `world`.
pub(super) fn joint(file: &JointFile, world: &World) -> Result<BallJoint> {
    let JointFile::Ball { bodies, anchor, anchors, collide } = file;
    let (a, b) = match &bodies[..] {
        [a] => (a.find(world)?, None),
        [a, b] => (a.find(world)?, Some(b.find(world)?)),
        _ => return Err(Error::input(format!("{} bodies: a joint ties one or two", bodies.len()))),
    };
    if b == Some(a) {
        return Err(Error::input(format!("bodies {} and {}: the same body twice", bodies[0], bodies[1])));
    }
    let dynamic = |i: usize| world.bodies[i].kind == BodyKind::Dynamic;
    if !dynamic(a) && !b.is_some_and(dynamic) {
        return Err(Error::input("nothing that it ties can be moved: one of the bodies must be dynamic"));
    }
    let (anchor_a, anchor_b) = match (anchor, anchors) {
        (Some(point), None) => {
            let point = check::lengths("anchor", *point)?.into();
            let in_frame = |i: usize| world.bodies[i].rotation.inverse() * (point - world.bodies[i].position);
            (in_frame(a), b.map_or(point, in_frame))
        }
        (None, Some([on_a, on_b])) => {
            (check::lengths("anchors[0]", *on_a)?.into(), check::lengths("anchors[1]", *on_b)?.into())
        }
        _ => return Err(Error::input("anchor and anchors: give one of them")),
    };
    Ok(BallJoint { body_a: a, body_b: b, anchor_a, anchor_b, collide: *collide })
}
