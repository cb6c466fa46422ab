//! That engines are compiled as their users compile them.
#![cfg(feature = "physx")]

use drystone_scenes::Scene;
use drystone_peers::{Engine, Entrant};

/// Whether a text is in this program, which the library is linked into. Texts are given backwards, so that they are not here themselves.
fn holds(program: &[u8], backwards: &str) -> bool {
    let text: Vec<u8> = backwards.bytes().rev().collect();
    program.windows(text.len()).any(|window| window == text)
}

/// With debug information in the build profile the crate defines PX_CHECKED and PX_DEBUG, and steps take three times as long. Only such a
/// build has the messages of the checks; any build has those of errors.
#[test]
fn physx_has_no_checks() {
    // The calls that have the messages are linked in.
    let scene = Scene::find("tower", &[]).expect("a scene");
    Entrant::default_of(Engine::Physx).build(&scene, 1).and_then(|mut physx| physx.step()).expect("a step");
    let path = std::env::current_exe().expect("a program");
    let program = std::fs::read(path).expect("a program");
    assert!(holds(&program, " rotcA :)(rotcAdda::enecSxP"), "no message of an error: this looks at the wrong program");
    for message in ["dilav ton si noitanitsed :tegraTcitameniKtes", "dilav ton si esop :esoPlabolGtes"] {
        assert!(
            !holds(&program, message),
            "PhysX was compiled with its checks: does the profile ask for debug information?"
        );
    }
}
