//! The shaders as text, without a GPU: what naga finds in them is what the crate says of them.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::mem::offset_of;
use std::path::Path;

use common::kernels::{every_kernel, every_rules};
use drystone::config::FrictionRule;
use drystone::stages::backend::shader::{
    BINDINGS, PASSES, Program, Reflected, SCRATCH_ROW, UNIFORMS, WORKGROUP, constants, source,
};
use drystone::stages::kernels::Rules;
use drystone::stages::plan::Kernel;

/// One kernel without overrides that naga reads.
fn reflected(kernel: Kernel) -> Reflected {
    let reflected = Reflected::new(&source(kernel), kernel.name(), &constants(kernel));
    reflected.unwrap_or_else(|e| panic!("{kernel}: {e}"))
}

/// As written, overrides and all.
fn parsed(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)))
}

mod layouts {
    use super::*;
    use drystone::stages::problem::{
        BodyRow, ContactRow, ConvergenceRow, FreeRow, ImpulseRow, InertiaRow, JointImpulseRow, JointRow, MassRow,
        MomentumRow, Params, PassColors, PointRow, Softness,
    };

    const TYPES: &str = include_str!("../shaders/lib/types.wgsl");

    /// Size of a struct, and offset of each of its fields.
    #[derive(Debug, PartialEq)]
    pub struct Layout {
        pub size: usize,
        pub fields: BTreeMap<String, usize>,
    }

    macro_rules! layouts {
        ($($twin:ident = $row:ident { $($field:ident)* })*) => {
            BTreeMap::from([$((
                stringify!($twin).to_owned(),
                Layout {
                    size: size_of::<$row>(),
                    fields: BTreeMap::from([$((stringify!($field).to_owned(), offset_of!($row, $field))),*]),
                },
            )),*])
        };
    }

    /// Stays on the device: Rust knows only how long it is.
    #[repr(C)]
    struct ImpulseStep {
        before: [f32; 4],
        begin: [f32; 4],
    }
    const _: () = assert!(size_of::<FreeRow>() == SCRATCH_ROW && size_of::<ImpulseStep>() == SCRATCH_ROW);

    /// The layout of each row, under the name of its twin.
    fn in_rust() -> BTreeMap<String, Layout> {
        layouts! {
            Body = BodyRow { v w dp dq }
            Free = FreeRow { v w }
            Mass = MassRow { inv_inertia_x inv_mass inv_inertia_yz acceleration }
            Inertia = InertiaRow { principal body inv_principal frame }
            Contact = ContactRow {
                normal friction tangent restitution body_a body_b first_point point_count radius_a radius_b
                preload
            }
            Point = PointRow { r_a separation r_b normal_mass tangent_mass approach_velocity slip_1 slip_2 }
            Joint = JointRow { r_a body_a r_b body_b gap }
            JointImpulse = JointImpulseRow { linear }
            Convergence = ConvergenceRow { moving done sweeps planned }
            ImpulseStep = ImpulseStep { before begin }
            Momentum = MomentumRow { t factor square restarts }
            Impulse = ImpulseRow { normal tangent_1 tangent_2 peak }
            Softness = Softness { bias_rate mass_scale impulse_scale push_limit }
            Params = Params {
                substep inverse_substep restitution_threshold inertia_count movable fixed joint
                body_count point_count slop relaxation tolerance joint_count patches
            }
            PassColors = PassColors { first end }
        }
    }

    /// The layout of each struct of `types`.
    pub fn in_wgsl(types: &str) -> BTreeMap<String, Layout> {
        let module = parsed(types);
        let structs = module.types.iter().filter_map(|(_, t)| match &t.inner {
            naga::TypeInner::Struct { members, span } => Some((t.name.clone()?, members, *span)),
            _ => None,
        });
        let field = |m: &naga::StructMember| (m.name.clone().expect("a field has a name"), m.offset as usize);
        structs
            .map(|(name, members, span)| {
                (name, Layout { size: span as usize, fields: members.iter().map(field).collect() })
            })
            .collect()
    }

