// Goes over the rows of some colors, one color after another, because a later color reads the bodies that an earlier
// one moves.
fn over_colors(first_color: u32, end_color: u32, first: u32, stride: u32) {
    for (var color = first_color; color < end_color; color++) {
        over_rows(colors[color], colors[color + 1u], first, stride);
        storageBarrier();
    }
}
