//! The shaders as text, without a GPU: what naga finds in them is what the crate says of them.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::mem::offset_of;
use std::path::Path;

use common::kernels::{every_kernel, every_rules};
use drystone::config::FrictionRule;
use drystone::stages::backend::shader::{
    Binding, ENTRY_POINT, Program, Reflected, SCRATCH_ROW, WORKGROUP, exact_spirv,
};
use drystone::stages::kernels::Rules;
use drystone::stages::plan::Kernel;

/// A program as naga reads it: validated without any capability.
fn reflected(program: &Program) -> Reflected {
    Reflected::new(program.name(), &program.source()).unwrap_or_else(|e| panic!("{program:?}: {e}"))
}

fn parsed(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)))
}

/// The kernels of plans, and the programs that begin a step on the device.
fn every_program() -> Vec<Program> {
    every_kernel().into_iter().map(Program::Pass).chain(Program::RESIDENT).collect()
}

/// Number of storage buffers of a program.
fn storage_buffers(reflected: &Reflected) -> usize {
    let is_storage = |&&at: &&Binding| matches!(reflected.space(at), naga::AddressSpace::Storage { .. });
    reflected.bindings.iter().filter(is_storage).count()
}

mod layouts {
    use super::*;
    use drystone::stages::backend::shader::ResidentParams;
    use drystone::stages::problem::carry::{Preload, Written};
    use drystone::stages::problem::{
        BodyRow, ContactRow, ConvergenceRow, FreeRow, ImpulseRow, InertiaRow, JointImpulseRow, JointRow, MassRow,
        MomentumRow, Params, PassColors, PointRow, Softness,
    };

    const TYPES: &str = include_str!("../shaders/lib/types.wgsl");

    /// Size of a struct, and offset of each of its fields.
    #[derive(Debug, PartialEq)]
    struct Layout {
        size: usize,
        fields: BTreeMap<String, usize>,
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
    struct Step {
        before: [f32; 4],
        begin: [f32; 4],
    }
    const _: () = assert!(size_of::<FreeRow>() == SCRATCH_ROW && size_of::<Step>() == SCRATCH_ROW);

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
            Step = Step { before begin }
            Momentum = MomentumRow { t factor square restarts }
            Impulse = ImpulseRow { normal tangent_1 tangent_2 peak }
            Softness = Softness { bias_rate mass_scale impulse_scale push_limit }
            Params = Params {
                substep inverse_substep restitution_threshold inertia_count movable fixed joint
                body_count point_count slop relaxation tolerance joint_count patches
            }
            PassColors = PassColors { first end }
            Preload = Preload { movable_compliance fixed_compliance share warm_start }
            ResidentParams = ResidentParams {
                preload body_count contact_count order written_count patches has_points
            }
            Written = Written { row points_before }
        }
    }

    /// The layout of each struct of `types`.
    fn in_wgsl(types: &str) -> BTreeMap<String, Layout> {
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
            (Some(a), Some(b)) if name.ends_with("Params") => a.fields == b.fields && a.size >= b.size,
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

/// Names of the files of a folder of shaders.
fn files(folder: &str) -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = std::fs::read_dir(folder).expect("a folder of shaders").map(|e| e.expect("an entry").path());
    let shaders = entries.filter(|path| path.extension().is_some_and(|e| e == "wgsl"));
    shaders.map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned()).collect()
}

#[test]
fn every_shader_file_is_a_program_and_every_program_has_a_file() {
    let names = |programs: &[Program]| programs.iter().map(|p| p.name().to_owned()).collect::<BTreeSet<_>>();
    let kernels: Vec<_> = every_kernel().into_iter().map(Program::Pass).collect();
    assert_eq!(files("shaders"), names(&kernels));
    assert_eq!(files("shaders/resident"), names(&Program::RESIDENT));
    for program in every_program() {
        let entry_points: Vec<_> = reflected(&program).module.entry_points.into_iter().map(|e| e.name).collect();
        assert_eq!(entry_points, [ENTRY_POINT], "{program:?}");
    }
}