    /// Names of the structs whose two layouts differ. A uniform may be larger in Rust: it stands in no array.
    fn differing(types: &str) -> Vec<String> {
        let (ours, theirs) = (in_rust(), in_wgsl(types));
        let names: BTreeSet<_> = ours.keys().chain(theirs.keys()).collect();
        let agree = |name: &str| match (ours.get(name), theirs.get(name)) {
            (Some(a), Some(b)) if name == "Params" => a.fields == b.fields && a.size >= b.size,
            (a, b) => a == b,
        };
        names.into_iter().filter(|name| !agree(name)).cloned().collect()
    }

    #[test]
    fn every_row_has_the_layout_of_its_twin() {
        assert_eq!(differing(TYPES), [""; 0]);
    }

    #[test]
    fn a_changed_twin_is_found() {
        for (before, after, name) in [
            ("v: vec3f, w: vec3f", "w: vec3f, v: vec3f", "Body"),
            ("first_point: u32, point_count: u32", "point_count: u32, first_point: u32", "Contact"),
            ("peak: f32 }", "peak: f32, more: f32 }", "Impulse"),
            ("push_limit: f32", "limit: f32", "Softness"),
            ("struct PassColors", "struct Colors", "Colors"),
        ] {
            let changed = TYPES.replace(before, after);
            assert_ne!(changed, TYPES, "{before} is not in the text");
            assert!(differing(&changed).iter().any(|n| n == name), "{after}");
        }
    }
}

#[test]
fn every_shader_file_is_a_kernel_and_every_kernel_a_file_with_an_entry_point_of_its_name() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let entries = std::fs::read_dir(folder).expect("the folder of the shaders").map(|e| e.expect("an entry").path());
    let files: BTreeSet<_> = entries
        .filter(|path| path.extension().is_some_and(|e| e == "wgsl"))
        .map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned())
        .collect();
    let kernels: BTreeSet<_> = every_kernel().into_iter().map(|k| k.name().to_owned()).collect();
    assert_eq!(files, kernels);
    for kernel in every_kernel() {
        let names: Vec<_> = parsed(&source(kernel)).entry_points.into_iter().map(|e| e.name).collect();
        assert_eq!(names, [kernel.name()]);
    }
}

#[test]
fn every_kernel_stays_inside_what_every_webgpu_offers() {
    for kernel in every_kernel() {
        // Validates without any capability.
        let reflected = reflected(kernel);
        let storage = reflected.bindings.iter().filter(|&&b| b as usize >= UNIFORMS).count();
        assert!(storage <= 8, "{kernel} has {storage} storage buffers");
        let threads = if matches!(kernel, Kernel::BeginSweep { .. }) { 1 } else { WORKGROUP };
        assert_eq!(reflected.module.entry_points[0].workgroup_size, [threads, 1, 1], "{kernel}");
    }
}

#[test]
fn every_binding_stands_where_its_name_stands_in_the_list() {
    for kernel in every_kernel() {
        let module = parsed(&source(kernel));
        let mut bound: Vec<_> = module
            .global_variables
            .iter()
            .filter_map(|(_, v)| {
                v.binding.map(|at| (at.binding, v.name.clone().expect("a binding has a name"), v.space))
            })
            .collect();
        bound.sort_by_key(|(at, ..)| *at);
        assert_eq!(bound.iter().map(|(at, ..)| *at).collect::<Vec<_>>(), Vec::from_iter(0..BINDINGS.len() as u32));
        assert_eq!(bound.iter().map(|(_, name, _)| name).collect::<Vec<_>>(), BINDINGS);
        for (at, name, space) in bound {
            assert_eq!(space == naga::AddressSpace::Uniform, (at as usize) < UNIFORMS, "{name}");
        }
    }
}

/// The programs that carry rows from step to step.
mod carry {
    use super::*;
    use drystone::stages::backend::shader::CarryParams;
    use drystone::stages::backend::shader::{CARRY, CARRY_BINDINGS};
    use drystone::stages::collide::MAX_POINTS;
    use drystone::stages::problem::carry::{NO_POINT, Preload, Written};

    fn reflected(program: Program) -> Reflected {
        Reflected::new(&program.source(), program.name(), &program.constants()).unwrap_or_else(|e| panic!("{e}"))
    }

