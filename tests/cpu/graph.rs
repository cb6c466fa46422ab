//! Graph coloring: what every coloring must keep to, over random graphs.

use drystone::stages::graph::{Coloring, ConstraintGraph, Edge, IMMOVABLE};
use proptest::prelude::*;

/// A mistake in the coloring of `edges`, if there is one.
fn fault(edges: &[Edge], coloring: &Coloring) -> Option<String> {
    let mut seen = coloring.order.clone();
    seen.sort_unstable();
    if seen != Vec::from_iter(0..edges.len() as u32) {
        return Some("the order is not one of all edges".into());
    }
    let ends = (coloring.offsets.first(), coloring.offsets.last());
    if ends != (Some(&0), Some(&(edges.len() as u32))) && !edges.is_empty() {
        return Some(format!("the colors go from {ends:?}"));
    }
    let mut alone = 0;
    for (color, window) in coloring.offsets.windows(2).enumerate() {
        if window[0] >= window[1] {
            return Some(format!("color {color} is empty"));
        }
        let members = coloring.order[window[0] as usize..window[1] as usize].iter().map(|&i| edges[i as usize]);
        let members: Vec<Edge> = members.collect();
        let kind = (members[0].color, is_fixed(&members[0]));
        if members.iter().any(|e| (e.color, is_fixed(e)) != kind) {
            return Some(format!("color {color} holds edges of several"));
        }
        if kind.0.is_none() && members.len() > 1 {
            return Some(format!("color {color} holds {} edges that found none", members.len()));
        }
        alone += u32::from(kind.0.is_none());
        let mut bodies: Vec<u32> = members.iter().flat_map(|e| [e.a, e.b]).filter(|&b| b != IMMOVABLE).collect();
        bodies.sort_unstable();
        if let Some(twice) = bodies.windows(2).find(|w| w[0] == w[1]) {
            return Some(format!("color {color} has body {} twice", twice[0]));
        }
    }
    (alone != coloring.overflow).then(|| format!("{alone} edges found no color, {} are counted", coloring.overflow))
}

fn is_fixed(edge: &Edge) -> bool {
    edge.a == IMMOVABLE || edge.b == IMMOVABLE
}

const BODIES: u32 = 40;

fn color(edges: &mut [Edge], max_colors: u32) -> Coloring {
    ConstraintGraph::default().color(BODIES as usize, edges, max_colors)
}

fn new_edge(a: u32, b: u32) -> Edge {
    Edge { a, b, color: None, rank: 0 }
}

/// Edges of which some have a body that cannot move.
fn some_edges(color: impl Strategy<Value = Option<u8>> + Clone + 'static) -> impl Strategy<Value = Vec<Edge>> {
    let body = prop_oneof![9 => 0..BODIES, 1 => Just(IMMOVABLE)];
    let edge = (0..BODIES, body, color).prop_filter_map("two bodies", |(a, b, color)| {
        if a == b {
            None
        } else {
            Some(if a % 2 == 0 { Edge { a, b, color, rank: 0 } } else { Edge { a: b, b: a, color, rank: 0 } })
        }
    });
    prop::collection::vec(edge, 0..200)
}

fn new_edges() -> impl Strategy<Value = Vec<Edge>> {
    some_edges(Just(None))
}

proptest! {
    #[test]
    fn no_body_is_twice_in_a_color_whatever_colors_the_edges_come_with(
        mut edges in some_edges(prop::option::of(0_u8..64)),
        max_colors in 1_u32..=64,
    ) {
        let coloring = color(&mut edges, max_colors);
        prop_assert_eq!(fault(&edges, &coloring), None);
        prop_assert!(edges.iter().all(|e| e.color.is_none_or(|c| u32::from(c) < max_colors)));
    }

    #[test]
    fn an_edge_keeps_its_color_when_others_begin(
        mut old in new_edges(), new in new_edges(), place in any::<prop::sample::Index>(), max_colors in 1_u32..=64,
    ) {
        color(&mut old, max_colors);
        let at = place.index(old.len() + 1);
        let mut all = [&old[..at], &new[..], &old[at..]].concat();
        let coloring = color(&mut all, max_colors);
        prop_assert_eq!(fault(&all, &coloring), None);
        for (before, after) in old.iter().zip(all[..at].iter().chain(&all[at + new.len()..])) {
            prop_assert!(before.color.is_none() || before == after, "{:?} became {:?}", before, after);
        }
    }

    #[test]
    fn an_edge_keeps_its_color_when_others_end(mut edges in new_edges(), kept in any::<u64>(), max_colors in 1_u32..=64) {
        color(&mut edges, max_colors);
        let mut left: Vec<_> = (0..).zip(edges).filter(|(i, _)| kept >> (i % 64) & 1 == 1).map(|(_, e)| e).collect();
        let before = left.clone();
        let coloring = color(&mut left, max_colors);
        prop_assert_eq!(fault(&left, &coloring), None);
        prop_assert!(before.iter().zip(&left).all(|(b, a)| b.color.is_none() || b == a));
    }

    #[test]
    fn the_same_edges_get_the_same_colors_from_a_fresh_graph_and_from_a_used_one(
        edges in new_edges(), mut others in new_edges(), max_colors in 1_u32..=64,
    ) {
        let (mut first, mut second) = (edges.clone(), edges);
        let mut used = ConstraintGraph::default();
        used.color(BODIES as usize, &mut others, 64);
        prop_assert_eq!(color(&mut first, max_colors), used.color(BODIES as usize, &mut second, max_colors));
        prop_assert_eq!(first, second);
    }

    #[test]
    fn what_stands_on_one_floor_shares_one_color(count in 1..BODIES, floor_first: bool) {
        let on_floor = |body| if floor_first { new_edge(IMMOVABLE, body) } else { new_edge(body, IMMOVABLE) };
        let mut edges: Vec<_> = (0..count).map(on_floor).collect();
        let coloring = color(&mut edges, 1);
        prop_assert_eq!((coloring.color_count(), coloring.overflow), (1, 0));
    }

    #[test]
    fn a_hub_overflows_by_the_spokes_beyond_the_colors(spokes in 1..BODIES, max_colors in 1_u32..=64) {
        let mut edges: Vec<_> = (1..=spokes).map(|body| new_edge(0, body)).collect();
        let coloring = color(&mut edges, max_colors);
        prop_assert_eq!(fault(&edges, &coloring), None);
        prop_assert_eq!(coloring.overflow, spokes.saturating_sub(max_colors));
        prop_assert_eq!(coloring.color_count(), edges.len());
    }

    #[test]
    fn an_ended_edge_gives_its_place_back(spokes in 2_u32..30, ended in any::<prop::sample::Index>()) {
        let mut edges: Vec<_> = (1..=spokes).map(|body| new_edge(0, body)).collect();
        prop_assert_eq!(color(&mut edges, spokes).overflow, 0);
        let place = ended.index(edges.len());
        let freed = edges[place].color;
        edges[place] = new_edge(0, spokes + 1);
        prop_assert_eq!(color(&mut edges, spokes).overflow, 0);
        prop_assert_eq!(edges[place].color, freed);
    }
}

