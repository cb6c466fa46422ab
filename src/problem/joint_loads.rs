//! The load of each joint in a connected set of bodies.

use std::collections::BTreeMap;

use glam::Vec4;

/// A body on joints.
struct Node {
    joints: Vec<usize>,
    /// Number of joints on the way from the support, 0 until that is known.
    distance: u32,
    /// Its own load, and that of the bodies that it has passed on.
    load: Vec4,
}

/// The load of each joint: the sum of mass times position (kg m), and the mass (kg). Every body passes its own mass and
/// the load that hangs on it to the joints that lead toward a support, in equal parts. `sides` are the movable bodies
/// of each joint. A joint with one side is a support. If there is none, the heaviest body takes its place.
pub fn borne(sides: &[[Option<u32>; 2]], own: impl Fn(u32) -> Vec4) -> Vec<Vec4> {
    let mut nodes: BTreeMap<u32, Node> = BTreeMap::new();
    for (joint, both) in sides.iter().enumerate() {
        for &body in both.iter().flatten() {
            let node = nodes.entry(body);
            node.or_insert_with(|| Node { joints: Vec::new(), distance: 0, load: own(body) }).joints.push(joint);
        }
    }
    let is_support = |joint: usize| sides[joint].iter().flatten().count() == 1;
    let mut layer: Vec<u32> =
        nodes.iter().filter(|(_, node)| node.joints.iter().any(|&j| is_support(j))).map(|(&body, _)| body).collect();
    if layer.is_empty() {
        layer.extend(nodes.iter().max_by(|a, b| a.1.load.w.total_cmp(&b.1.load.w)).map(|(&body, _)| body));
    }
    let mut order = Vec::new();
    for distance in 1.. {
        layer.retain(|body| {
            let node = nodes.get_mut(body).expect("every body has a node");
            let is_new = node.distance == 0;
            node.distance = if is_new { distance } else { node.distance };
            is_new
        });
        if layer.is_empty() {
            break;
        }
        order.extend_from_slice(&layer);
        layer = layer.iter().flat_map(|body| &nodes[body].joints).flat_map(|&joint| sides[joint]).flatten().collect();
    }
    let mut borne = vec![Vec4::ZERO; sides.len()];
    for body in order.into_iter().rev() {
        let Node { joints, distance, load } = &nodes[&body];
        let other = |joint: usize| sides[joint].iter().flatten().copied().find(|&other| other != body);
        let above = |&joint: &usize| other(joint).map_or(0, |other| nodes[&other].distance) < *distance;
        let up: Vec<usize> = joints.iter().copied().filter(above).collect();
        let share = *load / up.len().max(1) as f32;
        for joint in up {
            borne[joint] = share;
            if let Some(node) = other(joint).and_then(|other| nodes.get_mut(&other)) {
                node.load += share;
            }
        }
    }
    borne
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_bears_what_hangs_on_it_and_a_loop_shares() {
        let tie = |a, b| [Some(a), Some(b)];
        let hung = |a| [Some(a), None];
        let own = |body: u32| Vec4::new(1.0, 0.0, 0.0, 1.0) * [1.0, 2.0, 4.0, 8.0][body as usize];
        let borne_masses = |sides: &[[Option<u32>; 2]]| -> Vec<f32> {
            let all = borne(sides, own);
            assert!(all.iter().all(|load| load.x == load.w));
            all.iter().map(|load| load.w).collect()
        };
        assert_eq!(borne_masses(&[hung(0), tie(0, 1), tie(1, 2)]), [7.0, 6.0, 4.0]);
        assert_eq!(borne_masses(&[tie(2, 1), hung(2), tie(0, 1)]), [3.0, 7.0, 1.0]);
        // A square hung at one corner: the far corner hangs on both others.
        assert_eq!(borne_masses(&[hung(0), tie(0, 1), tie(0, 2), tie(1, 3), tie(2, 3)]), [15.0, 6.0, 8.0, 4.0, 4.0]);
        // Without a support the heaviest holds the others.
        assert_eq!(borne_masses(&[tie(0, 1), tie(1, 3)]), [1.0, 3.0]);
    }
}
