//! In which order a sweep goes over the contacts of a problem.

use std::collections::BTreeMap;

use crate::contacts::ContactProblem;
use crate::graph::{ConstraintGraph, Edge, IMMOVABLE};

/// In which order a sweep goes over contacts. It is a part of the method: another order takes other numbers of sweeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Every contact by itself: in the order of the file each takes the first color that is free on both of its bodies.
    Contacts,
    /// All contacts of the same two bodies one after another, as in a step: manifolds are colored, those with something
    /// fixed come last.
    #[default]
    Manifolds,
}

/// Contacts in the order of a sweep.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sequence {
    /// Indices of the contacts.
    pub contacts: Vec<u32>,
    /// Colors that they form.
    pub colors: usize,
}

impl Sequence {
    /// Of the contacts of a problem.
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
    Sequence { colors: colors.len(), contacts: colors.concat() }
}

fn by_manifold(problem: &ContactProblem) -> Sequence {
    let mut places = BTreeMap::new();
    let mut manifolds: Vec<Vec<u32>> = Vec::new();
    let mut edges = Vec::new();
    for (i, contact) in (0..).zip(&problem.contacts) {
        let [a, b] = [contact.a, contact.b].map(|body| body.unwrap_or(IMMOVABLE));
        let place = *places.entry([a.min(b), a.max(b)]).or_insert(manifolds.len());
        if place == manifolds.len() {
            manifolds.push(Vec::new());
            edges.push(Edge { a, b, color: None });
        }
        manifolds[place].push(i);
    }
    let coloring = ConstraintGraph::default().color(problem.bodies.len(), &mut edges, 64);
    let contacts = coloring.order.iter().flat_map(|&m| &manifolds[m as usize]).copied().collect();
    Sequence { contacts, colors: coloring.color_count() }
}
