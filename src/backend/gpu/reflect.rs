//! A shader after parsing by naga: its buffers and their use.

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

use super::bindings::Binding;
use crate::error::{Error, Result};

/// A shader with one entry point.
pub struct Reflected {
    /// The module.
    pub module: naga::Module,
    /// Naga's analysis of the module.
    pub info: ModuleInfo,
    /// Bindings that the entry point uses, in the order of their numbers.
    pub bindings: Vec<Binding>,
    /// Name of the program, for messages.
    pub name: &'static str,
}

impl Reflected {
    /// Parses and validates a shader with the capabilities of plain WebGPU.
    ///
    /// # Errors
    /// The WGSL is invalid. That is a defect of this crate; the message has naga's words.
    pub fn new(name: &'static str, source: &str) -> Result<Self> {
        let wrong = |e: String| Error::Adapter(format!("shader {name}: {e}"));
        let module = naga::front::wgsl::parse_str(source).map_err(|e| wrong(e.emit_to_string(source)))?;
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        let info = validator.validate(&module).map_err(|e| wrong(e.emit_to_string(source)))?;
        let used = info.get_entry_point(0);
        let used = |(handle, _): &(naga::Handle<naga::GlobalVariable>, _)| !used[*handle].is_empty();
        let binding = |v: &naga::GlobalVariable| Some(Binding::ALL[v.binding.as_ref()?.binding as usize]);
        let mut bindings: Vec<_> =
            module.global_variables.iter().filter(used).filter_map(|(_, v)| binding(v)).collect();
        bindings.sort_unstable();
        Ok(Self { module, info, bindings, name })
    }

    /// The address space of a binding in the shader.
    pub fn space(&self, binding: Binding) -> naga::AddressSpace {
        let number = |v: &naga::GlobalVariable| v.binding.as_ref().is_some_and(|at| at.binding == binding as u32);
        let mut variables = self.module.global_variables.iter().map(|(_, v)| v);
        variables.find(|v| number(v)).expect("the binding is one of this shader").space
    }
}
