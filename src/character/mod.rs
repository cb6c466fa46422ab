//! A character that walks: it slides along walls, climbs steps and slopes, stays on what moves, and pushes bodies.
//!
//! Each convex collider or triangle near the character gives one plane between the two. Planes separate: a motion that
//! stays on its side of every plane enters nothing, however long it is. So one piece of the motion is a convex problem,
//! the vector within the half-spaces that is nearest to the wanted one (`nearest.rs`). The planes are computed anew at
//! the end of a piece, until no motion is left. There are no casts, and no rule decides in which order walls count.
//! A motion deepens no overlap, and ends those that it can end.
//!
//! Three laws describe the legs:
//! - A contact carries the character if the surface has a normal within the limit of slopes there, and if it is not
//!   higher than a step above the feet. Steeper surfaces are walls for its walk. An edge has the normals of all faces
//!   that meet there, so it does not matter how a surface is cut into triangles and bodies.
//! - After a walk the feet go down by up to a step, until a surface carries them. So the character stays on stairs,
//!   slopes and edges.
//! - If something stops the walk, the character tries the same walk from a step higher up, and takes the path that ends
//!   nearer to its aim.

mod nearest;
mod surroundings;

use glam::Vec3;

use crate::config::check_step_length;
use crate::error::{Result, ensure, input};
use crate::queries::{Hit, Predicate};
use crate::saved::{Format, Saved};
use crate::simulation::Simulation;
use crate::world::{BodyHandle, BodyKind, MAX_SPEED, World};
use surroundings::{Footing, Glide, Surroundings, Touch};

/// A character that walks through a world. It moves a kinematic body, for example a capsule.
///
/// Before each step, [`Character::walk`] chooses the motion of that body for the step. The body does not rotate; the
/// caller may turn it between steps. The shapes of the body are convex. Lengths are relative to the body, so a
/// character of any size moves alike.
///
/// The character goes out of the way of kinematic bodies and stays on the body on which it stands, however that body
/// moves. It stops at other dynamic bodies and pushes them with a limited force. The same calls give the same bits for
/// any number of threads. The value is the whole state: a copy of it belongs to a snapshot of the simulation, and its
/// bytes ([`Character::save`]) to those of a saved run.
///
/// ```
/// use drystone::{Body, Character, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// world.insert(Body::fixed().shape(Shape::cuboid(0.5, 0.15, 2.0)).position(2.0, 0.15, 0.0).named("a step"));
/// let capsule = Body::kinematic().shape(Shape::capsule(0.6, 0.3)).position(0.0, 0.906, 0.0);
/// let mut character = Character::new(world.insert(capsule));
/// let mut simulation = Simulation::new(world)?;
/// for _ in 0..60 {
///     let movement = character.walk(&mut simulation, Vec3::X * 2.0, 1.0 / 60.0)?;
///     assert!(movement.ground.is_some());
///     simulation.step(1.0 / 60.0)?;
/// }
/// let body = simulation.world.body(character.body).expect("still there");
/// assert!((body.position - Vec3::new(2.0, 1.2, 0.0)).length() < 0.01, "{}", body.position);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Character {
    /// The kinematic body that it moves.
    pub body: BodyHandle,
    /// The direction away from the feet, of unit length; Y by default.
    pub up: Vec3,
    /// The steepest slope that carries it (rad), from 0 to a quarter turn; an eighth of a turn by default.
    pub steepest: f32,
    /// The highest step that it climbs, and the deepest step down that it takes without leaving the ground, relative to
    /// its height; 0.2 by default.
    pub step_height: f32,
    /// The distance that it keeps from everything, relative to the smallest half extent of its shapes; 0.02 by default.
    pub margin: f32,
    /// Its mass (kg), which weighs on dynamic bodies under it; 80 by default.
    pub mass: f32,
    /// The largest force with which it pushes a dynamic body (N), 0 or more; 400 by default.
    pub push_force: f32,
    /// Its velocity without its walk (m/s): that of the ground, or of its fall.
    drift: Vec3,
    ground: Option<Ground>,
}

