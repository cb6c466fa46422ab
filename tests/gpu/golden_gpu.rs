//! Exact mode on a GPU has the golden hashes, by SPIR-V and by guarded WGSL.

#[path = "../golden/scenes/mod.rs"]
mod scenes;
#[allow(dead_code, reason = "only the test of the processor writes the table")]
#[path = "../golden/table.rs"]
mod table;

use crate::common::gpu;
use crate::common::sample::one_in;
use drystone::backend::gpu::GpuOptions;
use drystone::{Backend, Gpu};

tests! {
    exact_gpu {
        exact_mode_has_the_golden_hashes,
    }
    any_gpu {
        guarded_wgsl_has_golden_hashes,
    }
}

fn exact_mode_has_the_golden_hashes() {
    have_the_golden_hashes(gpu::exact(), one_in(5));
}

fn guarded_wgsl_has_golden_hashes() {
    let options = GpuOptions { exact: true, guarded: true, ..GpuOptions::default() };
    // Fewer scenes: the driver takes nearly three times as long to compile these shaders.
    have_the_golden_hashes(Gpu::open(options).expect("an adapter"), 3 * one_in(5));
}

fn have_the_golden_hashes(gpu: impl Backend + 'static, step: usize) {
    let golden = table::rows(include_str!("../golden/hashes.txt")).expect("a file of hashes");
    let golden: Vec<_> = golden.into_iter().step_by(step).collect();
    let mut backend: Box<dyn Backend> = Box::new(gpu);
    let mut found = Vec::new();
    for scene in scenes::all().into_iter().step_by(step) {
        let begin = std::time::Instant::now();
        let (row, back) = scene.run(backend, |_| {});
        backend = back;
        measured!("{}: {:.1} s", row.scene, begin.elapsed().as_secs_f64());
        found.push(row);
    }
    let different = table::differences(&golden, &found);
    assert!(different.is_empty(), "{}", different.join("\n"));
}
