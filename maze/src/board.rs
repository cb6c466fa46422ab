//! Converts a map to a world: the board is one kinematic triangle mesh.
//!
//! On a board of separate boxes, a ball that overlaps the floor slightly would hit the side of the next box. In a mesh,
//! triangles know their neighbors, and only the triangle below the ball has a contact, with its own normal.

use std::collections::HashMap;

use glam::{Quat, Vec2, Vec3};

use crate::map::{Cell, Map};
use drystone::{Body, Result, Shape, World};
use drystone_scenes::Scene;

// Side of a cell, radii of ball and hole, height of the walls, and depth of the holes (m).
pub const CELL: f32 = 0.06;
pub const RADIUS: f32 = 0.015;
const HOLE: f32 = 0.4 * CELL;
const HEIGHT: f32 = 0.022;
const DEPTH: f32 = 0.04;
/// Corners of a hole, a multiple of four.
const SEGMENTS: u16 = 24;
/// Steps per second.
const RATE: f32 = 120.0;

// Indices of the bodies in the world of [`scene`].
pub(crate) const BOARD: usize = 0;
pub(crate) const BALL: usize = 3;

/// The world of a map: kinematic board, goal and lids of the walls around the origin, and the ball at rest on the
/// start. Rows lie along z and columns along x. The floor is at y = 0.
pub fn scene(map: &Map) -> Result<Scene> {
    let mut world = World::new();
    world.insert(Body::kinematic().named("board").shape(surface(map)?));
    // The goal is a separate body, so that it has another color. Boundary edges have the normal of their surface, so
    // the ball rolls across them.
    let mut plate = Surface::default();
    plate.quad(corners(map, map.goal.0 as isize, map.goal.1 as isize), Vec3::Y);
    world.insert(Body::kinematic().named("goal").shape(Shape::mesh(plate.vertices, plate.triangles)?));
    let mut lids = Body::kinematic().named("walls");
    for (place, half_length) in wall_runs(map) {
        // The lid is beyond the contact distance of the ball.
        let lid = Shape::cuboid(half_length, 0.0005, 0.5 * CELL);
        lids = lids.shape_at(lid, place + (HEIGHT + 0.0005) * Vec3::Y, Quat::IDENTITY);
    }
    world.insert(lids);
    let Vec3 { x, z, .. } = center_of(map, map.start);
    let ball = Body::dynamic().named("ball").density(7800.0).shape(Shape::ball(RADIUS)).position(x, RADIUS, z);
    world.insert(ball);
    Ok(Scene { dt: 1.0 / RATE, ..Scene::new(format!("maze {}", map.name), world, 10 * RATE as u32) })
}

pub fn center_of(map: &Map, (row, column): (usize, usize)) -> Vec3 {
    corner(map, row as f32 + 0.5, column as f32 + 0.5)
}

fn corner(map: &Map, row: f32, column: f32) -> Vec3 {
    Vec3::new(CELL * (column - 0.5 * map.columns as f32), 0.0, CELL * (row - 0.5 * map.rows as f32))
}

/// Corners of a cell: back left, back right, front right, front left.
fn corners(map: &Map, row: isize, column: isize) -> [Vec3; 4] {
    [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(r, c)| corner(map, (row + r) as f32, (column + c) as f32))
}

/// Distances of the ball from floor and walls (m); an overlap is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gap {
    /// `None` over a hole.
    pub floor: Option<f32>,
    /// Distance from the nearest wall in the surrounding cells; infinite without a wall.
    pub wall: f32,
}

