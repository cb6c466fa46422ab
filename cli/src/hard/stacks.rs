//! Structures that should stand.

use super::{Checks, DT, Limit, Setup};
use drystone::config::Method;
use drystone::load::Load;
use drystone::stats::largest;
use drystone::{Body, Result, Shape, SolvedManifold, World};
use drystone_problems::residuals::Measure;
use drystone_problems::solver::{Order, Solver};
use drystone_scenes::Scene;

/// Number of sweeps over the first step; a power of two.
const SWEEPS: u32 = 4096;
/// Number of steps in ten seconds.
const TEN: u32 = 600;

pub(super) fn light_under_heavy(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for ratio in [10.0, 100.0, 1e3, 1e4, 1e5, 1e6_f64] {
        let world = Scene::find_spec(&format!("tower:n=2,top_ratio={ratio}"))?.world;
        let load = Load::heaviest(&world, &setup.config).expect("a load");
        let law = load.overlap(setup.config.substeps, DT, &setup.config);
        let outcome = setup.outcome(world, TEN)?;
        checks.stands(&outcome, format!("1 under {ratio}"));
        checks.at_most(format!("1 under {ratio}: overlap at rest over the static law"), outcome.at_rest / law, 1.2);
        if ratio == 1e3 {
            checks.at_most("1 under 1000: overlap at rest [mm]", 1e3 * outcome.at_rest, 5.0);
        }
    }
    Ok(())
}

pub(super) fn towers(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for n in [20, 40] {
        let outcome = setup.run(&format!("tower:n={n},offset=0.01"), TEN)?;
        checks.stands(&outcome, format!("{n} cubes"));
        checks.at_most(format!("{n} cubes: drift [m]"), outcome.drift, 0.1);
        checks.at_most(format!("{n} cubes: final rms speed [m/s]"), outcome.rms, 0.05);
    }
    Ok(())
}

pub(super) fn heavy_tops(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for (n, top) in [(20, 100), (10, 1000), (20, 1000)] {
        let outcome = setup.run(&format!("tower:n={n},top_ratio={top},offset=0.01"), TEN)?;
        checks.stands(&outcome, format!("{n} cubes, top {top} times"));
    }
    let alternating = setup.run("mass-ratio:n=10,ratio=1000", TEN)?;
    checks.stands(&alternating, "10 cubes, 1 and 1000 in turn");
    checks.at_most("10 cubes, 1 and 1000 in turn: final rms speed [m/s]", alternating.rms, 0.05);
    Ok(())
}

pub(super) fn redundancy(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for side in [1, 2, 4] {
        let mut simulation = setup.simulation(cube_on_pads(side))?;
        (0..300).try_for_each(|_| simulation.step(DT).map(drop))?;
        let (points, asymmetry) = asymmetry(simulation.manifolds(), side);
        checks.at_most(format!("{points} points: asymmetry of the forces"), asymmetry, 0.05);
    }
    let planks = Scene::find_spec("kapla:storeys=9")?.world;
    let worlds = [("64 points".to_owned(), cube_on_pads(4)), (format!("{} planks", planks.dynamic_count()), planks)];
    for (what, world) in worlds {
        let (growth, left) = convergence(setup, world)?;
        checks.at_most(format!("{what}: largest growth of e_vel as sweeps double"), growth, 1.0);
        checks.at_most(format!("{what}: e_vel after {SWEEPS} sweeps"), left, 1e-3);
    }
    Ok(())
}

/// A cube of 2 m on `side` x `side` fixed pads of 0.2 m.
fn cube_on_pads(side: usize) -> World {
    let mut world = World::new();
    let step = 1.8 / side.max(2) as f32;
    for i in 0..side * side {
        let at = |k: usize| (k as f32 - (side as f32 - 1.0) / 2.0) * step;
        world.insert(Body::fixed().shape(Shape::cuboid(0.1, 0.1, 0.1)).position(at(i % side), -0.1, at(i / side)));
    }
    world.insert(Body::dynamic().shape(Shape::cuboid(1.0, 1.0, 1.0)).position(0.0, 1.0, 0.0));
    world
}

