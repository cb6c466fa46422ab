//! The `drystone` command.

fn main() -> std::process::ExitCode {
    // Where there is no desktop, a layer of Mesa's Vulkan looks for a Wayland socket in no folder, and libwayland complains on
    // standard error whenever adapters are listed. In any folder it finds no socket without a word.
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: no other thread runs yet: this is the first thing that the process does.
        unsafe { std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir()) };
    }
    drystone_cli::commands::main()
}
