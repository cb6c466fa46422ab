//! The game: tilts the board, steps the world, and knows when it is won or lost.

use glam::{Quat, Vec3};
use serde::Serialize;

use super::board::{BALL, BOARD, CELL, RADIUS, center_of, gap, scene};
use super::map::Map;
use super::script::{Script, TILT_LIMIT};
use drystone::{Backend, Result, Scene, Simulation, SolverConfig, World};

/// How fast the board tilts (degrees/s).
const TILT_RATE: f32 = 60.0;
/// Steps after which a ball on the floor rolls: a tenth of a second.
const SETTLED: u32 = 12;
/// The ball is on the floor if it is nearer than this, and off the walls if it is further from them than that (m). A board that
/// turns back throws the ball up by some micrometers.
const ON_FLOOR: f32 = 2e-6;
const OFF_WALLS: f32 = 2e-5;
/// The ball has arrived when its middle is this near to the goal's (m).
const ARRIVED: f32 = 0.4 * CELL;

/// How a game ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// The ball is at the goal: won.
    Goal,
    /// The ball fell into a hole: lost.
    Hole,
    /// The script ended before either.
    Time,
}

/// Speed of the ball's surface against the floor where they touch, while it rolls: it has touched nothing else for a tenth of
/// a second, in which friction ends what a wall began (m/s).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Slip {
    /// Root of the mean square.
    pub rms: f64,
    /// Largest.
    pub max: f64,
    /// Steps that were measured.
    pub steps: u32,
}

/// What moves the bodies of a game: drystone's [`Simulation`], or another engine that is compared with it.
pub trait Engine {
    /// What it is called.
    fn name(&self) -> String;
    /// The bodies as they are.
    fn world(&self) -> &World;
    /// The same, to write the velocities of the kinematic ones.
    fn world_mut(&mut self) -> &mut World;
    /// Moves them by `dt` seconds.
    fn step(&mut self, dt: f32) -> Result<()>;
}

impl Engine for Simulation {
    fn name(&self) -> String {
        self.backend().name().into()
    }

    fn world(&self) -> &World {
        &self.world
    }

    fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    fn step(&mut self, dt: f32) -> Result<()> {
        self.step(dt).map(|_| ())
    }
}

/// A game that is played.
pub struct Game {
    /// The board.
    pub map: Map,
    engine: Box<dyn Engine>,
    /// How it ended, if it did.
    pub outcome: Option<Outcome>,
    /// Tilts of the board now, to the right and to the front (degrees).
    pub tilt: [f32; 2],
    steps: u32,
    dt: f32,
    /// Steps for which the floor was all that the ball touched.
    rolled: u32,
    slips: (f64, f64, u32),
    deepest: f32,
}

impl Game {
    /// A game that has not begun.
    pub fn new(map: Map, config: SolverConfig, backend: Box<dyn Backend>) -> Result<Self> {
        Self::with(map, |scene| Ok(Box::new(Simulation::new(scene.world, config, backend)?)))
    }

    /// A game that has not begun, moved by the engine that `build` makes for its scene.
    pub fn with(map: Map, build: impl FnOnce(Scene) -> Result<Box<dyn Engine>>) -> Result<Self> {
        let scene = scene(&map)?;
        Ok(Self {
            map,
            outcome: None,
            tilt: [0.0; 2],
            steps: 0,
            dt: scene.dt,
            engine: build(scene)?,
            rolled: 0,
            slips: (0.0, 0.0, 0),
            deepest: 0.0,
        })
    }

    /// Board and ball: bodies [`BOARD`] and [`BALL`], and what else is seen.
    pub fn world(&self) -> &World {
        self.engine.world()
    }

    /// Seconds since the start.
    pub fn time(&self) -> f32 {
        self.steps as f32 * self.dt
    }

    /// Length of a step (s).
    pub fn dt(&self) -> f32 {
        self.dt
    }

    /// Where the ball is, on the board (m).
    pub fn ball(&self) -> Vec3 {
        let bodies = &self.world().bodies;
        bodies[BOARD].rotation.inverse() * bodies[BALL].position
    }