    #[test]
    fn each_is_a_file_with_an_entry_point_of_its_name() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/carry");
        let files = std::fs::read_dir(folder).expect("the folder").count();
        assert_eq!(files, Program::CARRY.len() + 1, "and their bindings");
        for program in Program::CARRY {
            let names: Vec<_> = parsed(&program.source()).entry_points.into_iter().map(|e| e.name).collect();
            assert_eq!(names, [program.name()]);
        }
    }

    #[test]
    fn each_stays_inside_what_every_webgpu_offers() {
        for program in Program::CARRY {
            let name = program.name();
            let reflected = reflected(program);
            let storage = reflected.bindings.iter().filter(|&&b| b != CARRY).count();
            assert!(storage <= 8, "{name} has {storage} storage buffers");
            assert_eq!(reflected.module.entry_points[0].workgroup_size, [WORKGROUP, 1, 1]);
        }
    }

    #[test]
    fn every_binding_has_the_number_of_its_name() {
        let name_of = |at: usize| BINDINGS.get(at).copied().unwrap_or_else(|| CARRY_BINDINGS[at - BINDINGS.len()]);
        let module = parsed(&Program::WriteContacts.source());
        let bound: Vec<_> = module.global_variables.iter().filter_map(|(_, v)| Some((v.binding?, v))).collect();
        // All but that of a plan that one workgroup follows.
        assert_eq!(bound.len(), 6 + CARRY_BINDINGS.len() - 1);
        for (at, variable) in bound {
            assert_eq!(variable.name.as_deref(), Some(name_of(at.binding as usize)));
            assert_eq!(variable.space == naga::AddressSpace::Uniform, at.binding == CARRY);
        }
    }

    #[test]
    fn every_struct_has_the_layout_of_its_twin() {
        let theirs = layouts::in_wgsl(&Program::WriteContacts.source());
        let fields = |name: &str| theirs[name].fields.clone();
        let own = |fields: &[(&str, usize)]| BTreeMap::from_iter(fields.iter().map(|&(n, at)| (n.to_owned(), at)));
        let preload = [
            ("movable_compliance", offset_of!(Preload, movable_compliance)),
            ("fixed_compliance", offset_of!(Preload, fixed_compliance)),
            ("share", offset_of!(Preload, share)),
            ("warm_start", offset_of!(Preload, warm_start)),
        ];
        assert_eq!(fields("Preload"), own(&preload));
        let carry = [
            ("preload", offset_of!(CarryParams, preload)),
            ("body_count", offset_of!(CarryParams, body_count)),
            ("contact_count", offset_of!(CarryParams, contact_count)),
            ("order", offset_of!(CarryParams, order)),
            ("written_count", offset_of!(CarryParams, written_count)),
            ("patches", offset_of!(CarryParams, patches)),
            ("has_points", offset_of!(CarryParams, has_points)),
        ];
        assert_eq!(fields("Carry"), own(&carry));
        assert!(theirs["Carry"].size <= size_of::<CarryParams>());
        let written = [("row", offset_of!(Written, row)), ("points_before", offset_of!(Written, points_before))];
        assert_eq!((fields("Written"), theirs["Written"].size), (own(&written), size_of::<Written>()));
        // A point that is new is one more than the last.
        let constants = parsed(&Program::WriteContacts.source());
        let most = constants.constants.iter().find(|(_, c)| c.name.as_deref() == Some("MAX_POINTS"));
        let value = &constants.global_expressions[most.expect("the constant").1.init];
        let same = |x: u32| x == u32::from(NO_POINT) && x as usize == MAX_POINTS;
        assert!(matches!(value, naga::Expression::Literal(naga::Literal::U32(x)) if same(*x)), "{value:?}");
    }
}

