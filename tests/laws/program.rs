//! `laws` runs random worlds, and prints how many break the laws.
//!
//! ```text
//! laws [--family WORDS] [--kind WORDS] [--collides 0|1|both] [--worlds N] [--from SEED] [--seconds S]
//!      [--preset NAME] [--rate N] [--set KEY=VALUE]... [--threads N] [--csv FILE] [--worst N]
//! laws ... --shrinks N --out FOLDER                       the same, and the N worst of each kind shrunk, as scene files
//! laws --one plain/ball-0/17 [--trace] [--out FILE]      a world by its name, as the first column of the csv has it
//! laws --scene FILE [--trace]                            a scene file
//! laws --shrink NAME|FILE --out FILE                     the smallest world that breaks the same law
//! ```

use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use drystone::preset::Preset;
use drystone::{Cpu, Error, SolverConfig};
use drystone_scenes::{Scene, SceneFile};

#[path = "mod.rs"]
mod laws;
#[path = "../common/settings.rs"]
mod settings;
mod table;

use laws::draw::{Drawn, Family, Kind};
use laws::run::{self, Case, Verdict};
use laws::shrink::{Cause, shrunk};

/// The options of the command line.
struct Options {
    families: Vec<Family>,
    kinds: Vec<Kind>,
    collides: Vec<bool>,
    worlds: u64,
    from: u64,
    seconds: f32,
    config: SolverConfig,
    settings: Vec<String>,
    rate: Option<u32>,
    threads: usize,
    csv: Option<String>,
    worst: usize,
    one: Option<String>,
    shrink: Option<String>,
    out: Option<String>,
    shrinks: usize,
    trace: bool,
}

fn words<T: std::str::FromStr<Err = Error> + Copy>(text: &str, all: &[T]) -> Result<Vec<T>, String> {
    let parsed = |word: &str| word.parse().map_err(|error: Error| error.to_string());
    if text == "each" { Ok(all.to_vec()) } else { text.split(',').map(parsed).collect() }
}

fn number<T: std::str::FromStr>(text: &str) -> Result<T, String> {
    text.parse().map_err(|_| format!("{text}: no number"))
}

impl Options {
    fn read(mut arguments: impl Iterator<Item = String>) -> Result<Self, String> {
        let mut options = Self {
            families: vec![Family::Plain],
            kinds: Kind::ALL.to_vec(),
            collides: vec![false, true],
            worlds: 100,
            from: 0,
            seconds: 10.0,
            config: SolverConfig::default(),
            settings: Vec::new(),
            rate: None,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            csv: None,
            worst: 3,
            one: None,
            shrink: None,
            out: None,
            shrinks: 0,
            trace: false,
        };
        while let Some(name) = arguments.next() {
            if name == "--trace" {
                options.trace = true;
                continue;
            }
            let value = arguments.next().ok_or_else(|| format!("{name}: has no value"))?;
            match name.as_str() {
                "--family" => options.families = words(&value, &Family::ALL)?,
                "--kind" => options.kinds = words(&value, &Kind::ALL)?,
                "--collides" => {
                    options.collides = match value.as_str() {
                        "0" => vec![false],
                        "1" => vec![true],
                        "both" => vec![false, true],
                        _ => return Err(format!("--collides {value}: none of 0, 1, both")),
                    };
                }
                "--worlds" => options.worlds = number(&value)?,
                "--from" => options.from = number(&value)?,
                "--seconds" => options.seconds = number(&value)?,
                "--preset" => options.config = value.parse::<Preset>().map_err(|e| e.to_string())?.config(),
                "--rate" => options.rate = Some(number(&value)?),
                "--set" => options.settings.push(value),
                "--threads" => options.threads = number(&value)?,
                "--csv" => options.csv = Some(value),
                "--worst" => options.worst = number(&value)?,
                "--one" | "--scene" => options.one = Some(value),
                "--shrink" => options.shrink = Some(value),
                "--shrinks" => options.shrinks = number(&value)?,
                "--out" => options.out = Some(value),
                _ => return Err(format!("{name}: no such option; the first lines of tests/laws/program.rs name all")),
            }
        }
        for setting in &options.settings {
            settings::set(&mut options.config, setting);
        }
        Ok(options)
    }

    /// A world by its name, or of a scene file.
    fn case(&self, name: &str) -> Result<Case, String> {
        let (scene, rate) = if name.ends_with(".json") {
            let scene = drystone_scenes::load(name.as_ref()).map_err(|e| e.to_string())?;
            let rate = (1.0 / scene.dt).round() as u32;
            (scene, rate)
        } else {
            (name.parse::<Drawn>()?.scene(), 60)
        };
        Ok(Case::new(scene, self.config.clone(), self.rate.unwrap_or(rate), self.seconds))
    }
}

