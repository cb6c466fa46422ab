//! Checks that every instruction set has the results of plain Rust numbers, including special values.

use std::ops::Range;
use std::sync::Mutex;

use super::{InstructionSet, Lanes, Portable, Row8, WIDTH, Wide, Work};
use crate::math::Lane;

/// Zeros of both signs, the smallest and the largest numbers, infinities and NaN.
const NUMBERS: [f32; WIDTH] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    1e-45,
    -1e-45,
    f32::MAX,
    f32::MIN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    0.1,
    -3.7,
    1e20,
];

/// The results of lane operations on two numbers, for any kind of lane.
fn done<L: Lane>(a: L, b: L) -> [L; 11] {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let chosen = |mask: L::Mask| L::select(zero, one, mask);
    // Only positive numbers have an inverse square root.
    let positive = L::larger(a * a, L::constant(1e-30));
    [
        a + b,
        a - b,
        a * b,
        -a,
        chosen(a.gt(b)),
        chosen(L::and(a.gt(b), a.gt(zero))),
        chosen(L::and(L::mask(true), L::mask(false))),
        L::larger(a, b),
        L::smaller(a, b),
        L::select(a, b, L::mask(true)),
        L::smaller(positive, L::constant(1e30)).inverse_sqrt(),
    ]
}

/// The same for sixteen numbers at a time, with conversion to rows and back.
struct Sixteen {
    a: Wide,
    b: Wide,
    rows: Vec<Row8>,
    places: [u32; WIDTH],
    results: Mutex<(Vec<Wide>, Vec<Row8>)>,
}

impl Work for Sixteen {
    #[inline(always)]
    fn over<L: Lanes>(&self, _: Range<usize>) {
        let numbers = done(L::load(&self.a), L::load(&self.b));
        // SAFETY: `places` has offsets of rows in `rows`.
        let columns = unsafe { L::gathered(self.rows.as_ptr(), &self.places) };
        let (a, b) = (L::load(&self.a), L::load(&self.b));
        let exact = [a.sqrt(), a.divided_by(b), a.with_sign(b), a.floats_below(4)];
        let mut results = self.results.lock().expect("one thread");
        for number in numbers.into_iter().chain(exact).chain(columns) {
            results.0.push(number.store());
        }
        results.1.extend(L::scattered(columns));
    }
}

fn sixteen(a: Wide, b: Wide) -> Sixteen {
    let rows: Vec<Row8> = (0..40).map(|row| Row8([0, 1, 2, 3, 4, 5, 6, 7].map(|k| (8 * row + k) as f32))).collect();
    // The unit is 8 bytes, and a row has four of them.
    let places = std::array::from_fn(|lane| 4 * ((7 * lane as u32 + 3) % 40));
    Sixteen { a, b, rows, places, results: Mutex::default() }
}

type Run = Box<dyn Fn(&Sixteen)>;

/// Plain Rust, and each instruction set of this processor.
fn each() -> impl Iterator<Item = (&'static str, Run)> {
    let plain: Run = Box::new(|work| work.over::<Portable>(0..1));
    let of = |set: InstructionSet| (set.name(), Box::new(move |work: &Sixteen| set.run(work, 0..1)) as Run);
    std::iter::once((Portable::NAME, plain)).chain(InstructionSet::each().map(of))
}

fn same(x: f32, y: f32) -> bool {
    x.to_bits() == y.to_bits() || x.is_nan() && y.is_nan()
}

#[test]
fn every_set_compares_and_chooses_as_a_number_does() {
    for (set, run) in each() {
        for turn in 0..WIDTH {
            let b = std::array::from_fn(|lane| NUMBERS[(lane + turn) % WIDTH]);
            let work = sixteen(Wide(NUMBERS), Wide(b));
            run(&work);
            let results = work.results.into_inner().expect("one thread").0;
            for lane in 0..WIDTH {
                let (x, y) = (NUMBERS[lane], b[lane]);
                let below = f32::from_bits(x.to_bits().wrapping_sub(4));
                let exact = [x.sqrt(), x / y, x.copysign(y), below];
                for (k, expected) in done(x, y).into_iter().chain(exact).enumerate() {
                    let found = results[k].0[lane];
                    assert!(same(found, expected), "{set}: {x:e} and {y:e}, {k}: {found:e}, not {expected:e}");
                }
            }
        }
    }
}

#[test]
fn every_set_brings_rows_to_lanes_and_back() {
    for (set, run) in each() {
        let work = sixteen(Wide(NUMBERS), Wide(NUMBERS));
        run(&work);
        let (columns, back) = work.results.into_inner().expect("one thread");
        for (lane, (place, back)) in work.places.iter().zip(&back).enumerate() {
            let row = work.rows[*place as usize / 4];
            let found: Vec<f32> = columns[15..].iter().map(|column| column.0[lane]).collect();
            assert_eq!((&found[..], *back), (&row.0[..], row), "{set}, lane {lane}");
        }
    }
}
