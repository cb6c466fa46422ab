//! Pictures of worlds, and the boards of the maze game.

use std::sync::{Mutex, PoisonError};

use drystone::backend::gpu::{AdapterChoice, open_device};
use drystone::{Result, World};
use drystone_maze::{BOARDS, CELL, Cell, Map, RADIUS, TILT_LIMIT};
use drystone_view::{Canvas, ColorBy, Film, Look, wgpu};
use pyo3::prelude::*;

use crate::raised;
use crate::scene::Scene;

/// The drawing device, and the process that opened it. A forked process cannot use the device of its parent.
static DEVICE: Mutex<Option<(u32, wgpu::Device, wgpu::Queue)>> = Mutex::new(None);

fn device() -> Result<(wgpu::Device, wgpu::Queue)> {
    let mut known = DEVICE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((process, device, queue)) = &*known
        && *process == std::process::id()
    {
        return Ok((device.clone(), queue.clone()));
    }
    let (device, queue, _) = open_device(AdapterChoice::Best)?;
    *known = Some((std::process::id(), device.clone(), queue.clone()));
    Ok((device, queue))
}

/// Red, green and blue of each pixel, row by row from the top.
pub fn picture(world: &World, size: (u32, u32), look: Look) -> Result<Vec<u8>> {
    let (device, queue) = device()?;
    let mut canvas = Canvas::on(device, queue, world, size)?;
    let mut film = Film::new(drystone_scenes::Scene::new("world", world.clone(), 0), ColorBy::Material);
    film.add_world(0.0, world);
    let mut rgb = Vec::new();
    film.draw(&mut canvas, &look, |picture| {
        rgb = picture.rgba.chunks_exact(4).flat_map(|pixel| pixel[..3].to_vec()).collect();
        Ok(())
    })?;
    Ok(rgb)
}

/// The scene of a board, its rows as text, side of a cell (m), radius of the ball (m), and largest tilt (degrees).
#[pyfunction]
pub fn maze(board: &str) -> PyResult<(Scene, Vec<String>, f32, f32, f32)> {
    let map = Map::find(board).map_err(|error| raised(error.within("board")))?;
    let symbol = |row: usize, column: usize| match map.at(row as isize, column as isize) {
        _ if (row, column) == map.start => 'S',
        _ if (row, column) == map.goal => 'G',
        Cell::Floor => '.',
        Cell::Wall => '#',
        Cell::Hole => 'O',
    };
    let rows = (0..map.rows).map(|row| (0..map.columns).map(|column| symbol(row, column)).collect()).collect();
    let scene = drystone_maze::scene(&map).map_err(raised)?;
    Ok((Scene(scene.into()), rows, CELL, RADIUS, TILT_LIMIT))
}

/// Names of the boards.
#[pyfunction]
pub fn boards() -> Vec<&'static str> {
    BOARDS.iter().map(|board| board.0).collect()
}
