//! Numbers, shapes, bodies and joints from bytes, both valid and invalid.

use arbitrary::{Arbitrary, Result, Unstructured};
use drystone::glam::{Quat, Vec3};
use drystone::{Axis, Body, BodyHandle, BodyKind, Groups, Joint, MassProperties, Material, Shape};

use crate::good;

/// Usually an ordinary size, sometimes a value that causes errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number(pub f32);

const EDGES: [f32; 18] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-3,
    1e-6,
    1e-12,
    1e-30,
    1e-40,
    1e3,
    1e6,
    1e9,
    1e15,
    1e30,
    f32::MAX,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

impl<'a> Arbitrary<'a> for Number {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(Self(match u.arbitrary::<u8>()? {
            0 => f32::from_bits(u.arbitrary()?),
            1..=3 => *u.choose(&EDGES)?,
            _ => f32::from(u.arbitrary::<i16>()?) / 4096.0,
        }))
    }
}

/// Usually from 0.01 to 1.3 m.
#[derive(Clone, Copy, Debug)]
pub struct Size(pub f32);

impl<'a> Arbitrary<'a> for Size {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(Self(match u.arbitrary::<u8>()? {
            0..=2 => Number::arbitrary(u)?.0,
            k => f32::from(k) / 200.0,
        }))
    }
}

#[derive(Arbitrary, Clone, Copy, Debug)]
pub struct Vector([Number; 3]);

impl Vector {
    pub fn vec(self) -> Vec3 {
        Vec3::from_array(self.0.map(|number| number.0))
    }
}

/// Usually of unit length.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub struct Turn {
    q: [i8; 4],
    raw: Option<[Number; 4]>,
}

impl Turn {
    pub fn quat(self) -> Quat {
        let q = Quat::from_array(self.q.map(f32::from));
        match self.raw {
            Some(raw) if self.q[0] == 77 => Quat::from_array(raw.map(|number| number.0)),
            _ if q.length_squared() > 0.0 => q.normalize(),
            _ => Quat::IDENTITY,
        }
    }
}

#[derive(Arbitrary, Clone, Debug)]
pub enum AnyShape {
    Ball(Size),
    Cuboid([Size; 3]),
    Capsule(Size, Size),
    Cylinder(Size, Size),
    Cone(Size, Size),
    Hull(Vec<[i8; 3]>, Size),
    Points(Vec<Vector>),
    HalfSpace(Vector),
    Up,
    Mesh(Vec<[i8; 3]>, Vec<[u8; 3]>, Size),
    Vertices(Vec<Vector>, Vec<[u8; 3]>),
    Field(Vec<i8>, u8, Vector),
}

impl AnyShape {
    pub fn shape(&self) -> Option<Shape> {
        let on_grid = |points: &[[i8; 3]], size: &Size| -> Vec<Vec3> {
            points.iter().take(24).map(|p| Vec3::from_array(p.map(|x| f32::from(x) / 64.0 * size.0))).collect()
        };
        let corners = |points: usize, triangles: &[[u8; 3]]| -> Vec<[u32; 3]> {
            // Usually vertices that exist.
            let corner = |k: u8| if k == 255 { 255 } else { u32::from(k) % points.max(1) as u32 };
            triangles.iter().take(24).map(|t| t.map(corner)).collect()
        };
        let vectors = |points: &[Vector]| -> Vec<Vec3> { points.iter().take(24).map(|p| p.vec()).collect() };
        Some(match self {
            Self::Ball(r) => Shape::ball(r.0),
            Self::Cuboid([x, y, z]) => Shape::cuboid(x.0, y.0, z.0),
            Self::Capsule(h, r) => Shape::capsule(h.0, r.0),
            Self::Cylinder(h, r) => Shape::cylinder(h.0, r.0),
            Self::Cone(h, r) => Shape::cone(h.0, r.0),
            Self::Hull(points, size) => return good(Shape::convex_hull(&on_grid(points, size))),
            Self::Points(points) => return good(Shape::convex_hull(&vectors(points))),
            Self::HalfSpace(normal) => Shape::half_space(normal.vec()),
            Self::Up => Shape::half_space(Vec3::Y),
            Self::Mesh(points, triangles, size) => {
                let points = on_grid(points, size);
                let triangles = corners(points.len(), triangles);
                return good(Shape::mesh(points, triangles));
            }
            Self::Vertices(points, triangles) => {
                let points = vectors(points);
                let triangles = corners(points.len(), triangles);
                return good(Shape::mesh(points, triangles));
            }
            Self::Field(heights, columns, scale) => {
                let columns = usize::from(columns % 7) + 1;
                let heights: Vec<Vec<f32>> = heights[..heights.len().min(48)]
                    .chunks(columns)
                    .map(|row| row.iter().map(|&h| f32::from(h) / 128.0).collect())
                    .collect();
                return good(Shape::height_field(&heights, scale.vec()));
            }
        })
    }
}

#[derive(Arbitrary, Clone, Copy, Debug)]
pub enum Kind {
    Dynamic,
    Fixed,
    Kinematic,
    Falling,
}

impl Kind {
    pub fn kind(self) -> BodyKind {
        match self {
            Self::Dynamic | Self::Falling => BodyKind::Dynamic,
            Self::Fixed => BodyKind::Fixed,
            Self::Kinematic => BodyKind::Kinematic,
        }
    }
}

