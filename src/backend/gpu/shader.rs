//! From WGSL to what a pipeline needs: a shader is a list of parts, its layout what its entry point uses.

use std::sync::Arc;

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

use super::{exact, whole};
use crate::config::FrictionRule;
use crate::error::{Error, Result};
use crate::kernels::Rules;
use crate::plan::Kernel;

/// Name of each binding; the place in this list is its number. All but the last [`SCRATCH`] are fields of `StepProblem`.
pub const BINDINGS: [&str; 17] = [
    "params",
    "pass_colors",
    "bodies",
    "masses",
    "inertias",
    "contacts",
    "points",
    "impulses",
    "colors",
    "joints",
    "joint_impulses",
    "convergence",
    "momentum",
    "free",
    "velocities_before",
    "impulse_steps",
    "lengths",
];
/// The bindings that begin a step from the rows of the step before, and that of a plan that one workgroup follows; their numbers follow on.
pub const CARRY_BINDINGS: [&str; 6] =
    ["carry", "written", "written_contacts", "written_points", "separations", "passes"];
/// How many of them, the last, stay on the device: velocities without the impulses of the substep, and what accelerated
/// sweeps leave for each other.
pub const SCRATCH: usize = 4;
/// Size of a row of all of these but the last: two vectors (B).
pub const SCRATCH_ROW: usize = 32;
/// How many of them, the first, are uniforms.
pub const UNIFORMS: usize = 2;
/// The same for all.
pub const PARAMS: u32 = 0;
/// The colors of a pass, at an offset of their own for each.
pub const PASS_COLORS: u32 = 1;
/// State, read back.
pub const BODIES: u32 = 2;
/// Masses.
pub const MASSES: u32 = 3;
/// Principal inertia.
pub const INERTIAS: u32 = 4;
/// Manifolds.
pub const CONTACTS: u32 = 5;
/// Their points.
pub const POINTS: u32 = 6;
/// Impulses of the points, read back when somebody asks.
pub const IMPULSES: u32 = 7;
/// Where colors begin, and the rows that are in them.
pub const COLORS: u32 = 8;
/// Joints.
pub const JOINTS: u32 = 9;
/// Impulses of the joints, read back.
pub const JOINT_IMPULSES: u32 = 10;
/// Whether the sweeps still move anything, read back.
pub const CONVERGENCE: u32 = 11;
/// How far the sweeps extrapolate, read back.
pub const MOMENTUM: u32 = 12;
/// What [`CARRY_BINDINGS`] is about, the same for all.
pub const CARRY: u32 = 17;
/// Which contacts were written again.
pub const WRITTEN: u32 = 18;
/// Their rows.
pub const WRITTEN_CONTACTS: u32 = 19;
/// Their points.
pub const WRITTEN_POINTS: u32 = 20;
/// How far the points are apart when the step begins.
pub const SEPARATIONS: u32 = 21;
/// The passes of a plan that one workgroup follows.
pub const PASSES: u32 = 22;
/// Threads of a workgroup, the constant of the same name in `bindings.wgsl`.
pub const WORKGROUP: u32 = 64;

/// Reads a shader part at compile time.
macro_rules! part {
    ($name:literal) => {
        include_str!(concat!("../../../shaders/", $name, ".wgsl"))
    };
}

/// What a pipeline runs.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Program {
    /// A kernel of a plan.
    Pass(Kernel),
    /// All kernels of a plan, whose passes one workgroup of so many threads follows.
    Whole(Arc<[Kernel]>, u32),
    /// Bodies begin a step; before the plan, as the others.
    BeginBodies,
    /// Rows of contacts are written again.
    WriteContacts,
    /// Contacts begin a step.
    BeginContacts,
}

impl Program {
    /// Those that are not kernels of plans.
    pub const CARRY: [Self; 3] = [Self::BeginBodies, Self::WriteContacts, Self::BeginContacts];

