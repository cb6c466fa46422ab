//! The shaders as naga reads them, without a GPU.

mod exact;
mod guarded;
mod layouts;

use std::collections::BTreeSet;
use std::path::Path;

use crate::common::kernels::{every_kernel, every_rules};
use drystone::config::FrictionRule;
use drystone::stages::backend::shader::{Binding, ENTRY_POINT, Program, Reflected, Target};
use drystone::stages::kernels::Rules;
use drystone::stages::plan::Kernel;

/// A program as naga reads it: validated without any capability.
fn reflected(program: &Program, target: Target) -> Reflected {
    Reflected::new(program.name(), &program.source(target)).unwrap_or_else(|e| panic!("{program:?}, {target:?}: {e}"))
}

fn parsed(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)))
}

/// Kernels whose colors are swept one after another.
fn swept() -> [Kernel; 7] {
    [
        Kernel::SolveContacts(Rules::default()),
        Kernel::SolveJoints(Rules::default()),
        Kernel::WarmStart(Rules::default()),
        Kernel::SolveJoints(Rules { axes: true, ..Rules::default() }),
        Kernel::WarmStartJoints { axes: false },
        Kernel::WarmStartJoints { axes: true },
        Kernel::ApplyRestitution(Rules::default()),
    ]
}

/// The kernels of plans, and the programs that begin a step on the device.
fn every_program() -> Vec<Program> {
    let fused = swept().into_iter().map(Program::Fused);
    every_kernel().into_iter().map(Program::Pass).chain(fused).chain(Program::RESIDENT).collect()
}

/// Every program with the kinds of adapters that get a text of their own.
fn every_text() -> Vec<(Program, Target)> {
    let differs = |program: &Program| matches!(program, Program::Pass(Kernel::SolveContacts(_)));
    let of = |program: Program| {
        let hardware = differs(&program).then(|| (program.clone(), Target::Hardware));
        [(program, Target::Software)].into_iter().chain(hardware)
    };
    every_program().into_iter().flat_map(of).collect()
}

/// Number of storage buffers of a program.
fn storage_buffers(reflected: &Reflected) -> usize {
    let is_storage = |&&at: &&Binding| matches!(reflected.space(at), naga::AddressSpace::Storage { .. });
    reflected.bindings.iter().filter(is_storage).count()
}

/// Names of the files of a folder of shaders.
fn files(folder: &str) -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder);
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
    for (program, target) in every_text() {
        let reflected = reflected(&program, target);
        let entry_points: Vec<_> = reflected.module.entry_points.into_iter().map(|e| e.name).collect();
        assert_eq!(entry_points, [ENTRY_POINT], "{program:?}");
    }
}

#[test]
fn every_program_stays_inside_what_every_webgpu_offers() {
    for (program, target) in every_text() {
        let reflected = reflected(&program, target);
        let storage = storage_buffers(&reflected);
        assert!((1..=8).contains(&storage), "{program:?} has {storage} storage buffers");
        let threads = program.threads(target);
        assert!([32, 64].contains(&threads), "{program:?}: {threads}");
        assert_eq!(reflected.module.entry_points[0].workgroup_size, [threads, 1, 1], "{program:?}");
    }
}

/// naga refuses a program that writes to a buffer which the program declares as read-only.
#[test]
fn plans_read_contacts_that_a_resident_program_writes() {
    let writes = |program: &Program, binding| match reflected(program, Target::Software).space(binding) {
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
            Kernel::IntegrateVelocities { warm_start: false, from_start: false },
            Kernel::WarmStart(shared.of_warm_start()),
            Kernel::SolveContacts(biased),
            Kernel::IntegratePositions { from_start: false },
            Kernel::SolveContacts(shared),
            Kernel::IntegrateVelocities { warm_start: true, from_start: false },
            Kernel::ApplyRestitution(Rules { patch, ..Rules::default() }),
        ];
        // Eight buffers are enough for one or the other.
        kernels.push(if measured {
            Kernel::BeginSweep { first: false }
        } else {
            Kernel::IntegrateGyroscopic { from_start: false }
        });
        kernels
    };
    for (measured, patch, friction) in
        [(false, false, FrictionRule::Disc), (true, false, FrictionRule::Box), (false, true, FrictionRule::Disc)]
    {
        let reflected = reflected(&Program::OneDispatch(of(measured, patch, friction).into(), 16), Target::Software);
        assert_eq!(storage_buffers(&reflected), 8);
        assert_eq!(reflected.bindings.contains(&Binding::Convergence), measured);
        assert_eq!(reflected.module.entry_points[0].workgroup_size, [16, 1, 1]);
    }
}

/// A pass reads the results of the pass before, whichever threads wrote them. On an adapter whose subgroup is as wide as the workgroup a
/// missing barrier shows in no result.
#[test]
fn every_pass_of_the_one_dispatch_kernel_ends_with_a_barrier() {
    let kernels =
        [Kernel::IntegrateVelocities { warm_start: false, from_start: false }, Kernel::SolveContacts(Rules::default())];
    let module = parsed(&Program::OneDispatch(kernels.into(), 16).source(Target::Software));
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

/// Colors of one dispatch are swept by one workgroup, one after another.
#[test]
fn every_color_of_a_pass_ends_with_a_barrier() {
    for kernel in swept() {
        let module = parsed(&Program::Fused(kernel).source(Target::Software));
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

/// A barrier makes the software adapter stop and go on with every thread: a step of a pile of 1,000 takes 1.5 times as long with one in
/// each dispatch.
#[test]
fn a_pass_over_rows_in_any_order_waits_for_nothing() {
    for kernel in swept() {
        for (program, waits) in [(Program::Pass(kernel), false), (Program::Fused(kernel), true)] {
            assert_eq!(program.source(Target::Software).contains("Barrier()"), waits, "{program:?}");
        }
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
    let source = |&rules: &Rules| Program::Pass(Kernel::SolveContacts(rules)).source(Target::Hardware);
    let distinct: BTreeSet<_> = all.iter().map(source).collect();
    assert_eq!(distinct.len(), all.len());
}

#[test]
fn the_series_of_a_rotation_has_the_coefficients_of_its_double() {
    // The last ones are too small to show in the bits of a rotation.
    let module = parsed(&Program::Pass(Kernel::IntegratePositions { from_start: false }).source(Target::Software));
    let named = |f: &&naga::Function| f.name.as_deref() == Some("exp_rotation");
    let function = module.functions.iter().map(|(_, f)| f).find(named).expect("the function");
    let magnitude = |e: &naga::Expression| match e {
        // Larger values belong to the cut.
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
