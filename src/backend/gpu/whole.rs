//! A small world in one dispatch: one workgroup follows the whole plan, with a barrier after every pass.
//!
//! A dispatch costs as much as a sweep over hundreds of contacts. Where no pass has more rows than a workgroup goes over in a
//! few rounds, the kernels of the plan are put together into one shader: each as it is, under names of its own and with its
//! rules as constants, called in the order of the passes, which stand in a uniform. Results are the same to the last bit.
//!
//! A tower of ten on the software adapter, 33 passes: 1.15 ms a step in 33 dispatches, 1.05 in one of 64 threads, 0.39 in one of
//! 8, which are one subgroup there, so that a barrier is none.

use std::fmt::Write;

use super::shader::{Program, WORKGROUP, constants, own_source};
use crate::plan::{Kernel, Pass};
use crate::problem::StepProblem;

/// Most rows that a pass may have: four for each thread.
const MOST_ROWS: usize = 256;
/// Most passes: what a uniform of 16 KiB holds, with their number in front.
const MOST_PASSES: usize = 1023;
/// Fewest passes that are worth a shader of their own.
const FEWEST_PASSES: usize = 4;

/// The program for all passes and what it reads, one row a pass after their number; none where the world is too large for one
/// workgroup, or the plan has what needs more than one.
pub(super) fn of(problem: &StepProblem, passes: &[Pass]) -> Option<(Program, Vec<[u32; 4]>)> {
    let rows = |pass: &Pass| {
        let colors = pass.colors.clone().map(|color| problem.rows_of(&(color..color + 1)).len());
        colors.max().unwrap_or(0)
    };
    let fits = problem.bodies.len() <= MOST_ROWS
        && problem.points.len() <= 4 * MOST_ROWS
        && (FEWEST_PASSES..=MOST_PASSES).contains(&passes.len())
        && passes.iter().all(|pass| is_alone(pass.kernel) && rows(pass) <= MOST_ROWS);
    if !fits || needs_many_buffers(problem, passes) {
        return None;
    }
    let mut kernels: Vec<Kernel> = Vec::new();
    let mut table = vec![[passes.len() as u32, 0, 0, 0]];
    for pass in passes {
        let known = kernels.iter().position(|kernel| *kernel == pass.kernel).unwrap_or(kernels.len());
        if known == kernels.len() {
            kernels.push(pass.kernel);
        }
        table.push([known as u32, pass.colors.start, pass.colors.end, 0]);
    }
    // As long for every plan, as the shader has it.
    table.resize(MOST_PASSES + 1, [0; 4]);
    // As many threads as the largest color has rows: where they are one subgroup, barriers cost nothing.
    let threads = passes.iter().map(rows).max().unwrap_or(0).next_power_of_two().clamp(8, WORKGROUP as usize);
    Some((Program::Whole(kernels.into(), threads as u32), table))
}

/// Whether threads of a kernel share nothing but rows, so that it can be one of many.
fn is_alone(kernel: Kernel) -> bool {
    !matches!(kernel, Kernel::Extrapolate { .. } | Kernel::MeasureStep | Kernel::UpdateMomentum)
}

/// Whether all kernels together need more than the eight storage buffers of a stage: bodies, masses, free, contacts, points,
/// impulses and colors are seven.
fn needs_many_buffers(problem: &StepProblem, passes: &[Pass]) -> bool {
    let measured = passes.iter().any(|pass| matches!(pass.kernel, Kernel::BeginSweep { .. }));
    let contacts = if problem.contacts.is_empty() { 0 } else { 3 };
    let joints = if problem.joints.is_empty() { 0 } else { 2 };
    let colors = usize::from(contacts + joints > 0);
    3 + contacts + joints + colors + usize::from(!problem.inertias.is_empty()) + usize::from(measured) > 8
}