/// The gap of a ball with its center at `ball`, in the frame of the board.
pub(crate) fn gap(map: &Map, ball: Vec3) -> Gap {
    let origin = corner(map, 0.0, 0.0);
    let (row, column) = (((ball.z - origin.z) / CELL).floor(), ((ball.x - origin.x) / CELL).floor());
    let mut gap = Gap { floor: Some(ball.y - RADIUS), wall: f32::INFINITY };
    for (down, right) in (-1..=1).flat_map(|down| (-1..=1).map(move |right| (down, right))) {
        let (row, column) = (row as isize + down, column as isize + right);
        let low = corner(map, row as f32, column as f32);
        let aside = |from: Vec3| Vec2::new(ball.x - from.x, ball.z - from.z).length();
        match map.at(row, column) {
            Cell::Wall => {
                let nearest = ball.clamp(low, low + Vec3::new(CELL, HEIGHT, CELL));
                gap.wall = gap.wall.min(aside(nearest) - RADIUS);
            }
            Cell::Hole if aside(low + 0.5 * Vec3::new(CELL, 0.0, CELL)) < HOLE => gap.floor = None,
            _ => {}
        }
    }
    gap
}

/// All cells, and the rim of walls around them.
fn places(map: &Map) -> impl Iterator<Item = (isize, isize)> {
    let (rows, columns) = (map.rows as isize, map.columns as isize);
    (-1..=rows).flat_map(move |row| (-1..=columns).map(move |column| (row, column)))
}

/// Center and half length of each run of walls in a row.
fn wall_runs(map: &Map) -> Vec<(Vec3, f32)> {
    let mut runs: Vec<(isize, isize, isize)> = Vec::new();
    for (row, column) in places(map).filter(|&(r, c)| map.at(r, c) == Cell::Wall) {
        match runs.last_mut().filter(|(r, _, end)| (*r, *end) == (row, column)) {
            Some(run) => run.2 += 1,
            None => runs.push((row, column, column + 1)),
        }
    }
    let run = |&(row, first, end): &(isize, isize, isize)| {
        (corner(map, row as f32 + 0.5, 0.5 * (first + end) as f32), 0.5 * (end - first) as f32 * CELL)
    };
    runs.iter().map(run).collect()
}

#[derive(Default)]
struct Surface {
    vertices: Vec<Vec3>,
    known: HashMap<[i32; 3], u32>,
    triangles: Vec<[u32; 3]>,
}

impl Surface {
    fn vertex(&mut self, p: Vec3) -> u32 {
        // Vertices within a micrometer count as equal.
        let key = (p * 1e6).round().as_ivec3().to_array();
        *self.known.entry(key).or_insert_with(|| {
            self.vertices.push(p);
            self.vertices.len() as u32 - 1
        })
    }

    /// Adds a triangle that faces in the direction of `normal`.
    fn triangle(&mut self, [a, b, c]: [Vec3; 3], normal: Vec3) {
        let faces = (b - a).cross(c - a).dot(normal) > 0.0;
        let corners = if faces { [a, b, c] } else { [a, c, b] };
        let triangle = corners.map(|p| self.vertex(p));
        self.triangles.push(triangle);
    }

    fn quad(&mut self, [a, b, c, d]: [Vec3; 4], normal: Vec3) {
        self.triangle([a, b, c], normal);
        self.triangle([a, c, d], normal);
    }

    /// Adds a vertical rectangle on the edge from `a` to `b`, from height `low` to `high`.
    fn upright(&mut self, a: Vec3, b: Vec3, (low, high): (f32, f32), normal: Vec3) {
        let at = |p: Vec3, y: f32| p + y * Vec3::Y;
        self.quad([at(a, low), at(b, low), at(b, high), at(a, high)], normal);
    }
}

fn surface(map: &Map) -> Result<Shape> {
    let mut surface = Surface::default();
    let (rows, columns) = (map.rows as isize, map.columns as isize);
    let on_board = |row: isize, column: isize| (-1..=rows).contains(&row) && (-1..=columns).contains(&column);
    for (row, column) in places(map) {
        let corners = corners(map, row, column);
        let cell = map.at(row, column);
        let is_goal = (row, column) == (map.goal.0 as isize, map.goal.1 as isize);
        match cell {
            Cell::Floor if is_goal => {}
            Cell::Floor => surface.quad(corners, Vec3::Y),
            Cell::Wall => surface.quad(corners.map(|p| p + HEIGHT * Vec3::Y), Vec3::Y),
            Cell::Hole => hole(&mut surface, corners),
        }
        // The neighbors, in the order of the cell's edges.
        let neighbors = [(-1, 0), (0, 1), (1, 0), (0, -1)];
        for (k, (down, right)) in neighbors.into_iter().enumerate() {
            let (a, b) = (corners[k], corners[(k + 1) % 4]);
            let outward = Vec3::new(right as f32, 0.0, down as f32);
            if !on_board(row + down, column + right) {
                surface.upright(a, b, (-DEPTH, HEIGHT), outward);
            } else if cell != Cell::Wall && map.at(row + down, column + right) == Cell::Wall {
                surface.upright(a, b, (0.0, HEIGHT), -outward);
            }
        }
    }
    Shape::mesh(surface.vertices, surface.triangles)
}

