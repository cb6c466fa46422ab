//! FCLIB's local form: u = W r + q, W sparse.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

use super::table::{Sparse, Tables};
use crate::contacts::LocalProblem;
use crate::error::{Error, Result};

impl LocalProblem {
    /// From an open FCLIB file with a local problem in space.
    pub(super) fn from_tables(tables: &Tables) -> Result<Self> {
        let dimensions = tables.number("fclib_local/spacedim")?;
        if dimensions != 3 {
            return Err(Error::input(format!("fclib_local/spacedim: {dimensions}: must be 3")));
        }
        if tables.has("fclib_local/R") || tables.has("fclib_local/V") {
            return Err(Error::input("fclib_local/R: joints cannot be read"));
        }
        let w = tables.matrix("fclib_local/W")?;
        let rows = blocks(&w).map_err(|e| e.within("fclib_local/W"))?;
        let q = tables.reals("fclib_local/vectors/q", w.rows)?;
        let friction = tables.frictions("fclib_local/vectors/mu", rows.len())?;
        let free = q.chunks_exact(3).map(DVec3::from_slice).collect();
        Ok(Self { name: tables.text("fclib_local/info/title"), friction, free, rows })
    }
}

/// W by rows of 3x3 blocks.
fn blocks(w: &Sparse) -> Result<Vec<Vec<(u32, DMat3)>>> {
    if w.rows != w.columns || !w.rows.is_multiple_of(3) || w.rows > u32::MAX as usize {
        let (rows, columns) = (w.rows, w.columns);
        return Err(Error::input(format!("{rows} x {columns}: contacts have 3 rows and columns each")));
    }
    // Before as much memory is asked for.
    if w.entries.len() < w.rows {
        return Err(Error::input(format!("{} entries for {} rows: a contact is empty", w.entries.len(), w.rows)));
    }
    let mut rows = vec![BTreeMap::<u32, DMat3>::new(); w.rows / 3];
    for &(row, column, x) in w.entries.iter().filter(|e| e.2 != 0.0) {
        rows[row / 3].entry(column as u32 / 3).or_default().col_mut(column % 3)[row % 3] += x;
    }
    for (i, row) in (0..).zip(&rows) {
        let own = row.get(&i).copied().unwrap_or_default();
        let diagonal = DVec3::new(own.x_axis.x, own.y_axis.y, own.z_axis.z);
        if diagonal.min_element() <= 0.0 {
            let diagonal = diagonal.to_array();
            return Err(Error::input(format!("contact {i}: its diagonal {diagonal:?} must be positive")));
        }
    }
    Ok(rows.into_iter().map(|row| row.into_iter().collect()).collect())
}
