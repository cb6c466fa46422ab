//! Random worlds in exact mode break and keep the laws as they do on the processor, to the last bit.

use drystone::Cpu;

use crate::common::gpu;
use crate::laws::draw::{Drawn, Family, Kind};
use crate::laws::run::{Case, run_on};

tests! { exact_gpu { a_verdict_is_that_of_the_processor, } }

fn a_verdict_is_that_of_the_processor() {
    let kinds = [Kind::Ball, Kind::Hinge, Kind::Slider, Kind::Generic, Kind::Distance, Kind::All];
    for (family, (kind, seed)) in Family::ALL.iter().zip(kinds.into_iter().zip(0..)) {
        let drawn = Drawn { family: *family, kind, collides: true, seed };
        let case = Case::new(drawn.scene(), drystone::SolverConfig::default(), 60, 0.5);
        let [cpu, gpu] = [run_on(&case, Box::new(Cpu::new()), true), run_on(&case, Box::new(gpu::exact()), true)];
        assert_eq!(format!("{cpu:?}"), format!("{gpu:?}"), "{drawn}");
    }
}
