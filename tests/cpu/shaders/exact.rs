//! In exact mode every program only adds and multiplies, no driver may fuse, and no index leaves its buffer.

use std::collections::BTreeSet;

use super::every_text;
use drystone::config::FrictionRule;
use drystone::stages::backend::shader::{Program, Reflected, Target, exact_spirv};
use drystone::stages::kernels::Rules;
use drystone::stages::plan::Kernel;

/// Operations that may make a float, or a vector of floats: reading, moving, choosing, and + - * in a written order.
const EXACT: [u32; 14] = [
    55,  // OpFunctionParameter
    57,  // OpFunctionCall
    61,  // OpLoad
    79,  // OpVectorShuffle
    80,  // OpCompositeConstruct
    81,  // OpCompositeExtract
    124, // OpBitcast
    127, // OpFNegate
    129, // OpFAdd
    131, // OpFSub
    133, // OpFMul
    142, // OpVectorTimesScalar
    169, // OpSelect
    245, // OpPhi
];
const ROUNDS: [u32; 5] = [127, 129, 131, 133, 142];
const TYPE_FLOAT: u32 = 22;
const TYPE_VECTOR: u32 = 23;
const FUNCTION: u32 = 54;
const DECORATE: u32 = 71;
const NO_CONTRACTION: u32 = 42;

fn instructions(words: &[u32]) -> Vec<(u32, &[u32])> {
    let (mut rest, mut all) = (&words[5..], Vec::new());
    while let Some(&first) = rest.first() {
        let (instruction, after) = rest.split_at((first >> 16) as usize);
        all.push((first & 0xffff, &instruction[1..]));
        rest = after;
    }
    all
}

/// Opcodes that make floats in a way that is not exact, or that a driver may fuse.
fn inexact(words: &[u32]) -> BTreeSet<u32> {
    let all = instructions(words);
    let mut floats = BTreeSet::new();
    for (opcode, operands) in &all {
        if *opcode == TYPE_FLOAT || (*opcode == TYPE_VECTOR && floats.contains(&operands[1])) {
            floats.insert(operands[0]);
        }
    }
    let kept = |(opcode, operands): &(u32, &[u32])| {
        (*opcode == DECORATE && operands[1] == NO_CONTRACTION).then(|| operands[0])
    };
    let kept: BTreeSet<_> = all.iter().filter_map(kept).collect();
    // In functions the first operand of what has a result is its type, and no other instruction names a type there.
    all.iter()
        .skip_while(|(opcode, _)| *opcode != FUNCTION)
        .filter(|(opcode, operands)| *opcode != FUNCTION && operands.first().is_some_and(|t| floats.contains(t)))
        .filter(|(opcode, operands)| {
            !EXACT.contains(opcode) || (ROUNDS.contains(opcode) && !kept.contains(&operands[1]))
        })
        .map(|(opcode, _)| *opcode)
        .collect()
}

fn spirv(source: &str) -> Vec<u32> {
    let reflected = Reflected::new("test", source).unwrap_or_else(|e| panic!("{e}"));
    exact_spirv(&reflected, false).expect("naga writes SPIR-V")
}

#[test]
fn every_program_only_adds_and_multiplies_and_may_not_be_fused() {
    for (program, target) in every_text() {
        assert_eq!(inexact(&spirv(&program.source(target))), BTreeSet::new(), "{program:?}, {target:?}");
    }
}

/// A driver may flush subnormal numbers and drop the signs of zeros unless a program forbids it. It may refuse a program whose
/// instructions stand in another order than that of the specification: capabilities, extensions, entry point, modes.
#[test]
fn float_controls_stand_where_the_specification_wants_them() {
    const CAPABILITY: u32 = 17;
    const EXTENSION: u32 = 10;
    const ENTRY_POINT: u32 = 15;
    const EXECUTION_MODE: u32 = 16;
    let program = Program::Pass(Kernel::SolveContacts(Rules::default()));
    let reflected = Reflected::new("test", &program.source(Target::Software)).unwrap_or_else(|e| panic!("{e}"));
    let [plain, both] = [false, true].map(|modes| exact_spirv(&reflected, modes).expect("naga writes SPIR-V"));
    let place = |opcode, operands: &[u32]| {
        let found = instructions(&both).iter().position(|(o, own)| *o == opcode && own.starts_with(operands));
        found.unwrap_or_else(|| panic!("no instruction {opcode} {operands:?}"))
    };
    let entry =
        instructions(&both).into_iter().find(|(opcode, _)| *opcode == ENTRY_POINT).expect("an entry point").1[1];
    let order = [
        place(CAPABILITY, &[4464]),
        place(CAPABILITY, &[4466]),
        place(EXTENSION, &bytemuck::pod_collect_to_vec(b"SPV_KHR_float_controls\0\0")),
        place(ENTRY_POINT, &[]),
        place(EXECUTION_MODE, &[entry, 4459, 32]),
        place(EXECUTION_MODE, &[entry, 4461, 32]),
        place(DECORATE, &[]),
    ];
    assert!(order.is_sorted(), "{order:?}");
    let last = |opcode| instructions(&both).iter().rposition(|(o, _)| *o == opcode).expect("an instruction");
    assert!(last(CAPABILITY) < order[2], "no capability follows the extension");
    // Nothing else changed.
    let added = [4464, 4466, 4459, 4461];
    assert_eq!(instructions(&plain).len() + 5, instructions(&both).len());
    let is_old = |(opcode, operands): &(u32, &[u32])| match *opcode {
        CAPABILITY => !added.contains(&operands[0]),
        EXECUTION_MODE => !added.contains(&operands[1]),
        opcode => opcode != EXTENSION,
    };
    let old: Vec<_> = instructions(&both).into_iter().filter(is_old).collect();
    assert_eq!(old, instructions(&plain).into_iter().filter(is_old).collect::<Vec<_>>());
}

