//! `drystone render`: the motion in a file, several pictures, and messages for bad requests.

#[path = "../../../view/tests/compared/mod.rs"]
mod compared;

use std::path::Path;
use std::process::{Command, Output};

use compared::{PERCENT, difference, read_png};

tests! {
    any_gpu {
        bad_requests_are_refused_in_one_line_before_the_run,
        a_recorded_motion_gives_the_picture_of_the_run,
    }
    no_gpu {
        without_an_adapter_the_driver_package_is_named,
    }
}

/// Runs the command in `folder`.
fn drystone(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).current_dir(folder).output().expect("the command starts")
}

/// Fails unless the command ends with `code` and one line that names all of `parts`, and leaves nothing behind.
fn assert_refused(arguments: &str, adapter: Option<&str>, code: i32, parts: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("short.csv"), "step,time,body,px\n0,0,1,0\n").expect("a file");
    let header = "step,time,body,px,py,pz,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz\n";
    std::fs::write(folder.path().join("empty.csv"), header).expect("a file");
    let row = "0,0,99,0,0,0,0,0,0,1,0,0,0,0,0,0\n";
    std::fs::write(folder.path().join("other.csv"), [header, row].concat()).expect("a file");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    if let Some(adapter) = adapter {
        command.env("DRYSTONE_ADAPTER", adapter);
    }
    let output = command.args(arguments.split(' ')).current_dir(&folder).output().expect("the command starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments}: {message}");
    assert!(parts.iter().all(|part| message.contains(part)), "{arguments}: {message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 3, "{arguments} left something behind");
}

fn bad_requests_are_refused_in_one_line_before_the_run() {
    let none = None;
    assert_refused("render pile -p n=4000000 --out x.bmp", none, 2, &["x.bmp", ".png", ".gif"]);
    assert_refused("render pile -p n=8 --out nowhere/x.png", none, 2, &["nowhere/x.png"]);
    assert_refused("render pile -p n=8 --out x.png --frames 3", none, 2, &["--frames 3", ".gif"]);
    assert_refused("render tower --out x.png --from short.csv", none, 2, &["short.csv", "line 2"]);
    assert_refused("render tower --out x.png --from empty.csv", none, 2, &["empty.csv", "no rows"]);
    assert_refused("render tower --out x.png --from other.csv", none, 2, &["other.csv", "line 2", "body 99"]);
    assert_refused("render tower --out x.png --from other.csv --color batch", none, 2, &["contacts", "speed"]);
    assert_refused("render tower --out x.png --size 16384x16384", none, 2, &["16384x16384"]);
}

fn without_an_adapter_the_driver_package_is_named() {
    assert_refused("render tower --out x.png", Some("none"), 3, &["no adapter", "mesa-vulkan-drivers"]);
}

fn a_recorded_motion_gives_the_picture_of_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    for arguments in [
        "run tower -p offset=0.3 --steps 40 --every 10 --out motion.csv",
        "render tower -p offset=0.3 --steps 40 --size 192x128 --color speed --out run.png",
        "render tower -p offset=0.3 --size 192x128 --color speed --from motion.csv --out recorded.png",
        "render tower -p offset=0.3 --steps 40 --size 96x64 --frames 3 --out frames/",
        "render tower -p offset=0.3 --steps 40 --size 96x64 --frames 4 --out tower.gif",
    ] {
        let output = drystone(folder.path(), arguments);
        assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let png = |name: &str| read_png(&folder.path().join(name));
    let percent = difference(&png("run.png"), &png("recorded.png"));
    assert!(percent <= PERCENT, "{percent} % of the pixels differ");
    // Boxes topple: first and last picture differ.
    assert!(difference(&png("frames/00000.png"), &png("frames/00002.png")) > PERCENT);
    let gif = std::fs::File::open(folder.path().join("tower.gif")).expect("a GIF");
    let mut decoder = gif::DecodeOptions::new().read_info(gif).expect("a GIF");
    let mut frames = 0;
    while decoder.next_frame_info().expect("a frame").is_some() {
        frames += 1;
    }
    assert_eq!(frames, 4);
}
