//! Exact mode in SPIR-V: every sum and product has to be computed as written.
//!
//! Plain WGSL allows drivers to reassociate and to fuse. Software Vulkan turns `v + (x y - z w)` into `(v + x y) - z
//! w`, and after four sweeps nearly every body differs in its last bits. The decoration `NoContraction` on every
//! arithmetic result prevents this at the same speed, and the GPU agrees with the reference to the last bit. Some
//! drivers flush subnormal numbers to zero, or drop the sign of a zero; execution modes prevent both. Naga writes
//! neither, so this module adds them to naga's output.

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};

use super::bindings::Binding;
use super::reflect::Reflected;
use crate::error::{Error, Result};

/// Words of a SPIR-V header.
const HEADER: usize = 5;
const OP_EXTENSION: u32 = 10;
const OP_ENTRY_POINT: u32 = 15;
const OP_EXECUTION_MODE: u32 = 16;
const OP_CAPABILITY: u32 = 17;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;
const NO_CONTRACTION: u32 = 42;

/// Whether an instruction computes with floats: negate, add, sub, mul, div, rem, mod, vector and matrix products, dot.
fn is_arithmetic(opcode: u32) -> bool {
    matches!(opcode, 127 | 129 | 131 | 133 | 136 | 140 | 141 | 142..=148)
}

/// The instructions of a module.
fn instructions(words: &[u32]) -> impl Iterator<Item = &[u32]> {
    let mut rest = &words[HEADER..];
    std::iter::from_fn(move || {
        let length = (*rest.first()? >> 16).max(1) as usize;
        let own;
        (own, rest) = rest.split_at(length);
        Some(own)
    })
}

/// The same module with a decoration on every arithmetic result.
fn without_contraction(words: &[u32]) -> Vec<u32> {
    let mut decorations = Vec::new();
    let mut annotations_begin = None;
    let mut at = HEADER;
    for own in instructions(words) {
        let opcode = own[0] & 0xffff;
        if matches!(opcode, OP_DECORATE | OP_MEMBER_DECORATE) {
            annotations_begin.get_or_insert(at);
        }
        if is_arithmetic(opcode) {
            decorations.extend([3 << 16 | OP_DECORATE, own[2], NO_CONTRACTION]);
        }
        at += own.len();
    }
    // Annotations are contiguous, and every kernel has some: its bindings.
    let split = annotations_begin.unwrap_or(words.len());
    [&words[..split], &decorations, &words[split..]].concat()
}

/// Execution modes of `SPV_KHR_float_controls` with their capabilities: `DenormPreserve`, which keeps subnormal numbers,
/// and `SignedZeroInfNanPreserve`.
const MODES: [[u32; 2]; 2] = [[4459, 4464], [4461, 4466]];

/// Whether the driver of an adapter knows the modes: Vulkan has them since 1.2. The properties of a device do not tell
/// whether a mode has an effect: llvmpipe keeps subnormal numbers and reports that it cannot. NVIDIA 580 flushes them
/// without the mode and keeps them with it, but not if the mode follows from these properties.
#[cfg(any(windows, target_os = "linux", target_os = "android"))]
#[allow(unsafe_code)]
pub(super) fn knows_float_controls(adapter: &wgpu::Adapter) -> bool {
    // SAFETY: these calls only read properties, of a device that `adapter` keeps alive.
    unsafe {
        adapter.as_hal::<wgpu::hal::api::Vulkan>().is_some_and(|adapter| {
            let (instance, device) = (adapter.shared_instance(), adapter.raw_physical_device());
            let version = instance.raw_instance().get_physical_device_properties(device).api_version;
            instance.instance_api_version().min(version) >= ash::vk::API_VERSION_1_2
        })
    }
}

/// Elsewhere no adapter takes SPIR-V.
#[cfg(not(any(windows, target_os = "linux", target_os = "android")))]
pub(super) fn knows_float_controls(_: &wgpu::Adapter) -> bool {
    false
}