/// Shrinks the worst worlds of each family and kind; a line for each.
fn shrink_worst(options: &Options, rows: &[table::Row], rate: u32) -> Result<(), String> {
    let folder = options.out.as_deref().unwrap_or(".");
    std::fs::create_dir_all(folder).map_err(|e| format!("{folder}: {e}"))?;
    let worst: Vec<&table::Row> =
        table::groups(rows).flat_map(|own| table::worst(own).into_iter().take(options.shrinks)).collect();
    let lines = each(worst.len(), options.threads, |i| {
        let (drawn, (verdict, _)) = worst[i];
        let cause = Cause::of(verdict)?;
        let small = shrunk(&Case::new(drawn.scene(), options.config.clone(), rate, options.seconds), cause);
        let world = &small.scene.world;
        let verdict = run::run(&small);
        let path = format!("{folder}/{}.json", drawn.to_string().replace('/', "-"));
        let written = write(&small.scene, &path).map_or_else(|e| e, |()| path);
        Some(format!(
            "{drawn}: {cause:?}, {} bodies, {} joints, {} steps, gravity {}: gain {:.1e}, lasting {:.1e}, gap {:.1e}; {written}",
            world.bodies.count(),
            world.joints.len(),
            small.steps(),
            world.gravity.y,
            verdict.gain(),
            verdict.lasting_gain(),
            verdict.gap.worst(),
        ))
    });
    lines.iter().flatten().for_each(|line| println!("{line}"));
    Ok(())
}

/// Runs `work` on each of `count` numbers, on so many threads; each world runs on one. The results are in order.
fn each<T: Send>(count: usize, threads: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let (next, found) = (AtomicUsize::new(0), Mutex::new(Vec::with_capacity(count)));
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
                pool.install(|| {
                    loop {
                        let i = next.fetch_add(1, Ordering::Relaxed);
                        if i >= count {
                            break;
                        }
                        let done = work(i);
                        found.lock().expect("no thread panicked").push((i, done));
                    }
                });
            });
        }
    });
    let mut found = found.into_inner().expect("no thread panicked");
    found.sort_by_key(|(i, _)| *i);
    found.into_iter().map(|(_, done)| done).collect()
}

fn print(name: &str, verdict: &Verdict) {
    let Verdict { lost, rise, excess, above_start, broken_at, scale, push, work, gap, gap_at, drift, substeps, .. } =
        verdict;
    println!("{name}: breaks {:?}", verdict.broken());
    println!(
        "  energy: rise {rise:.3e} J, {excess:.3e} J beyond the law (first in step {broken_at:?}), {above_start:.3e} J of that above the start, {:.3e} of {scale:.3e} J; push {push:.2e}, work {work:.2e}",
        verdict.gain()
    );
    println!(
        "  gap: {:.2e} of a lever, {:.2e} rad, {:.2e} m (step {gap_at}); drift {}; at most {substeps} substeps",
        gap.share,
        gap.angle,
        gap.distance,
        drift.map_or("none".into(), |[p, l]| format!("{p:.1e} {l:.1e}"))
    );
    if let Some(lost) = lost {
        println!("  lost: {lost}");
    }
}

fn write(scene: &Scene, path: &str) -> Result<(), String> {
    let text = SceneFile::of(scene).map_err(|e| e.to_string())?.to_text();
    std::fs::write(path, text).map_err(|e| format!("{path}: {e}"))
}

fn answer(options: &Options) -> Result<(), String> {
    if let Some(name) = &options.one {
        let case = options.case(name)?;
        if let Some(path) = &options.out {
            write(&case.scene, path)?;
        }
        let verdict = run::run_on(&case, Box::new(Cpu::new()), options.trace);
        for (step, [motion, weight, springs, work, taken, refused, spin, gap, substeps]) in
            verdict.trace.iter().enumerate()
        {
            println!(
                "{step} motion {motion:.6e} weight {weight:.6e} springs {springs:.6e} work {work:.6e} energy {:.6e} taken {taken:.3e} refused {refused} spin {spin:.3e} gap {gap:.2e} substeps {substeps}",
                motion + weight + springs - work
            );
        }
        print(name, &verdict);
        return Ok(());
    }
    if let Some(name) = &options.shrink {
        let case = options.case(name)?;
        let verdict = run::run(&case);
        let cause = Cause::of(&verdict).ok_or_else(|| format!("{name}: breaks no law"))?;
        print(name, &verdict);
        let small = shrunk(&case, cause);
        let world = &small.scene.world;
        println!("{cause:?}: {} bodies, {} joints, {} s", world.bodies.count(), world.joints.len(), small.seconds);
        print("shrunk", &run::run(&small));
        return options.out.as_ref().map_or(Ok(()), |path| write(&small.scene, path));
    }
    let mut all = Vec::new();
    for &family in &options.families {
        for &kind in &options.kinds {
            for &collides in &options.collides {
                all.extend((options.from..options.from + options.worlds).map(|seed| Drawn {
                    family,
                    kind,
                    collides,
                    seed,
                }));
            }
        }
    }
    let start = Instant::now();
    let rate = options.rate.unwrap_or(60);
    let verdicts = each(all.len(), options.threads, |i| {
        let start = Instant::now();
        let verdict = run::run(&Case::new(all[i].scene(), options.config.clone(), rate, options.seconds));
        (verdict, start.elapsed().as_secs_f64())
    });
    let rows: Vec<_> = all.into_iter().zip(verdicts).collect();
    if let Some(path) = &options.csv {
        std::fs::write(path, table::csv(&rows)).map_err(|e| format!("{path}: {e}"))?;
    }
    print!("{}", table::text(&rows, options.worst));
    if options.shrinks > 0 {
        shrink_worst(options, &rows, rate)?;
    }
    println!("{} worlds in {:.1} s on {} threads", rows.len(), start.elapsed().as_secs_f64(), options.threads);
    Ok(())
}

fn main() -> ExitCode {
    match Options::read(std::env::args().skip(1)).and_then(|options| answer(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(line) => {
            eprintln!("{line}");
            ExitCode::FAILURE
        }
    }
}