/// Adds the floor around a round hole in a cell, and the wall of the hole.
fn hole(surface: &mut Surface, corners: [Vec3; 4]) {
    let middle = 0.5 * (corners[0] + corners[2]);
    let rim = |k: u16| {
        let angle = std::f32::consts::TAU * f32::from(k % SEGMENTS) / f32::from(SEGMENTS);
        let Vec2 { x, y } = HOLE * Vec2::from_angle(angle);
        middle + Vec3::new(x, 0.0, y)
    };
    // Angles go from x to z: the corners of the quarters are right front, left front, left back, right back.
    let quarter = |k: u16| corners[[2, 3, 0, 1][usize::from(k * 4 / SEGMENTS) % 4]];
    for k in 0..SEGMENTS {
        let (a, b) = (rim(k), rim(k + 1));
        surface.triangle([a, b, quarter(k)], Vec3::Y);
        if quarter(k) != quarter(k + 1) {
            surface.triangle([b, quarter(k), quarter(k + 1)], Vec3::Y);
        }
        surface.upright(a, b, (-DEPTH, 0.0), middle - 0.5 * (a + b));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::BOARDS;

    #[test]
    fn the_floor_is_closed_except_for_the_holes_and_the_goal() {
        for (name, text) in BOARDS {
            let map = Map::parse(name, text).expect(name);
            let (vertices, triangles) = surface(&map).expect("a surface").triangles();
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| vertices[i as usize]);
                // Area of the projection from above: vertical sides have none.
                0.5 * (b - a).cross(c - a).y
            };
            assert!(triangles.iter().all(|t| area(t) > -1e-9), "nothing looks down");
            let seen: f32 = triangles.iter().map(area).sum();
            let holes = places(&map).filter(|&(r, c)| map.at(r, c) == Cell::Hole).count() as f32;
            let side = std::f32::consts::TAU / f32::from(SEGMENTS);
            let hole = 0.5 * f32::from(SEGMENTS) * HOLE * HOLE * side.sin();
            let board = (map.rows + 2) as f32 * (map.columns + 2) as f32 * CELL * CELL;
            let board = board - CELL * CELL;
            assert!((seen + holes * hole - board).abs() < 1e-4 * board, "{name}: {seen} m² and {holes} holes");
        }
    }

    #[test]
    fn gaps_are_those_to_floor_wall_and_hole() {
        let map = Map::parse("m", "S.O\n..G\n").expect("a map");
        let at = |x: f32, y: f32, z: f32| gap(&map, corner(&map, 0.0, 0.0) + Vec3::new(x, y, z));
        let near = |a: f32, b: f32| (a - b).abs() < 1e-6;
        let free = at(1.5 * CELL, RADIUS + 0.001, CELL);
        assert!(near(free.floor.expect("floor"), 0.001) && near(free.wall, CELL - RADIUS), "{free:?}");
        assert!(near(at(RADIUS - 0.002, RADIUS, CELL).wall, -0.002));
        assert_eq!(at(2.5 * CELL, 0.0, 0.5 * CELL).floor, None);
    }

    #[test]
    fn runs_of_walls_cover_every_wall_once() {
        let map = Map::parse("m", "S#.\n##G\n").expect("a map");
        let walls = places(&map).filter(|&(r, c)| map.at(r, c) == Cell::Wall).count() as f32;
        let length: f32 = wall_runs(&map).iter().map(|r| 2.0 * r.1 / CELL).sum();
        assert!((length - walls).abs() < 1e-3);
    }
}