/// The same module with the modes.
fn with_float_controls(words: &[u32]) -> Vec<u32> {
    let instruction =
        |opcode: u32, operands: &[u32]| [&[(operands.len() as u32 + 1) << 16 | opcode], operands].concat();
    let name: Vec<u32> = bytemuck::pod_collect_to_vec(b"SPV_KHR_float_controls\0\0");
    let mut changed = words[..HEADER].to_vec();
    let (mut before, mut entry_point) = (OP_CAPABILITY, 0);
    for own in instructions(words) {
        let opcode = own[0] & 0xffff;
        // Extensions follow the capabilities, which come first. Execution modes follow the only entry point.
        if before == OP_CAPABILITY && opcode != OP_CAPABILITY {
            changed.extend(MODES.iter().flat_map(|[_, capability]| instruction(OP_CAPABILITY, &[*capability])));
            changed.extend(instruction(OP_EXTENSION, &name));
        }
        if before == OP_ENTRY_POINT {
            let of_floats = |[mode, _]: &[u32; 2]| instruction(OP_EXECUTION_MODE, &[entry_point, *mode, 32]);
            changed.extend(MODES.iter().flat_map(of_floats));
        }
        if opcode == OP_ENTRY_POINT {
            entry_point = own[2];
        }
        changed.extend_from_slice(own);
        before = opcode;
    }
    changed
}

/// SPIR-V in which no result can be reassociated or fused, and no index leaves its buffer: naga takes the smaller of an
/// index and the last index of the buffer. wgpu does the same to the shaders that it compiles, unless the driver checks
/// indices itself. On the software adapter, `solve_contacts` takes 1.01 times as long with these checks (pile of 2,000
/// and wall, 20 pairs of runs in turn).
///
/// # Errors
/// Naga cannot write it.
pub fn exact_spirv(reflected: &Reflected, float_controls: bool) -> Result<Vec<u32>> {
    // wgpu numbers the bindings of a layout consecutively.
    let place = |(at, &binding): (usize, &Binding)| {
        let info = spv::BindingInfo { descriptor_set: 0, binding: at as u32, binding_array_size: None };
        (naga::ResourceBinding { group: 0, binding: binding as u32 }, info)
    };
    let options = spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
        binding_map: reflected.bindings.iter().enumerate().map(place).collect(),
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: BoundsCheckPolicy::Restrict,
            ..BoundsCheckPolicies::default()
        },
        ..Default::default()
    };
    let entry_point = reflected.module.entry_points[0].name.clone();
    let pipeline = spv::PipelineOptions { shader_stage: naga::ShaderStage::Compute, entry_point };
    let words = spv::write_vec(&reflected.module, &reflected.info, &options, Some(&pipeline));
    let words = words.map_err(|e| Error::Adapter(format!("shader {}: {e}", reflected.name)))?;
    Ok(without_contraction(&if float_controls { with_float_controls(&words) } else { words }))
}

/// A SPIR-V shader module that wgpu passes to the driver unchanged.
#[allow(unsafe_code)]
pub(super) fn shader_module(
    device: &wgpu::Device,
    reflected: &Reflected,
    float_controls: bool,
) -> Result<wgpu::ShaderModule> {
    let spirv = exact_spirv(reflected, float_controls)?;
    let entry_point = &reflected.module.entry_points[0];
    let [x, y, z] = entry_point.workgroup_size;
    let entry_points =
        [wgpu::PassthroughShaderEntryPoint { name: entry_point.name.as_str().into(), workgroup_size: (x, y, z) }];
    let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
        label: Some(reflected.name),
        entry_points: (&entry_points[..]).into(),
        spirv: Some(spirv.into()),
        ..Default::default()
    };
    // SAFETY: the driver does not check these words, so they must be valid, and their indices must stay inside the
    // bound buffers. They are valid: naga wrote them from a module that it validated, and `without_contraction` only
    // adds decorations, and `with_float_controls` modes that Vulkan 1.2 has. Indices stay inside: `CheckedStep`
    // guarantees that the indices in a problem's rows and in a pass's colors name existing rows, and `exact_spirv` lets
    // naga limit every index to the length of its buffer for any rows (test: `tests/cpu/shaders.rs`).
    // `Pipelines::prepare` makes the layout of the bindings from the same module.
    Ok(unsafe { device.create_shader_module_passthrough(descriptor) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sum_and_product_is_decorated_and_nothing_else_changes() {
        // Header; OpDecorate %9 0; OpFAdd %1 %2 %3 %4; OpIAdd; OpFMul.
        let words = [
            7,
            7,
            7,
            7,
            7,
            3 << 16 | 71,
            9,
            0,
            5 << 16 | 129,
            1,
            2,
            3,
            4,
            5 << 16 | 128,
            1,
            5,
            3,
            4,
            5 << 16 | 133,
            1,
            6,
            3,
            4,
        ];
        let exact = without_contraction(&words);
        assert_eq!(exact[..5], words[..5]);
        assert_eq!(exact[5..11], [3 << 16 | 71, 2, 42, 3 << 16 | 71, 6, 42]);
        assert_eq!(exact[11..], words[5..]);
    }
}