#[test]
fn the_kernels_of_a_step_are_one_shader_in_a_small_world() {
    let of = |measured, patch, friction| {
        let shared = Rules { measured, patch, friction, round: true, ..Rules::default() };
        let biased = Rules { biased: true, friction: FrictionRule::None, patch: false, ..shared };
        let mut kernels = vec![
            Kernel::IntegrateVelocities { carry: false },
            Kernel::WarmStart(shared.of_warm_start()),
            Kernel::SolveContacts(biased),
            Kernel::IntegratePositions,
            Kernel::SolveContacts(shared),
            Kernel::IntegrateVelocities { carry: true },
            Kernel::ApplyRestitution(Rules { patch, ..Rules::default() }),
        ];
        // Eight buffers are enough for one or the other.
        kernels.push(if measured { Kernel::BeginSweep { first: false } } else { Kernel::IntegrateGyroscopic });
        kernels
    };
    for (measured, patch, friction) in
        [(false, false, FrictionRule::Disc), (true, false, FrictionRule::Box), (false, true, FrictionRule::Disc)]
    {
        let program = Program::Whole(of(measured, patch, friction).into(), 16);
        let reflected = Reflected::new(&program.source(), program.name(), &[]).unwrap_or_else(|e| panic!("{e}"));
        let storage = reflected.bindings.iter().filter(|&&b| b as usize >= UNIFORMS && b != PASSES).count();
        assert!(storage <= 8, "{storage} storage buffers");
        assert!(reflected.module.overrides.is_empty());
        assert_eq!(reflected.module.entry_points[0].workgroup_size, [16, 1, 1]);
    }
}

/// What a pass writes the next one reads, whichever thread that is. On an adapter whose subgroup is as wide as the workgroup a
/// missing barrier shows in no result.
#[test]
fn every_pass_of_the_one_dispatch_kernel_ends_with_a_barrier() {
    let kernels = [Kernel::IntegrateVelocities { carry: false }, Kernel::SolveContacts(Rules::default())];
    let module = parsed(&Program::Whole(kernels.into(), 16).source());
    let [entry] = &module.entry_points[..] else { panic!("one entry point") };
    let mut bodies = Vec::new();
    for statement in entry.function.body.iter() {
        loops(statement, &mut bodies);
    }
    let [passes] = bodies[..] else { panic!("one loop, over the passes: {}", bodies.len()) };
    let passes = flat(passes);
    let switch =
        passes.iter().position(|s| matches!(s, naga::Statement::Switch { .. })).expect("a choice of the kernel");
    let after = passes[switch + 1];
    let waits = |b: &naga::Barrier| b.contains(naga::Barrier::STORAGE);
    assert!(matches!(after, naga::Statement::ControlBarrier(b) if waits(b)), "after the kernel comes {after:?}");
    // And no way around it.
    let leaves = |s: &naga::Statement| matches!(s, naga::Statement::Continue | naga::Statement::Return { .. });
    assert!(!passes[..switch].iter().any(|s| leaves(s)));
}

/// Colors of one pass are swept by one workgroup, one after another.
#[test]
fn every_color_of_a_pass_ends_with_a_barrier() {
    let swept = [
        Kernel::SolveContacts(Rules::default()),
        Kernel::SolveJoints(Rules::default()),
        Kernel::WarmStart(Rules::default()),
        Kernel::WarmStartJoints,
        Kernel::ApplyRestitution(Rules::default()),
    ];
    for kernel in swept {
        let module = parsed(&source(kernel));
        let mut bodies = Vec::new();
        for statement in module.entry_points[0].function.body.iter() {
            loops(statement, &mut bodies);
        }
        // That over the colors is the outer one, and comes first.
        let colors = bodies.first().unwrap_or_else(|| panic!("{kernel} has a loop over its colors"));
        let last = flat(colors).pop().expect("a statement");
        let waits = matches!(last, naga::Statement::ControlBarrier(b) if b.contains(naga::Barrier::STORAGE));
        assert!(waits, "{kernel}: the last statement of a color is {last:?}");
    }
}

/// The statements of a block and of the blocks that stand in it by themselves.
fn flat(block: &naga::Block) -> Vec<&naga::Statement> {
    let mut all = Vec::new();
    for statement in block.iter() {
        match statement {
            naga::Statement::Block(inner) => all.extend(flat(inner)),
            other => all.push(other),
        }
    }
    all
}

/// The bodies of the loops in a statement, outer ones first.
fn loops<'a>(statement: &'a naga::Statement, found: &mut Vec<&'a naga::Block>) {
    let inner: Vec<&naga::Block> = match statement {
        naga::Statement::Loop { body, .. } => {
            found.push(body);
            vec![body]
        }
        naga::Statement::Block(block) => vec![block],
        naga::Statement::If { accept, reject, .. } => vec![accept, reject],
        _ => Vec::new(),
    };
    inner.into_iter().flat_map(|block| block.iter()).for_each(|s| loops(s, found));
}

