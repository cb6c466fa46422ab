//! The constants of the solver that are judgments. Settings, limits of numbers, sizes of tasks and tolerances of
//! geometry stand where they belong.
//!
//! None is a length, a speed or a mass. docs/robust.md has the effect of a change by 30 %.

// Bodies that begin at rest: src/rest.

/// Smallest rise of the normal of a supporting contact, as the sine of its angle from the horizontal.
pub const MIN_RISE: f64 = 0.01;
/// Stiffness of single points, and of friction, relative to that of whole manifolds. A manifold has one preload, so its
/// points should carry equal loads where they can.
pub const POINT_STIFFNESS: f64 = 0.02;
/// The share of a load that may stay unbalanced, and by which friction may exceed its limit.
pub const UNBALANCED: f64 = 1e-4;
/// Stiffness against motions that no point resists, relative to the largest stiffness.
pub const NO_RESISTANCE: f64 = 1e-10;
/// Forces below this share of the largest force are rounding errors.
pub const NO_FORCE: f64 = 1e-9;
/// Most rounds of letting go of points, of friction, and of bodies that rest on falling bodies.
pub const MAX_ROUNDS: usize = 24;

// Loads, and the substeps that they need: src/load.rs, src/effort.rs.

/// Bodies are level, and bodies touch, if they are apart by at most this share of the size of the upper body.
pub const LEVEL: f64 = 0.1;
/// Largest load of a contact, over the sum of the loads of its island. A body that leans on others, as a wedge does,
/// presses with more than its weight.
pub const LEVERAGE: f32 = 4.0;
/// Fewest substeps of an island with a body that began unbalanced, until the body rests or falls. Of 15 arches with 13
/// to 41 wedges, 0.12 of the radius thick, 4 stand with 8 substeps, 9 with 16 and 10 with 32.
pub const UNBALANCED_SUBSTEPS: f32 = 32.0;
/// A body as fast as after a fall of this time does not come to rest in place (s).
pub const FALL: f32 = 0.1;
/// Steps in which the next lower class is enough, after which an island goes down one class, up to [`LONG_SUBSTEPS`].
/// Each class above halves the number. With 60 steps, one more of 750 stacks, leaned towers, card houses, plank towers
/// and piles passes, and dropped walls and pyramids take 1.3 to 1.5 times as long in their first 100 steps.
pub const DESCENT_STEPS: u32 = 30;
/// The share of the promise that the next lower class has to keep.
pub const DESCENT_SHARE: f32 = 0.5;
/// From this number of substeps on, a class falls after a number of substeps and not of steps, because each step costs
/// more.
pub const LONG_SUBSTEPS: u32 = 64;

// Contacts: src/problem, src/plan.

/// Largest preload of a contact, relative to its overlap at rest under its load.
pub const LARGEST_PRELOAD: f64 = 2.0;
/// No solid of even density jams with friction up to this. A point at the distance r from the center of such a solid
/// has m r²/I <= 15, and with that ratio friction below 8/15 jams no point (docs/derivation.md, section 6).
pub const MIN_JAMMING: f32 = 0.53;
/// Number of sweeps over a jamming contact before the next contact. A rod whose tip is pushed into a floor (`drystone
/// hard --case painleve`) gains up to 2.8e-2 of its energy in a step with 1 sweep, 7.7e-3 with 2, 5.4e-4 with 4 and
/// 1e-5 with 8, at 4 to 128 substeps.
pub const JAMMED_PASSES: u8 = 8;
/// In shorter substeps than this (s), velocities are changes since the start of the step. Sums of velocities have a
/// squared error of 3e-6 m²/s² in the scene `rolling` at 1/8000 s and 3e-4 at 1/32,000 s. They change the energy of a
/// free rotation in 20 s by 8e-6 at 1/480 s and by 3e-5 at 1/1920 s.
pub const LONGEST_FROM_START: f32 = 1.0 / 1000.0;

// Joints: src/problem, src/kernels.

