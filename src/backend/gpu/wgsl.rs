//! The WGSL of every program: parts from files, declarations of buffers, and an entry point that calls the kernels.

use std::fmt::Write;
use std::sync::Arc;

use super::bindings::declarations;
use crate::collide::MAX_POINTS;
use crate::config::FrictionRule;
use crate::kernels::Rules;
use crate::kernels::momentum::IMPULSES_PER_CHUNK;
use crate::plan::Kernel;

/// Threads of a workgroup, where [`Target`] does not say otherwise.
pub const WORKGROUP: u32 = 64;
/// Rows of the uniform with the passes of one dispatch: 16 KiB, which every adapter supports.
pub const PASS_ROWS: usize = 1024;
/// Name of every entry point.
pub const ENTRY_POINT: &str = "main";

/// The kind of adapter for which a program is written. Results have the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// A GPU. It waits for memory, so a thread loads much at once, and a color spreads over as many processors as it
    /// can. On an NVIDIA H200, with points in arrays, a step of 20,000 boxes takes 3.6 ms with 32 threads a workgroup,
    /// 4.1 with 64 and 5.4 with 128; with points in registers, 32 and 64 differ by less than the spread.
    Hardware,
    /// A processor. llvmpipe restarts every thread of a workgroup, which costs more than a loop over more rows: a step
    /// of a settled pile of 1,000 takes 13.1 ms with 1 row a thread and 11.7 ms with 4.
    Software,
}

impl Target {
    /// Threads of a workgroup of rows in any order.
    pub fn threads(self) -> u32 {
        match self {
            Self::Hardware => 32,
            Self::Software => WORKGROUP,
        }
    }

    /// Number of rows for a thread.
    pub fn rows_a_thread(self) -> u32 {
        match self {
            Self::Hardware => 1,
            Self::Software => 4,
        }
    }

    /// Largest number of threads of the workgroup of a whole step: at most 256, which every adapter has.
    pub fn threads_of_step(self) -> u32 {
        match self {
            Self::Hardware => 256,
            Self::Software => WORKGROUP,
        }
    }

    /// Number of dispatches that the host encodes before it sends them. Hardware runs them while the host encodes the
    /// next; a software adapter needs the same processors for both. On an NVIDIA H200, stage `run` of a pile of
    /// 1,000 takes 1.6 ms with 32 or 64, 1.7 with 128 and 1.9 with all at once.
    pub fn dispatches_at_once(self) -> usize {
        match self {
            Self::Hardware => 64,
            Self::Software => usize::MAX,
        }
    }
}

/// Reads a shader part at compile time.
macro_rules! part {
    ($name:literal) => {
        include_str!(concat!("../../../shaders/", $name, ".wgsl"))
    };
}

/// The files of a kernel over joints, for joints with axes or without axes.
macro_rules! of_joints {
    ($axes:expr, $name:literal) => {
        if $axes {
            &[part!("lib/pair"), part!("lib/joint"), part!("lib/angles"), part!("lib/axes"), part!($name)] as &[&str]
        } else {
            &[part!("lib/pair"), part!("lib/joint"), part!("lib/no_axes"), part!($name)]
        }
    };
}

/// The program of a pipeline.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Program {
    /// A kernel of a plan over the rows of its colors, in any order.
    Pass(Kernel),
    /// A kernel of a plan over its colors in order. One workgroup runs it, with a barrier after each color.
    Fused(Kernel),
    /// All kernels of a plan. One workgroup with this number of threads runs the passes.
    OneDispatch(Arc<[Kernel]>, u32),
    /// Sets the movements of all bodies to zero.
    BeginBodies,
    /// Writes the recomputed rows of contacts.
    WriteContacts,
    /// Writes separations and preloads of all contacts.
    BeginContacts,
}

impl Program {
    /// The programs that begin a step from the rows on the device.
    pub const RESIDENT: [Self; 3] = [Self::BeginBodies, Self::WriteContacts, Self::BeginContacts];

    /// Its name in measurements and messages. For a kernel, it is the name of the file.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pass(kernel) | Self::Fused(kernel) => kernel.name(),
            Self::OneDispatch(..) => "one_dispatch",
            Self::BeginBodies => "begin_bodies",
            Self::WriteContacts => "write_contacts",
            Self::BeginContacts => "begin_contacts",
        }
    }

    /// Threads of its workgroups.
    pub fn threads(&self, target: Target) -> u32 {
        match self {
            // Their sums have the order of this number of threads.
            Self::Pass(Kernel::MeasureStep | Kernel::UpdateMomentum) => WORKGROUP,
            Self::Pass(_) => target.threads(),
            Self::OneDispatch(_, threads) => *threads,
            _ => WORKGROUP,
        }
    }

    /// Its WGSL text.
    pub fn source(&self, target: Target) -> String {
        let of_plan = |kernels, fused, range, main: fn(&[String]) -> String| {
            of_plan(kernels, target, self.threads(target), fused, range, main)
        };
        match self {
            Self::Pass(kernel) => {
                of_plan(&[*kernel], false, "colors[pass_row.first], colors[pass_row.end]", <[String]>::concat)
            }
            Self::Fused(kernel) => of_plan(&[*kernel], true, "pass_row.first, pass_row.end", <[String]>::concat),
            Self::OneDispatch(kernels, _) => of_plan(kernels, true, "step.y, step.z", follow_passes),
            Self::BeginBodies => of_begin(&[part!("resident/begin_bodies")], "begin_body", "body_count"),
            Self::WriteContacts => {
                let parts = &[part!("lib/prepare"), part!("resident/write_contacts")];
                of_begin(parts, "write_contact", "written_count")
            }
            Self::BeginContacts => of_begin(&[part!("resident/begin_contacts")], "begin_contact", "contact_count"),
        }
    }
}

