//! Runs libFuzzer on the kind of input that `DRYSTONE_FUZZ` names. If `DRYSTONE_FUZZ_SEEDS` names a folder, it writes
//! valid inputs there instead. Without a kind it prints all kinds, each with its longest input.
#![no_main]

use std::panic::catch_unwind;
use std::path::Path;
use std::sync::OnceLock;

use drystone_fuzz::{TARGETS, Target, target};

fn chosen() -> &'static Target {
    static CHOSEN: OnceLock<&Target> = OnceLock::new();
    CHOSEN.get_or_init(|| {
        let Ok(name) = std::env::var("DRYSTONE_FUZZ") else {
            TARGETS.iter().for_each(|target| println!("{} {}", target.name, target.longest));
            std::process::exit(0)
        };
        target(&name).unwrap_or_else(|| {
            eprintln!("DRYSTONE_FUZZ={name}: unknown kind of input");
            std::process::exit(2)
        })
    })
}

fn write_seeds(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let seeds = (chosen().seeds)();
    (0..).zip(&seeds).try_for_each(|(k, seed): (u32, _)| std::fs::write(folder.join(format!("seed-{k}")), seed))
}

libfuzzer_sys::fuzz_target!(
    init: {
        // The library turns some panics into errors. They must not abort here, as the hook of libfuzzer-sys would.
        std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
        chosen();
        if let Some(folder) = std::env::var_os("DRYSTONE_FUZZ_SEEDS") {
            std::process::exit(match write_seeds(Path::new(&folder)) {
                Ok(()) => 0,
                Err(error) => {
                    eprintln!("{}: {error}", folder.display());
                    1
                }
            });
        }
    },
    |data: &[u8]| catch_unwind(|| (chosen().check)(data)).unwrap_or_else(|_| std::process::abort())
);