/// The WGSL of all `kernels` together.
pub(super) fn source(kernels: &[Kernel], threads: u32) -> String {
    let mut text = [
        include_str!("../../../shaders/lib/types.wgsl"),
        include_str!("../../../shaders/lib/bindings.wgsl"),
        include_str!("../../../shaders/lib/math.wgsl"),
    ]
    .join("\n")
    .replace(&format!("WORKGROUP: u32 = {WORKGROUP}u"), &format!("WORKGROUP: u32 = {threads}u"));
    let mut calls = String::new();
    for (at, &kernel) in kernels.iter().enumerate() {
        let (own, takes_rows) = as_function(kernel, at);
        text.push_str(&own);
        let (name, arguments) = (kernel.name(), "thread, groups, PassColors(step.y, step.z)");
        let call = format!("{name}_{at}({})", if takes_rows { arguments } else { "" });
        let call = if takes_rows { format!("{call};") } else { format!("if thread.x == 0u {{ {call}; }}") };
        writeln!(calls, "            case {at}u: {{ {call} }}").expect("memory takes it");
    }
    text + &format!(
        "
@group(0) @binding(22) var<uniform> passes: array<vec4u, {}>;

@compute @workgroup_size(WORKGROUP)
fn whole_step(@builtin(local_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u) {{
    for (var i = 1u; i <= passes[0].x; i++) {{
        let step = passes[i];
        switch step.x {{
{calls}            default: {{}}
        }}
        storageBarrier();
    }}
}}
",
        MOST_PASSES + 1
    )
}

/// The own parts of a kernel with its entry point as a function, every name with a number; and whether it goes over rows.
fn as_function(kernel: Kernel, number: usize) -> (String, bool) {
    let mut own = own_source(kernel);
    for (name, value) in constants(kernel) {
        // What is not done asks for no buffer.
        if value == 0.0 {
            own = without(own, &format!("if {name} {{"));
        }
        own = with_constant(&own, name, value);
    }
    let begin = own.find("@compute").expect("every kernel has an entry point");
    let signature = begin + own[begin..].find('{').expect("it has a body");
    let takes_rows = own[begin..signature].contains("global_invocation_id");
    let arguments = if takes_rows { "id: vec3u, groups: vec3u, pass_colors: PassColors" } else { "" };
    own.replace_range(begin..signature, &format!("fn {}({arguments}) ", kernel.name()));
    let names: Vec<String> = declared(&own);
    (numbered(&own, &names, number), takes_rows)
}

/// The text without the blocks that begin so.
fn without(mut text: String, begin: &str) -> String {
    while let Some(at) = text.find(begin) {
        let mut depth = 0;
        let is_end = |c: char| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            c == '}' && depth == 0
        };
        let end = at + text[at..].find(is_end).expect("it ends") + 1;
        // A block that is one of two ways stays.
        if text[end..].trim_start().starts_with("else") {
            return text;
        }
        text.replace_range(at..end, "");
    }
    text
}

/// A declaration `override NAME: type = default;` as a constant of that type.
fn with_constant(text: &str, name: &str, value: f64) -> String {
    let begin = text.find(&format!("override {name}:")).expect("every constant is an override of its kernel");
    let end = begin + text[begin..].find(';').expect("it ends");
    let kind = text[begin..end].split([':', '=']).nth(1).expect("it has a type").trim();
    let value = match kind {
        "bool" => (value != 0.0).to_string(),
        _ => format!("{value}u"),
    };
    format!("{}const {name}: {kind} = {value}{}", &text[..begin], &text[end..])
}

/// Names that a text declares outside of functions.
fn declared(text: &str) -> Vec<String> {
    let of = |line: &str| {
        let rest = ["fn ", "const ", "struct "].iter().find_map(|word| line.strip_prefix(word))?;
        Some(rest.chars().take_while(|c| is_of_name(*c)).collect())
    };
    text.lines().filter_map(of).collect()
}

/// The text with a number after each of these names; fields of the same name stay.
fn numbered(text: &str, names: &[String], number: usize) -> String {
    let mut result = String::with_capacity(2 * text.len());
    let mut rest = text;
    while let Some(begin) = rest.find(is_of_name) {
        let end = begin + rest[begin..].find(|c| !is_of_name(c)).unwrap_or(rest.len() - begin);
        result.push_str(&rest[..end]);
        let is_field = rest[..begin].ends_with('.');
        if !is_field && names.iter().any(|name| *name == rest[begin..end]) {
            write!(result, "_{number}").expect("memory takes it");
        }
        rest = &rest[end..];
    }
    result + rest
}

fn is_of_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}
