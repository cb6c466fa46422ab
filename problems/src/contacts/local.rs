//! A contact problem without bodies: the relative velocities at its contacts as functions of their impulses.

use glam::{DMat3, DVec3};

/// u = W r + q, with W in blocks of contacts. The conditions on r and u are those of [`super::ContactProblem`].
///
/// W need not be symmetric: in files of some programs it differs from its transpose by a thousandth.
///
/// ```
/// use drystone_problems::contacts::LocalProblem;
/// use drystone::glam::{DMat3, DVec3};
/// let rows = vec![vec![(0, DMat3::IDENTITY * 0.5)]];
/// let problem = LocalProblem { name: "one contact".into(), friction: vec![0.1], free: vec![DVec3::X * -3.0], rows };
/// assert_eq!((problem.block(0), problem.colors()), (DMat3::IDENTITY * 0.5, vec![vec![0]]));
/// assert_eq!(problem.response(0, &[DVec3::X * 6.0]), DVec3::X * 3.0);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LocalProblem {
    /// Its name, on one line.
    pub name: String,
    /// Coulomb coefficient of each contact.
    pub friction: Vec<f64>,
    /// q: the relative velocity at each contact without impulses (m/s), in the coordinates of the contact: normal,
    /// first and second tangent.
    pub free: Vec<DVec3>,
    /// The rows of W (1/kg). For each contact it lists the contacts whose impulses affect it, in ascending order, each
    /// with its block. Every row has its own contact.
    pub rows: Vec<Vec<(u32, DMat3)>>,
}

impl LocalProblem {
    /// W_ii (1/kg).
    ///
    /// # Panics
    /// The row does not have its own contact.
    pub fn block(&self, contact: usize) -> DMat3 {
        let row = &self.rows[contact];
        row[row.binary_search_by_key(&(contact as u32), |e| e.0).expect("a contact answers to itself")].1
    }

    /// W r at a contact (m/s), for impulses in the coordinates of their contacts (N s).
    pub fn response(&self, contact: usize, impulses: &[DVec3]) -> DVec3 {
        self.rows[contact].iter().fold(DVec3::ZERO, |u, &(j, w)| u + w * impulses[j as usize])
    }

    /// Colors the contacts: in file order, each contact takes the first color without a contact that is coupled to it
    /// in either direction.
    pub fn colors(&self) -> Vec<Vec<u32>> {
        let mut near: Vec<Vec<u32>> = vec![Vec::new(); self.rows.len()];
        for (i, row) in (0..).zip(&self.rows) {
            for &(j, _) in row {
                near[i as usize].push(j);
                near[j as usize].push(i);
            }
        }
        let mut color_of: Vec<Option<usize>> = vec![None; self.rows.len()];
        let mut colors: Vec<Vec<u32>> = Vec::new();
        for (i, near) in (0..).zip(&near) {
            let is_used = |color: &usize| near.iter().any(|&j| color_of[j as usize] == Some(*color));
            let color = (0..).find(|color| !is_used(color)).expect("there are more colors than neighbors");
            if color == colors.len() {
                colors.push(Vec::new());
            }
            colors[color].push(i);
            color_of[i as usize] = Some(color);
        }
        colors
    }
}
