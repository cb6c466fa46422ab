//! `drystone-golden` runs all scenes on all backends of this platform, and `drystone-golden SCENE` prints the hash of each step of one.

use std::process::ExitCode;

use drystone_golden::{backends, report, trace};

/// Threads that the best lanes run on.
const THREADS: [usize; 4] = [1, 2, 3, 7];

fn main() -> ExitCode {
    if let Some(name) = std::env::args().nth(1) {
        let Some(hashes) = trace(&name) else {
            eprintln!("no scene has the name {name:?}");
            return ExitCode::FAILURE;
        };
        hashes.iter().for_each(|hash| println!("{hash:016x}"));
        return ExitCode::SUCCESS;
    }
    let count = backends().len();
    let one = (0..count).map(|backend| (backend, 1));
    let many = THREADS[1..].iter().map(|&threads| (count - 1, threads));
    let mut all_same = true;
    for (backend, threads) in one.chain(many) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
        let (line, is_same) = pool.install(|| {
            let (name, backend) = backends().swap_remove(backend);
            report(&name, backend)
        });
        println!("{line}");
        all_same &= is_same;
    }
    if all_same { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