    /// Name of the shader file and of its entry point.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pass(kernel) => kernel.name(),
            Self::Whole(..) => "whole_step",
            Self::BeginBodies => "begin_bodies",
            Self::WriteContacts => "write_contacts",
            Self::BeginContacts => "begin_contacts",
        }
    }

    /// Its WGSL.
    pub fn source(&self) -> String {
        let own = match self {
            Self::Pass(kernel) => return source(*kernel),
            Self::Whole(kernels, threads) => return whole::source(kernels, *threads),
            Self::BeginBodies => part!("carry/begin_bodies"),
            Self::WriteContacts => part!("carry/write_contacts"),
            Self::BeginContacts => part!("carry/begin_contacts"),
        };
        [part!("lib/types"), part!("lib/math"), part!("carry/bindings"), own].join("\n")
    }

    /// Its overrides.
    pub fn constants(&self) -> Vec<(&'static str, f64)> {
        if let Self::Pass(kernel) = self { constants(*kernel) } else { Vec::new() }
    }
}

/// The WGSL of a kernel: the parts it is made of, one after another.
pub fn source(kernel: Kernel) -> String {
    [part!("lib/types"), part!("lib/bindings"), part!("lib/math"), &own_source(kernel)].join("\n")
}

/// What of the WGSL of a kernel is not the same for all.
pub(super) fn own_source(kernel: Kernel) -> String {
    let own: &[&str] = match kernel {
        Kernel::IntegrateVelocities { .. } => &[part!("integrate_velocities")],
        Kernel::IntegrateGyroscopic => &[part!("integrate_gyroscopic")],
        Kernel::IntegratePositions => &[part!("integrate_positions")],
        Kernel::ClearImpulses => &[part!("clear_impulses")],
        Kernel::BeginSweep { .. } => &[part!("begin_sweep")],
        Kernel::Extrapolate { .. } => &[part!("extrapolate")],
        Kernel::MeasureStep => &[part!("lib/sum"), part!("measure_step")],
        Kernel::UpdateMomentum => &[part!("lib/sum"), part!("update_momentum")],
        Kernel::WarmStartJoints => &[part!("lib/pair"), part!("lib/joint"), part!("warm_start_joints")],
        Kernel::SolveJoints(_) => &[part!("lib/pair"), part!("lib/joint"), part!("solve_joints")],
        Kernel::WarmStart(_) => &[part!("lib/pair"), part!("lib/friction"), part!("warm_start")],
        Kernel::SolveContacts(_) => &[
            part!("lib/pair"),
            part!("lib/contact"),
            part!("lib/friction"),
            part!("lib/sweep"),
            part!("solve_contacts"),
        ],
        Kernel::ApplyRestitution(_) => &[part!("lib/pair"), part!("apply_restitution")],
    };
    own.join("\n")
}

/// The overrides of a kernel, as its source has them.
pub fn constants(kernel: Kernel) -> Vec<(&'static str, f64)> {
    let yes = |b: bool| f64::from(u8::from(b));
    let pair = |r: Rules| vec![("BIASED", yes(r.biased)), ("MEASURED", yes(r.measured))];
    let friction = |r: Rules| {
        let rule = match r.friction {
            FrictionRule::None => 0.0,
            FrictionRule::Slip => 1.0,
            FrictionRule::Box => 2.0,
            FrictionRule::Disc => 3.0,
        };
        vec![
            ("FRICTION", rule),
            ("PATCH", yes(r.patch)),
            ("FRICTION_FIRST", yes(r.friction_first)),
            ("DRIVEN", yes(r.driven)),
        ]
    };
    let contact = |r: Rules| vec![("ACCUMULATED", yes(r.accumulated)), ("ROUND", yes(r.round))];
    match kernel {
        Kernel::IntegrateVelocities { carry } => vec![("CARRY", yes(carry))],
        Kernel::BeginSweep { first } => vec![("FIRST", yes(first))],
        Kernel::Extrapolate { first, measured } => vec![("FIRST", yes(first)), ("MEASURED", yes(measured))],
        Kernel::WarmStartJoints => pair(Rules::default()),
        Kernel::SolveJoints(r) | Kernel::ApplyRestitution(r) => pair(r),
        Kernel::WarmStart(r) => [pair(r), friction(r)].concat(),
        Kernel::SolveContacts(r) => [pair(r), contact(r), friction(r), vec![("PASSES", r.passes.into())]].concat(),
        _ => Vec::new(),
    }
}

