//! The elimination order of the blocks of a sparse matrix.

use std::collections::BTreeSet;

/// The minimum-degree order. Returns the place of each node, and for each place its later neighbors, including fill.
pub(super) fn eliminate(nodes: usize, ties: impl IntoIterator<Item = [u32; 2]>) -> (Vec<u32>, Vec<Vec<u32>>) {
    let mut near: Vec<Vec<u32>> = vec![Vec::new(); nodes];
    for [a, b] in ties {
        near[a as usize].push(b);
        near[b as usize].push(a);
    }
    for (node, near) in near.iter_mut().enumerate() {
        near.sort_unstable();
        near.dedup();
        near.retain(|&other| other as usize != node);
    }
    // Nodes by degree, then by index: the order is the same on every machine.
    let mut queue: BTreeSet<(usize, u32)> = (0..nodes).map(|i| (near[i].len(), i as u32)).collect();
    let (mut place, mut below, mut order) = (vec![0; nodes], Vec::with_capacity(nodes), Vec::with_capacity(nodes));
    while let Some((_, node)) = queue.pop_first() {
        let own = std::mem::take(&mut near[node as usize]);
        place[node as usize] = order.len() as u32;
        order.push(node);
        for &other in &own {
            let old = &near[other as usize];
            let joined = union(old, &own, [node, other]);
            queue.remove(&(old.len(), other));
            queue.insert((joined.len(), other));
            near[other as usize] = joined;
        }
        below.push(own);
    }
    for rows in &mut below {
        rows.iter_mut().for_each(|node| *node = place[*node as usize]);
        rows.sort_unstable();
    }
    (place, below)
}

/// The union of two ascending lists, without two nodes.
fn union(a: &[u32], b: &[u32], without: [u32; 2]) -> Vec<u32> {
    let mut all = Vec::with_capacity(a.len() + b.len());
    let (mut a, mut b) = (a.iter().copied().peekable(), b.iter().copied().peekable());
    loop {
        let next = match (a.peek(), b.peek()) {
            (Some(x), Some(y)) if x == y => {
                b.next();
                a.next()
            }
            (Some(x), Some(y)) if x > y => b.next(),
            (Some(_), _) => a.next(),
            (None, _) => b.next(),
        };
        match next {
            Some(node) if !without.contains(&node) => all.push(node),
            Some(_) => {}
            None => return all,
        }
    }
}
