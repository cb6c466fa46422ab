//! Compiles `src/bullet.cpp` against the library that pkg-config finds, for the feature `bullet`.

#[cfg(feature = "bullet")]
use std::path::Path;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    #[cfg(feature = "bullet")]
    bullet();
}

#[cfg(feature = "bullet")]
fn bullet() {
    println!("cargo:rerun-if-changed=src/bullet.cpp");
    // The flags to link come after the shim that needs them.
    let mut quiet = pkg_config::Config::new();
    let library = match quiet.cargo_metadata(false).atleast_version("3").probe("bullet") {
        Ok(library) => library,
        Err(e) => panic!("the feature bullet needs Bullet 3 (Debian: apt-get install libbullet-dev pkg-config): {e}"),
    };
    let mut shim = cc::Build::new();
    shim.cpp(true).std("c++17").file("src/bullet.cpp");
    // Warnings are about the shim, not about the library. The compiler has its own order for the folder that it knows.
    for folder in library.include_paths.iter().filter(|folder| *folder != Path::new("/usr/include")) {
        shim.flag("-isystem").flag(folder);
    }
    shim.compile("drystone_bullet");
    library.link_paths.iter().for_each(|folder| println!("cargo:rustc-link-search=native={}", folder.display()));
    library.libs.iter().for_each(|name| println!("cargo:rustc-link-lib={name}"));
}