/// A kernel as naga understands it, its overrides resolved.
pub struct Reflected {
    /// The module.
    pub module: naga::Module,
    /// What naga found out about it.
    pub info: ModuleInfo,
    /// Bindings that the entry point uses, ascending.
    pub bindings: Vec<u32>,
    entry_point: String,
}

impl Reflected {
    /// Parses and validates with no capability beyond plain WebGPU.
    ///
    /// # Errors
    /// The WGSL is wrong: a defect of this crate, reported with naga's own words.
    pub fn new(source: &str, entry_point: &str, constants: &[(&str, f64)]) -> Result<Self> {
        let wrong = |e: &dyn std::fmt::Display| Error::Adapter(format!("shader {entry_point}: {e}"));
        let parsed = naga::front::wgsl::parse_str(source).map_err(|e| wrong(&e.emit_to_string(source)))?;
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        let valid = validator.validate(&parsed).map_err(|e| wrong(&e.emit_to_string(source)))?;
        let mut values = naga::back::PipelineConstants::default();
        values.extend(constants.iter().map(|&(name, value)| (name.to_owned(), value)));
        let stage = Some((naga::ShaderStage::Compute, entry_point));
        let (module, info) = naga::back::pipeline_constants::process_overrides(&parsed, &valid, stage, &values)
            .map_err(|e| wrong(&e))?;
        let (module, info) = (module.into_owned(), info.into_owned());
        let used = info.get_entry_point(0);
        let mut bindings: Vec<u32> = module
            .global_variables
            .iter()
            .filter(|(handle, _)| !used[*handle].is_empty())
            .filter_map(|(_, variable)| variable.binding.as_ref().map(|b| b.binding))
            .collect();
        bindings.sort_unstable();
        Ok(Self { module, info, bindings, entry_point: entry_point.to_owned() })
    }

    /// SPIR-V in which no result may be reassociated or fused, and no index leaves its buffer: naga takes the smaller of an index
    /// and the last one of the buffer, as in the shaders that wgpu compiles itself where the driver does not do it. On the software
    /// adapter `solve_contacts` takes 1.01 times as long with these checks (pile of 2,000 and wall, 20 pairs of runs in turn).
    ///
    /// # Errors
    /// naga cannot write it.
    pub fn exact_spirv(&self) -> Result<Vec<u32>> {
        // wgpu numbers the bindings of a layout consecutively.
        let place = |(at, &binding): (usize, &u32)| {
            let info = spv::BindingInfo { descriptor_set: 0, binding: at as u32, binding_array_size: None };
            (naga::ResourceBinding { group: 0, binding }, info)
        };
        let options = spv::Options {
            lang_version: (1, 3),
            flags: spv::WriterFlags::empty(),
            binding_map: self.bindings.iter().enumerate().map(place).collect(),
            bounds_check_policies: BoundsCheckPolicies {
                index: BoundsCheckPolicy::Restrict,
                buffer: BoundsCheckPolicy::Restrict,
                ..BoundsCheckPolicies::default()
            },
            ..Default::default()
        };
        let pipeline =
            spv::PipelineOptions { shader_stage: naga::ShaderStage::Compute, entry_point: self.entry_point.clone() };
        let words = spv::write_vec(&self.module, &self.info, &options, Some(&pipeline));
        let words = words.map_err(|e| Error::Adapter(format!("shader {}: {e}", self.entry_point)))?;
        Ok(exact::without_contraction(&words))
    }
}

/// The bind group layout of a kernel.
pub(super) fn layout(device: &wgpu::Device, reflected: &Reflected) -> wgpu::BindGroupLayout {
    let entry = |&binding: &u32| {
        let global = |(_, v): &(_, &naga::GlobalVariable)| v.binding.as_ref().is_some_and(|b| b.binding == binding);
        let (_, variable) = reflected.module.global_variables.iter().find(global).expect("reflected from this module");
        let kind = match variable.space {
            naga::AddressSpace::Storage { access } => {
                wgpu::BufferBindingType::Storage { read_only: !access.contains(naga::StorageAccess::STORE) }
            }
            _ => wgpu::BufferBindingType::Uniform,
        };
        wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: kind,
                has_dynamic_offset: binding == PASS_COLORS,
                min_binding_size: None,
            },
            count: None,
        }
    };
    let entries: Vec<_> = reflected.bindings.iter().map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
}