#[test]
fn every_program_stays_inside_what_every_webgpu_offers() {
    for program in every_program() {
        let reflected = reflected(&program);
        let storage = storage_buffers(&reflected);
        assert!((1..=8).contains(&storage), "{program:?} has {storage} storage buffers");
        assert_eq!(reflected.module.entry_points[0].workgroup_size, [WORKGROUP, 1, 1], "{program:?}");
    }
}

/// A buffer that a program only reads may be in the cache of a texture unit; a program that writes where it declares reading is
/// refused by naga.
#[test]
fn plans_read_contacts_that_a_resident_program_writes() {
    let writes = |program: &Program, binding| match reflected(program).space(binding) {
        naga::AddressSpace::Storage { access } => access.contains(naga::StorageAccess::STORE),
        _ => false,
    };
    for binding in [Binding::Contacts, Binding::Points] {
        assert!(!writes(&Program::Pass(Kernel::SolveContacts(Rules::default())), binding), "{binding:?}");
        assert!(writes(&Program::WriteContacts, binding), "{binding:?}");
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
        let reflected = reflected(&Program::OneDispatch(of(measured, patch, friction).into(), 16));
        assert_eq!(storage_buffers(&reflected), 8);
        assert_eq!(reflected.bindings.contains(&Binding::Convergence), measured);
        assert_eq!(reflected.module.entry_points[0].workgroup_size, [16, 1, 1]);
    }
}

/// What a pass writes the next one reads, whichever thread that is. On an adapter whose subgroup is as wide as the workgroup a
/// missing barrier shows in no result.
#[test]
fn every_pass_of_the_one_dispatch_kernel_ends_with_a_barrier() {
    let kernels = [Kernel::IntegrateVelocities { carry: false }, Kernel::SolveContacts(Rules::default())];
    let module = parsed(&Program::OneDispatch(kernels.into(), 16).source());
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
        let module = parsed(&Program::Pass(kernel).source());
        let over_colors = |f: &&naga::Function| f.name.as_ref().is_some_and(|n| n.starts_with("over_colors"));
        let [function] = module.functions.iter().map(|(_, f)| f).filter(over_colors).collect::<Vec<_>>()[..] else {
            panic!("{kernel} goes over colors in one function")
        };
        let mut bodies = Vec::new();
        function.body.iter().for_each(|statement| loops(statement, &mut bodies));
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
fn every_rule_reaches_the_sweep_as_a_constant() {
    let all = every_rules();
    let source = |&rules: &Rules| Program::Pass(Kernel::SolveContacts(rules)).source();
    let distinct: BTreeSet<_> = all.iter().map(source).collect();
    assert_eq!(distinct.len(), all.len());
}

#[test]
fn the_series_of_a_rotation_has_the_coefficients_of_its_double() {
    // The last ones are too small to show in the bits of a rotation.
    let module = parsed(&Program::Pass(Kernel::IntegratePositions).source());
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

    fn spirv(source: &str) -> Vec<u32> {
        let reflected = Reflected::new("test", source).unwrap_or_else(|e| panic!("{e}"));
        exact_spirv(&reflected).expect("naga writes SPIR-V")
    }

    #[test]
    fn every_program_only_adds_and_multiplies_and_may_not_be_fused() {
        for program in every_program() {
            assert_eq!(inexact(&spirv(&program.source())), BTreeSet::new(), "{program:?}");
        }
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
            Kernel::IntegrateVelocities { carry: false },
            Kernel::SolveContacts(Rules { friction: FrictionRule::Disc, round: true, ..Rules::default() }),
            Kernel::IntegratePositions,
        ]
        .into();
        for program in every_program().into_iter().chain([Program::OneDispatch(small_world, 16)]) {
            let (count, unbounded) = indices(&spirv(&program.source()));
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
}
