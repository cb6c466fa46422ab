//! The Rust part of the Python package. `python/drystone` checks arguments and has the documentation. Arrays arrive
//! here with the right shapes and types.

#![deny(unsafe_code)]

mod batch;
mod columns;
mod families;
mod picture;
mod scene;

use std::ffi::OsString;
use std::process::ExitCode;

use pyo3::exceptions::{PyMemoryError, PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

pyo3::create_exception!(drystone, InternalError, PyRuntimeError, "A defect of drystone.");
pyo3::create_exception!(
    drystone,
    AdapterError,
    PyRuntimeError,
    "No graphics adapter, neither a GPU nor a software driver, or one that lacks a needed feature."
);

/// Converts an error of the library to a Python exception.
pub fn raised(error: drystone::Error) -> PyErr {
    use drystone::Error;
    let line = error.to_string();
    match error {
        Error::Input(_) => PyValueError::new_err(line),
        Error::File { .. } => PyOSError::new_err(line),
        Error::Adapter(_) | Error::Lost(_) => AdapterError::new_err(line),
        Error::TooLarge(_) => PyMemoryError::new_err(line),
        Error::Panicked(_) => InternalError::new_err(line),
        _ => PyRuntimeError::new_err(line),
    }
}

/// Runs the command `drystone`. The first word is the name of the program. Returns its exit code.
#[pyfunction]
fn command(py: Python<'_>, words: Vec<OsString>) -> u8 {
    let code = py.detach(|| drystone_cli::commands::main_of(&words));
    // The number of an exit code can only be found by comparison.
    (0..=u8::MAX).find(|&number| ExitCode::from(number) == code).unwrap_or(1)
}

#[pymodule(gil_used = false)]
mod _drystone {
    #[pymodule_export]
    use super::batch::{Batch, State};
    #[pymodule_export]
    use super::command;
    #[pymodule_export]
    use super::families::{family_names, judge, wilson};
    #[pymodule_export]
    use super::picture::{boards, maze};
    #[pymodule_export]
    use super::scene::{Config, Scene, catalogue, schema};
    #[pymodule_export]
    use super::{AdapterError, InternalError};
}
