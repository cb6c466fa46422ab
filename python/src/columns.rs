//! Python arrays, divided by worlds.

use drystone::batch::Column;
use drystone_problems::batch::Measure;
use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn};
use pyo3::prelude::*;

use crate::raised;

/// An array of single precision with a row of numbers for each world.
pub type Named<'py> = (String, Bound<'py, PyArrayDyn<f32>>);

/// The values of a world in each column.
pub type InputParts<'a> = Vec<(Column, &'a [f32])>;
/// Places for the values of a world in each column.
pub type OutputParts<'a> = Vec<(Column, &'a mut [f32])>;

/// Columns that are read while threads step worlds.
pub struct Inputs<'py>(Vec<(Column, PyReadonlyArrayDyn<'py, f32>)>);

impl<'py> Inputs<'py> {
    pub fn new(arrays: &[Named<'py>]) -> PyResult<Self> {
        let column = |(name, array): &Named<'py>| Ok((name.parse().map_err(raised)?, array.try_readonly()?));
        arrays.iter().map(column).collect::<PyResult<_>>().map(Self)
    }

    /// The columns, each with the values of every chosen world.
    pub fn cut(&self, worlds: usize, chosen: &[usize]) -> PyResult<Vec<InputParts<'_>>> {
        let mut all: Vec<Vec<_>> = chosen.iter().map(|_| Vec::with_capacity(self.0.len())).collect();
        for (column, array) in &self.0 {
            let numbers = array.as_slice()?;
            let each = numbers.len() / worlds;
            for (own, world) in all.iter_mut().zip(chosen) {
                own.push((*column, &numbers[world * each..(world + 1) * each]));
            }
        }
        Ok(all)
    }
}

/// Columns that are written.
pub struct Outputs<'py>(Vec<(Column, PyReadwriteArrayDyn<'py, f32>)>);

impl<'py> Outputs<'py> {
    pub fn new(arrays: &[Named<'py>]) -> PyResult<Self> {
        let column = |(name, array): &Named<'py>| Ok((name.parse().map_err(raised)?, array.try_readwrite()?));
        arrays.iter().map(column).collect::<PyResult<_>>().map(Self)
    }

    /// The columns, each with the place for every chosen world.
    pub fn cut(&mut self, worlds: usize, chosen: &[usize]) -> PyResult<Vec<OutputParts<'_>>> {
        let mut all: Vec<Vec<_>> = chosen.iter().map(|_| Vec::with_capacity(self.0.len())).collect();
        for (column, array) in &mut self.0 {
            let parts = parts(array.as_slice_mut()?, worlds).into_iter().enumerate();
            let mut parts = parts.filter(|(world, _)| chosen.binary_search(world).is_ok());
            for (own, (_, part)) in all.iter_mut().zip(&mut parts) {
                own.push((*column, part));
            }
        }
        Ok(all)
    }
}

/// The recorded values of a world after a step.
pub enum Record<'a> {
    Column(Column, &'a mut [f32]),
    Measure(Measure, &'a mut [f64]),
    Hash(&'a mut [u64]),
}

/// Arrays for the records of a rollout: columns, measures and hashes.
pub enum RecordArray<'py> {
    Column(Column, PyReadwriteArrayDyn<'py, f32>),
    Measure(Measure, PyReadwriteArrayDyn<'py, f64>),
    Hash(PyReadwriteArrayDyn<'py, u64>),
}

impl<'py> RecordArray<'py> {
    /// Arrays by the names of their records.
    pub fn all(arrays: &[(String, Bound<'py, PyAny>)]) -> PyResult<Vec<Self>> {
        arrays.iter().map(|(name, array)| Self::new(name, array)).collect()
    }

    fn new(name: &str, array: &Bound<'py, PyAny>) -> PyResult<Self> {
        if name == "hash" {
            return Ok(Self::Hash(array.cast::<PyArrayDyn<u64>>()?.try_readwrite()?));
        }
        match (name.parse::<Column>(), name.parse::<Measure>()) {
            (Ok(column), _) => Ok(Self::Column(column, array.cast::<PyArrayDyn<f32>>()?.try_readwrite()?)),
            (_, Ok(measure)) => Ok(Self::Measure(measure, array.cast::<PyArrayDyn<f64>>()?.try_readwrite()?)),
            (Err(error), _) => Err(raised(error)),
        }
    }

    /// The place for each of `worlds` worlds.
    pub fn cut(&mut self, worlds: usize) -> PyResult<Vec<Record<'_>>> {
        Ok(match self {
            Self::Column(column, array) => {
                parts(array.as_slice_mut()?, worlds).into_iter().map(|part| Record::Column(*column, part)).collect()
            }
            Self::Measure(measure, array) => {
                parts(array.as_slice_mut()?, worlds).into_iter().map(|part| Record::Measure(*measure, part)).collect()
            }
            Self::Hash(array) => parts(array.as_slice_mut()?, worlds).into_iter().map(Record::Hash).collect(),
        })
    }
}

/// Equal parts of a slice. They can be empty.
pub fn parts<T>(mut slice: &mut [T], count: usize) -> Vec<&mut [T]> {
    let each = slice.len() / count.max(1);
    (0..count)
        .map(|_| {
            let (part, rest) = std::mem::take(&mut slice).split_at_mut(each);
            slice = rest;
            part
        })
        .collect()
}
