// Goes over the rows of some colors, one color after another: a body that one color moves, a later color reads. The text of a
// program holds this function once for each kernel; src/backend/gpu/wgsl.rs writes the call of the kernel in place of over_row.
fn over_colors(first_color: u32, end_color: u32, first: u32, stride: u32) {
    for (var color = first_color; color < end_color; color++) {
        for (var at = colors[color] + first; at < colors[color + 1u]; at += stride) {
            let row = colors[at];
            over_row(row);
        }
        storageBarrier();
    }
}