#[derive(Arbitrary, Clone, Debug)]
pub struct AnyBody {
    kind: Kind,
    shape: AnyShape,
    second: Option<(AnyShape, Vector, Turn, bool)>,
    place: [i8; 3],
    at: Option<Vector>,
    turn: Turn,
    velocity: Option<(Vector, Vector)>,
    material: Option<(Number, Number)>,
    mass: Option<AnyMass>,
    groups: Option<(u8, u8)>,
    gravity_scale: Option<Number>,
    damping: Option<(Number, Number)>,
    locked: Option<([bool; 3], bool)>,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
pub enum AnyMass {
    Density(Number),
    Total(Number),
    Whole(Number, Vector, Vector, Turn),
}

impl AnyMass {
    pub fn onto(self, body: Body) -> Body {
        match self {
            Self::Density(density) => body.density(density.0),
            Self::Total(mass) => body.total_mass(mass.0),
            Self::Whole(mass, inertia, center, frame) => body.mass_properties(MassProperties {
                mass: mass.0,
                principal_inertia: inertia.vec(),
                center: center.vec(),
                principal_frame: frame.quat(),
            }),
        }
    }
}

impl AnyBody {
    pub fn body(&self) -> Body {
        let mut body = Body::dynamic();
        body.kind = self.kind.kind();
        if let Some(shape) = self.shape.shape() {
            body = body.shape(shape);
        }
        if let Some((shape, at, turn, is_sensor)) = &self.second
            && let Some(shape) = shape.shape()
        {
            body = match is_sensor {
                true => body.sensor_at(shape, at.vec(), turn.quat()),
                false => body.shape_at(shape, at.vec(), turn.quat()),
            };
        }
        let at = self.at.map_or_else(|| Vec3::from_array(self.place.map(|x| f32::from(x) / 32.0)), Vector::vec);
        body = body.position(at.x, at.y, at.z).rotation(self.turn.quat());
        if let Some((linear, angular)) = self.velocity {
            body = body.velocity(linear.vec(), angular.vec());
        }
        if let Some((friction, restitution)) = self.material {
            body.material = Material { friction: friction.0, restitution: restitution.0, ..Material::default() };
        }
        if let Some(mass) = self.mass {
            body = mass.onto(body);
        }
        if let Some((membership, filter)) = self.groups {
            body = body.groups(Groups { membership: membership.into(), filter: filter.into() });
        }
        if let Some(scale) = self.gravity_scale {
            body = body.gravity_scale(scale.0);
        }
        if let Some((linear, angular)) = self.damping {
            body = body.linear_damping(linear.0).angular_damping(angular.0);
        }
        if let Some((axes, can_sleep)) = self.locked {
            body = body.locked_rotations(axes).can_sleep(can_sleep);
        }
        body
    }
}

#[derive(Arbitrary, Clone, Copy, Debug)]
pub enum AnyAxis {
    Free,
    Locked,
    Limited(Number, Number),
    Motor(Number, Number),
    Spring(Number, Number, Number, Number),
}

impl AnyAxis {
    fn axis(self) -> Axis {
        match self {
            Self::Free => Axis::FREE,
            Self::Locked => Axis::LOCKED,
            Self::Limited(min, max) => Axis::limited(min.0, max.0),
            Self::Motor(speed, most) => Axis::FREE.motor(speed.0, most.0),
            Self::Spring(target, frequency, damping, most) => {
                Axis::FREE.spring(target.0, frequency.0, damping.0, most.0)
            }
        }
    }
}

#[derive(Arbitrary, Clone, Debug)]
pub struct AnyJoint {
    pub bodies: [u8; 2],
    anchors: [Vector; 2],
    kind: AnyJointKind,
    breaks: Option<Number>,
    collides: bool,
}

#[derive(Arbitrary, Clone, Debug)]
enum AnyJointKind {
    Ball,
    Hinge(Vector, Option<(Number, Number)>),
    Slider(Vector, Option<(Number, Number)>),
    Fixed,
    Rope(Number),
    Rod(Number),
    Elastic(Number, Number, Number),
    Generic([AnyAxis; 3], [AnyAxis; 3], Turn, Turn),
}

impl AnyJoint {
    /// A joint between two bodies, or to the world if `b` is `None`.
    pub fn joint(&self, a: BodyHandle, b: Option<BodyHandle>) -> Joint {
        let [anchor_a, anchor_b] = self.anchors.map(Vector::vec);
        let joint = match b {
            Some(b) => Joint::new(a, anchor_a, b, anchor_b),
            None => Joint::to_world(a, anchor_a, anchor_b),
        };
        let limited = |joint: Joint, limits: &Option<(Number, Number)>| match limits {
            Some((min, max)) => joint.limited(min.0, max.0),
            None => joint,
        };
        let mut joint = match &self.kind {
            AnyJointKind::Ball => joint,
            AnyJointKind::Hinge(along, limits) => limited(joint.hinge(along.vec()), limits),
            AnyJointKind::Slider(along, limits) => limited(joint.slider(along.vec()), limits),
            AnyJointKind::Fixed => joint.fixed(),
            AnyJointKind::Rope(length) => joint.rope(length.0),
            AnyJointKind::Rod(length) => joint.rod(length.0),
            AnyJointKind::Elastic(length, frequency, damping) => joint.elastic(length.0, frequency.0, damping.0),
            AnyJointKind::Generic(linear, angular, a, b) => {
                joint.generic(linear.map(AnyAxis::axis), angular.map(AnyAxis::axis)).zero_at(a.quat(), b.quat())
            }
        };
        if let Some(force) = self.breaks {
            joint = joint.breaking_at(force.0);
        }
        if self.collides { joint.colliding() } else { joint }
    }
}
