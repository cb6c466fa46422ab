//! The game: tilts the board, steps the world, and decides whether the game is won or lost.

use glam::{Quat, Vec3};
use serde::Serialize;

use crate::board::{BALL, BOARD, CELL, RADIUS, center_of, gap, scene};
use crate::map::Map;
use crate::script::{Script, TILT_LIMIT};
use drystone::{Backend, Result, Simulation, SolverConfig, World};
use drystone_scenes::Scene;

/// Rate of the tilt (degrees/s).
const TILT_RATE: f32 = 60.0;
/// Number of steps with contact only to the floor after which the ball counts as rolling: a tenth of a second.
const SETTLED: u32 = 12;
/// Largest distance from the floor for a ball on the floor (m). A board that turns back lifts the ball by some
/// micrometers.
const ON_FLOOR: f32 = 2e-6;
/// Smallest distance of a free ball from the walls (m).
const OFF_WALLS: f32 = 2e-5;
/// Largest distance between the centers of ball and goal for a win (m).
const ARRIVED: f32 = 0.4 * CELL;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// Won: the ball is at the goal.
    Goal,
    /// Lost: the ball fell into a hole.
    Hole,
    /// The script ended first.
    Time,
}

/// Slip of the rolling ball: the relative speed of ball and floor at their contact (m/s), over the given number of
/// steps. The ball counts as rolling if it touched nothing else for a tenth of a second: in that time friction ends the
/// slip after a wall contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Slip {
    pub rms: f64,
    pub max: f64,
    pub steps: u32,
}

/// The engine of a game: drystone's [`Simulation`], or another one for comparison.
pub trait Engine {
    fn name(&self) -> String;
    fn world(&self) -> &World;
    /// The game sets the velocities of kinematic bodies.
    fn world_mut(&mut self) -> &mut World;
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

pub struct Game {
    pub map: Map,
    engine: Box<dyn Engine>,
    /// `None` while the game runs.
    pub outcome: Option<Outcome>,
    /// Tilts of the board to the right and to the front (degrees).
    pub tilt: [f32; 2],
    steps: u32,
    dt: f32,
    /// Number of steps since the ball last touched anything but the floor.
    rolled: u32,
    slip: Slip,
    /// Sum of the squares of the slip (m²/s²).
    squares: f64,
    /// Deepest overlap with floor or walls at the end of a step (m).
    deepest: f32,
}

impl Game {
    pub fn new(map: Map, config: SolverConfig, backend: Box<dyn Backend>) -> Result<Self> {
        Self::with(map, |scene| Ok(Box::new(Simulation::with(scene.world, config, backend)?)))
    }

    /// A game with the engine that `build` makes for its scene.
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
            slip: Slip::default(),
            squares: 0.0,
            deepest: 0.0,
        })
    }

    /// Its bodies are named `board`, `goal`, `walls` and `ball`.
    pub fn world(&self) -> &World {
        self.engine.world()
    }

    /// Time since the start (s).
    pub fn time(&self) -> f32 {
        self.steps as f32 * self.dt
    }

    /// Length of a step (s).
    pub fn dt(&self) -> f32 {
        self.dt
    }

    /// Position of the ball in the frame of the board (m).
    pub fn ball(&self) -> Vec3 {
        let bodies = &self.world().bodies;
        bodies[BOARD].rotation.inverse() * bodies[BALL].position
    }

    /// Tilts the board towards `wanted` (right and front, degrees) and makes one step. It does nothing after the end of
    /// the game.
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
        for body in self.engine.world_mut().bodies.iter_mut().take(BALL) {
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

    /// Measures overlap and slip only from poses and velocities, so that engines can be compared.
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
            self.squares += slip * slip;
            let steps = self.slip.steps + 1;
            self.slip = Slip { rms: (self.squares / f64::from(steps)).sqrt(), max: self.slip.max.max(slip), steps };
        }
    }
}

/// Position of the ball on the board at a time (s): to the right, up and to the front of the center (m).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    pub time: f32,
    pub ball: [f32; 3],
}

#[derive(Clone, Debug, Serialize)]
pub struct Played {
    pub board: String,
    pub engine: String,
    pub outcome: Outcome,
    pub time: f32,
    pub steps: u32,
    /// Deepest overlap (m).
    pub penetration: f32,
    pub slip: Slip,
    /// Positions of the ball, 20 per second.
    pub track: Vec<Sample>,
}

// Steps between two samples of the track, and samples per second.
const SAMPLE: u32 = 6;
pub const SAMPLES: f64 = 20.0;

/// Plays `script` until it ends or the game is won or lost. `watch` is called at every sample of the track.
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
        penetration: game.deepest,
        slip: game.slip,
        engine: game.engine.name(),
        board: game.map.name,
        track,
    })
}