/// The ground on which a character stands: see [`Movement::ground`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// The body.
    pub body: BodyHandle,
    /// Unit normal of the surface. At an edge it is the normal of the most level face.
    pub normal: Vec3,
    /// The velocity of the ground at the feet, including that of its surface (m/s).
    pub velocity: Vec3,
    /// The velocity of the surface relative to the body, as of a belt, in world axes (m/s): see
    /// [`Material::surface_velocity`](crate::Material::surface_velocity).
    pub surface_velocity: Vec3,
}

/// How a character moves in the next step: see [`Character::walk`].
///
/// ```
/// use drystone::{Body, Character, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
/// use drystone::character::{Ground, Movement};
///
/// let mut world = World::new();
/// let lift = Body::kinematic().shape(Shape::cuboid(2.0, 0.5, 2.0)).velocity(Vec3::Y, Vec3::ZERO);
/// let lift = world.insert(lift);
/// let ball = world.insert(Body::kinematic().shape(Shape::ball(0.5)).position(0.0, 1.01, 0.0));
/// let mut character = Character::new(ball);
/// let mut simulation = Simulation::new(world)?;
/// character.walk(&mut simulation, Vec3::ZERO, 0.1)?;
/// simulation.step(0.1)?;
/// let Movement { translation, ground, contacts } = character.walk(&mut simulation, Vec3::ZERO, 0.1)?;
/// let Some(Ground { body, normal, velocity, .. }) = ground else { panic!("it fell off") };
/// assert!(body == lift && (normal - Vec3::Y).length() < 1e-4 && (velocity - Vec3::Y).length() < 1e-4);
/// assert!((translation - 0.1 * Vec3::Y).length() < 1e-4 && contacts.len() == 1);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Movement {
    /// Its translation in the step (m).
    pub translation: Vec3,
    /// The ground at the end of the step, or `None` in the air and on slopes that are too steep.
    pub ground: Option<Ground>,
    /// The contacts at the end of the step, with kinematic bodies and the ground at their poses of that time, sorted by
    /// index.
    pub contacts: Vec<Hit>,
}

const CHARACTER: Format = Format { name: "a saved character", mark: *b"drywalks" };

crate::saved::fields!(Character { body, up, steepest, step_height, margin, mass, push_force, drift, ground });
crate::saved::fields!(Ground { body, normal, velocity, surface_velocity });

impl Character {
    /// A character that moves this kinematic body. It is in the air until its first step.
    pub fn new(body: BodyHandle) -> Self {
        Self {
            body,
            up: Vec3::Y,
            steepest: std::f32::consts::FRAC_PI_4,
            step_height: 0.2,
            margin: 0.02,
            mass: 80.0,
            push_force: 400.0,
            drift: Vec3::ZERO,
            ground: None,
        }
    }

