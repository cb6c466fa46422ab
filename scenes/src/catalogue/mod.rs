//! The catalogue of built-in scenes, by name and parameters.

mod basics;
mod boxes;
mod common;
mod course;
mod drop;
mod drum;
mod entry;
mod families;
mod fast;
mod flow;
mod held;
mod jointed;
mod machines;
mod masonry;
mod stacks;
mod vehicle;

pub use entry::{Entry, MAX_BODIES, Parameter};
pub use families::{Family, Law, Member};

use drystone::Result;
use drystone::stages::error::ensure;

const ANGLE: Parameter = Parameter::real("angle", 20.0, (0.0, 60.0), "angle of the slope [degrees]");
const BOXES: Parameter = Parameter::whole("n", 1000, (1.0, MAX_BODIES), "number of boxes");
const JITTER: Parameter =
    Parameter::real("jitter", 0.03, (0.0, 0.04), "largest shift off the grid along each axis [m]");
const CUBES: Parameter = Parameter::whole("n", 10, (1.0, 10_000.0), "number of cubes");
const GAP: Parameter =
    Parameter::real("gap", 0.0, (0.0, 0.1), "gap that is below each of them at the start, relative to its height");
const MU: Parameter = Parameter::real("mu", 0.5, (0.0, 10.0), "friction of all bodies");
const LIFTED: Parameter = Parameter::real("angle", 90.0, (0.0, 180.0), "start, lifted from where it hangs [degrees]");

/// 1 + 2 + ... + n.
fn triangle(n: f64) -> f64 {
    n * (n + 1.0) / 2.0
}

/// Refuses a parameter that is larger than its limit, which is another parameter.
fn at_most([name, limit]: [&str; 2], value: f64, most: f64) -> Result<()> {
    ensure(value <= most, || format!("{name} = {value}: must be at most {limit} = {most}"))
}

