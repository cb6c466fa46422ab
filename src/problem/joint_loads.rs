//! The load of each joint in a connected set of bodies.

use std::collections::BTreeMap;

use glam::Vec4;

/// The load of each joint: the sum of mass times position (kg m), and the mass (kg). Every body passes its own mass and
/// the load that hangs on it to the joints that lead toward a support, in equal parts. `sides` are the movable bodies
/// of each joint. A joint with one side is a support. If there is none, the heaviest body takes its place.
pub fn borne(sides: &[[Option<u32>; 2]], own: impl Fn(u32) -> Vec4) -> Vec<Vec4> {
    let mut of_body: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (joint, own) in sides.iter().enumerate() {
        own.iter().flatten().for_each(|&body| of_body.entry(body).or_default().push(joint));
    }
    let is_support = |joint: usize| sides[joint].iter().flatten().count() == 1;
    let mut layer: Vec<u32> =
        of_body.iter().filter(|(_, own)| own.iter().any(|&j| is_support(j))).map(|(&body, _)| body).collect();
    if layer.is_empty() {
        layer.extend(of_body.keys().copied().max_by(|&a, &b| own(a).w.total_cmp(&own(b).w)));
    }
    let mut distances: BTreeMap<u32, u32> = layer.iter().map(|&body| (body, 1)).collect();
    let mut order = Vec::new();
    for distance in 2.. {
        if layer.is_empty() {
            break;
        }
        order.extend_from_slice(&layer);
        let around = std::mem::take(&mut layer).into_iter().flat_map(|body| of_body[&body].clone());
        for body in around.flat_map(|joint| sides[joint]).flatten() {
            if let std::collections::btree_map::Entry::Vacant(entry) = distances.entry(body) {
                entry.insert(distance);
                layer.push(body);
            }
        }
    }
    let mut borne = vec![Vec4::ZERO; sides.len()];
    let mut load: BTreeMap<u32, Vec4> = of_body.keys().map(|&body| (body, own(body))).collect();
    for body in order.into_iter().rev() {
        let distance = distances[&body];
        let above = |&joint: &usize| {
            sides[joint].iter().flatten().find(|&&other| other != body).map_or(0, |other| distances[other]) < distance
        };
        let up: Vec<usize> = of_body[&body].iter().copied().filter(above).collect();
        let share = load[&body] / up.len().max(1) as f32;
        for joint in up {
            borne[joint] = share;
            if let Some(other) = sides[joint].iter().flatten().find(|&&other| other != body) {
                *load.get_mut(other).expect("every body has a load") += share;
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