/// The number of contact points, and the largest relative difference between the force on a pad and the mean over its
/// mirror images.
fn asymmetry(manifolds: impl Iterator<Item = SolvedManifold> + Clone, side: usize) -> (usize, f64) {
    let force = |m: &SolvedManifold| m.points().iter().map(|p| f64::from(p.normal_impulse)).sum::<f64>();
    let points = manifolds.clone().map(|m| m.points().len()).sum();
    // The pads are the first bodies, row by row.
    let mut forces = vec![f64::NAN; side * side];
    manifolds.for_each(|m| forces[m.a.body.index().min(m.b.body.index())] = force(&m));
    let image = |i: usize| {
        let fold = |k: usize| k.min(side - 1 - k);
        let (x, z) = (fold(i % side), fold(i / side));
        (x.min(z), x.max(z))
    };
    let worst = (0..side * side).map(|i| {
        let images: Vec<f64> = (0..side * side).filter(|&j| image(j) == image(i)).map(|j| forces[j]).collect();
        let mean = images.iter().sum::<f64>() / images.len() as f64;
        (forces[i] / mean - 1.0).abs()
    });
    (points, largest(0.0, worst))
}

/// The largest growth of e_vel when the number of plain f64 sweeps over the first step doubles, and the last e_vel.
fn convergence(setup: &Setup, world: World) -> Result<(f64, f64)> {
    let problem = drystone_problems::step_with_contacts(&mut setup.simulation(world)?, "first step", DT)?.0;
    let mut solver = Solver::new(&problem, Method::Plain, Order::Manifolds, None)?;
    let measure = Measure::new(&problem);
    let mut error = |sweeps: u32| -> Result<f64> {
        solver.advance(sweeps)?;
        Ok(measure.of(&solver.impulses(), &solver.velocities()).e_vel)
    };
    let (mut growth, mut before) = (0.0_f64, error(1)?);
    for power in 0..SWEEPS.ilog2() {
        let e = error(1 << power)?;
        // Smaller errors are rounding.
        growth = largest(growth, [if e < 1e-12 { 0.0 } else { e / before }]);
        before = e;
    }
    Ok((growth, before))
}

pub(super) fn cards(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let outcome = setup.run("card-house:storeys=5,length=0.4,thickness=0.002", TEN)?;
    checks.stands(&outcome, "34 cards");
    checks.at_most("34 cards: deepest overlap [mm]", 1e3 * outcome.deepest, 1.0);
    Ok(())
}

pub(super) fn kapla(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let outcome = setup.run("kapla", 3600)?;
    checks.stands(&outcome, "105 planks");
    checks.at_most("105 planks: drift [m]", outcome.drift, 0.1);
    Ok(())
}

pub(super) fn arches(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let thin = setup.run("arch:voussoirs=31,thickness=0.095", TEN)?;
    checks.stands(&setup.run("arch:voussoirs=31,thickness=0.12", TEN)?, "0.12 of the radius");
    checks.add("0.095 of the radius: stones out of place".into(), thin.fallen, Limit::AtLeast(1.0));
    Ok(())
}

pub(super) fn aqueduct(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let outcome = setup.run("aqueduct:arches=8", TEN)?;
    checks.stands(&outcome, "stones");
    checks.at_most("stones: final rms speed [m/s]", outcome.rms, 1e-3);
    Ok(())
}

pub(super) fn large_pyramid(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let outcome = setup.run("pyramid:base=100", 10_000)?;
    checks.stands(&outcome, "boxes");
    checks.at_most("boxes: drift [m]", outcome.drift, 0.1);
    checks.at_most("boxes: final rms speed [m/s]", outcome.rms, 0.05);
    checks.at_most("boxes: final overlap [mm]", 1e3 * outcome.at_rest, 5.0);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_eccentric_load_has_asymmetric_forces() {
        let mut world = cube_on_pads(2);
        let lopsided = world.bodies[4].clone().position(0.2, 1.0, 0.0);
        let measure = |world: World| {
            let open = || Ok(Box::new(drystone::Cpu::new()) as Box<dyn drystone::Backend>);
            let setup = Setup { config: drystone::SolverConfig::default(), open: &open };
            let mut simulation = setup.simulation(world).expect("a simulation");
            for _ in 0..60 {
                simulation.step(DT).expect("a step");
            }
            asymmetry(simulation.manifolds(), 2)
        };
        let (points, even) = measure(world.clone());
        assert!(points == 16 && even < 0.05, "{points} points, {even}");
        world.bodies[4] = lopsided;
        assert!(measure(world).1 > 0.1);
        assert!(asymmetry([].into_iter(), 1).1.is_nan());
    }
}