    /// The character as bytes, for [`Self::load`], beside [`Simulation::save`]. They are the same on every machine.
    ///
    /// ```
    /// # use drystone::{Body, Character, Cpu, Shape, Simulation, World, glam::Vec3};
    /// # let mut world = World::new();
    /// # let mut character = Character::new(world.insert(Body::kinematic().shape(Shape::ball(0.5))));
    /// # let mut simulation = Simulation::new(world)?;
    /// character.launch(Vec3::Y * 5.0);
    /// character.walk(&mut simulation, Vec3::X, 1.0 / 60.0)?;
    /// simulation.step(1.0 / 60.0)?;
    /// let (run, walker) = (simulation.save(), character.save());
    /// let (mut again, mut other) = (Simulation::load(&run, Box::new(Cpu::new()))?, Character::load(&walker)?);
    /// let movement = character.walk(&mut simulation, Vec3::X, 1.0 / 60.0)?;
    /// assert_eq!(other.walk(&mut again, Vec3::X, 1.0 / 60.0)?, movement);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn save(&self) -> Vec<u8> {
        let mut own = *self;
        CHARACTER.seal(|writer| Saved::walk(&mut own, writer))
    }

    /// Loads a saved character.
    ///
    /// # Errors
    /// The bytes are not a saved character, have another version, or are damaged or cut short.
    pub fn load(bytes: &[u8]) -> Result<Self> {
        CHARACTER.open(bytes, |reader| {
            let mut character = Self::blank();
            Saved::walk(&mut character, reader)?;
            Ok(character)
        })
    }

    /// The ground after the last call of [`Character::walk`].
    pub fn ground(&self) -> Option<Ground> {
        self.ground
    }

    /// Leaves the ground with this velocity relative to it (m/s), for a jump. In the air, it adds the velocity to that
    /// of the fall.
    ///
    /// ```
    /// # use drystone::{Body, Character, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
    /// let mut world = World::new();
    /// let ball = world.insert(Body::kinematic().shape(Shape::ball(0.5)));
    /// let mut character = Character::new(ball);
    /// let mut simulation = Simulation::new(world)?;
    /// character.launch(Vec3::Y * 4.905);
    /// assert!(character.ground().is_none());
    /// for _ in 0..10 {
    ///     character.walk(&mut simulation, Vec3::X, 0.1)?;
    ///     simulation.step(0.1)?;
    /// }
    /// // After a second it is as high as before.
    /// let body = simulation.world.body(ball).expect("still there");
    /// assert!((body.position - Vec3::X).length() < 1e-4, "{}", body.position);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn launch(&mut self, velocity: Vec3) {
        self.ground = None;
        self.drift += velocity;
    }

    /// Chooses the motion of the body for a step of `dt` seconds: call it before [`Simulation::step`], after all other
    /// changes of the world. `velocity` (m/s) is that of the walk relative to the ground, or in the air relative to the
    /// ground that it left; its part along `up` is ignored. On a slope the walk follows the surface at the same speed.
    /// In the air the character falls by the gravity of its world.
    ///
    /// Each call looks at all bodies, like [`Simulation::queries`]. The character enters nothing at any speed.
    /// A kinematic body that moves by more than the smallest half extent of the character in one step can pass it.
    /// [`ContactHooks`](crate::ContactHooks) do not act on it: see [`Self::walk_among`].
    ///
    /// # Errors
    /// The body is gone, not kinematic, or without convex shapes; a setting, the velocity or `dt` is out of range. The
    /// world is then unchanged.
    pub fn walk(&mut self, simulation: &mut Simulation, velocity: Vec3, dt: f32) -> Result<Movement> {
        self.walk_by(simulation, velocity, dt, None)
    }

    /// The same as [`Self::walk`], but only bodies for which `only` returns true count, for example platforms that carry
    /// from above and let pass from below.
    ///
    /// ```
    /// use drystone::{Body, BodyHandle, Character, Shape, Simulation, World, glam::Vec3};
    ///
    /// // A platform 2 m above the feet of a character that jumps 3 m high.
    /// let mut world = World::new();
    /// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    /// let platform = world.insert(Body::fixed().shape(Shape::cuboid(2.0, 0.1, 2.0)).position(0.0, 1.9, 0.0));
    /// let body = world.insert(Body::kinematic().shape(Shape::capsule(0.6, 0.3)).position(0.0, 0.906, 0.0));
    /// let mut character = Character::new(body);
    /// let mut simulation = Simulation::new(world)?;
    /// character.launch(Vec3::Y * 7.67);
    /// for _ in 0..120 {
    ///     let feet = simulation.world.bodies[body].position.y - 0.9;
    ///     let counts = |other: BodyHandle, _: &Body| other != platform || feet > 2.0;
    ///     character.walk_among(&mut simulation, Vec3::ZERO, 1.0 / 60.0, &counts)?;
    ///     simulation.step(1.0 / 60.0)?;
    /// }
    /// assert_eq!(character.ground().map(|ground| ground.body), Some(platform));
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// As those of [`Self::walk`].
    pub fn walk_among(
        &mut self,
        simulation: &mut Simulation,
        velocity: Vec3,
        dt: f32,
        only: Predicate,
    ) -> Result<Movement> {
        self.walk_by(simulation, velocity, dt, Some(only))
    }

    fn walk_by(
        &mut self,
        simulation: &mut Simulation,
        velocity: Vec3,
        dt: f32,
        only: Option<Predicate>,
    ) -> Result<Movement> {
        check_step_length(dt)?;
        self.check(&simulation.world, velocity)?;
        let own = self.body.index();
        let (start, gravity) = {
            let world = &simulation.world;
            (world.bodies[own].position, world.gravity_of(world.bodies.worlds()[own] as usize))
        };
        let (walked, pushes) = {
            let queries = simulation.queries();
            let around =
                Surroundings::new(&simulation.world, &queries, self, self.ground.map(|ground| ground.body), only, dt);
            let walked = self.way(&around, start, velocity, gravity, dt);
            let pushes = self.pushes(&around, &walked, gravity, dt);
            (walked, pushes)
        };
        let Walked { glide: Glide { at, touches }, ground, drift, .. } = walked;
        (self.ground, self.drift) = (ground, drift);
        let body = &mut simulation.world.bodies[own];
        body.move_to(at, body.rotation, dt);
        for (body, force, point) in pushes {
            simulation.world.bodies[body.index()].apply_force_at(force, point);
        }
        let mut contacts: Vec<Hit> = touches.iter().filter(|touch| touch.is_near).map(|touch| touch.hit).collect();
        contacts.sort_by_key(|hit| (hit.body, hit.collider));
        Ok(Movement { translation: at - start, ground, contacts })
    }

    /// The way from `start` through the next step.
    fn way(&self, around: &Surroundings, start: Vec3, velocity: Vec3, gravity: Vec3, dt: f32) -> Walked {
        let walk = around.across(velocity);
        let Some(ground) = self.ground else {
            return self.fly(around, start, self.drift, (walk, gravity), dt);
        };
        // The ground carries it along, past all other obstacles.
        let carried = around.carried(start);
        let belt = ground.surface_velocity - ground.surface_velocity.dot(ground.normal) * ground.normal;
        let drift = carried / dt + belt;
        let from = if carried == Vec3::ZERO {
            start
        } else {
            around.beside(ground.body).glide(start, carried, Footing::Feet).at
        };
        // Along the surface, at the same speed.
        let along = walk - ground.normal.dot(walk) / ground.normal.dot(self.up) * self.up;
        let walk = along.normalize_or_zero() * walk.length();
        let by = (walk + belt) * dt;
        let plain = around.glide(from, by, Footing::Feet);
        let missed = |at: Vec3| around.across(from + by - at).length();
        let landed = around.lower(plain.at, around.step, Footing::Feet);
        let mut best = around.stands(&landed, Footing::Feet).map(|on| (landed, on));
        let miss = missed(plain.at);
        if miss > around.exact {
            let footing = Footing::Level(around.feet(from));
            let raised = around.glide(from, around.step * self.up, Footing::Feet).at;
            let over = around.glide(raised, by, footing).at;
            let landed = around.lower(over, around.step + (raised - from).dot(self.up), footing);
            if missed(landed.at) < miss - around.exact {
                best = around.stands(&landed, footing).map(|on| (landed, on)).or(best);
            }
        }
        let wanted = drift + walk;
        match best {
            Some((glide, on)) => {
                let ground = Some(Ground { velocity: drift, ..on });
                Walked { glide, ground, drift, wanted }
            }
            None => Walked { glide: plain, ground: None, drift: drift + walk.dot(self.up) * self.up, wanted },
        }
    }

    /// The way through the air.
    fn fly(&self, around: &Surroundings, from: Vec3, drift: Vec3, (walk, gravity): (Vec3, Vec3), dt: f32) -> Walked {
        let by = (drift + walk + 0.5 * dt * gravity) * dt;
        let falling = drift + gravity * dt;
        let glide = around.glide(from, by, Footing::Air);
        let landing = |touch: &Touch| touch.hit.normal.dot(falling - around.velocity_of(touch)) <= 0.0;
        let on = around.stands(&glide, Footing::Air).filter(|on| {
            glide.touches.iter().any(|touch| touch.is_near && touch.hit.body == on.body && landing(touch))
        });
        let drift = if on.is_some() { Vec3::ZERO } else { around.clipped(falling, &glide.touches) };
        let ground = on.map(|on| {
            let velocity = glide.touches.iter().find(|touch| touch.hit.body == on.body);
            Ground { velocity: velocity.map_or(Vec3::ZERO, |touch| around.velocity_of(touch)), ..on }
        });
        Walked { glide, ground, drift: ground.map_or(drift, |on| on.velocity), wanted: falling + walk }
    }

    /// The forces on dynamic bodies in the next step (N), with their points: the character's weight on the ground, and
    /// a push on the bodies that stop its walk.
    fn pushes(&self, around: &Surroundings, walked: &Walked, gravity: Vec3, dt: f32) -> Vec<(BodyHandle, Vec3, Vec3)> {
        let touching = || walked.glide.touches.iter().filter(|touch| touch.is_near);
        let carries = |touch: &&Touch| {
            walked.ground.is_some_and(|ground| ground.body == touch.hit.body) && touch.hit.normal.dot(self.up) > 0.0
        };
        let weight = touching().find(carries).and_then(|touch| {
            around.dynamic(touch.hit.body).map(|_| (touch.hit.body, self.mass * gravity, touch.hit.point))
        });
        let push = |touch: &Touch| {
            let Hit { body, point, normal, .. } = touch.hit;
            let other = around.dynamic(body)?;
            let approach = -normal.dot(walked.wanted - other.velocity_at(point));
            let arm = (point - other.center_of_mass()).cross(normal);
            let mobility = 1.0 / other.mass.mass + arm.dot(other.world_inverse_inertia() * arm);
            let force = (approach / (mobility * dt)).min(self.push_force);
            (force > 0.0).then_some((body, -force * normal, point))
        };
        weight.into_iter().chain(touching().filter(|touch| !carries(touch)).filter_map(push)).collect()
    }

    fn check(&self, world: &World, velocity: Vec3) -> Result<()> {
        let body = world.body(self.body).ok_or_else(|| input!("the body of the character was removed"))?;
        let name = world.name_of(self.body.index());
        ensure(body.kind == BodyKind::Kinematic, || format!("{name}: the body of a character must be kinematic"))?;
        let is_convex = body.solids().all(|collider| collider.shape.has_volume());
        let has_shapes = body.solids().next().is_some();
        ensure(has_shapes && is_convex, || {
            format!("{name}: the body of a character must have shapes, all of them convex")
        })?;
        body.check().map_err(|error| error.within(&name))?;
        ensure((self.up.length() - 1.0).abs() < 1e-3, || format!("up = {}: must have length 1", self.up))?;
        let within = |what: &str, value: f32, (least, most): (f32, f32)| {
            ensure((least..=most).contains(&value), || format!("{what} = {value}: must be {least} to {most}"))
        };
        within("steepest", self.steepest, (0.0, std::f32::consts::FRAC_PI_2))?;
        within("step_height", self.step_height, (0.0, 1.0))?;
        within("margin", self.margin, (1e-3, 1.0))?;
        within("mass", self.mass, (0.0, 1e15))?;
        within("push_force", self.push_force, (0.0, f32::MAX))?;
        let is_speed = [velocity, self.drift].iter().all(|v| v.abs().cmple(Vec3::splat(MAX_SPEED)).all());
        ensure(is_speed, || format!("velocity = {velocity}: must be at most {MAX_SPEED:e} in size"))
    }
}

/// The end of a way.
struct Walked {
    glide: Glide,
    ground: Option<Ground>,
    drift: Vec3,
    /// The velocity that it would have without obstacles (m/s).
    wanted: Vec3,
}
