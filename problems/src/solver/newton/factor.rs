//! Sparse LU factors of a matrix in N x N blocks with a symmetric pattern. Blocks are eliminated in minimum-degree
//! order.

use std::array::from_fn;

use super::elimination::eliminate;

/// A dense block, by rows.
pub type Block<const N: usize> = [[f64; N]; N];

/// The matrix, which its factors later replace.
///
/// ```
/// use drystone_problems::solver::newton::Factor;
///
/// // 1 + [[3, 1], [1, 4]] with two nodes of one unknown.
/// let mut factor = Factor::<1>::new(2, [[0, 1]]);
/// factor.clear();
/// for (row, column, value) in [(0, 0, 3.0), (0, 1, 1.0), (1, 0, 1.0), (1, 1, 4.0)] {
///     factor.block_mut(row, column)[0][0] += value;
/// }
/// assert!(factor.multiplications() > 0.0);
/// factor.factor().expect("no pivot is singular");
/// let mut x = [[9.0], [20.0]];
/// factor.solve(&mut x);
/// assert!((x[0][0] - 25.0 / 19.0).abs() < 1e-12 && (x[1][0] - 71.0 / 19.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct Factor<const N: usize> {
    /// The place of each node in the elimination order.
    place: Vec<u32>,
    /// For each place: the later places that are coupled to it at its elimination, ascending.
    below: Vec<Vec<u32>>,
    /// For each place: the index of its first block in `lower` and `upper`.
    begin: Vec<usize>,
    /// For each place: the diagonal block, later its factors: L below the diagonal, U on and above it.
    diagonal: Vec<Block<N>>,
    /// For each place: the row of the block for each row of L U.
    pivots: Vec<[u8; N]>,
    /// For each place and entry of `below`: block (below, place).
    lower: Vec<Block<N>>,
    /// For each place and entry of `below`: block (place, below).
    upper: Vec<Block<N>>,
}

impl<const N: usize> Factor<N> {
    /// The pattern with `nodes` diagonal blocks, and with the blocks of `ties` in both directions.
    pub fn new(nodes: usize, ties: impl IntoIterator<Item = [u32; 2]>) -> Self {
        let (place, below) = eliminate(nodes, ties);
        let mut begin = vec![0];
        for rows in &below {
            begin.push(begin[begin.len() - 1] + rows.len());
        }
        let blocks = begin[nodes];
        let zero = [[0.0; N]; N];
        Self {
            place,
            below,
            begin,
            diagonal: vec![zero; nodes],
            pivots: vec![[0; N]; nodes],
            lower: vec![zero; blocks],
            upper: vec![zero; blocks],
        }
    }

    /// Number of multiplications of [`Self::factor`].
    pub fn multiplications(&self) -> f64 {
        let products = |rows: &Vec<u32>| (1 + rows.len()).pow(2) as f64;
        (N as f64).powi(3) * self.below.iter().map(products).sum::<f64>()
    }

    /// Resets the matrix to the identity.
    pub fn clear(&mut self) {
        let unit = from_fn(|i| from_fn(|j| f64::from(u8::from(i == j))));
        self.diagonal.fill(unit);
        self.lower.fill([[0.0; N]; N]);
        self.upper.fill([[0.0; N]; N]);
    }

    /// The block (row, column), for addition.
    ///
    /// # Panics
    /// The pattern does not have this block.
    pub fn block_mut(&mut self, row: u32, column: u32) -> &mut Block<N> {
        let [row, column] = [row, column].map(|node| self.place[node as usize]);
        let entry = |first: u32, second: u32| {
            let of = self.below[first as usize].binary_search(&second).expect("a block of the pattern");
            self.begin[first as usize] + of
        };
        match row.cmp(&column) {
            std::cmp::Ordering::Equal => &mut self.diagonal[row as usize],
            std::cmp::Ordering::Greater => {
                let at = entry(column, row);
                &mut self.lower[at]
            }
            std::cmp::Ordering::Less => {
                let at = entry(row, column);
                &mut self.upper[at]
            }
        }
    }

    /// Factors the matrix. Returns `None` if a pivot is singular.
    pub fn factor(&mut self) -> Option<()> {
        for k in 0..self.diagonal.len() {
            self.pivots[k] = decompose(&mut self.diagonal[k])?;
            let (begin, count) = (self.begin[k], self.below[k].len());
            for m in begin..begin + count {
                right_divide(&mut self.lower[m], &self.diagonal[k]);
                left_divide(&mut self.upper[m], &self.diagonal[k], &self.pivots[k]);
            }
            // Subtract L_ik U_kj from block (i, j) of the remaining matrix.
            for (n, &j) in self.below[k].iter().enumerate() {
                let j = j as usize;
                let (l, u) = (self.lower[begin + n], self.upper[begin + n]);
                subtract(&mut self.diagonal[j], &l, &u);
                let mut at = self.begin[j];
                let mut rows = self.below[j].iter();
                for (m, i) in self.below[k].iter().enumerate().skip(n + 1) {
                    while rows.next().is_some_and(|row| row < i) {
                        at += 1;
                    }
                    let (below, other) = (self.lower[begin + m], self.upper[begin + m]);
                    subtract(&mut self.lower[at], &below, &u);
                    subtract(&mut self.upper[at], &l, &other);
                    at += 1;
                }
            }
        }
        Some(())
    }

