//! How pictures are compared.

use std::path::Path;

use drystone_view::Picture;

/// Pixels differ if a channel differs by more than this, as at an edge that another driver rounds differently.
pub const CHANNEL: u8 = 24;
/// Largest percentage of pixels that may differ: 50 of 24,576. The same software adapter gives 0.
pub const PERCENT: f64 = 0.2;

/// Percentage of pixels that differ.
pub fn difference(a: &Picture, b: &Picture) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let pairs = a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4));
    let differ = |(p, q): &(&[u8], &[u8])| p.iter().zip(*q).any(|(x, y)| x.abs_diff(*y) > CHANNEL);
    100.0 * pairs.filter(differ).count() as f64 / f64::from(a.width * a.height)
}

pub fn read_png(path: &Path) -> Picture {
    let file = std::fs::File::open(path).expect("a picture");
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let mut rgb = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut rgb).expect("a PNG");
    let rgba = rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
    Picture { width: info.width, height: info.height, rgba }
}