#[test]
fn constraints_with_a_fixed_body_are_swept_last() {
    let mut edges = [new_edge(IMMOVABLE, 0), new_edge(0, 1), new_edge(2, IMMOVABLE), new_edge(1, 2)];
    let coloring = color(&mut edges, 64);
    assert_eq!(coloring.order, [1, 3, 0, 2]);
    assert_eq!(coloring.offsets, [0, 1, 2, 4]);
}

#[test]
fn new_edges_choose_in_the_order_of_their_ranks_and_have_places_in_their_own() {
    for (ranks, colors) in
        [([0, 1, 2], [0, 1, 0]), ([1, 0, 2], [1, 0, 1]), ([2, 2, 1], [0, 1, 0]), ([1, 3, 2], [0, 1, 0])]
    {
        let mut edges = [(0, 1), (1, 2), (2, 3)].map(|(a, b)| new_edge(a, b));
        edges.iter_mut().zip(ranks).for_each(|(edge, rank)| edge.rank = rank);
        let coloring = color(&mut edges, 64);
        assert_eq!(edges.map(|edge| edge.color), colors.map(Some), "ranks {ranks:?}");
        assert!(coloring.offsets.windows(2).all(|w| coloring.order[w[0] as usize..w[1] as usize].is_sorted()));
    }
}

#[test]
fn no_edges_make_no_colors() {
    let coloring = color(&mut [], 64);
    assert_eq!((coloring.color_count(), coloring.order.len(), coloring.overflow), (0, 0, 0));
}

/// The checker finds what it is there to find.
mod must_fail {
    use super::*;

    /// A chain: its edges take two colors in turn.
    fn chain() -> (Vec<Edge>, Coloring) {
        let mut edges: Vec<_> = (0..4).map(|body| new_edge(body, body + 1)).collect();
        let coloring = color(&mut edges, 64);
        assert_eq!((fault(&edges, &coloring), coloring.color_count()), (None, 2));
        (edges, coloring)
    }

    fn found(edges: &[Edge], coloring: &Coloring, part: &str) {
        let fault = fault(edges, coloring).expect("a fault");
        assert!(fault.contains(part), "{fault}");
    }

    #[test]
    fn two_edges_swapped_between_colors_are_found() {
        let (mut edges, mut coloring) = chain();
        coloring.order.swap(0, 2);
        found(&edges, &coloring, "holds edges of several");
        // Also where the edges claim to belong there.
        let (one, other) = (coloring.order[0] as usize, coloring.order[2] as usize);
        (edges[one].color, edges[other].color) = (edges[other].color, edges[one].color);
        found(&edges, &coloring, "twice");
    }

    #[test]
    fn an_edge_that_is_missing_or_twice_is_found() {
        let (edges, mut coloring) = chain();
        coloring.order[0] = coloring.order[1];
        found(&edges, &coloring, "not one of all edges");
    }

    #[test]
    fn an_overflow_that_is_not_counted_is_found() {
        let mut edges = [new_edge(0, 1), new_edge(0, 2)];
        let mut coloring = color(&mut edges, 1);
        assert_eq!((fault(&edges, &coloring), coloring.overflow), (None, 1));
        coloring.overflow = 0;
        found(&edges, &coloring, "are counted");
    }

    #[test]
    fn edges_without_a_color_that_are_swept_together_are_found() {
        let mut edges = [new_edge(0, 1), new_edge(0, 2), new_edge(0, 3)];
        let mut coloring = color(&mut edges, 1);
        coloring.offsets.remove(2);
        found(&edges, &coloring, "that found none");
    }
}
