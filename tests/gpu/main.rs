//! Tests on every backend, and of all that an adapter runs: shaders, devices, the numbers that come back.

#[macro_use]
#[path = "../common/mod.rs"]
mod common;

#[path = "../laws/mod.rs"]
#[allow(dead_code)]
mod laws;

mod batches;
mod breaking;
mod closed_forms;
mod cones;
mod conform;
mod course;
mod damping;
mod direct_joints;
mod events;
mod exact_laws;
mod faults;
mod forces;
mod golden_gpu;
mod gpu;
mod hooks;
mod jamming;
mod joint_forces;
mod joint_kinds;
mod joints;
mod kernels;
mod living;
mod living_random;
mod locked;
mod masses;
mod problems;
mod resident;
mod saved_problem;
mod solver;
mod spin;
mod spring_dampers;
mod surfaces;
mod teleports;
mod waits;

fn main() -> std::process::ExitCode {
    common::harness::run([
        batches::tests(),
        breaking::tests(),
        closed_forms::tests(),
        cones::tests(),
        conform::tests(),
        course::tests(),
        damping::tests(),
        direct_joints::tests(),
        events::tests(),
        exact_laws::tests(),
        faults::tests(),
        forces::tests(),
        golden_gpu::tests(),
        gpu::tests(),
        hooks::tests(),
        jamming::tests(),
        joint_forces::tests(),
        joint_kinds::tests(),
        joints::tests(),
        kernels::tests(),
        living::tests(),
        locked::tests(),
        living_random::tests(),
        masses::tests(),
        problems::tests(),
        resident::tests(),
        saved_problem::tests(),
        solver::tests(),
        spin::tests(),
        spring_dampers::tests(),
        surfaces::tests(),
        teleports::tests(),
        waits::tests(),
    ])
}
