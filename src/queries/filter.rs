//! Filters: which bodies a query considers.

use crate::world::{Body, BodyHandle, Groups};

/// Decides whether a query considers a body.
pub type Predicate<'a> = &'a dyn Fn(BodyHandle, &Body) -> bool;

/// Selects the bodies that a query considers. The default is every body of the first world.
///
/// ```
/// use drystone::queries::{Filter, Queries};
/// use drystone::{Body, BodyKind, Shape, World, glam::Vec3};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::ball(2.0)));
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
    /// The groups of the query. It ignores bodies that do not collide with these groups.
    pub groups: Groups,
    /// The number of the world, if several stand [beside](crate::World::beside) each other.
    pub world: usize,
    /// A body to ignore.
    pub except: Option<BodyHandle>,
    /// Ignores the bodies for which this function returns false.
    pub only: Option<Predicate<'a>>,
    /// Whether the query considers sensors; false by default.
    pub sensors: bool,
}

impl<'a> Filter<'a> {
    /// Queries with these groups.
    pub fn groups(self, groups: Groups) -> Self {
        Self { groups, ..self }
    }

    /// Queries one of several worlds that stand [beside](crate::World::beside) each other.
    pub fn world(self, world: usize) -> Self {
        Self { world, ..self }
    }

    /// Ignores a body, for example the one that casts the ray. A handle that names no body of this world has no effect.
    pub fn except(self, body: BodyHandle) -> Self {
        Self { except: Some(body), ..self }
    }

    /// Considers sensors too.
    pub fn with_sensors(self) -> Self {
        Self { sensors: true, ..self }
    }

    /// Considers only the bodies for which `only` returns true.
    pub fn only(self, only: Predicate<'a>) -> Self {
        Self { only: Some(only), ..self }
    }

    /// Whether the query considers a body of its world.
    pub(super) fn accepts(&self, handle: BodyHandle, body: &Body) -> bool {
        !self.except.is_some_and(|except| except.is(handle))
            && self.groups.meets(body.groups)
            && self.only.is_none_or(|only| only(handle, body))
    }
}
