//! The maze game in the page.

use drystone::backend::BackendChoice;
use drystone::{Result, SolverConfig};
use drystone_maze::{BOARDS, Map};
use drystone_view::{Camera, Labyrinth, Pointer, Show as _};
use glam::{Vec2, Vec3};
use serde_json::json;
use wasm_bindgen::prelude::*;

use crate::{next_number, thrown};

/// A game on one of the boards.
#[wasm_bindgen]
pub struct Maze {
    pub(crate) labyrinth: Labyrinth,
    pub(crate) camera: Camera,
    #[cfg_attr(not(target_family = "wasm"), expect(dead_code, reason = "only browsers draw"))]
    pub(crate) number: u32,
    board: String,
}

impl Maze {
    fn on(board: &str) -> Result<Self> {
        let labyrinth = Labyrinth::new(Map::find(board)?, SolverConfig::default().without_sleep(), BackendChoice::Cpu)?;
        Ok(Self { camera: labyrinth.camera(1.0), labyrinth, number: next_number(), board: board.into() })
    }
}

#[wasm_bindgen]
impl Maze {
    /// A game on a board, before its first tilt.
    #[wasm_bindgen(constructor)]
    pub fn new(board: &str) -> std::result::Result<Maze, JsError> {
        thrown(Self::on(board))
    }

    /// The names of the boards.
    pub fn boards() -> Vec<String> {
        BOARDS.iter().map(|(name, _)| (*name).to_owned()).collect()
    }

    /// Advances the time by `seconds`. The board tilts to the right and to the front, each -1 to 1.
    pub async fn advance(&mut self, seconds: f32, right: f32, front: f32) -> std::result::Result<(), JsError> {
        // A game tilts towards a pointer, and reaches the largest tilt at two thirds of the picture.
        let at = Vec2::new(right, -front) / 1.5;
        if at == Vec2::ZERO {
            self.labyrinth.release();
        } else {
            self.labyrinth.drag(&Pointer { at, origin: Vec3::ZERO, direction: Vec3::NEG_Z });
        }
        thrown(self.labyrinth.advance(seconds).await)
    }

    /// Time, tilt and outcome as JSON.
    pub fn numbers(&self) -> String {
        let game = &self.labyrinth.game;
        let ball = game.ball().to_array();
        let told =
            json!({"board": self.board, "time": game.time(), "tilt": game.tilt, "outcome": game.outcome, "ball": ball});
        told.to_string()
    }

    /// Turns the camera after a drag, in heights of the picture.
    pub fn orbit(&mut self, x: f32, y: f32) {
        self.camera.orbit(Vec2::new(x, y));
    }

    /// Moves the camera after a drag, in heights of the picture.
    pub fn pan(&mut self, x: f32, y: f32) {
        self.camera.pan(Vec2::new(x, y));
    }

    /// Moves the camera nearer by notches of the wheel.
    pub fn zoom(&mut self, notches: f32) {
        self.camera.zoom(notches);
    }

    /// Shows the whole board in a picture of width `aspect` times its height.
    pub fn whole(&mut self, aspect: f32) {
        self.camera = self.labyrinth.camera(aspect);
    }
}
