//! Finds a path to the goal and a script that follows it.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use glam::{Vec2, Vec3Swizzles};

use crate::board::{CELL, center_of};
use crate::game::{Game, Outcome};
use crate::map::{Cell, Map};
use crate::script::{Script, TILT_LIMIT};
use drystone::{Error, Result};

/// Steps between two points of the script: 0.05 s.
const HOLD: u32 = 6;
/// Stiffness towards the next cell (1/s²) and damping (1/s): slightly less than critical.
const PULL: f32 = 9.0;
const DAMPING: f32 = 5.0;
/// Acceleration of a ball that rolls on a slope of 1 (m/s²).
const ROLLING: f32 = 9.81 * 5.0 / 7.0;
/// Longest script (s).
const PATIENCE: f32 = 120.0;

/// Plays `game` and returns the script that wins it, with 3 s to spare.
pub fn pilot(mut game: Game) -> Result<Script> {
    let way: Vec<Vec2> = way(&game.map).iter().map(|&cell| center_of(&game.map, cell).xz()).collect();
    if way.is_empty() {
        return Err(Error::input(format!("{}: there is no way from the start to the goal", game.map.name)));
    }
    let mut script = Script::default();
    let (mut next, mut wanted) = (0, [0.0; 2]);
    script.push(0.0, wanted);
    let mut before = game.ball().xz();
    while game.outcome.is_none() && game.time() < PATIENCE {
        let at = game.ball().xz();
        let speed = (at - before) / (HOLD as f32 * game.dt());
        before = at;
        while next + 1 < way.len() && at.distance(way[next]) < 0.25 * CELL {
            next += 1;
        }
        let acceleration = PULL * (way[next] - at) - DAMPING * speed;
        let slope = |a: f32| ((a / ROLLING).atan().to_degrees().clamp(-TILT_LIMIT, TILT_LIMIT) * 100.0).round() / 100.0;
        wanted = [slope(acceleration.x), slope(acceleration.y)];
        // The script reaches the wanted tilt at its next point. The pilot plays the same rounded times that
        // `Script::text` writes.
        let end = (game.time() + HOLD as f32 * game.dt()) * 1000.0;
        script.push(end.round() / 1000.0, wanted);
        for _ in 0..HOLD {
            game.step(script.at(game.time()))?;
        }
    }
    match game.outcome {
        Some(Outcome::Goal) => {
            // Hold the last tilt, in case the ball is late.
            script.push(script.end() + 3.0, wanted);
            Ok(script)
        }
        _ => Err(Error::input(format!("{}: the ball did not keep to the way", game.map.name))),
    }
}

/// Cells of the cheapest path from the start to the goal; cells beside holes cost more. Empty without a path.
fn way(map: &Map) -> Vec<(usize, usize)> {
    let place = |(row, column): (usize, usize)| (row as isize, column as isize);
    let free = |(row, column): (isize, isize)| map.at(row, column) == Cell::Floor;
    let around = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)];
    let price = |(row, column): (isize, isize)| {
        let holes = around.iter().filter(|(r, c)| map.at(row + r, column + c) == Cell::Hole).count() as u32;
        10 + 10 * holes
    };
    let (start, goal) = (place(map.start), place(map.goal));
    let mut best = HashMap::from([(start, (0, start))]);
    let mut open = BinaryHeap::from([(Reverse(0), start)]);
    while let Some((Reverse(cost), (row, column))) = open.pop() {
        if cost > best[&(row, column)].0 {
            continue;
        }
        // No diagonal steps: the ball would hit the corner of a wall.
        for (r, c) in &around[..4] {
            let there = (row + r, column + c);
            let cost = cost + price(there);
            if free(there) && best.get(&there).is_none_or(|b| cost < b.0) {
                best.insert(there, (cost, (row, column)));
                open.push((Reverse(cost), there));
            }
        }
    }
    let mut cells = Vec::new();
    let mut at = goal;
    while let Some(&(_, before)) = best.get(&at) {
        cells.push((at.0 as usize, at.1 as usize));
        if at == start {
            break;
        }
        at = before;
    }
    cells.reverse();
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_avoids_holes() {
        let map = Map::parse("m", "S.O.G\n.....\n.....\n").expect("a map");
        let cells = way(&map);
        assert!(cells.iter().all(|&(row, _)| row < 3) && cells.contains(&(2, 2)), "{cells:?}");
        assert_eq!((cells[0], cells[cells.len() - 1]), (map.start, map.goal));
    }

    #[test]
    fn a_goal_behind_walls_has_no_way() {
        assert!(way(&Map::parse("m", "S#G\n.#.\n").expect("a map")).is_empty());
    }
}
