//! Graph coloring: constraints are put into colors in which no body that a sweep writes occurs twice.
//!
//! Integers only. Only bodies that can move count, so a floor costs no color. A constraint keeps its color from step to
//! step; a new one takes the first that is free on both of its bodies (greedy, in the order of the ranks given), and the place of an
//! ended one is free again. Constraints with one movable body have colors of their own, swept last: what rests on
//! something fixed has the last word. A constraint that finds no color is swept alone, and counted.

/// A body that no sweep writes.
pub const IMMOVABLE: u32 = u32::MAX;

/// One constraint between two bodies, either of which may be [`IMMOVABLE`], with the color it has so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// One body.
    pub a: u32,
    /// The other body.
    pub b: u32,
    /// Its color among those of its kind; none if it is new, or found none.
    pub color: Option<u8>,
    /// New ones choose in the order of their ranks, then of their indices.
    pub rank: u64,
}

crate::saved::fields!(Edge { a, b, color, rank });

impl Edge {
    fn is_fixed(&self) -> bool {
        self.a == IMMOVABLE || self.b == IMMOVABLE
    }
}

/// The constraints that take part, in the order in which they are swept.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Coloring {
    /// Indices of the edges, color by color.
    pub order: Vec<u32>,
    /// Where each color begins in `order`, and where the last ends: one more than there are colors.
    pub offsets: Vec<u32>,
    /// Edges that found no color; each stands as a color of its own.
    pub overflow: u32,
}

crate::saved::state!(Coloring { order, offsets, overflow });

impl Coloring {
    /// Number of colors, the single ones of the overflow included.
    pub fn color_count(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }
}

/// Which colors each body is in.
#[derive(Debug, Default)]
pub struct ConstraintGraph {
    /// One bit a color and body, for constraints of two movable bodies and for those with a fixed one.
    used: [Vec<u64>; 2],
}

crate::saved::cloned!(ConstraintGraph {} scratch { used });

impl ConstraintGraph {
    /// Gives every edge a color; see [`Self::color_members`].
    pub fn color(&mut self, body_count: usize, edges: &mut [Edge], max_colors: u32) -> Coloring {
        let members: Vec<u32> = (0..edges.len() as u32).collect();
        self.color_members(body_count, edges, &members, max_colors)
    }

    /// Gives the edges that take part, `members` by their indices, a color each among at most `max_colors` (1 to 64) a kind, and lays
    /// them out for sweeping. An edge that takes no part keeps the number of its color, but another edge may take the place.
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
        // Edges that have a color keep it, and so take their place first.
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

    /// Colors in which neither body is.
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

/// Bodies that are connected, however far.
#[derive(Clone, Debug, Default)]
pub struct Islands {
    /// A body nearer to the root, or the root itself.
    toward_root: Vec<u32>,
}

impl Islands {
    /// So many bodies, each alone.
    pub fn reset(&mut self, bodies: usize) {
        self.toward_root.clear();
        self.toward_root.extend(0..bodies as u32);
    }

    /// Makes one island of two.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.toward_root[a.max(b) as usize] = a.min(b);
    }

    /// The root of each body, after all joins.
    pub fn roots(&mut self) -> &[u32] {
        // A body nearer to the root has a smaller index, and so knows its root already.
        for i in 0..self.toward_root.len() {
            self.toward_root[i] = self.toward_root[self.toward_root[i] as usize];
        }
        &self.toward_root
    }

    /// The body of the island with the smallest index; shortens the way there.
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
