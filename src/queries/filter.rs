//! Which bodies a query looks at.

use crate::world::{Body, BodyHandle, Groups};

/// Whether a query looks at a body.
pub type Predicate<'a> = &'a dyn Fn(BodyHandle, &Body) -> bool;

/// Which bodies a query looks at: all of the first world, unless told otherwise.
///
/// ```
/// use drystone::queries::{Filter, Queries};
/// use drystone::{Body, BodyKind, Shape, World, glam::Vec3};
///
/// let mut world = World::new();
/// world.add(Body::fixed().shape(Shape::ball(2.0)));
/// let small = world.insert(Body::dynamic().shape(Shape::ball(1.0)));
/// let is_dynamic = |_, body: &Body| body.kind == BodyKind::Dynamic;
/// let found = Queries::of(&world).point(Vec3::ZERO, &Filter::default().only(&is_dynamic));
/// assert_eq!(found, [(small, 0)]);
/// ```
///
/// ```
/// use drystone::{Body, Groups, Shape, World, glam::Vec3, queries::{Filter, Queries}};
///
/// let mut world = World::new();
/// let group = |bit: u32| Groups { membership: bit, filter: u32::MAX };
/// let wall = world.insert(Body::fixed().shape(Shape::ball(1.0)).groups(group(0b01)));
/// let zone = world.insert(Body::fixed().sensor(Shape::ball(1.0)).groups(group(0b10)));
/// let queries = Queries::of(&world);
/// let found = |filter: Filter| queries.point(Vec3::ZERO, &filter).iter().map(|found| found.0).collect::<Vec<_>>();
/// assert_eq!(found(Filter::default()), [wall]);
/// assert_eq!(found(Filter::default().with_sensors()), [wall, zone]);
/// assert_eq!(found(Filter::default().with_sensors().except(wall)), [zone]);
/// assert_eq!(found(Filter::default().groups(Groups { membership: !0, filter: 0b10 })), []);
/// assert_eq!(found(Filter::default().world(1)), []);
/// ```
#[derive(Clone, Copy, Default)]
pub struct Filter<'a> {
    /// The groups of what asks: bodies that it would not meet are left out.
    pub groups: Groups,
    /// The number of the world, of several [beside](crate::World::beside) each other.
    pub world: usize,
    /// A body to leave out.
    pub except: Option<BodyHandle>,
    /// Leaves out the bodies for which it is false.
    pub only: Option<Predicate<'a>>,
    /// Whether the query looks at sensors too; not unless told.
    pub sensors: bool,
}

impl<'a> Filter<'a> {
    /// Asks as a member of groups.
    pub fn groups(self, groups: Groups) -> Self {
        Self { groups, ..self }
    }

    /// Asks about one of several worlds [beside](crate::World::beside) each other.
    pub fn world(self, world: usize) -> Self {
        Self { world, ..self }
    }

    /// Leaves out a body, for instance the one that asks. A body that is gone or of another world leaves out none.
    pub fn except(self, body: BodyHandle) -> Self {
        Self { except: Some(body), ..self }
    }

    /// Looks at sensors too.
    pub fn with_sensors(self) -> Self {
        Self { sensors: true, ..self }
    }

    /// Leaves out the bodies for which `only` is false.
    pub fn only(self, only: Predicate<'a>) -> Self {
        Self { only: Some(only), ..self }
    }

    /// Whether the query looks at a body of its world.
    pub(super) fn accepts(&self, handle: BodyHandle, body: &Body) -> bool {
        !self.except.is_some_and(|except| except.is(handle))
            && self.groups.meets(body.groups)
            && self.only.is_none_or(|only| only(handle, body))
    }
}