/// The words of a kernel that computes one expression of `x: array<f32>`.
fn one_expression(expression: &str) -> Vec<u32> {
    let source = format!(
        "@group(0) @binding(2) var<storage, read_write> x: array<f32>;
        @compute @workgroup_size(64) fn main() {{ x[0] = {expression}; }}"
    );
    spirv(&source)
}

#[test]
fn what_a_driver_may_round_as_it_likes_is_found() {
    for (expression, opcode) in [
        ("x[1] / x[2]", 136),                         // OpFDiv
        ("sqrt(x[1])", 12),                           // OpExtInst
        ("fma(x[1], x[2], x[3])", 12),                // OpExtInst
        ("max(x[1], x[2])", 12),                      // OpExtInst
        ("x[1] % x[2]", 140),                         // OpFRem
        ("f32(u32(x[1]))", 112),                      // OpConvertUToF
        ("dot(vec2f(x[1], x[2]), vec2f(x[3]))", 148), // OpDot
    ] {
        let found = inexact(&one_expression(expression));
        assert!(found.contains(&opcode), "{expression}: {found:?}");
    }
    assert_eq!(inexact(&one_expression("x[1] * x[2] + x[3]")), BTreeSet::new());
}

const CONSTANT: u32 = 43;
const EXTENDED: u32 = 12;
const ACCESS_CHAIN: u32 = 65;
const IN_BOUNDS_ACCESS_CHAIN: u32 = 66;
/// The number of UMin in GLSL.std.450.
const UMIN: u32 = 38;

/// How many indices that are no constants lead into memory, and how many of these are not the smaller of two numbers.
fn indices(words: &[u32]) -> (usize, usize) {
    let all = instructions(words);
    let results = |wanted: &dyn Fn(u32, &[u32]) -> bool| -> BTreeSet<u32> {
        all.iter().filter(|(opcode, operands)| wanted(*opcode, operands)).map(|(_, operands)| operands[1]).collect()
    };
    let constants = results(&|opcode, _| opcode == CONSTANT);
    let bounded = results(&|opcode, operands| opcode == EXTENDED && operands[3] == UMIN);
    let chains = all.iter().filter(|(opcode, _)| [ACCESS_CHAIN, IN_BOUNDS_ACCESS_CHAIN].contains(opcode));
    // Type, result and base come before the indices.
    let computed = chains.flat_map(|(_, operands)| &operands[3..]).filter(|index| !constants.contains(index));
    let (mut count, mut unbounded) = (0, 0);
    for index in computed {
        count += 1;
        unbounded += usize::from(!bounded.contains(index));
    }
    (count, unbounded)
}

#[test]
fn no_index_leaves_its_buffer() {
    let small_world: std::sync::Arc<[Kernel]> = [
        Kernel::IntegrateVelocities { warm_start: false, from_start: false },
        Kernel::SolveContacts(Rules { friction: FrictionRule::Disc, round: true, ..Rules::default() }),
        Kernel::IntegratePositions { from_start: false },
    ]
    .into();
    let small_world = (Program::OneDispatch(small_world, 16), Target::Software);
    for (program, target) in every_text().into_iter().chain([small_world]) {
        let (count, unbounded) = indices(&spirv(&program.source(target)));
        // One kernel reads no more than one row.
        let has_rows = program.name() != "begin_sweep";
        assert!(unbounded == 0 && (count > 0) == has_rows, "{program:?}: {unbounded} of {count} indices");
    }
}

#[test]
fn an_index_without_a_bound_is_found() {
    let source = "@group(0) @binding(2) var<storage, read_write> x: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) { x[x[id.x]] = 7u; }";
    assert_eq!(indices(&spirv(source)), (2, 0));
    let reflected = Reflected::new("test", source).unwrap_or_else(|e| panic!("{e}"));
    let unchecked = naga::back::spv::write_vec(&reflected.module, &reflected.info, &Default::default(), None);
    assert_eq!(indices(&unchecked.expect("naga writes SPIR-V")), (2, 2));
}

#[test]
fn a_result_without_its_decoration_is_found() {
    let mut words = one_expression("x[1] * x[2] + x[3]");
    let at = words.iter().position(|&w| w == (3 << 16 | DECORATE)).expect("a decoration");
    assert_eq!(words[at + 2], NO_CONTRACTION);
    words.drain(at..at + 3);
    assert_eq!(inexact(&words).len(), 1);
}