/// Every built-in scene.
pub static CATALOGUE: &[Entry] = &[
    Entry {
        name: "pile",
        summary: "n boxes in a jittered grid fall into a container: none leaves, all rest, overlap stays small",
        parameters: &[
            BOXES,
            JITTER,
            Parameter::whole("seed", 1, (0.0, (1_u64 << 53) as f64), "seed of the random shifts and turns"),
            Parameter::real("ratio", 1.0, (1e-6, 1e6), "density of every other box relative to the others"),
        ],
        bodies: |v| v[0],
        build: |v| boxes::pile(v[0] as usize, v[1], v[2] as u64, v[3] as f32),
    },
    Entry {
        name: "pile-mixed",
        summary: "boxes of random sizes and densities, 200 to 5000 kg/m³: none leaves, all rest",
        parameters: &[
            BOXES,
            JITTER,
            Parameter::whole("seed", 1, (0.0, (1_u64 << 53) as f64), "seed of the sizes, densities, shifts and turns"),
            Parameter::whole(
                "kinds",
                1,
                (1.0, 6.0),
                "kinds of shapes in turn: box, ball, capsule, cylinder, cone, hull",
            ),
        ],
        bodies: |v| v[0],
        build: |v| boxes::pile_mixed(v[0] as usize, v[1], v[2] as u64, v[3] as usize),
    },
    Entry {
        name: "pyramid",
        summary: "a plane pyramid of boxes with gaps: it stands",
        parameters: &[Parameter::whole("base", 20, (1.0, 2800.0), "boxes in the lowest row"), GAP],
        bodies: |v| triangle(v[0]),
        build: |v| Ok(boxes::pyramid(v[0] as usize, v[1] as f32)),
    },
    Entry {
        name: "many-pyramids",
        summary: "n plane pyramids of boxes on one floor: all stand",
        parameters: &[
            Parameter::whole("n", 100, (1.0, 10_000.0), "number of pyramids"),
            Parameter::whole("base", 10, (1.0, 25.0), "boxes in the lowest row of each"),
        ],
        bodies: |v| v[0] * triangle(v[1]),
        build: |v| Ok(boxes::many_pyramids(v[0] as usize, v[1] as usize)),
    },
    Entry {
        name: "tower",
        summary: "a stack of boxes, straight or zigzag, light or heavy top: it stands up to an offset of 0.2 m",
        parameters: &[
            Parameter::whole("n", 10, (1.0, 10_000.0), "number of boxes"),
            Parameter::real("offset", 0.0, (0.0, 0.5), "shift of the boxes in x, one way and the other in turn [m]"),
            Parameter::real("top_ratio", 1.0, (1e-6, 1e6), "density of the top box relative to the others"),
            GAP,
        ],
        bodies: |v| v[0],
        build: |v| Ok(stacks::tower(v[0] as usize, v[1] as f32, v[2] as f32, v[3] as f32)),
    },
    Entry {
        name: "wall",
        summary: "a wall of bricks in running bond with half bricks at the ends: it stands",
        parameters: &[
            Parameter::whole("rows", 20, (1.0, 1900.0), "rows of bricks"),
            Parameter::whole("columns", 20, (1.0, 1900.0), "bricks in a row without half bricks"),
            GAP,
        ],
        bodies: |v| v[0] * v[1] + (v[0] / 2.0).floor(),
        build: |v| Ok(boxes::wall(v[0] as usize, v[1] as usize, v[2] as f32)),
    },
    Entry {
        name: "drop",
        summary: "one of every shape falls on a half-space, a mesh and a height field: each rests where it fell",
        parameters: &[Parameter::real("height", 2.0, (0.0, 20.0), "height of the fall [m]")],
        bodies: |_| 7.0,
        build: |v| drop::drop(v[0] as f32),
    },
    Entry {
        name: "sphere-plane",
        summary: "a ball falls on a half-space: it rests there",
        parameters: &[Parameter::real("height", 2.0, (0.0, 100.0), "height of the fall [m]")],
        bodies: |_| 1.0,
        build: |v| Ok(basics::sphere_plane(v[0] as f32)),
    },
    Entry {
        name: "stack",
        summary: "a straight stack of cubes: it stands",
        parameters: &[CUBES],
        bodies: |v| v[0],
        build: |v| Ok(stacks::aligned(v[0] as usize)),
    },
    Entry {
        name: "coins",
        summary: "a straight stack of cylinders, 1 m wide and 4 cm thick: it stands",
        parameters: &[Parameter::whole("n", 60, (1.0, 10_000.0), "number of coins")],
        bodies: |v| v[0],
        build: |v| Ok(stacks::coins(v[0] as usize)),
    },
    Entry {
        name: "misaligned",
        summary: "a stack of cubes with fixed random shifts: it stands",
        parameters: &[CUBES, Parameter::real("offset", 0.1, (0.0, 0.5), "largest shift along x and along z [m]")],
        bodies: |v| v[0],
        build: |v| Ok(stacks::misaligned(v[0] as usize, v[1])),
    },
    Entry {
        name: "slide",
        summary: "a block on a slope: it sticks if tan(angle) < mu, else a = g (sin(angle) - mu cos(angle))",
        parameters: &[ANGLE, MU],
        bodies: |_| 1.0,
        build: |v| Ok(basics::slide(v[0] as f32, v[1] as f32)),
    },
    Entry {
        name: "roll",
        summary: "a ball on a slope: it rolls with a = 5/7 g sin(angle), without slipping if tan(angle) < 7/2 mu",
        parameters: &[ANGLE, MU],
        bodies: |_| 1.0,
        build: |v| Ok(basics::roll(v[0] as f32, v[1] as f32)),
    },
    Entry {
        name: "rolling",
        summary: "balls on a plate pushed over the ground: they roll in the direction of the push, as theory predicts",
        parameters: &[Parameter::real("angle", 60.0, (0.0, 360.0), "direction of the push, from x to z [degrees]")],
        bodies: |_| 26.0,
        build: |v| Ok(basics::rolling(v[0] as f32)),
    },
    Entry {
        name: "throw",
        summary: "a ball is thrown at a stack of cubes: the stack stands until hit, then falls",
        parameters: &[CUBES, Parameter::real("speed", 20.0, (5.0, 100.0), "horizontal speed of the ball [m/s]")],
        bodies: |v| v[0] + 1.0,
        build: |v| Ok(basics::throw(v[0] as usize, v[1] as f32)),
    },
    Entry {
        name: "tallest",
        summary: "towers of step, 2 step, ... n cubes: the report names the highest that stands",
        parameters: &[
            Parameter::whole("n", 30, (1.0, 2000.0), "cubes of the tallest tower"),
            Parameter::whole("step", 2, (1.0, 2000.0), "how many more cubes each tower has; at most n"),
        ],
        bodies: |v| v[1] * triangle((v[0] / v[1]).floor()),
        build: |v| {
            at_most(["step", "n"], v[1], v[0])?;
            Ok(stacks::tallest(v[0] as usize, v[1] as usize))
        },
    },
    Entry {
        name: "mass-ratio",
        summary: "light and heavy cubes in turn, the lowest light: they stand with 1.5 mm overlap, 0.01 mm with substeps=32",
        parameters: &[
            CUBES,
            Parameter::real("ratio", 100.0, (1e-6, 1e6), "density of the heavy cubes relative to the light ones"),
            GAP,
        ],
        bodies: |v| v[0],
        build: |v| Ok(stacks::mass_ratio(v[0] as usize, v[1] as f32, v[2] as f32)),
    },
    Entry {
        name: "pendulum",
        summary: "a ball swings from a joint: back to its height",
        parameters: &[
            Parameter::real("length", 1.0, (0.1, 100.0), "distance from the joint to the center of the ball [m]"),
            LIFTED,
        ],
        bodies: |_| 1.0,
        build: |v| Ok(jointed::pendulum(v[0] as f32, v[1] as f32)),
    },
    Entry {
        name: "chain",
        summary: "a chain with a heavy end swings: joints stay closed, energy does not grow",
        parameters: &[
            Parameter::whole("links", 20, (1.0, 10_000.0), "number of links"),
            Parameter::real("ratio", 10.0, (1e-6, 1e6), "mass of the end relative to a link"),
            LIFTED,
        ],
        bodies: |v| v[0] + 1.0,
        build: |v| Ok(jointed::chain(v[0] as usize, v[1] as f32, v[2] as f32)),
    },
    Entry {
        name: "bridge",
        summary: "planks on ball joints between two towers carry boxes: joints stay closed, no box falls off",
        parameters: &[
            Parameter::whole("planks", 20, (1.0, 1000.0), "number of planks"),
            Parameter::whole("boxes", 5, (0.0, 1000.0), "number of boxes; at most one a plank"),
        ],
        bodies: |v| v[0] + v[1],
        build: |v| {
            at_most(["boxes", "planks"], v[1], v[0])?;
            Ok(jointed::bridge(v[0] as usize, v[1] as usize))
        },
    },
    Entry {
        name: "joint-grid",
        summary: "n x n balls on ball joints swing down from one edge: joints stay closed, energy does not grow",
        parameters: &[
            Parameter::whole("n", 20, (1.0, 2000.0), "balls along each side"),
            Parameter::real(
                "ratio",
                1.0,
                (1e-6, 1e6),
                "mass of the ball in the middle of the free edge relative to the others",
            ),
        ],
        bodies: |v| v[0] * v[0],
        build: |v| Ok(jointed::grid(v[0] as usize, v[1] as f32)),
    },
    Entry {
        name: "four-bar",
        summary: "a motor turns a crank, a coupler swings a rocker: it stays within the angles that follow from the lengths",
        parameters: &[Parameter::real("speed", 6.0, (-20.0, 20.0), "speed of the crank [rad/s]")],
        bodies: |_| 3.0,
        build: |v| Ok(machines::four_bar(v[0] as f32)),
    },
    Entry {
        name: "drawbridge",
        summary: "two winches pull up a deck with a crate: at their speed, to the limit of its hinge",
        parameters: &[Parameter::real("load", 100.0, (0.0, 1000.0), "mass of the crate [kg]")],
        bodies: |_| 2.0,
        build: |v| Ok(machines::drawbridge(v[0] as f32)),
    },
    Entry {
        name: "car",
        summary: "a car on sprung wheels drives over bumps: it reaches its speed, upright",
        parameters: &[
            Parameter::real("speed", 5.0, (0.0, 20.0), "speed that its motors turn the wheels for [m/s]"),
            Parameter::real(
                "inside",
                0.0,
                (0.0, 0.2),
                "how far the wheels reach into the chassis, and collide with it [m]",
            ),
        ],
        bodies: |v| if v[1] > 0.0 { 9.0 } else { 5.0 },
        build: |v| Ok(machines::car(v[0] as f32, v[1] as f32)),
    },
    Entry {
        name: "vehicle",
        summary: "a vehicle on four sprung, driven wheels circles over hills: it stays upright",
        parameters: &[
            Parameter::real("speed", 6.0, (0.0, 30.0), "speed that its motors turn the wheels for [m/s]"),
            Parameter::real(
                "steering",
                10.0,
                (-35.0, 35.0),
                "angle of the front wheels, positive to the left [degrees]",
            ),
            Parameter::real("hills", 1.0, (0.0, 5.0), "height of the hills [m]"),
            Parameter::real("load", 0.0, (0.0, 1200.0), "mass that it carries [kg]"),
            Parameter::real("mu", 1.0, (0.0, 10.0), "friction of the wheels and the ground"),
        ],
        bodies: |_| 5.0,
        build: |v| vehicle::vehicle(v[0] as f32, v[1] as f32, v[2] as f32, v[3] as f32, v[4] as f32),
    },
    Entry {
        name: "course",
        summary: "stairs, a ramp, a turntable, crates and a steep slope: a character walks from end to end if keys steer it",
        parameters: &[Parameter::real("spin", 0.5, (-3.0, 3.0), "angular speed of the turntable [rad/s]")],
        bodies: |_| 3.0,
        build: |v| Ok(course::course(v[0] as f32)),
    },
    Entry {
        name: "ragdoll",
        summary: "n ragdolls fall down stairs: joints stay closed and within limits, all rest",
        parameters: &[Parameter::whole("n", 1, (1.0, 1000.0), "number of ragdolls")],
        bodies: |v| 11.0 * v[0],
        build: |v| Ok(machines::ragdoll(v[0] as usize)),
    },
    Entry {
        name: "ragdolls",
        summary: "n ragdolls, each turned another way, fall on the floor: all sleep",
        parameters: &[Parameter::whole("n", 20, (1.0, 1000.0), "number of ragdolls")],
        bodies: |v| 11.0 * v[0],
        build: |v| Ok(machines::ragdolls(v[0] as usize)),
    },
    Entry {
        name: "press",
        summary: "a press inside a crate on the floor: the crate is held and lies still",
        parameters: &[Parameter::real("depth", 0.05, (0.0, 0.4), "how deep the press is in the crate [m]")],
        bodies: |_| 1.0,
        build: |v| Ok(machines::press(v[0] as f32)),
    },
    Entry {
        name: "arch",
        summary: "a semicircle of wedges without mortar, mu 0.6: it stands from a thickness of 0.12 of the radius on",
        parameters: &[
            Parameter::whole("voussoirs", 17, (3.0, 201.0), "number of wedges"),
            Parameter::real("thickness", 0.15, (0.05, 0.5), "thickness relative to the mean radius"),
        ],
        bodies: |v| v[0],
        build: |v| masonry::arch(v[0] as usize, v[1]),
    },
    Entry {
        name: "card-house",
        summary: "pairs of thin plates lean against each other, plates across them carry the next storey: the house stands",
        parameters: &[
            Parameter::whole("storeys", 3, (1.0, 100.0), "number of storeys"),
            Parameter::real("angle", 20.0, (5.0, 45.0), "lean of the cards from the vertical [degrees]"),
            MU,
            Parameter::real("length", 1.0, (0.01, 10.0), "length of a card [m]"),
            Parameter::real("thickness", 0.04, (1e-4, 0.1), "thickness of a card [m]; at most a fifth of the length"),
        ],
        bodies: |v| 2.0 * triangle(v[0]) + v[0] - 1.0,
        build: |v| {
            let message = || format!("thickness = {}: must be at most a fifth of length = {}", v[4], v[3]);
            ensure(v[4] <= 0.2 * v[3], message)?;
            Ok(masonry::card_house(v[0] as usize, v[1], v[2] as f32, v[3], v[4]))
        },
    },
    Entry {
        name: "aqueduct",
        summary: "arches of wedges on piers of loose blocks, slabs on their crowns, no mortar: it stands",
        parameters: &[Parameter::whole("arches", 4, (1.0, 1000.0), "number of arches")],
        bodies: |v| 4.0 * (v[0] - 1.0) + 11.0 * v[0],
        build: |v| masonry::aqueduct(v[0] as usize),
    },
    Entry {
        name: "kapla",
        summary: "a tower of equal planks, each storey nine on end and six across: it stands",
        parameters: &[Parameter::whole("storeys", 7, (1.0, 1000.0), "number of storeys")],
        bodies: |v| 15.0 * v[0],
        build: |v| Ok(masonry::kapla(v[0] as usize)),
    },
    Entry {
        name: "dominoes",
        summary: "a row of dominoes, the first one pushed: all fall",
        parameters: &[Parameter::whole("n", 30, (1.0, 10_000.0), "number of dominoes")],
        bodies: |v| v[0],
        build: |v| Ok(masonry::dominoes(v[0] as usize)),
    },
    Entry {
        name: "pyramid-heavy",
        summary: "a plane pyramid of cubes, a heavy one on its tip: it stands",
        parameters: &[
            Parameter::whole("base", 10, (1.0, 2800.0), "cubes in the lowest row"),
            Parameter::real("ratio", 100.0, (1e-6, 1e6), "density of the cube on the tip relative to the others"),
        ],
        bodies: |v| triangle(v[0]) + 1.0,
        build: |v| Ok(masonry::pyramid_heavy(v[0] as usize, v[1] as f32)),
    },
    Entry {
        name: "drum",
        summary: "boxes in a drum that turns about a horizontal axis: none leaves",
        parameters: &[
            Parameter::whole("n", 200, (1.0, 1_000_000.0), "number of boxes"),
            Parameter::real("speed", 1.0, (-10.0, 10.0), "angular speed [rad/s]"),
        ],
        bodies: |v| v[0],
        build: |v| Ok(drum::drum(v[0] as usize, v[1] as f32)),
    },
    Entry {
        name: "conveyor",
        summary: "boxes ride along driven rollers at their speed, fall off the end and leave: as many leave as come",
        parameters: &[
            Parameter::real("length", 8.0, (2.0, 1000.0), "length of the conveyor [m]"),
            Parameter::real("speed", 1.0, (0.1, 2.5), "speed of the tops of the rollers [m/s]"),
            Parameter::whole("every", 120, (1.0, 1e6), "steps from one box to the next"),
        ],
        bodies: |_| 1.0,
        build: |v| flow::conveyor(v[0] as f32, v[1] as f32, v[2] as u32),
    },
    Entry {
        name: "belts",
        summary: "boxes and balls ride round on four belts: all come round, none leaves",
        parameters: &[
            Parameter::whole("n", 24, (1.0, 40.0), "number of boxes and balls"),
            Parameter::real("speed", 1.0, (0.1, 3.0), "speed of the belts [m/s]"),
        ],
        bodies: |v| v[0],
        build: |v| Ok(flow::belts(v[0] as usize, v[1] as f32)),
    },
    Entry {
        name: "held",
        summary: "damping, a largest speed, a cone, a load on a hinge, a spring, locked axes: each as its formula says",
        parameters: &[
            Parameter::real("damping", 3.0, (0.0, 100.0), "damping of the ball on the left [1/s]"),
            Parameter::real("cone", 30.0, (1.0, 170.0), "angle of the cone of the arm [degrees]"),
            Parameter::real("load", 0.5, (0.0, 0.99), "torque on the flag, relative to the torque that holds it level"),
        ],
        bodies: |_| 6.0,
        build: |v| held::held(v[0] as f32, v[1] as f32, v[2] as f32),
    },
    Entry {
        name: "turnstile",
        summary: "balls roll down a channel and push a cross of four arms: one passes in a quarter turn, all in the end",
        parameters: &[
            Parameter::whole("n", 12, (1.0, 1e6), "number of balls"),
            Parameter::whole("every", 60, (40.0, 1e6), "steps from one ball to the next"),
        ],
        bodies: |_| 1.0,
        build: |v| Ok(flow::turnstile(v[0] as u32, v[1] as u32)),
    },
    Entry {
        name: "galton",
        summary: "balls fall past pins into bins, and sensors count them: every ball passes the gate and ends in a bin",
        parameters: &[
            Parameter::whole("n", 60, (1.0, 1000.0), "number of balls"),
            Parameter::whole("rows", 8, (2.0, 50.0), "rows of pins; one bin more"),
            Parameter::whole("every", 15, (12.0, 1e6), "steps from one ball to the next"),
            Parameter::whole("seed", 1, (0.0, (1_u64 << 53) as f64), "seed of the places where balls come"),
        ],
        bodies: |_| 0.0,
        build: |v| Ok(flow::galton(v[0] as u32, v[1] as usize, v[2] as u32, v[3] as u64)),
    },
    Entry {
        name: "terrain",
        summary: "thin slabs, coins and balls fall on hills of triangles: none goes through",
        parameters: &[
            Parameter::whole("n", 60, (1.0, 10_000.0), "number of bodies"),
            Parameter::real("height", 5.0, (0.0, 100.0), "height of the fall of the lowest [m]"),
            Parameter::whole("seed", 1, (0.0, (1_u64 << 53) as f64), "seed of the places and tilts"),
        ],
        bodies: |v| v[0],
        build: |v| fast::terrain(v[0] as usize, v[1] as f32, v[2] as u64),
    },
    Entry {
        name: "bullets",
        summary: "balls of 2 cm, marked as swept, fly in a room of sheets of 1 mm: none leaves",
        parameters: &[
            Parameter::whole("n", 64, (1.0, 10_000.0), "number of balls"),
            Parameter::real("speed", 300.0, (1.0, 1000.0), "speed of each at the start [m/s]"),
            Parameter::whole("seed", 1, (0.0, (1_u64 << 53) as f64), "seed of the directions"),
        ],
        bodies: |v| v[0],
        build: |v| Ok(fast::bullets(v[0] as usize, v[1] as f32, v[2] as u64)),
    },
    Entry {
        name: "family",
        summary: "a random world with a known outcome, as `drystone hard --families` judges",
        parameters: &[
            Parameter::word("kind", &Family::NAMES, "family of worlds"),
            Parameter::whole("seed", 1, (0.0, (1_u64 << 53) as f64), "seed of all that is drawn"),
        ],
        // Only a drawn world has this number. It is at most a few hundred.
        bodies: |v| families::drawn(v[0] as usize, v[1] as u64).map_or(0.0, |scene| scene.world.dynamic_count() as f64),
        build: |v| families::drawn(v[0] as usize, v[1] as u64),
    },
];
