//! The example that needs no window.

#[allow(dead_code, reason = "the test calls run, and no main")]
#[path = "../examples/falling_boxes.rs"]
mod falling_boxes;

#[test]
fn boxes_of_the_example_fall_and_lie_on_the_floor() {
    let lines = falling_boxes::run(60);
    assert_eq!(lines[0], "box 0 hits floor with 3.1 m/s");
    let place = |name: &str| {
        let start = format!("3 s: {name} at [");
        let line = lines.iter().find_map(|line| line.strip_prefix(&start)).expect("a line");
        line.split(", ").nth(1).and_then(|y| y.parse::<f32>().ok()).expect("a height")
    };
    assert_eq!(place("floor"), 0.0);
    assert!((0..5).all(|i| (place(&format!("box {i}")) - 0.5).abs() < 0.02), "{lines:?}");
    assert!(lines.iter().any(|line| line.ends_with(", asleep")), "{lines:?}");
    assert_eq!(lines, falling_boxes::run(60));
}
