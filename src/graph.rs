//! Graph coloring: assigns constraints to colors, so that within a color a sweep writes no body twice.
//!
//! It uses only integers. Only movable bodies count, so a floor costs no color. A constraint keeps its color from step
//! to step. A new constraint takes the first color that is free on both of its bodies (greedy, in the order of the
//! given ranks), and the place of an ended one becomes free. Constraints with one movable body have separate colors,
//! which are swept last: contacts with fixed bodies have the last word. A constraint that gets no color is swept alone,
//! and counted.

/// A body that no sweep writes.
pub const IMMOVABLE: u32 = u32::MAX;

/// One constraint between two bodies, with its color so far. Either body can be [`IMMOVABLE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// One body.
    pub a: u32,
    /// The other body.
    pub b: u32,
    /// Its color among those of its kind, or `None` if it is new or has no color.
    pub color: Option<u8>,
    /// New constraints choose colors in the order of their ranks, then of their indices.
    pub rank: u64,
}

crate::saved::fields!(Edge { a, b, color, rank });

impl Edge {
    fn is_fixed(&self) -> bool {
        self.a == IMMOVABLE || self.b == IMMOVABLE
    }
}

/// The active constraints, in the order of the sweep.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Coloring {
    /// Indices of the edges, color by color.
    pub order: Vec<u32>,
    /// The start of each color in `order`, and the end of the last: one entry more than there are colors.
    pub offsets: Vec<u32>,
    /// Number of edges without a color. Each one is a color of its own.
    pub overflow: u32,
}

crate::saved::state!(Coloring { order, offsets, overflow });

impl Coloring {
    /// Number of colors, including the single ones of the overflow.
    pub fn color_count(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }
}

/// The used colors of each body.
#[derive(Debug, Default)]
pub struct ConstraintGraph {
    /// One bit for each color and body: for constraints of two movable bodies, and for those with a fixed body.
    used: [Vec<u64>; 2],
}

crate::saved::cloned!(ConstraintGraph {} scratch { used });

impl ConstraintGraph {
    /// Assigns a color to every edge; see [`Self::color_members`].
    pub fn color(&mut self, body_count: usize, edges: &mut [Edge], max_colors: u32) -> Coloring {
        let members: Vec<u32> = (0..edges.len() as u32).collect();
        self.color_members(body_count, edges, &members, max_colors)
    }

    /// Assigns a color to each active edge, and lays the edges out for sweeping. `members` has their indices, and each
    /// kind has at most `max_colors` (1 to 64) colors. An inactive edge keeps the number of its color, but another edge
    /// can take its place.
    pub fn color_members(
        &mut self,
        body_count: usize,
        edges: &mut [Edge],
        members: &[u32],
        max_colors: u32,
    ) -> Coloring {
        let available = if max_colors >= 64 { u64::MAX } else { (1 << max_colors) - 1 };
        for used in &mut self.used {
            used.clear();
            used.resize(body_count, 0);
        }
        // Edges that already have a color take their place first.
        let mut new = Vec::new();
        for &i in members {
            let edge = &mut edges[i as usize];
            match edge.color {
                Some(color) if color < 64 && self.free(edge) & available & (1 << color) != 0 => self.take(edge, color),
                _ => {
                    edge.color = None;
                    new.push(i);
                }
            }
        }
        new.sort_unstable_by_key(|&i| (edges[i as usize].rank, i));
        for i in new {
            let edge = &mut edges[i as usize];
            let free = self.free(edge) & available;
            if free != 0 {
                let color = free.trailing_zeros() as u8;
                edge.color = Some(color);
                self.take(edge, color);
            }
        }
        lay_out(edges, members)
    }

    /// Colors that neither body uses.
    fn free(&self, edge: &Edge) -> u64 {
        let used = &self.used[usize::from(edge.is_fixed())];
        let of = |body: u32| if body == IMMOVABLE { 0 } else { used[body as usize] };
        !(of(edge.a) | of(edge.b))
    }

    fn take(&mut self, edge: &Edge, color: u8) {
        let used = &mut self.used[usize::from(edge.is_fixed())];
        for body in [edge.a, edge.b] {
            if body != IMMOVABLE {
                used[body as usize] |= 1 << color;
            }
        }
    }
}

/// Sets of connected bodies.
#[derive(Clone, Debug, Default)]
pub struct Islands {
    /// A body nearer to the root, or the root itself.
    toward_root: Vec<u32>,
}

impl Islands {
    /// Resets to `bodies` islands of one body each.
    pub fn reset(&mut self, bodies: usize) {
        self.toward_root.clear();
        self.toward_root.extend(0..bodies as u32);
    }

    /// Joins the islands of two bodies.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.toward_root[a.max(b) as usize] = a.min(b);
    }

    /// The root of each body, after all joins.
    pub fn roots(&mut self) -> &[u32] {
        // A body nearer to the root has a smaller index, so its root is already known.
        for i in 0..self.toward_root.len() {
            self.toward_root[i] = self.toward_root[self.toward_root[i] as usize];
        }
        &self.toward_root
    }

    /// The root of a body: the body of its island with the smallest index. Shortens the path to it.
    pub fn root(&mut self, body: u32) -> u32 {
        let (to, mut i) = (&mut self.toward_root, body as usize);
        while to[i] as usize != i {
            to[i] = to[to[i] as usize];
            i = to[i] as usize;
        }
        i as u32
    }
}

/// Sorts the members by color: movable ones, their overflow, those with fixed bodies, their overflow.
pub fn lay_out(edges: &[Edge], members: &[u32]) -> Coloring {
    // 64 colors and one bucket for the overflow, twice.
    let bucket = |i: u32| {
        let edge = &edges[i as usize];
        65 * usize::from(edge.is_fixed()) + edge.color.map_or(64, usize::from)
    };
    let mut begins = [0_u32; 131];
    for &i in members {
        begins[bucket(i) + 1] += 1;
    }
    for i in 0..130 {
        begins[i + 1] += begins[i];
    }
    let mut offsets = Vec::new();
    let mut overflow = 0;
    for i in 0..130 {
        if begins[i] == begins[i + 1] {
            continue;
        }
        if i % 65 == 64 {
            overflow += begins[i + 1] - begins[i];
            offsets.extend(begins[i]..begins[i + 1]);
        } else {
            offsets.push(begins[i]);
        }
    }
    offsets.push(members.len() as u32);
    let mut order = vec![0; members.len()];
    let mut next = begins;
    for &i in members {
        let place = &mut next[bucket(i)];
        order[*place as usize] = i;
        *place += 1;
    }
    Coloring { order, offsets, overflow }
}
