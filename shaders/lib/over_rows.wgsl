// Goes over the rows of neighboring colors, from one place in the buffer of the colors to another, in any order. The text of a program
// holds this function once for each kernel; src/backend/gpu/wgsl.rs writes the call of the kernel in place of over_row.
fn over_rows(begin: u32, end: u32, first: u32, stride: u32) {
    for (var at = begin + first; at < end; at += stride) {
        let row = colors[at];
        over_row(row);
    }
}
