//! The maze game, played by scripts.

#[macro_use]
#[path = "../../tests/common/mod.rs"]
mod common;

use std::path::Path;

use common::gpu;
use drystone::glam::{Quat, Vec3};
use drystone::{Backend, Body, Cpu, Reference, Shape, Simulation, SolverConfig, World};
use drystone_maze::{BOARDS, CELL, Game, Map, Outcome, Played, RADIUS, Script, TILT_LIMIT, pilot, play};

tests! {
    exact_gpu {
        the_gpu_plays_the_same_game_to_the_last_bit,
    }
    no_gpu {
        every_board_is_won_by_a_script_and_the_ball_rolls_without_slipping,
        a_script_that_rolls_into_a_hole_loses_and_a_script_that_ends_decides_nothing,
        lanes_play_the_same_game_to_the_last_bit,
        the_ball_rolls_over_the_seams_of_triangles_and_boxes_as_over_one_plane,
        the_board_tilts_no_further_than_its_limit_and_no_faster_than_its_rate,
        a_game_is_won_within_two_fifths_of_a_cell_of_the_goal_and_not_before,
    }
}

fn main() -> std::process::ExitCode {
    common::harness::run([tests()])
}

fn reference() -> Box<dyn Backend> {
    Box::new(Reference::<f32>::new())
}

fn game(map: Map, backend: Box<dyn Backend>) -> Game {
    Game::new(map, SolverConfig::default().without_sleep(), backend).expect("a game")
}

/// A script in tests/maze. `drystone play maze easy --pilot tests/maze/easy.txt` makes the winning one again.
fn script(name: &str) -> Script {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/maze").join(format!("{name}.txt"));
    Script::parse(name, &std::fs::read_to_string(path).expect("a script")).expect("a script")
}

fn played(board: &str, script: &Script, backend: Box<dyn Backend>) -> Played {
    play(game(Map::find(board).expect("a board"), backend), script, |_| ()).expect("a game")
}

fn every_board_is_won_by_a_script_and_the_ball_rolls_without_slipping() {
    for (board, _) in BOARDS {
        let way = pilot(game(Map::find(board).expect("a board"), reference())).expect("a way");
        let won = played(board, &way, reference());
        assert_eq!(won.outcome, Outcome::Goal, "{board} after {} s", won.time);
        assert!(won.penetration < 5e-5, "{board}: {} m deep", won.penetration);
        assert!(won.slip.steps > won.steps / 4, "{board}: rolls {} of {} steps", won.slip.steps, won.steps);
        // The ball rolls at up to 0.3 m/s.
        assert!(won.slip.rms < 1e-3 && won.slip.max < 2e-2, "{board}: {:?}", won.slip);
        let end = won.track.last().expect("a track");
        assert_eq!(end.time, won.time);
    }
}

fn a_script_that_rolls_into_a_hole_loses_and_a_script_that_ends_decides_nothing() {
    assert_eq!(played("easy", &script("lose"), reference()).outcome, Outcome::Hole);
    let nothing = Script::parse("s", "1 0 0\n").expect("a script");
    let game = game(Map::find("easy").expect("a board"), reference());
    let played = play(game, &nothing, |_| ()).expect("a game");
    assert_eq!((played.outcome, played.steps), (Outcome::Time, 120));
}

fn lanes_play_the_same_game_to_the_last_bit() {
    let (a, b) = (played("easy", &script("easy"), reference()), played("easy", &script("easy"), Box::new(Cpu::new())));
    assert_eq!((a.steps, a.track), (b.steps, b.track));
}

fn the_gpu_plays_the_same_game_to_the_last_bit() {
    let played = |backend| played("easy", &script("easy"), backend);
    let (a, b) = (played(reference()), played(Box::new(gpu::exact())));
    assert_eq!((a.outcome, a.steps, a.track), (b.outcome, b.steps, b.track));
}

