//! Functions for a JavaScript engine: they take and return numbers, and the engine reads text from memory.

use std::cell::RefCell;

thread_local! {
    static TEXT: RefCell<String> = const { RefCell::new(String::new()) };
}

/// How many backends this platform has.
#[unsafe(no_mangle)]
pub extern "C" fn backend_count() -> usize {
    crate::backends().len()
}

/// Runs all scenes on a backend; 1 if all have their golden hashes. The line is at [`text`].
#[unsafe(no_mangle)]
pub extern "C" fn check_backend(index: usize) -> u32 {
    let (line, is_same) = crate::backends().into_iter().nth(index).map_or_else(
        || (format!("there is no backend {index}"), false),
        |(name, backend)| crate::report(&name, backend),
    );
    TEXT.set(line);
    is_same.into()
}

/// Notes the hash of each step of a scene, a line each, at [`text`].
#[unsafe(no_mangle)]
pub extern "C" fn trace_scene(index: usize) {
    let name = crate::scenes::all().get(index).map_or("", |scene| scene.name);
    let hashes = crate::trace(name).unwrap_or_default();
    TEXT.set(hashes.iter().map(|hash| format!("{hash:016x}\n")).collect());
}

/// Where the last text is.
#[unsafe(no_mangle)]
pub extern "C" fn text() -> *const u8 {
    TEXT.with_borrow(|text| text.as_ptr())
}

/// How many bytes it has.
#[unsafe(no_mangle)]
pub extern "C" fn text_len() -> usize {
    TEXT.with_borrow(String::len)
}