/// Largest turn of a spring in a substep (rad). The solver integrates stiffer springs implicitly, which takes energy
/// away. Otherwise several such springs on one body would gain energy.
pub const STIFFEST: f32 = 0.5;
/// (h w)² above which a body gets stiffness inertia, where w is the frequency at which it swings under the pull of its
/// joints. Explicit steps are stable below 4. The value was measured on chains of 10 to 300 links with 1000 times the
/// mass at the end, which go slack and snap, over 50 s. With 3 no chain gains energy and gaps stay below 25 mm. With 2
/// and less, energy grows by up to 0.1 of the swing, as the added inertia comes and goes. With 4 gaps reach 2.5 m.
pub const SWING_LIMIT: f64 = 3.0;
/// Half the substep has to reduce the gap of a joint to this fraction. If the shortest substeps do not, a load that
/// cannot be met holds it open, and the step is not taken again until the gap has grown by the inverse. Gaps that motion
/// opens fall to a quarter.
pub const HELPS: f32 = 0.5;
/// The largest turn of a body against another in a step for which the angles of their joint keep the directions that
/// they have when the step begins (rad). The angles are then off by half of its square.
pub const SLOW_TURN: f32 = 0.02;
/// Most products of blocks for each node of a system of joints. A chain of balls has 1, a ring 3, and a ladder with two
/// joints at each seam 6. A sheet of 16 x 16 balls has 100, where more substeps are cheaper.
pub const MAX_TERMS_A_NODE: usize = 24;
/// Softness of joints in loops. Loops may be redundant, as in a flat sheet: S is then singular and determines no impulse.
/// 2^-14 / 3 is above the rounding errors of the sums of its products.
pub const LOOP_SOFTNESS: f32 = 6.103_515_6e-5 / 3.0;
/// Softness of joints in trees with locked angles, 2^-19 / 3, above the rounding errors. In single precision the turn
/// of one link is lost in the turn of a long lever of links: the pivot of the link is a difference of numbers 1e7 times
/// as large.
pub const AXIS_SOFTNESS: f32 = 1.907_348_6e-6 / 3.0;
/// The share of its softness by which a joint yields to its whole impulse. It yields to the change of the impulse in a
/// substep by all of its softness, so the impulses of a lasting load grow within some substeps to what holds the load.
/// Where loops have no solution, impulses would grow without end with 0.
pub const YIELDING: f64 = 0.125;
/// The smallest pivot of a row, relative to the trace of its block in S: 2^-20, above the rounding errors of the
/// products that are subtracted from a pivot. A smaller pivot is raised to this, so corrections are too small, never
/// too large.
pub const MIN_PIVOT: f64 = 9.536_743_164_062_5e-7;
/// The least movement of bodies with locked axes, relative to that of free ones: 2^-20.
pub const MIN_MOVED: f64 = 9.536_743_164_062_5e-7;
/// Stiffness that every direction of the block of a joint gets, relative to its trace: 2^-19. Rounding changes the
/// determinant of a block with a trace of 1 to 2 by 3e-7.
pub const STIFFENING: f64 = 1.907_348_632_812_5e-6;

// The law of energy: src/energy.rs.

/// Limits of an island's reserve, the part of its earlier losses that it can regain: this share of its kinetic energy,
/// plus [`ROUNDING`].
pub const REGAINED: f64 = 1e-3;
/// The share of the weight of its bodies times their size that an island can regain.
pub const ROUNDING: f64 = 1e-6;
/// The distance between the highest and the lowest place that rounding gives a jointed body, relative to its distance
/// from the origin plus its lever: the position, the rotation, the arm and their sum each round by up to half of
/// `EPSILON`, up or down.
pub const LAST_BITS: f64 = 4.0 * f32::EPSILON as f64;
/// Largest number of substeps in a step for which rounding of velocities adds up. Shorter substeps sum changes, which
/// round less.
pub const MAX_ROUNDINGS: f64 = 16.0;
/// Share of its energy by which a spring of the caller has to grow between two steps to count as one that jumped.
pub const MIN_JUMP: f64 = 0.1;

// Sleep and events: src/sleep.rs, src/simulation/events.rs.

/// Overlap, relative to the promised sag, above which a body that still comes out of another stays awake. Preloads lift
/// resting bodies out of deeper overlaps.
pub const DEEP_OVERLAP: f32 = 0.25;
/// A body comes out of another if its present speed ends the overlap within this time (s).
pub const COMING_OUT: f32 = 10.0;
/// Number of steps between two searches for islands that sleep.
pub const STEPS_TO_SLEEP: u32 = 8;
/// While more than this share of the approach speed remains after a step, the hit waits for the next step before it is
/// reported.
pub const UNFINISHED: f32 = 0.01;
