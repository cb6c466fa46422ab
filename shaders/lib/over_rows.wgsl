// Goes over the rows of neighboring colors in any order, from one place in the buffer of colors to another. The text of
// a program has this function once for each kernel. src/backend/gpu/wgsl.rs writes the call of the kernel in place of
// over_row.
fn over_rows(begin: u32, end: u32, first: u32, stride: u32) {
    for (var at = begin + first; at < end; at += stride) {
        let row = colors[at];
        over_row(row);
    }
}