    /// Solves with the factors, in place. `x` is indexed by nodes.
    pub fn solve(&self, x: &mut [[f64; N]]) {
        let mut y = vec![[0.0; N]; x.len()];
        for (node, &place) in self.place.iter().enumerate() {
            y[place as usize] = x[node];
        }
        for k in 0..y.len() {
            let own = from_fn(|i| y[k][self.pivots[k][i] as usize]);
            y[k] = own;
            for i in 1..N {
                y[k][i] -= (0..i).map(|j| self.diagonal[k][i][j] * y[k][j]).sum::<f64>();
            }
            let own = y[k];
            for (m, &i) in self.below[k].iter().enumerate() {
                let less = times(&self.lower[self.begin[k] + m], &own);
                (0..N).for_each(|c| y[i as usize][c] -= less[c]);
            }
        }
        for k in (0..y.len()).rev() {
            let mut own = y[k];
            for (m, &i) in self.below[k].iter().enumerate() {
                let less = times(&self.upper[self.begin[k] + m], &y[i as usize]);
                (0..N).for_each(|c| own[c] -= less[c]);
            }
            for i in (0..N).rev() {
                let more: f64 = (i + 1..N).map(|j| self.diagonal[k][i][j] * own[j]).sum();
                own[i] = (own[i] - more) / self.diagonal[k][i][i];
            }
            y[k] = own;
        }
        for (node, &place) in self.place.iter().enumerate() {
            x[node] = y[place as usize];
        }
    }
}

/// c -= a b.
fn subtract<const N: usize>(c: &mut Block<N>, a: &Block<N>, b: &Block<N>) {
    for i in 0..N {
        for k in 0..N {
            for j in 0..N {
                c[i][j] -= a[i][k] * b[k][j];
            }
        }
    }
}

fn times<const N: usize>(a: &Block<N>, x: &[f64; N]) -> [f64; N] {
    from_fn(|i| (0..N).map(|j| a[i][j] * x[j]).sum())
}

/// Factors P A = L U in place, with the largest pivot of each column. Returns the row of A for each row of L U, or
/// `None` if the block is singular or has a number that is not finite.
fn decompose<const N: usize>(a: &mut Block<N>) -> Option<[u8; N]> {
    let mut rows: [u8; N] = from_fn(|i| i as u8);
    for k in 0..N {
        let pivot = (k..N).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        a.swap(k, pivot);
        rows.swap(k, pivot);
        let by = 1.0 / a[k][k];
        if !by.is_finite() {
            return None;
        }
        let own = a[k];
        for row in &mut a[k + 1..] {
            row[k] *= by;
            let by = row[k];
            (k + 1..N).for_each(|j| row[j] -= by * own[j]);
        }
    }
    a.iter().flatten().all(|x| x.is_finite()).then_some(rows)
}

/// Replaces B by B U⁻¹.
fn right_divide<const N: usize>(b: &mut Block<N>, lu: &Block<N>) {
    for row in b {
        for j in 0..N {
            row[j] = (row[j] - (0..j).map(|k| row[k] * lu[k][j]).sum::<f64>()) / lu[j][j];
        }
    }
}

/// Replaces B by L⁻¹ P B.
fn left_divide<const N: usize>(b: &mut Block<N>, lu: &Block<N>, rows: &[u8; N]) {
    *b = from_fn(|i| b[rows[i] as usize]);
    for i in 1..N {
        for k in 0..i {
            let (by, own) = (lu[i][k], b[k]);
            (0..N).for_each(|j| b[i][j] -= by * own[j]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drystone::stages::random::SplitMix64;

    /// A grid of 4 x 3 nodes, entry by entry without an order, and the same matrix in dense form.
    fn matrix(stiffness: f64) -> (Factor<3>, Vec<Vec<f64>>) {
        let ties: Vec<[u32; 2]> = (0..12)
            .flat_map(|i| [(i % 4 < 3).then_some([i, i + 1]), (i < 8).then_some([i + 4, i])])
            .flatten()
            .collect();
        let mut random = SplitMix64::new(7);
        let mut number = || (random.bits() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        let mut factor = Factor::new(12, ties.iter().copied());
        factor.clear();
        let mut dense: Vec<Vec<f64>> =
            (0..36).map(|i| (0..36).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        for [a, b] in ties {
            for (row, column, sign) in [(a, a, 1.0), (a, b, -1.0), (b, a, -0.9), (b, b, 1.1)] {
                let block = factor.block_mut(row, column);
                for i in 0..3 {
                    for j in 0..3 {
                        let x = sign * stiffness * (f64::from(u8::from(i == j)) + 0.2 * number());
                        block[i][j] += x;
                        dense[3 * row as usize + i][3 * column as usize + j] += x;
                    }
                }
            }
        }
        (factor, dense)
    }

    #[test]
    fn the_factors_solve_an_unsymmetric_matrix() {
        for stiffness in [1.0, 1e8] {
            let (mut factor, dense) = matrix(stiffness);
            factor.factor().expect("it is regular");
            let right: Vec<[f64; 3]> = (0..12).map(|i| [1.0, f64::from(i), -0.5]).collect();
            let mut x = right.clone();
            factor.solve(&mut x);
            let (x, right) = (x.into_flattened(), right.into_flattened());
            for (row, right) in dense.iter().zip(right) {
                let sum: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
                assert!((sum - right).abs() < 1e-12, "{stiffness}: {sum}, not {right}");
            }
            assert!(x.iter().any(|x| x.abs() > 1e-12), "all zero");
        }
    }

    #[test]
    fn a_singular_matrix_has_no_factors() {
        let (mut factor, _) = matrix(1.0);
        *factor.block_mut(5, 5) = [[0.0; 3]; 3];
        for j in [1, 4, 6, 9] {
            *factor.block_mut(5, j) = [[0.0; 3]; 3];
        }
        assert!(factor.factor().is_none());
        let (mut factor, _) = matrix(f64::NAN);
        assert!(factor.factor().is_none());
    }
}
