//! The same scene gives the same bits, for any number of threads; a settled one computes hardly any contact anew.

use crate::common::state::reference;
use std::collections::HashMap;

use drystone::config::FrictionAt;
use drystone::stages::problem::{EffectiveMass, InverseMass};
use drystone::{Backend, Cpu, Simulation, SolverConfig, StepStats, World};
use drystone_scenes::Scene;

/// FNV-1a over every bit of every pose and velocity.
fn hash(world: &World) -> u64 {
    let numbers = world.bodies.iter().flat_map(|b| {
        let vectors = [b.position, b.linear_velocity, b.angular_velocity].map(|v| v.to_array());
        b.rotation.to_array().into_iter().chain(vectors.into_iter().flatten())
    });
    numbers.fold(0xcbf2_9ce4_8422_2325, |h, x| (h ^ u64::from(x.to_bits())).wrapping_mul(0x100_0000_01b3))
}

fn cpu() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

/// A pile of 300 boxes after `steps` steps, run with `threads` threads; impact comes within the first 30.
fn pile(backend: fn() -> Box<dyn Backend>, seed: u32, steps: u32, threads: usize) -> (World, StepStats) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(|| {
        let scene = Scene::find("pile", &["n=300".into(), format!("seed={seed}")]).expect("the scene");
        let mut simulation =
            Simulation::with(scene.world, SolverConfig::default().without_sleep(), backend()).expect("good settings");
        let mut stats = StepStats::default();
        for _ in 0..steps {
            stats = simulation.step(scene.dt).expect("a step");
        }
        (simulation.world, stats)
    })
}

#[test]
fn the_same_run_gives_the_same_bits_and_another_seed_gives_others() {
    for backend in [reference, cpu] {
        let (world, stats) = pile(backend, 1, 90, 2);
        assert!(stats.manifolds > 300, "the boxes have not met: {} manifolds", stats.manifolds);
        assert_eq!(hash(&world), hash(&pile(backend, 1, 90, 2).0));
        assert_ne!(hash(&world), hash(&pile(backend, 2, 90, 2).0));
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let one = hash(&pile(reference, 1, 90, 1).0);
    for threads in [1, 2, 5] {
        assert_eq!(one, hash(&pile(reference, 1, 90, threads).0), "reference, {threads} threads");
        assert_eq!(one, hash(&pile(cpu, 1, 90, threads).0), "cpu, {threads} threads");
    }
}

/// Scenes whose shapes parry has to search: its search starts from what it is given, which is not to come from another pair.
#[test]
fn the_number_of_threads_changes_no_bit_of_any_shape() {
    for (name, parameter, steps) in [("arch", "voussoirs=201", 25), ("drop", "", 90), ("drum", "", 40)] {
        let hash_with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| {
                let parameters: Vec<String> =
                    Some(parameter).filter(|p| !p.is_empty()).map(Into::into).into_iter().collect();
                let scene = Scene::find(name, &parameters).expect("the scene");
                let mut simulation = Simulation::with(scene.world, SolverConfig::default().without_sleep(), cpu())
                    .expect("a simulation");
                let touched: usize = (0..steps).map(|_| simulation.step(scene.dt).expect("a step").computed).sum();
                assert!(touched > 0, "{name}: nothing touches");
                hash(&simulation.world)
            })
        };
        let one = hash_with(1);
        for threads in [2, 3, 7] {
            assert_eq!(one, hash_with(threads), "{name}, {threads} threads");
        }
    }
}

#[test]
fn the_hash_sees_the_last_bit_of_the_last_number() {
    let (world, _) = pile(reference, 1, 1, 1);
    let mut other = world.clone();
    let last = other.bodies.iter_mut().last().expect("a body");
    last.angular_velocity.z = f32::from_bits(last.angular_velocity.z.to_bits() ^ 1);
    assert_ne!(hash(&world), hash(&other));
}

/// Measured: none of some 1100 pairs after 10 s, all of them in the first step.
#[test]
fn a_settled_pile_reuses_its_contacts_and_a_new_one_computes_them() {
    let (_, first) = pile(cpu, 1, 1, 2);
    assert_eq!(first.computed, first.pairs);
    let (_, settled) = pile(cpu, 1, 600, 2);
    println!("{} of {} pairs computed", settled.computed, settled.pairs);
    assert!(settled.computed * 100 < settled.pairs, "{} of {} pairs computed", settled.computed, settled.pairs);
}

