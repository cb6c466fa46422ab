//! The memory of `drystone run` per body.
#![cfg(target_os = "linux")]

use std::process::{Command, Stdio};

/// Largest resident memory of a run of a pyramid (bytes), and the number of boxes.
fn peak(base: u64) -> (u64, u64) {
    let parameter = format!("base={base}");
    let arguments =
        ["run", "pyramid", "-p", &parameter, "--steps", "3", "--backend", "cpu", "--threads", "2", "--json"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    let mut run = command.args(arguments).stdout(Stdio::null()).spawn().expect("the program");
    let mut kilobytes = 0;
    while run.try_wait().expect("a process").is_none() {
        // The file is empty after the process has ended.
        let status = std::fs::read_to_string(format!("/proc/{}/status", run.id())).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let read = line.and_then(|rest| rest.trim().trim_end_matches(" kB").parse().ok());
        kilobytes = read.unwrap_or(0).max(kilobytes);
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    (1024 * kilobytes, base * (base + 1) / 2)
}

/// Measured: 4,090 bytes per box; 6,230 if the report computes contacts while the simulation exists.
#[test]
fn a_run_of_a_pyramid_takes_at_most_4500_bytes_a_box() {
    let ((small, few), (large, many)) = (peak(100), peak(300));
    let bytes = (large - small) / (many - few);
    println!("{bytes} bytes a box");
    assert!((1000..=4500).contains(&bytes), "{bytes} bytes a box");
}