#[test]
fn every_override_is_a_constant_of_its_kernel_and_every_constant_an_override() {
    for kernel in every_kernel() {
        let module = parsed(&source(kernel));
        let overrides: BTreeSet<_> = module.overrides.iter().filter_map(|(_, o)| o.name.clone()).collect();
        let constants: BTreeSet<_> = constants(kernel).into_iter().map(|(name, _)| name.to_owned()).collect();
        assert_eq!(overrides, constants, "{kernel}");
    }
}

#[test]
fn every_rule_reaches_the_sweep_as_a_constant() {
    let all = every_rules();
    let constants = |&rules: &Rules| format!("{:?}", constants(Kernel::SolveContacts(rules)));
    let distinct: BTreeSet<_> = all.iter().map(constants).collect();
    assert_eq!(distinct.len(), all.len());
}

#[test]
fn the_series_of_a_rotation_has_the_coefficients_of_its_double() {
    // The last ones are too small to show in the bits of a rotation.
    let module = parsed(&source(Kernel::IntegratePositions));
    let named = |f: &&naga::Function| f.name.as_deref() == Some("exp_rotation");
    let function = module.functions.iter().map(|(_, f)| f).find(named).expect("the function");
    let magnitude = |e: &naga::Expression| match e {
        // What is larger belongs to the cut.
        naga::Expression::Literal(naga::Literal::F32(x)) if x.abs() <= 1.0 => Some(x.abs().to_bits()),
        _ => None,
    };
    let found: BTreeSet<u32> = function.expressions.iter().filter_map(|(_, e)| magnitude(e)).collect();
    let mut factorial = 1.0_f64;
    let series = (1..=11).map(|n| {
        factorial *= f64::from(n);
        (1.0 / factorial) as f32
    });
    assert_eq!(found, series.map(f32::to_bits).collect());
}

mod exact {
    use super::*;

    /// What may make a float, or a vector of floats: reading, moving, choosing, and + - * in a written order.
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

    fn spirv(source: &str, entry_point: &str, constants: &[(&str, f64)]) -> Vec<u32> {
        let reflected = Reflected::new(source, entry_point, constants).unwrap_or_else(|e| panic!("{e}"));
        reflected.exact_spirv().expect("naga writes SPIR-V")
    }

    #[test]
    fn every_kernel_only_adds_and_multiplies_and_may_not_be_fused() {
        for kernel in every_kernel() {
            let words = spirv(&source(kernel), kernel.name(), &constants(kernel));
            assert_eq!(inexact(&words), BTreeSet::new(), "{kernel}");
        }
    }

    /// The words of a kernel that computes one expression of `x: array<f32>`.
    fn one_expression(expression: &str) -> Vec<u32> {
        let source = format!(
            "@group(0) @binding(2) var<storage, read_write> x: array<f32>;
            @compute @workgroup_size(64) fn kernel() {{ x[0] = {expression}; }}"
        );
        spirv(&source, "kernel", &[])
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
            Kernel::IntegrateVelocities { carry: false },
            Kernel::SolveContacts(Rules { friction: FrictionRule::Disc, round: true, ..Rules::default() }),
            Kernel::IntegratePositions,
        ]
        .into();
        let kernels = every_kernel().into_iter().map(Program::Pass);
        for program in kernels.chain(Program::CARRY).chain([Program::Whole(small_world, 16)]) {
            let words = spirv(&program.source(), program.name(), &program.constants());
            let (count, unbounded) = indices(&words);
            // One kernel reads no more than one row.
            let has_rows = program.name() != "begin_sweep";
            assert!(unbounded == 0 && (count > 0) == has_rows, "{program:?}: {unbounded} of {count} indices");
        }
    }

    #[test]
    fn an_index_without_a_bound_is_found() {
        let source = "@group(0) @binding(2) var<storage, read_write> x: array<u32>;
            @compute @workgroup_size(64) fn kernel(@builtin(global_invocation_id) id: vec3u) { x[x[id.x]] = 7u; }";
        assert_eq!(indices(&spirv(source, "kernel", &[])), (2, 0));
        let reflected = Reflected::new(source, "kernel", &[]).unwrap_or_else(|e| panic!("{e}"));
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
}