/// Rolls the ball over a floor of 40 x 40 squares of 0.06 m that is inclined by 2 degrees along x and 1 degree along z. Returns the
/// largest hop (m) and slip (m/s) between 1 s and 2 s.
fn roll_over(floor: Body) -> (f32, f32) {
    let mut world = World::new();
    let tilt = Quat::from_rotation_x(1.0_f32.to_radians()) * Quat::from_rotation_z(-2.0_f32.to_radians());
    world.insert(floor.rotation(tilt));
    let ball = world.insert(Body::dynamic().density(7800.0).shape(Shape::ball(RADIUS)));
    world.bodies[ball].position = tilt * Vec3::new(-0.97, RADIUS, -0.97);
    let mut simulation =
        Simulation::with(world, SolverConfig::default().without_sleep(), reference()).expect("a simulation");
    let up = tilt * Vec3::Y;
    let (mut hop, mut slip) = (0.0_f32, 0.0_f32);
    for step in 0..240 {
        simulation.step(1.0 / 120.0).expect("a step");
        let ball = &simulation.world.bodies[ball];
        if step >= 120 {
            hop = hop.max(ball.position.dot(up) - RADIUS);
            slip = slip.max(ball.velocity_at(ball.position - RADIUS * up).length());
        }
    }
    assert!(simulation.world.bodies[ball].position.length() < 1.0, "the ball is still on the floor");
    (hop, slip)
}

fn the_ball_rolls_over_the_seams_of_triangles_and_boxes_as_over_one_plane() {
    const SIDE: f32 = 0.06;
    let corner = |k: u32| Vec3::new((k % 41) as f32 * SIDE - 20.0 * SIDE, 0.0, (k / 41) as f32 * SIDE - 20.0 * SIDE);
    let cells = (0..41 * 40).filter(|k| k % 41 < 40);
    let triangles = cells.clone().flat_map(|k| [[k, k + 41, k + 1], [k + 1, k + 41, k + 42]]).collect();
    let mesh = Shape::mesh((0..41 * 41).map(corner).collect(), triangles).expect("a mesh");
    let tile = Shape::cuboid(0.5 * SIDE, 0.01, 0.5 * SIDE);
    let middle = Vec3::new(0.5 * SIDE, -0.01, 0.5 * SIDE);
    let boxes = cells.fold(Body::kinematic(), |b, k| b.shape_at(tile.clone(), corner(k) + middle, Quat::IDENTITY));

    let (plane_hop, plane_slip) = roll_over(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let (mesh_hop, mesh_slip) = roll_over(Body::kinematic().shape(mesh));
    let (box_hop, box_slip) = roll_over(boxes);
    for (hop, slip, floor) in [(mesh_hop, mesh_slip, "triangles"), (box_hop, box_slip, "boxes")] {
        assert!(hop < plane_hop + 2e-6 && slip < plane_slip + 1e-4, "{hop} m, {slip} m/s on {floor}");
    }
}

fn the_board_tilts_no_further_than_its_limit_and_no_faster_than_its_rate() {
    let mut game = game(Map::find("easy").expect("a board"), reference());
    for step in 1..=24 {
        game.step([90.0, -90.0]).expect("a step");
        assert_eq!(game.outcome, None);
        // 60 degrees a second.
        let expected = (60.0 * step as f32 * game.dt()).min(TILT_LIMIT);
        let [right, front] = game.tilt;
        assert!((right - expected).abs() < 1e-4 && (front + expected).abs() < 1e-4, "step {step}: {:?}", game.tilt);
    }
    assert_eq!(game.tilt, [TILT_LIMIT, -TILT_LIMIT]);
    let board = game.world().bodies.iter().find(|body| body.name == "board").expect("a board");
    let up = board.rotation * Vec3::Y;
    let expected = TILT_LIMIT.to_radians().cos().powi(2);
    assert!((up.y - expected).abs() < 1e-4, "the board is tilted both ways: {up}");
}

fn a_game_is_won_within_two_fifths_of_a_cell_of_the_goal_and_not_before() {
    let (mut game, script) = (game(Map::find("easy").expect("a board"), reference()), script("easy"));
    let (row, column) = game.map.goal;
    let middle = |at: usize, count: usize| CELL * (at as f32 + 0.5 - 0.5 * count as f32);
    let (x, z) = (middle(column, game.map.columns), middle(row, game.map.rows));
    let far = |game: &Game| (game.ball().x - x).hypot(game.ball().z - z);
    let mut before = f32::INFINITY;
    while game.outcome.is_none() {
        before = far(&game);
        game.step(script.at(game.time())).expect("a step");
    }
    assert_eq!(game.outcome, Some(Outcome::Goal));
    assert!(before >= 0.4 * CELL && far(&game) < 0.4 * CELL, "{before} m, then {} m", far(&game));
}
