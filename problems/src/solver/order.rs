//! The order in which a sweep visits the contacts of a problem.

use std::collections::BTreeMap;

use crate::contacts::{ContactProblem, PointContact};
use drystone::named;
use drystone::stages::graph::{ConstraintGraph, Edge, IMMOVABLE};

/// The order in which a sweep visits contacts. It is part of the method: another order needs another number of sweeps.
///
/// ```
/// # use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
/// # use drystone_problems::ContactProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let free = Velocity { linear: DVec3::new(1.0, -3.0, 0.0), angular: DVec3::ZERO };
/// # let ball = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// # let frame = [DVec3::Y, DVec3::Z, DVec3::X];
/// # let (offset, r_a, r_b) = (DVec3::ZERO, DVec3::ZERO, DVec3::Y * -0.5);
/// # let contact = PointContact { a: None, b: Some(0), friction: 0.1, offset, frame, r_a, r_b };
/// # let problem = ContactProblem { name: "a ball".into(), bodies: vec![ball], contacts: vec![contact] };
/// use drystone_problems::solver::{Order, Sequence};
///
/// assert_eq!([Order::Contacts, Order::Manifolds].map(Order::passes), [1, 2]);
/// assert_eq!(Sequence::new(Order::Contacts, &problem).manifolds, [[0]]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Order {
    /// Every contact by itself. In file order, each contact takes the first color that is free on both of its bodies.
    Contacts,
    /// Contacts of the same two bodies with the same frame form a manifold of up to four, as in a step. Manifolds are
    /// colored, and those with a fixed body come last.
    #[default]
    Manifolds,
}

named!(Order { Contacts = "contacts", Manifolds = "manifolds", });

impl Order {
    /// Number of passes over a manifold before the next one: two, because its points are strongly coupled (numbers in
    /// docs/convergence.md). Single contacts get one pass.
    pub fn passes(self) -> u8 {
        match self {
            Self::Contacts => 1,
            Self::Manifolds => 2,
        }
    }
}

/// Contacts in the order of a sweep.
///
/// ```
/// # use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
/// # use drystone_problems::ContactProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let free = Velocity { linear: DVec3::new(1.0, -3.0, 0.0), angular: DVec3::ZERO };
/// # let ball = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// # let frame = [DVec3::Y, DVec3::Z, DVec3::X];
/// # let (offset, r_a, r_b) = (DVec3::ZERO, DVec3::ZERO, DVec3::Y * -0.5);
/// # let contact = PointContact { a: None, b: Some(0), friction: 0.1, offset, frame, r_a, r_b };
/// # let problem = ContactProblem { name: "a ball".into(), bodies: vec![ball], contacts: vec![contact] };
/// use drystone_problems::solver::{Order, Sequence};
///
/// let Sequence { manifolds, offsets } = Sequence::new(Order::Manifolds, &problem);
/// assert_eq!((manifolds, offsets), (vec![vec![0]], vec![0, 1]));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sequence {
    /// Indices of the contacts of each manifold, 1 to 4, color by color.
    pub manifolds: Vec<Vec<u32>>,
    /// The index of the first manifold of each color, and the end of the last color.
    pub offsets: Vec<u32>,
}

impl Sequence {
    /// The sequence of the contacts of a problem.
    pub fn new(order: Order, problem: &ContactProblem) -> Self {
        match order {
            Order::Contacts => by_contact(problem),
            Order::Manifolds => by_manifold(problem),
        }
    }
}

fn by_contact(problem: &ContactProblem) -> Sequence {
    let mut used: Vec<Vec<bool>> = vec![Vec::new(); problem.bodies.len()];
    let mut colors: Vec<Vec<u32>> = Vec::new();
    for (i, contact) in (0..).zip(&problem.contacts) {
        let bodies = || [contact.a, contact.b].into_iter().flatten().map(|b| b as usize);
        let is_used = |color: usize| bodies().any(|b| used[b].get(color) == Some(&true));
        let color = (0..colors.len()).find(|&color| !is_used(color)).unwrap_or(colors.len());
        if color == colors.len() {
            colors.push(Vec::new());
        }
        colors[color].push(i);
        for body in bodies() {
            let length = used[body].len().max(color + 1);
            used[body].resize(length, false);
            used[body][color] = true;
        }
    }
    let mut offsets = vec![0];
    for color in &colors {
        offsets.push(offsets[offsets.len() - 1] + color.len() as u32);
    }
    Sequence { manifolds: colors.into_iter().flatten().map(|i| vec![i]).collect(), offsets }
}

fn by_manifold(problem: &ContactProblem) -> Sequence {
    let mut open: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    let mut manifolds: Vec<Vec<u32>> = Vec::new();
    let mut edges = Vec::new();
    for (i, contact) in (0..).zip(&problem.contacts) {
        let [a, b] = [contact.a, contact.b].map(|body| body.unwrap_or(IMMOVABLE));
        let of_pair = open.entry([a, b]).or_default();
        let fits = |&&m: &&usize| {
            let first = &problem.contacts[manifolds[m][0] as usize];
            manifolds[m].len() < 4 && is_same_surface(first, contact)
        };
        if let Some(&place) = of_pair.iter().find(fits) {
            manifolds[place].push(i);
        } else {
            of_pair.push(manifolds.len());
            manifolds.push(vec![i]);
            edges.push(Edge { a, b, color: None, rank: 0 });
        }
    }
    let coloring = ConstraintGraph::default().color(problem.bodies.len(), &mut edges, 64);
    let manifolds = coloring.order.iter().map(|&m| std::mem::take(&mut manifolds[m as usize])).collect();
    Sequence { manifolds, offsets: coloring.offsets }
}

/// Whether two contacts of a pair can be points of one manifold.
fn is_same_surface(a: &PointContact, b: &PointContact) -> bool {
    let apart = |k: usize| a.frame[k].distance(b.frame[k]);
    a.friction == b.friction && apart(0) <= SAME_FRAME && apart(1) <= SAME_FRAME
}

/// Frames with a smaller difference count as equal: the difference is rounding.
const SAME_FRAME: f64 = 1e-12;
