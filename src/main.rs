use drystone::*;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let mut config = SolverConfig::default();
    for s in std::env::args().skip(2) {
        config.set(&s).unwrap();
    }
    // temporary: peers txt
    let mut world = World::new();
    for line in std::fs::read_to_string(&path).unwrap().lines() {
        let t: Vec<&str> = line.split_whitespace().collect();
        if t.first() != Some(&"body") {
            continue;
        }
        let n: Vec<f32> = t[3..].iter().map(|x| x.parse().unwrap()).collect();
        let b = if t[2] == "static" { Body::fixed() } else { Body::dynamic() };
        world.add(
            b.shape(Shape::cuboid(n[0], n[1], n[2]))
                .density(n[3])
                .position(n[4], n[5], n[6])
                .rotation(glam::Quat::from_xyzw(n[7], n[8], n[9], n[10])),
        );
    }
    let start = world.clone();
    let mut sim = Simulation::new(world, config, Box::new(Reference::<f32>::new())).unwrap();
    let mut total = stats::StageTimes::default(); let mut comp = 0;
    for step in 1..=600 {
        let s = sim.step(1.0 / 60.0).unwrap();
        comp += s.computed; total.detect += s.times.detect;
        total.color += s.times.color;
        total.prepare += s.times.prepare;
        total.run += s.times.run;
        total.store += s.times.store;
        if std::env::var("DBG").is_ok() && step % 40 == 0 { let n = sim.world.bodies.len(); print!("{step} comp {comp}/{} y", s.pairs); for i in [1, n/4, n/2, 3*n/4, n-1] { let b=&sim.world.bodies[i]; print!(" ({:.4},{:.4},rz{:.4})", b.position.x, b.position.z, b.rotation.z); } println!(); }
        if step % 100 == 0 {
            let p = sim.penetration();
            let placed = start
                .bodies
                .iter()
                .zip(&sim.world.bodies)
                .filter(|(a, b)| {
                    a.position.distance(b.position) < 0.5 * a.colliders[0].shape.as_cuboid().unwrap().y * 2.0
                })
                .count();
            println!(
                "{step}: pen {:.3} mean {:.3} mm, rms {:.4} m/s, fastest {:.3?}, placed {placed}/{}, manifolds {} points {} colors {} overflow {} computed {}/{} nf {:?}",
                p.max * 1e3,
                p.mean * 1e3,
                metrics::rms_speed(&sim.world),
                metrics::fastest(&sim.world),
                start.bodies.len(),
                s.manifolds,
                s.points,
                s.colors,
                s.overflow,
                s.computed,
                s.pairs,
                s.first_non_finite
            );
        }
    }
    println!("ms/step {:?}", total.stages().map(|s| (s.0, s.1.as_secs_f64() * 1e3 / 600.0)));
}
