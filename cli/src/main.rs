//! The `drystone` command.

fn main() -> std::process::ExitCode {
    // Without a desktop, Mesa's Vulkan layer looks for a Wayland socket. libwayland prints an error if the variable is
    // unset. It is silent if the variable names a folder without a socket.
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: no other thread runs yet; `main` has just begun.
        unsafe { std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir()) };
    }
    drystone_cli::commands::main()
}
