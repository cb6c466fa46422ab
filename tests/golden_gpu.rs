//! Exact mode on a GPU has the golden hashes.

#[macro_use]
mod common;

#[path = "golden/scenes/mod.rs"]
mod scenes;
#[allow(dead_code, reason = "only the test of the processor writes the table")]
#[path = "golden/table.rs"]
mod table;

use common::gpu;
use drystone::Backend;

tests! {
    exact_gpu {
        exact_mode_has_the_golden_hashes,
    }
}

fn exact_mode_has_the_golden_hashes() {
    let golden = table::rows(include_str!("golden/hashes.txt")).expect("a file of hashes");
    let mut backend: Box<dyn Backend> = Box::new(gpu::exact());
    let mut found = Vec::new();
    for scene in scenes::all() {
        let begin = std::time::Instant::now();
        let (row, back) = scene.run(backend, |_| {});
        backend = back;
        measured!("{}: {:.1} s", row.scene, begin.elapsed().as_secs_f64());
        found.push(row);
    }
    let different = table::differences(&golden, &found);
    assert!(different.is_empty(), "{}", different.join("\n"));
}