/// The files of a kernel, and the call of its function: for one `row`, or for all rows if the kernel finds them itself.
fn kernel_text(kernel: Kernel, target: Target) -> (&'static [&'static str], String) {
    let with = |name: &str, rules: Rules| format!("{name}({}, row)", rules_text(rules));
    match kernel {
        Kernel::IntegrateVelocities { warm_start, from_start } => {
            let call = format!("integrate_velocity({warm_start}, {from_start}, row)");
            (&[part!("integrate_velocities")], call)
        }
        Kernel::BeginChanges => (&[part!("begin_changes")], "begin_change(row)".into()),
        Kernel::EndChanges => (&[part!("end_changes")], "end_change(row)".into()),
        Kernel::IntegrateTorques { from_start } => {
            (&[part!("integrate_torques")], format!("integrate_torque({from_start}, row)"))
        }
        Kernel::DampVelocities { from_start } => {
            (&[part!("damp_velocities")], format!("damp_velocity({from_start}, row)"))
        }
        Kernel::IntegrateGyroscopic { from_start } => {
            (&[part!("integrate_gyroscopic")], format!("turn_spin({from_start}, row)"))
        }
        Kernel::IntegratePositions { from_start } => {
            (&[part!("integrate_positions")], format!("integrate_position({from_start}, row)"))
        }
        Kernel::ClearImpulses => (&[part!("clear_impulses")], "clear_contact(row)".into()),
        Kernel::SumImpulses { first } => (&[part!("sum_impulses")], format!("sum_contact({first}, row)")),
        Kernel::SumJointImpulses { first } => (&[part!("sum_joint_impulses")], format!("sum_joint({first}, row)")),
        Kernel::BeginSweep { first } => (&[part!("begin_sweep")], format!("begin_sweep({first})")),
        Kernel::Extrapolate { first, measured } => {
            (&[part!("extrapolate")], format!("extrapolate({first}, {measured}, first, stride)"))
        }
        Kernel::MeasureStep => {
            (&[part!("lib/sum"), part!("measure_step")], "measure_step(thread, group.x, groups.x)".into())
        }
        Kernel::UpdateMomentum => (&[part!("lib/sum"), part!("update_momentum")], "update_momentum(thread)".into()),
        Kernel::WarmStartJoints { axes } => (of_joints!(axes, "warm_start_joints"), "warm_start_joint(row)".into()),
        Kernel::TurnInertias => (&[part!("turn_inertias")], "turn_inertia(row)".into()),
        Kernel::BeginSystems => {
            let parts = &[
                part!("lib/pair"),
                part!("lib/joint"),
                part!("lib/angles"),
                part!("lib/axes"),
                part!("lib/joint_system"),
                part!("begin_systems"),
            ];
            (parts, "begin_system(row)".into())
        }
        Kernel::MeasureJoints(rules) => (of_joints!(true, "measure_joints"), with("measure_joint", rules)),
        Kernel::SolveJointSystems(rules) => {
            let parts = &[part!("lib/joint_system"), part!("solve_joint_systems")];
            (parts, with("solve_system", rules))
        }
        Kernel::ApplyJointChanges(rules) => {
            (of_joints!(true, "apply_joint_changes"), with("apply_joint_change", rules))
        }
        Kernel::SolveJoints(rules) => (of_joints!(rules.axes, "solve_joints"), with("solve_joint", rules)),
        Kernel::SolveAxes(rules) => (of_joints!(true, "solve_axes"), with("solve_swept_axes", rules)),
        Kernel::WarmStart(rules) => (&[part!("lib/pair"), part!("warm_start")], with("warm_start_contact", rules)),
        Kernel::SolveContacts(rules) => {
            macro_rules! with_points {
                ($points:literal) => {
                    &[
                        part!("lib/pair"),
                        part!("lib/contact"),
                        part!("lib/friction"),
                        part!($points),
                        part!("solve_contacts"),
                    ]
                };
            }
            let parts = match target {
                Target::Hardware => with_points!("lib/points_in_registers"),
                Target::Software => with_points!("lib/points_in_memory"),
            };
            (parts, with("solve_contact", rules))
        }
        Kernel::ApplyRestitution(rules) => {
            (&[part!("lib/pair"), part!("lib/contact"), part!("apply_restitution")], with("restitute_contact", rules))
        }
    }
}

