//! Runs the examples that print what happens.

#[allow(dead_code, reason = "the tests call run, and no main")]
#[path = "../../examples/character.rs"]
mod character;
#[allow(dead_code, reason = "the tests call run, and no main")]
#[path = "../../examples/one_way_platform.rs"]
mod one_way_platform;
#[allow(dead_code, reason = "the tests call run, and no main")]
#[path = "../../examples/queries.rs"]
mod queries;
#[allow(dead_code, reason = "the tests call run, and no main")]
#[path = "../../examples/server_loop.rs"]
mod server_loop;
#[allow(dead_code, reason = "the tests call run, and no main")]
#[path = "../../examples/spawn_and_remove.rs"]
mod spawn_and_remove;
#[allow(dead_code, reason = "the tests call run, and no main")]
#[path = "../../examples/vehicle.rs"]
mod vehicle;

fn lines(run: impl FnOnce(&mut dyn FnMut(String)) -> drystone::Result<()>) -> Vec<String> {
    let mut lines = Vec::new();
    run(&mut |line| lines.push(line)).expect("the example runs");
    lines.iter().for_each(|line| println!("{line}"));
    lines
}

#[test]
fn the_example_of_queries_prints_where_bodies_are() {
    let lines = lines(|print| queries::run(print));
    let expected = [
        "-2 m: 0.80 m high, ball",
        "0 m: 0.00 m high, floor",
        "2 m: 3.00 m high, crate 2",
        "the walker gets 1.10 m far, to crate 0",
        "0.60 m to ball",
    ];
    assert_eq!(lines[..5], expected);
    assert_eq!(lines.iter().filter(|line| line.starts_with("the blast pushes crate")).count(), 2, "{lines:?}");
}

#[test]
fn balls_that_fly_above_the_platform_lie_on_it() {
    let lines = lines(|print| one_way_platform::run(print));
    let heights = [(3, "0.20"), (6, "1.30"), (9, "1.30")];
    assert_eq!(lines, heights.map(|(speed, height)| format!("thrown up at {speed} m/s: {height} m high")));
}

#[test]
fn the_fountain_uses_the_places_of_its_balls_again() {
    let lines = lines(|print| spawn_and_remove::run(print));
    assert_eq!(lines.len(), 5);
    assert!(lines[..4].iter().all(|line| line.contains(" in 12") && !line.contains("at 0.")), "{lines:?}");
    assert_eq!(lines[4], "gone: true, place used again: true");
}

#[test]
fn the_server_sends_the_same_states_whatever_the_rounds() {
    let (all, first) = (lines(|send| server_loop::run(180, send)), lines(|send| server_loop::run(90, send)));
    assert_eq!((all.len(), first.len()), (6, 3));
    assert_eq!(all[..3], first);
    assert!(all.iter().zip(1..).all(|(line, k)| line.starts_with(&format!("{{\"step\":{},", 30 * k))), "{all:?}");
    assert!(all.iter().all(|line| line.matches("\"player\":").count() == 2));
    let players = |line: &str| line.split_once("players").map(|parts| parts.1.to_owned()).expect("players");
    assert!(all[..4].windows(2).all(|pair| players(&pair[0]) != players(&pair[1])), "nothing moves");
}

#[test]
fn the_character_of_the_example_walks_the_course_to_the_steep_slope() {
    let lines = lines(|print| character::run(print));
    assert_eq!(lines.len(), 15);
    let on = |name: &str| lines.iter().any(|line| line.contains(&format!("on {name},")));
    assert!(["floor", "stair", "turntable"].into_iter().all(on) && !on("nothing"), "{lines:?}");
    // A crate may lie between it and the slope.
    let is_there = ["x 18.", "x 19."].into_iter().any(|place| lines[14].contains(place));
    assert!(is_there && lines[14].contains("y 0.91"), "{lines:?}");
}

#[test]
fn the_vehicle_of_the_example_drives_and_stops() {
    let lines = lines(|print| vehicle::run(print));
    assert_eq!(lines.len(), 10);
    let speed =
        |line: &String| line.split(" m, ").nth(1).and_then(|rest| rest.split(" m/s").next()?.trim().parse().ok());
    let speeds: Vec<f32> = lines.iter().filter_map(speed).collect();
    assert!(speeds.len() == 10 && speeds[0] < 0.2 && speeds[6] > 8.0 && speeds[9] < 0.2, "{lines:?}");
}