    /// Tilts the board towards `wanted` (right and front, degrees) and moves everything by one step, unless the game has ended.
    pub fn step(&mut self, wanted: [f32; 2]) -> Result<()> {
        if self.outcome.is_some() {
            return Ok(());
        }
        let reach = TILT_RATE * self.dt;
        for (tilt, wanted) in self.tilt.iter_mut().zip(wanted) {
            *tilt += (wanted.clamp(-TILT_LIMIT, TILT_LIMIT) - *tilt).clamp(-reach, reach);
        }
        let [right, front] = self.tilt.map(f32::to_radians);
        let rotation = Quat::from_rotation_x(front) * Quat::from_rotation_z(-right);
        for body in &mut self.engine.world_mut().bodies[..BALL] {
            body.move_to(Vec3::ZERO, rotation, self.dt);
        }
        self.engine.step(self.dt)?;
        self.steps += 1;
        self.measure();

        let ball = self.ball();
        let mut to_goal = ball - center_of(&self.map, self.map.goal);
        to_goal.y = 0.0;
        if ball.y < 0.0 {
            self.outcome = Some(Outcome::Hole);
        } else if to_goal.length() < ARRIVED {
            self.outcome = Some(Outcome::Goal);
        }
        Ok(())
    }

    /// Overlap, and slip while the floor is all that the ball touches: from poses and velocities alone, so that engines can be
    /// compared.
    fn measure(&mut self) {
        let gap = gap(&self.map, self.ball());
        self.deepest = self.deepest.max(-gap.floor.unwrap_or(0.0)).max(-gap.wall);
        let rolls = gap.floor.is_some_and(|floor| floor < ON_FLOOR) && gap.wall > OFF_WALLS;
        self.rolled = if rolls { self.rolled + 1 } else { 0 };
        if self.rolled > SETTLED {
            let bodies = &self.world().bodies;
            let (board, ball) = (&bodies[BOARD], &bodies[BALL]);
            let at = ball.position - RADIUS * (board.rotation * Vec3::Y);
            let slip = f64::from((ball.velocity_at(at) - board.velocity_at(at)).length());
            let (squares, max, steps) = &mut self.slips;
            *squares += slip * slip;
            *max = max.max(slip);
            *steps += 1;
        }
    }

    /// Slip so far.
    pub fn slip(&self) -> Slip {
        let (squares, max, steps) = self.slips;
        Slip { rms: (squares / f64::from(steps.max(1))).sqrt(), max, steps }
    }

    /// Deepest overlap with floor or walls at the end of any step so far (m).
    pub fn penetration(&self) -> f32 {
        self.deepest
    }
}

/// Where the ball was.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// Seconds since the start.
    pub time: f32,
    /// Place on the board: to the right, up, to the front of its middle (m).
    pub ball: [f32; 3],
}

/// A game as it went.
#[derive(Clone, Debug, Serialize)]
pub struct Played {
    /// Name of the board.
    pub board: String,
    /// What moved the bodies.
    pub engine: String,
    /// How it ended.
    pub outcome: Outcome,
    /// When it ended (s).
    pub time: f32,
    /// Steps until then.
    pub steps: u32,
    /// Deepest overlap (m).
    pub penetration: f32,
    /// Slip while rolling.
    pub slip: Slip,
    /// The ball's way, 20 samples a second.
    pub track: Vec<Sample>,
}

/// Steps between two samples of the track.
const SAMPLE: u32 = 6;
/// Samples of the track a second.
pub const SAMPLES: f64 = 20.0;

/// Plays `script` to its end, or until the game is won or lost. `game` has not begun; `watch` sees every sample of the track.
pub fn play(mut game: Game, script: &Script, mut watch: impl FnMut(&Game)) -> Result<Played> {
    let mut track = Vec::new();
    loop {
        let ended = game.outcome.is_some() || game.time() >= script.end();
        if game.steps.is_multiple_of(SAMPLE) || ended {
            track.push(Sample { time: game.time(), ball: game.ball().to_array() });
            watch(&game);
        }
        if ended {
            break;
        }
        game.step(script.at(game.time()))?;
    }
    Ok(Played {
        outcome: game.outcome.unwrap_or(Outcome::Time),
        time: game.time(),
        steps: game.steps,
        penetration: game.penetration(),
        slip: game.slip(),
        engine: game.engine.name(),
        board: game.map.name,
        track,
    })
}