/// The rules as a constant of the struct `Rules` of `lib/rules.wgsl`.
fn rules_text(rules: Rules) -> String {
    let Rules {
        biased,
        patch,
        rolls,
        friction_first,
        accumulated,
        round,
        as_one,
        passes,
        driven,
        measured,
        from_start,
        isotropic,
        bounces,
        friction,
        axes: _,
    } = rules;
    let friction = match friction {
        FrictionRule::None => "NONE",
        FrictionRule::Slip => "SLIP",
        FrictionRule::Box => "BOX",
        FrictionRule::Disc => "DISC",
    };
    format!(
        "Rules({biased}, FRICTION_{friction}, {patch}, {rolls}, {friction_first}, {accumulated}, {round}, {as_one}, {passes}u, {driven}, {measured}, {from_start}, {isotropic}, {bounces})"
    )
}

/// The WGSL of some kernels. `range` is the WGSL for the colors of a pass if the colors are `fused`, otherwise for the
/// places of its rows. `main` turns the calls into the body of the entry point.
fn of_plan(
    kernels: &[Kernel],
    target: Target,
    threads: u32,
    fused: bool,
    range: &str,
    main: fn(&[String]) -> String,
) -> String {
    // A stage has at most eight storage buffers. `convergence` is one of them only if a kernel measures corrections,
    // and `free` only if a kernel reads it.
    let is_measured = kernels.iter().any(|kernel| kernel.is_measured());
    let reads_start = kernels.iter().any(|kernel| kernel.reads_start());
    let mut parts = vec![
        part!("lib/types"),
        part!("lib/math"),
        part!("lib/rules"),
        if is_measured { part!("lib/measured") } else { part!("lib/unmeasured") },
        if reads_start { part!("lib/from_start") } else { part!("lib/whole") },
    ];
    let (mut calls, mut loops) = (Vec::new(), String::new());
    for (at, &kernel) in kernels.iter().enumerate() {
        let (own, call) = kernel_text(kernel, target);
        for part in own {
            if !parts.contains(part) {
                parts.push(part);
            }
        }
        calls.push(match kernel {
            // These kernels find their rows themselves.
            Kernel::Extrapolate { .. } | Kernel::MeasureStep | Kernel::UpdateMomentum => format!("{call};"),
            Kernel::BeginSweep { .. } => over_count("1u", &call),
            _ => {
                let [rows, colors] = ["over_rows", "over_colors"].map(|name| format!("{name}_{at}"));
                loops += &part!("lib/over_rows").replace("over_rows", &rows).replace("over_row(row)", &call);
                if fused {
                    loops += &part!("lib/over_colors").replace("over_rows", &rows).replace("over_colors", &colors);
                }
                format!("{}({range}, first, stride);", if fused { colors } else { rows })
            }
        });
    }
    text(true, threads, &parts, &loops, &main(&calls))
}

/// The WGSL of a program that begins a step: it calls a function for each of `count` rows.
fn of_begin(own: &[&str], function: &str, count: &str) -> String {
    let main = over_count(&format!("resident.{count}"), &format!("{function}(row)"));
    let parts = [&[part!("lib/types"), part!("lib/math")], own].concat();
    text(false, WORKGROUP, &parts, "", &main)
}

fn over_count(count: &str, call: &str) -> String {
    format!("for (var row = first; row < {count}; row += stride) {{ {call}; }}")
}

/// All threads run the passes, with a barrier after each pass.
fn follow_passes(calls: &[String]) -> String {
    let mut cases = String::new();
    for (at, call) in calls.iter().enumerate() {
        writeln!(cases, "            case {at}u: {{ {call} }}").expect("memory takes it");
    }
    format!(
        "for (var i = 1u; i <= passes[0].x; i++) {{
        let step = passes[i];
        switch step.x {{
{cases}            default: {{}}
        }}
        storageBarrier();
    }}"
    )
}

/// A shader: constants, buffers, parts, and an entry point with the body `main`. In `main` the first row of a thread is
/// `first`, and its rows are `stride` apart.
fn text(of_plan: bool, threads: u32, parts: &[&str], loops: &str, main: &str) -> String {
    let (buffers, parts) = (declarations(of_plan), parts.join("\n"));
    format!(
        "const WORKGROUP: u32 = {threads}u;
const MAX_POINTS: u32 = {MAX_POINTS}u;
const IMPULSES_PER_CHUNK: u32 = {IMPULSES_PER_CHUNK}u;
const PASS_ROWS: u32 = {PASS_ROWS}u;

{buffers}
{parts}
{loops}
@compute @workgroup_size(WORKGROUP)
fn {ENTRY_POINT}(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) thread: u32,
    @builtin(num_workgroups) groups: vec3u,
) {{
    let first = group.x * WORKGROUP + thread;
    let stride = groups.x * WORKGROUP;
    {main}
}}
"
    )
}
