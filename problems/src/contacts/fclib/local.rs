//! FCLIB's local form: u = W r + q, W sparse.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

use super::table::{Sparse, Tables};
use crate::contacts::LocalProblem;
use drystone::{Error, Result};

impl LocalProblem {
    /// Reads an open FCLIB file with a local problem in space.
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
    // Check before memory is allocated.
    if w.entries.len() < w.rows {
        return Err(Error::input(format!("{} entries for {} rows: a contact is empty", w.entries.len(), w.rows)));
    }
    let mut rows = vec![BTreeMap::<u32, DMat3>::new(); w.rows / 3];
    for &(row, column, x) in w.entries.iter().filter(|e| e.2 != 0.0) {
        rows[row / 3].entry(column as u32 / 3).or_insert(DMat3::ZERO).col_mut(column % 3)[row % 3] += x;
    }
    for (i, row) in (0..).zip(&rows) {
        let own = row.get(&i).copied().unwrap_or(DMat3::ZERO);
        let diagonal = DVec3::new(own.x_axis.x, own.y_axis.y, own.z_axis.z);
        if diagonal.min_element() <= 0.0 {
            let diagonal = diagonal.to_array();
            return Err(Error::input(format!("contact {i}: its diagonal {diagonal:?} must be positive")));
        }
    }
    Ok(rows.into_iter().map(|row| row.into_iter().collect()).collect())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Data, Tree, boxes, bytes, change, triplets};
    use super::*;
    use crate::contacts::{ContactProblem, Operator, Problem};

    /// u = W r + q of the boxes: each unit impulse gives a column of W.
    fn delassus() -> (Sparse, Vec<f64>) {
        let problem = boxes();
        let operator = Operator::new(&problem);
        let count = problem.contacts.len();
        let velocities = |impulses: &[DVec3]| -> Vec<f64> {
            let velocities = operator.velocities(impulses);
            (0..count).flat_map(|i| operator.relative_velocity(i, &velocities).to_array()).collect()
        };
        let q = velocities(&vec![DVec3::ZERO; count]);
        let mut w = Sparse { rows: 3 * count, columns: 3 * count, entries: Vec::new() };
        for column in 0..3 * count {
            let mut impulses = vec![DVec3::ZERO; count];
            impulses[column / 3][column % 3] = 1.0;
            let u = velocities(&impulses);
            (0..3 * count).for_each(|row| w.push(row, column, u[row] - q[row]));
        }
        (w, q)
    }

    fn tree() -> Tree {
        let (w, q) = delassus();
        let size = w.rows as i32;
        let mut tree = vec![("spacedim", Data::Whole(vec![3]))];
        tree.extend(triplets(["W/nzmax", "W/m", "W/n", "W/nz", "W/p", "W/i", "W/x"], &w, [size, size]));
        tree.push(("vectors/q", Data::Real(q)));
        tree.push(("vectors/mu", Data::Real(boxes().contacts.iter().map(|c| c.friction).collect())));
        tree
    }

    fn read(tree: &Tree) -> Result<LocalProblem> {
        match Problem::from_fclib(bytes(tree, "fclib_local"))? {
            Problem::Blocks(problem) => Ok(problem),
            Problem::Bodies(_) => panic!("it has bodies"),
        }
    }

    #[test]
    fn a_local_file_holds_the_problem_of_its_bodies() {
        let (problem, local) = (boxes(), read(&tree()).expect("read"));
        let operator = Operator::new(&problem);
        let impulses: Vec<_> = (0..problem.contacts.len()).map(|i| DVec3::new(1.0, 0.3, -0.2) * i as f64).collect();
        let velocities = operator.velocities(&impulses);
        for i in 0..impulses.len() {
            let expected = operator.relative_velocity(i, &velocities);
            let u = local.free[i] + local.response(i, &impulses);
            assert!(u.distance(expected) < 1e-12 * expected.length(), "contact {i}: {u}, not {expected}");
            assert_eq!(local.friction[i], problem.contacts[i].friction);
        }
        // Contacts of different bodies are not coupled, and contacts of one color never are.
        assert!(local.rows.iter().any(|row| row.len() < impulses.len()), "W is full");
        for color in local.colors() {
            let meets = |i: &u32| local.rows[*i as usize].iter().any(|(j, _)| j != i && color.contains(j));
            assert!(!color.iter().any(meets), "{color:?}");
        }
    }

    /// A change of a file, and the text that the error must contain.
    #[test]
    fn a_bad_local_file_is_refused_in_one_line_that_names_the_dataset() {
        use Data::{Real, Whole};
        let good = tree();
        let size = 3 * boxes().contacts.len() as i32;
        let number = |path: &str, k: usize, x: f64| {
            let Some((_, Real(numbers))) = good.iter().find(|(at, _)| *at == path) else { panic!("{path}") };
            let mut numbers = numbers.clone();
            numbers[k] = x;
            Real(numbers)
        };
        for (path, data, named) in [
            ("spacedim", Whole(vec![2]), "must be 3"),
            ("W/m", Whole(vec![size + 3]), "24 x 21: contacts have"),
            ("W/n", Whole(vec![size - 1]), "less than 20"),
            ("W/nz", Whole(vec![-3]), "-3: must be -2, -1 or a count"),
            ("W/x", number("W/x", 0, -1.0), "contact 0: its diagonal [-1.0"),
            ("W/x", number("W/x", 3, f64::NAN), "number 3 is NaN"),
            ("vectors/q", Real(vec![0.0; 20]), "[20], but 21 numbers"),
            ("vectors/mu", number("vectors/mu", 6, -0.5), "-0.5 of contact 6"),
        ] {
            let mut tree = good.clone();
            *change(&mut tree, path) = data;
            let error = read(&tree).expect_err(named).to_string();
            let group = format!("fclib_local/{}", path.split('/').next().expect("a group"));
            assert!(
                error.starts_with(&group) && error.contains(named) && error.lines().count() == 1,
                "{path}: {error}"
            );
        }
        for missing in good.iter().map(|(path, _)| *path).filter(|path| !path.ends_with("nzmax")) {
            let tree = good.iter().filter(|(path, _)| *path != missing).cloned().collect();
            let error = read(&tree).expect_err(missing).to_string();
            assert!(error.starts_with(&format!("fclib_local/{missing}: ")) && error.lines().count() == 1, "{error}");
        }
        let mut jointed = good.clone();
        jointed.push(("R/m", Whole(vec![18])));
        assert_eq!(read(&jointed).expect_err("refused").to_string(), "fclib_local/R: joints cannot be read");
        let rolling = Problem::from_fclib(bytes(&good, "fclib_local_rolling")).expect_err("refused").to_string();
        assert_eq!(rolling, "fclib_local_rolling: rolling friction cannot be read");
        let bodies = ContactProblem::from_fclib(bytes(&good, "fclib_local")).expect_err("refused").to_string();
        assert_eq!(bodies, "fclib_local: has no bodies, but bodies are needed");
    }
}
