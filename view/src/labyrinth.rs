//! The maze game: arrow keys or the pointer tilt the board, R restarts the game.

use glam::{Vec2, Vec3};

use crate::bounds::Bounds;
use crate::camera::Camera;
use crate::colors::Rgba;
use crate::show::{Key, Passing, Pointer, Show};
use drystone::backend::{BackendChoice, choose};
use drystone::{Body, Result, SolverConfig, World};
use drystone_maze::{CELL, Game, Map, Outcome, TILT_LIMIT};

const BOARD_COLOR: Rgba = [226, 202, 160, 255];
const GOAL_COLOR: Rgba = [92, 170, 96, 255];
const WALL_COLOR: Rgba = [150, 98, 58, 255];
const BALL_COLOR: Rgba = [206, 210, 218, 255];
/// Largest number of steps before a picture: a tenth of a second.
const MAX_STEPS: f32 = 12.0;

pub(crate) fn colors(world: &World) -> Vec<Rgba> {
    let color = |body: &Body| match body.name.as_str() {
        "board" => BOARD_COLOR,
        "goal" => GOAL_COLOR,
        "ball" => BALL_COLOR,
        _ => WALL_COLOR,
    };
    world.bodies.iter().map(color).collect()
}

/// The bounds of the board with its rim at any tilt.
pub(crate) fn bounds_of(map: &Map) -> Bounds {
    let half = 0.5 * CELL * Vec3::new(map.columns as f32 + 3.0, 1.0, map.rows as f32 + 3.0);
    Bounds { low: -half, high: half }
}

pub(crate) fn camera_of(map: &Map, aspect: f32) -> Camera {
    Camera::framing(&bounds_of(map), Vec3::Y, 0.0, 1.1, aspect)
}

/// A maze game for a player.
pub struct Labyrinth {
    pub game: Game,
    map: Map,
    config: SolverConfig,
    backend: BackendChoice,
    /// Whether each arrow key is down: left, right, back, front.
    held: [bool; 4],
    /// Position of the pointer in the picture while it is held down.
    held_at: Option<Vec2>,
    /// Whether the board was tilted. The clock starts then.
    pub begun: bool,
    owed: f32,
    /// Whether the next advance begins a new game.
    again: bool,
    /// Shortest time of a won game (s).
    pub best: Option<f32>,
}

impl Labyrinth {
    pub fn new(map: Map, config: SolverConfig, backend: BackendChoice) -> Result<Self> {
        let game = Game::new(map.clone(), config.clone(), choose(backend, 1, false)?.0)?;
        let held = [false; 4];
        Ok(Self { game, map, config, backend, held, held_at: None, begun: false, owed: 0.0, again: false, best: None })
    }

    fn restart(&mut self) -> Result<()> {
        let fresh = Self::new(self.map.clone(), self.config.clone(), self.backend)?;
        *self = Self { held: self.held, held_at: self.held_at, best: self.best, ..fresh };
        Ok(())
    }

    /// Tilts that keys and pointer request, to the right and to the front (degrees).
    fn wanted(&self) -> [f32; 2] {
        let arrow = |less: usize, more: usize| f32::from(self.held[more]) - f32::from(self.held[less]);
        match self.held_at {
            Some(at) => [at.x, -at.y].map(|x| (1.5 * x).clamp(-1.0, 1.0) * TILT_LIMIT),
            None => [arrow(0, 1), arrow(2, 3)].map(|x| x * TILT_LIMIT),
        }
    }

    /// Advances the time, like [`Show::advance`], and waits for the steps.
    pub fn pass(&mut self, seconds: f32) -> Result<()> {
        if self.again {
            self.restart()?;
        }
        let wanted = self.wanted();
        self.begun |= wanted != [0.0; 2];
        let dt = self.game.dt();
        self.owed = (self.owed + seconds).min(MAX_STEPS * dt);
        while self.begun && self.owed >= dt {
            self.game.step(wanted)?;
            self.owed -= dt;
        }
        if self.game.outcome == Some(Outcome::Goal) {
            let time = self.game.time();
            self.best = Some(self.best.map_or(time, |best| best.min(time)));
        }
        Ok(())
    }
}

impl Show for Labyrinth {
    fn title(&self) -> String {
        format!("maze {}", self.map.name)
    }

    fn world(&self) -> &World {
        self.game.world()
    }

    fn bounds(&self) -> Bounds {
        bounds_of(&self.map)
    }

    fn camera(&self, aspect: f32) -> Camera {
        camera_of(&self.map, aspect)
    }

    fn colors(&mut self) -> Vec<Rgba> {
        colors(self.world())
    }

    fn advance(&mut self, seconds: f32) -> Passing<'_> {
        Box::pin(std::future::ready(self.pass(seconds)))
    }

    fn key(&mut self, key: Key, down: bool) {
        let arrows = [Key::Left, Key::Right, Key::Up, Key::Down];
        if let Some(arrow) = arrows.iter().position(|a| *a == key) {
            self.held[arrow] = down;
        }
        self.again |= key == Key::Character('r') && down;
    }

    fn grab(&mut self, pointer: &Pointer) -> bool {
        self.held_at = Some(pointer.at);
        true
    }

    fn drag(&mut self, pointer: &Pointer) {
        self.held_at = Some(pointer.at);
    }

    fn release(&mut self) {
        self.held_at = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labyrinth() -> Labyrinth {
        let map = Map::find("easy").expect("a board");
        Labyrinth::new(map, SolverConfig::default(), BackendChoice::Reference).expect("a game")
    }

    #[test]
    fn the_clock_waits_for_the_first_tilt_and_arrows_roll_the_ball() {
        let mut game = labyrinth();
        game.pass(0.5).expect("time");
        assert_eq!(game.game.time(), 0.0);
        let start = game.game.ball();
        game.key(Key::Right, true);
        (0..30).for_each(|_| game.pass(1.0 / 60.0).expect("time"));
        assert!(game.game.ball().x > start.x + 0.03, "{} m", game.game.ball().x - start.x);
        game.key(Key::Right, false);
        assert_eq!(game.wanted(), [0.0, 0.0]);
        game.key(Key::Character('r'), true);
        game.pass(0.0).expect("time");
        assert_eq!((game.game.time(), game.game.ball()), (0.0, start));
    }

    #[test]
    fn the_board_tilts_towards_the_pointer() {
        let mut game = labyrinth();
        let at = Vec2::new(0.2, -0.9);
        assert!(game.grab(&Pointer { at, origin: Vec3::ZERO, direction: Vec3::NEG_Z }));
        assert_eq!(game.wanted(), [0.3 * TILT_LIMIT, TILT_LIMIT]);
        game.release();
        assert_eq!(game.wanted(), [0.0, 0.0]);
    }
}