/// Reuse only saves work: a pile that computes every contact anew comes to rest at the same heights.
#[test]
fn reused_contacts_hold_as_well_as_new_ones() {
    let heights = |recycle_distance: f32| {
        let scene = Scene::find("tower", &["n=8".into()]).expect("the scene");
        let config = SolverConfig::default().without_sleep().with(|c| c.recycle_distance = recycle_distance);
        let mut simulation = Simulation::with(scene.world, config, cpu()).expect("good settings");
        let mut computed = 0;
        for _ in 0..300 {
            computed += simulation.step(scene.dt).expect("a step").computed;
        }
        let heights: Vec<f32> = simulation.world.bodies.iter().map(|b| b.position.y).collect();
        (heights, computed)
    };
    let ((reused, few), (anew, many)) = (heights(SolverConfig::default().recycle_distance), heights(0.0));
    let difference = reused.iter().zip(&anew).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    println!("{few} and {many} manifolds computed, heights {difference:.1e} m apart");
    assert!(10 * few < many, "{few} {many}");
    assert!(difference < 1e-5, "{difference}");
}

#[test]
fn a_reused_manifold_keeps_the_masses_that_its_arms_have() {
    let scene = Scene::find("pile", &["n=100".into()]).expect("the scene");
    let mut simulation =
        Simulation::with(scene.world, SolverConfig::default().without_sleep(), cpu()).expect("a simulation");
    let mut reused = 0;
    for _ in 0..80 {
        let stats = simulation.step(1.0 / 60.0).expect("a step");
        reused += stats.pairs - stats.computed;
        let problem = simulation.problem();
        for row in &problem.contacts {
            let inverse = [row.body_a, row.body_b].map(|b| InverseMass::of(&problem.masses[b as usize]));
            let effective = EffectiveMass { inverse: &inverse, row };
            for p in &problem.points[row.first_point as usize..][..row.point_count as usize] {
                let (r_a, r_b) = (p.r_a.into(), p.r_b.into());
                assert_eq!([p.normal_mass, p.tangent_mass], [effective.normal(r_a, r_b), effective.tangent(r_a, r_b)]);
            }
        }
    }
    assert!(reused > 1000, "{reused}");
}

/// The bodies of a contact and the arms of its points, to the bit: what tells it from every other.
type Contact = (u32, u32, Vec<[u32; 6]>);

fn arms(r_a: [f32; 3], r_b: [f32; 3]) -> [u32; 6] {
    let [[a, b, c], [d, e, f]] = [r_a, r_b].map(|r| r.map(f32::to_bits));
    [a, b, c, d, e, f]
}

/// Separation of the surfaces, preload and normal impulse of each point of every row.
fn rows(problem: &drystone::stages::problem::StepProblem) -> HashMap<Contact, Vec<[f32; 3]>> {
    let of = |row: &drystone::stages::problem::ContactRow| {
        let own = row.first_point as usize..(row.first_point + row.point_count) as usize;
        let points = &problem.points[own.clone()];
        let values =
            points.iter().zip(&problem.impulses[own]).map(|(p, i)| [p.separation, row.preload, i.normal]).collect();
        ((row.body_a, row.body_b, points.iter().map(|p| arms(p.r_a, p.r_b)).collect()), values)
    };
    problem.swept_contacts().map(of).collect()
}

/// Contacts begin and end, and a reused contact has to keep its impulses.
#[test]
fn what_a_reused_contact_carries_stays_with_it() {
    for friction_at in [FrictionAt::Points, FrictionAt::Manifold] {
        let scene = Scene::find("pile", &["n=100".into()]).expect("the scene");
        let config = SolverConfig::default().without_sleep().with(|c| c.friction_at = friction_at);
        let mut simulation = Simulation::with(scene.world, config, cpu()).expect("a simulation");
        let (mut carried, mut ended) = (0, 0);
        for step in 0..100 {
            simulation.step(scene.dt).expect("a step");
            let solved = rows(simulation.problem());
            // The manifolds have what their rows have.
            let read: HashMap<Contact, Vec<[f32; 3]>> = (simulation.manifolds())
                .map(|m| {
                    let key = m.points().iter().map(|p| arms(p.r_a.into(), p.r_b.into())).collect();
                    let values = m.points().iter().map(|p| [p.separation, m.preload, p.normal_impulse]).collect();
                    ((m.a.body.index() as u32, m.b.body.index() as u32, key), values)
                })
                .collect();
            assert_eq!(solved, read, "step {step}");
            // And the rows of the next step begin with the impulses that those of this one ended with.
            let next = rows(&simulation.next_problem(scene.dt).expect("a step").0);
            for (contact, points) in &solved {
                match next.get(contact) {
                    Some(now) => {
                        carried += 1;
                        assert!(points.iter().zip(now).all(|(p, n)| p[2] == n[2]), "step {step}: {points:?} {now:?}");
                    }
                    None => ended += 1,
                }
            }
        }
        println!("{carried} carried, {ended} ended");
        assert!(carried > 1000 && ended > 1000, "{carried} {ended}");
    }
}
