//! Blocks in a grid: the mesh of their surface, and boxes that fill them.

use glam::{IVec3, Vec3};

use super::limits::{MAX_LENGTH, is_place};
use crate::error::{Result, ensure};

/// The number of a cell along each axis, or of a corner of cells.
type Cell = [i64; 3];

/// Cells of a grid that are solid.
pub(super) struct Voxels {
    /// Sides of a cell (m). The cell `c` begins at `c * size`.
    size: Vec3,
    /// Sorted, each once.
    solid: Vec<Cell>,
}

impl Voxels {
    pub fn new(size: Vec3, cells: &[IVec3]) -> Result<Self> {
        ensure(!cells.is_empty(), || "voxels: there are no cells".into())?;
        ensure(is_place(size) && size.min_element() > 0.0, || {
            format!("voxels of {size} m: must be more than 0 and at most {MAX_LENGTH:e} m")
        })?;
        Ok(Self { size, solid: sorted(cells.iter().map(|cell| cell.to_array().map(i64::from)).collect()) })
    }

    /// Vertices and triangles of the surface. Neighbors share the corners of their faces, so no body catches on the
    /// edges between them.
    pub fn surface(&self) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let mut faces = Vec::new();
        for &cell in &self.solid {
            for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
                let mut beside = cell;
                beside[axis] += 2 * side - 1;
                if self.solid.binary_search(&beside).is_ok() {
                    continue;
                }
                let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[along, across]| {
                    let mut corner = cell;
                    corner[axis] += side;
                    corner[(axis + 1) % 3] += along;
                    corner[(axis + 2) % 3] += across;
                    corner
                });
                faces.push((side, corners));
            }
        }
        let corners = sorted(faces.iter().flat_map(|(_, corners)| *corners).collect());
        let number = |corner: Cell| corners.partition_point(|other| *other < corner) as u32;
        let triangles = faces.iter().flat_map(|(side, corners)| {
            // Counter-clockwise seen from outside.
            let [a, b, c, d] = corners.map(number);
            if *side == 1 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] }
        });
        (corners.iter().map(|&corner| self.place(corner)).collect(), triangles.collect())
    }

    /// Half extents and centers of boxes that fill each cell once (m). Each box begins at the first cell that is left,
    /// and grows along Z, Y and X as far as cells are left.
    pub fn boxes(&self) -> Vec<(Vec3, Vec3)> {
        let mut is_left = vec![true; self.solid.len()];
        let mut boxes = Vec::new();
        for first in 0..self.solid.len() {
            if !is_left[first] {
                continue;
            }
            let begin = self.solid[first];
            let mut end = begin.map(|x| x + 1);
            for axis in [2, 1, 0] {
                let grows = |end: Cell| {
                    let mut layer = (begin, end);
                    (layer.0[axis], layer.1[axis]) = (end[axis], end[axis] + 1);
                    cells_of(layer).all(|cell| self.solid.binary_search(&cell).is_ok_and(|k| is_left[k]))
                };
                while grows(end) {
                    end[axis] += 1;
                }
            }
            let filled = cells_of((begin, end)).filter_map(|cell| self.solid.binary_search(&cell).ok());
            filled.for_each(|k| is_left[k] = false);
            let (least, most) = (self.place(begin), self.place(end));
            boxes.push((0.5 * (most - least), 0.5 * (most + least)));
        }
        boxes
    }

    fn place(&self, corner: Cell) -> Vec3 {
        Vec3::from_array(corner.map(|x| x as f32)) * self.size
    }
}

/// The cells in ascending order, each once.
fn sorted(mut cells: Vec<Cell>) -> Vec<Cell> {
    cells.sort_unstable();
    cells.dedup();
    cells
}

/// The cells from `begin` up to `end`, without `end`.
fn cells_of((begin, end): (Cell, Cell)) -> impl Iterator<Item = Cell> {
    let along = move |axis: usize| begin[axis]..end[axis];
    along(0).flat_map(move |x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    #[test]
    fn boxes_fill_each_cell_once() {
        let mut random = SplitMix64::new(7);
        for share in [0.2, 0.5, 0.9, 2.0] {
            let all = cells_of(([-3; 3], [4, 3, 5]));
            let cells: Vec<IVec3> = all
                .filter(|_| random.symmetric() * 0.5 + 0.5 < share)
                .map(|cell| IVec3::from_array(cell.map(|x| x as i32)))
                .collect();
            let voxels = Voxels::new(Vec3::new(0.5, 1.0, 0.25), &cells).expect("cells");
            let boxes = voxels.boxes();
            for &cell in &cells {
                let center = (cell.as_vec3() + 0.5) * voxels.size;
                let around = boxes.iter().filter(|(half, at)| (center - *at).abs().cmplt(*half).all());
                assert_eq!(around.count(), 1, "{cell} of {} boxes", boxes.len());
            }
            let volume: f32 = boxes.iter().map(|(half, _)| 8.0 * half.element_product()).sum();
            assert_eq!(volume, cells.len() as f32 * voxels.size.element_product());
            assert!(boxes.len() < cells.len() && (share < 1.0 || boxes.len() == 1), "{} boxes", boxes.len());
        }
    }
}
