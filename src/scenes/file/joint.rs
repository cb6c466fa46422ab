//! From a joint of a scene file to a joint of the world.

use std::fmt;

use super::numbers::lengths;
use super::schema::{BodyRef, JointFile};
use crate::error::{Error, Result, ensure, input};
use crate::world::{BodyKind, Joint, World};

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
            Self::Index(index) => Err(input!("body {index}: there are {count}, counted from 0")),
            Self::Name(name) => {
                let mut named = (0..count).filter(|&i| world.bodies[i].name == *name);
                match (named.next(), named.next()) {
                    (Some(index), None) => Ok(index),
                    (None, _) => Err(input!("body {name:?}: no body has that name")),
                    (Some(a), Some(b)) => {
                        Err(input!("body {name:?}: bodies {a} and {b} have that name; give an index"))
                    }
                }
            }
        }
    }
}

/// The joint that `file` describes, between bodies of `world`.
pub(super) fn joint(file: &JointFile, world: &World) -> Result<Joint> {
    let JointFile::Ball { bodies, anchor, anchors, collide } = file;
    let (a, b) = match &bodies[..] {
        [a] => (a.find(world)?, None),
        [a, b] => (a.find(world)?, Some(b.find(world)?)),
        _ => return Err(input!("{} bodies: a joint ties one or two", bodies.len())),
    };
    ensure(b != Some(a), || format!("bodies {} and {}: the same body twice", bodies[0], bodies[1]))?;
    let dynamic = |i: usize| world.bodies[i].kind == BodyKind::Dynamic;
    let message = "nothing that it ties can be moved: one of the bodies must be dynamic";
    ensure(dynamic(a) || b.is_some_and(dynamic), || message.into())?;
    let (anchor_a, anchor_b) = match (anchor, anchors) {
        (Some(point), None) => {
            let point = lengths("anchor", *point)?.into();
            let in_frame = |i: usize| world.bodies[i].rotation.inverse() * (point - world.bodies[i].position);
            (in_frame(a), b.map_or(point, in_frame))
        }
        (None, Some([on_a, on_b])) => (lengths("anchors[0]", *on_a)?.into(), lengths("anchors[1]", *on_b)?.into()),
        _ => return Err(Error::input("anchor and anchors: give one of them")),
    };
    Ok(Joint { body_b: b, collide: *collide, ..Joint::to_world(a, anchor_a, anchor_b) })
}
