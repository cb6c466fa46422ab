//! Commands that end early: signals, closed pipes, full disks, panics. Each prints one line that says which outputs
//! remain.

use std::panic::{PanicHookInfo, UnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};

use super::output::{is_closed_pipe, say_last};
use crate::files;
use drystone::Result;

/// A shell adds this to the number of the signal that ended a program.
const SIGNALED: u8 = 128;
const SIGPIPE: u8 = 13;

/// The last panic: its message and its place.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// Runs a command. If it ends early, prints its last line.
pub(super) fn guarded(run: impl FnOnce() -> Result<bool> + UnwindSafe) -> ExitCode {
    on_signals();
    quiet_panics();
    let (code, line) = ending(run);
    line.into_iter().for_each(say_last);
    code.into()
}

/// The exit code of a command, and its last line if it ends early.
fn ending(run: impl FnOnce() -> Result<bool> + UnwindSafe) -> (u8, Option<String>) {
    let error = match catch_unwind(run) {
        Ok(Ok(passed)) => return (u8::from(!passed), None),
        Ok(Err(error)) => error,
        Err(_) => {
            let what = PANIC.lock().unwrap_or_else(PoisonError::into_inner);
            return (1, Some(format!("a defect in drystone, please report it: {what}{}", files::left())));
        }
    };
    if is_closed_pipe(&error) {
        return (SIGNALED + SIGPIPE, Some(format!("the reader of standard output is gone{}", files::left())));
    }
    (error.exit_code(), Some(format!("{error}{}", files::left())))
}

/// On a signal, unfinished files are removed before the process ends.
#[cfg(unix)]
fn on_signals() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
    use std::sync::Arc;
    // If a file exceeds the size limit of the shell, the write call fails and the process continues. These calls fail
    // only for signals that cannot be caught.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
    let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP]) else { return };
    let wait = move || {
        if let Some(signal) = signals.forever().next() {
            let name = signal_hook::low_level::signal_name(signal).unwrap_or("a signal");
            files::stop(|left| say_last(format_args!("stopped by {name}{left}")), i32::from(SIGNALED) + signal);
        }
    };
    // Without this thread, signals end the process in the default way.
    let _ = std::thread::Builder::new().name("ctrl-c".into()).spawn(wait);
}

/// On Ctrl-C, unfinished files are removed before the process ends.
#[cfg(not(unix))]
fn on_signals() {
    const SIGINT: i32 = 2;
    // This fails only if a handler is already set.
    let _ = ctrlc::set_handler(|| {
        files::stop(|left| say_last(format_args!("stopped by Ctrl-C{left}")), i32::from(SIGNALED) + SIGINT)
    });
}

/// Keeps the message of a panic for [`ending`]. With `RUST_BACKTRACE` it is printed at once, with its stack.
fn quiet_panics() {
    let usual = std::panic::take_hook();
    let traces = std::env::var_os("RUST_BACKTRACE").is_some_and(|value| value != "0");
    std::panic::set_hook(Box::new(move |panic| {
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = described(panic);
        if traces {
            usual(panic);
        }
    }));
}

fn described(panic: &PanicHookInfo) -> String {
    let text = panic.payload_as_str().unwrap_or("no message").replace(char::is_control, " ");
    let place = panic.location().map_or(String::new(), |at| format!(" ({}:{})", at.file(), at.line()));
    text + &place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::Draft;
    use drystone::Error;

    #[test]
    fn a_panic_of_any_thread_is_one_line_and_leaves_no_draft() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("motion.csv");
        let open = || {
            let draft = Draft::of(&path).expect("a name");
            draft.create().expect("room");
            draft
        };
        let usual = std::panic::take_hook();
        quiet_panics();
        let (code, line) = ending(|| {
            let _draft = open();
            rayon::join(|| (), || panic!("a thing\nbroke"));
            Ok(true)
        });
        std::panic::set_hook(usual);
        let line = line.expect("a line");
        assert_eq!((code, line.lines().count()), (1, 1), "{line}");
        assert!(
            line.starts_with("a defect in drystone, please report it: a thing broke (cli/src/commands/stop.rs:"),
            "{line}"
        );
        // Other tests of this process have their own files.
        let (_, lost) = line.rsplit_once("; ").expect("what is left");
        assert!(lost.contains(&path.display().to_string()) && lost.ends_with(" not written"), "{line}");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }

    #[test]
    fn an_ending_has_its_code() {
        assert_eq!(ending(|| Ok(true)), (0, None));
        assert_eq!(ending(|| Ok(false)), (1, None));
        let failed = |error: fn() -> Error| ending(move || Err(error()));
        assert_eq!(failed(|| Error::input("a = 1: no")).0, 2);
        assert_eq!(failed(|| Error::Panicked("a contact".into())).0, 1);
        assert_eq!(failed(|| Error::Adapter("none".into())).0, 3);
        let closed = || Error::file("standard output")(std::io::ErrorKind::BrokenPipe.into());
        assert_eq!(failed(closed).0, 141);
        assert_eq!(failed(|| Error::file("a file")(std::io::ErrorKind::BrokenPipe.into())).0, 2);
    }
}
