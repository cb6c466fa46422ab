//! An entropy code for numbers.
//!
//! A number is a symbol for its size, and the lower bits. Symbols have Huffman codes of at most [`MAX_BITS`] bits:
//! frequent symbols are shorter. Each symbol takes at least one bit, so no count can announce more numbers than there
//! are bits.

use crate::error::{Result, ensure, input};

/// Sizes of numbers by their highest bit, each with and without a sign that differs from the guess.
const SIZES: u32 = 33;
/// The first symbol of single-precision numbers: sign and exponent, with 23 bits below.
const FLOATS: u32 = 2 * SIZES;
/// The first symbol of bytes.
const BYTES: u32 = FLOATS + 512;
const SYMBOLS: usize = (BYTES + 256) as usize;
/// Largest number of bits of a symbol.
const MAX_BITS: u32 = 10;

/// A symbol and its lower bits.
#[derive(Clone, Copy, Default)]
pub(super) struct Coded {
    symbol: u32,
    below: u32,
}

impl Coded {
    pub fn number(number: u32, has_other_sign: bool) -> Self {
        let size = u32::BITS - number.leading_zeros();
        let below = if size > 1 { number & !(1 << (size - 1)) } else { 0 };
        Self { symbol: size + SIZES * u32::from(has_other_sign), below }
    }

    pub fn to_number(self) -> (u32, bool) {
        let size = self.symbol % SIZES;
        (if size == 0 { 0 } else { 1 << (size - 1) | self.below }, self.symbol >= SIZES)
    }

    pub fn float(float: f32) -> Self {
        let bits = float.to_bits();
        Self { symbol: FLOATS + (bits >> 23), below: bits & 0x7f_ffff }
    }

    pub fn to_float(self) -> f32 {
        f32::from_bits((self.symbol.wrapping_sub(FLOATS) & 0x1ff) << 23 | self.below & 0x7f_ffff)
    }

    pub fn byte(byte: u8) -> Self {
        Self { symbol: BYTES + u32::from(byte), below: 0 }
    }

    pub fn to_byte(self) -> u8 {
        self.symbol.wrapping_sub(BYTES) as u8
    }
}

/// Number of lower bits of a symbol.
fn bits_below(symbol: u32) -> u32 {
    match symbol {
        0..FLOATS => (symbol % SIZES).saturating_sub(1),
        FLOATS..BYTES => 23,
        _ => 0,
    }
}

/// Appends coded numbers to `bytes`.
pub(super) fn encode(numbers: &[Coded], bytes: &mut Vec<u8>) {
    put(numbers.len() as u32, bytes);
    if numbers.is_empty() {
        return;
    }
    let mut counts = [0_u32; SYMBOLS];
    numbers.iter().for_each(|number| counts[number.symbol as usize] += 1);
    let used: Vec<(u32, u32)> = (0..).zip(counts).filter(|(_, count)| *count > 0).collect();
    let lengths = lengths(&used);
    put(used.len() as u32, bytes);
    let mut next = 0;
    for (&(symbol, _), &length) in used.iter().zip(&lengths) {
        put((symbol - next) << 4 | length, bytes);
        next = symbol + 1;
    }
    // In the array of the counts: the code of each symbol, and above it its length and its number of lower bits.
    let mut codes = counts;
    for (code, length, symbol) in codes_of(used.iter().map(|&(symbol, _)| symbol).zip(lengths)) {
        codes[symbol as usize] = code | length << 16 | bits_below(symbol) << 24;
    }
    // A number takes at most 41 bits. Write eight bytes for each number; the next one overwrites the unfilled bytes.
    let mut at = bytes.len();
    bytes.resize(at + 6 * numbers.len() + 8, 0);
    let (mut waiting, mut count) = (0_u64, 0);
    for number in numbers {
        let code = codes[number.symbol as usize];
        let length = code >> 16 & 0xff;
        waiting |= (u64::from(code & 0xffff) | u64::from(number.below) << length) << count;
        count += length + (code >> 24);
        bytes[at..at + 8].copy_from_slice(&waiting.to_le_bytes());
        at += count as usize / 8;
        waiting >>= count & !7;
        count &= 7;
    }
    bytes.truncate(at + usize::from(count > 0));
}

/// Decodes numbers from the start of `bytes`, and leaves the rest.
pub(super) fn decode(bytes: &mut &[u8]) -> Result<Vec<Coded>> {
    let count = get(bytes)? as usize;
    if count == 0 {
        return Ok(Vec::new());
    }
    let used = get(bytes)? as usize;
    ensure(used <= SYMBOLS, || format!("{used} symbols"))?;
    let (mut all, mut next) = (Vec::with_capacity(used), 0_u32);
    for _ in 0..used {
        let own = get(bytes)?;
        let (symbol, length) = (next.saturating_add(own >> 4), own & 15);
        ensure((symbol as usize) < SYMBOLS && (1..=MAX_BITS).contains(&length), || {
            format!("symbol {symbol} of {length} bits")
        })?;
        all.push((symbol, length));
        next = symbol + 1;
    }
    let room: u32 = all.iter().map(|&(_, length)| 1 << (MAX_BITS - length)).sum();
    ensure(room <= 1 << MAX_BITS, || "more symbols than codes".to_owned())?;
    // For each bit pattern: the symbol that it starts with, its length and its number of lower bits; 0 if there is
    // none.
    let mut table = [(0_u16, 0_u8, 0_u8); 1 << MAX_BITS];
    for (code, length, symbol) in codes_of(all.into_iter()) {
        for entry in table.iter_mut().skip(code as usize).step_by(1 << length) {
            *entry = (symbol as u16, length as u8, bits_below(symbol) as u8);
        }
    }
    ensure(count <= 8 * bytes.len(), || format!("{count} numbers in {} bytes", bytes.len()))?;
    let (mut numbers, mut at) = (Vec::with_capacity(count), 0_usize);
    for _ in 0..count {
        let waiting = window(bytes, at);
        let (symbol, length, below) = table[waiting as usize & ((1 << MAX_BITS) - 1)];
        if length == 0 {
            return Err(input!("bits without a symbol"));
        }
        let below_bits = (waiting >> length) as u32 & ((1_u64 << below) - 1) as u32;
        numbers.push(Coded { symbol: u32::from(symbol), below: below_bits });
        at += usize::from(length) + usize::from(below);
    }
    *bytes = bytes.get(at.div_ceil(8)..).ok_or_else(|| input!("cut short"))?;
    Ok(numbers)
}

/// At least 57 bits from the bit `at` on. Bits beyond the end are 0.
fn window(bytes: &[u8], at: usize) -> u64 {
    let own = bytes.get(at / 8..).unwrap_or_default();
    let word = match own.first_chunk::<8>() {
        Some(word) => *word,
        None => {
            let mut word = [0; 8];
            word[..own.len()].copy_from_slice(own);
            word
        }
    };
    u64::from_le_bytes(word) >> (at % 8)
}

/// The code length of each symbol, from counts.
fn lengths(used: &[(u32, u32)]) -> Vec<u32> {
    let mut by_count: Vec<(u32, usize)> = used.iter().enumerate().map(|(i, &(_, count))| (count, i)).collect();
    by_count.sort_unstable();
    loop {
        let lengths = lengths_of_sorted(&by_count);
        if lengths.iter().all(|&length| length <= MAX_BITS) {
            return lengths;
        }
        // The order does not change.
        by_count.iter_mut().for_each(|(count, _)| *count = (*count / 2) | 1);
        by_count.sort_unstable();
    }
}

/// Huffman code lengths of symbols, sorted by count.
fn lengths_of_sorted(by_count: &[(u32, usize)]) -> Vec<u32> {
    let leaves = by_count.len();
    if leaves == 1 {
        return vec![1];
    }
    // Leaves, then inner nodes in order of creation, which is also the order of their weights.
    let mut weights: Vec<u64> = by_count.iter().map(|&(count, _)| u64::from(count)).collect();
    let mut above = vec![0; 2 * leaves - 1];
    let (mut leaf, mut node) = (0, leaves);
    for new in leaves..2 * leaves - 1 {
        let mut take = || {
            let is_leaf = leaf < leaves && (node >= weights.len() || weights[leaf] <= weights[node]);
            let next = if is_leaf { &mut leaf } else { &mut node };
            *next += 1;
            *next - 1
        };
        let [one, other] = [take(), take()];
        (above[one], above[other]) = (new, new);
        weights.push(weights[one] + weights[other]);
    }
    let mut depths = vec![0; 2 * leaves - 1];
    for i in (0..2 * leaves - 2).rev() {
        depths[i] = depths[above[i]] + 1;
    }
    let mut lengths = vec![0; leaves];
    by_count.iter().zip(depths).for_each(|(&(_, i), depth)| lengths[i] = depth);
    lengths
}

/// Code, length and symbol, for symbols with code lengths: shorter codes first, the first bit is the lowest.
fn codes_of(symbols: impl Iterator<Item = (u32, u32)>) -> impl Iterator<Item = (u32, u32, u32)> {
    let mut sorted: Vec<(u32, u32)> = symbols.map(|(symbol, length)| (length, symbol)).collect();
    sorted.sort_unstable();
    let mut next = 0_u32;
    sorted.into_iter().map(move |(length, symbol)| {
        let code = next >> (MAX_BITS - length);
        next += 1 << (MAX_BITS - length);
        (code.reverse_bits() >> (u32::BITS - length), length, symbol)
    })
}

/// Writes a number in groups of seven bits.
fn put(mut number: u32, bytes: &mut Vec<u8>) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Reads such a number.
fn get(bytes: &mut &[u8]) -> Result<u32> {
    let mut number = 0;
    for shift in (0..35).step_by(7) {
        let (&byte, rest) = bytes.split_first().ok_or_else(|| input!("cut short"))?;
        *bytes = rest;
        number |= u32::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Ok(number);
        }
    }
    Err(input!("a number of more than 32 bits"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn again(numbers: &[Coded]) -> Vec<Coded> {
        let mut bytes = Vec::new();
        encode(numbers, &mut bytes);
        let mut rest = &bytes[..];
        let again = decode(&mut rest).expect("what was written");
        assert!(rest.is_empty());
        again
    }

    fn pairs(numbers: &[Coded]) -> Vec<(u32, u32)> {
        numbers.iter().map(|number| (number.symbol, number.below)).collect()
    }

    #[test]
    fn numbers_of_all_sizes_come_back() {
        let sizes =
            (0..=32).flat_map(|size| [1_u64 << size, (1 << size) - 1]).map(|number| number.min(u32::MAX.into()));
        for number in sizes.map(|number| number as u32) {
            for sign in [false, true] {
                assert_eq!(Coded::number(number, sign).to_number(), (number, sign));
            }
            assert_eq!(Coded::float(f32::from_bits(number)).to_float().to_bits(), number);
            assert_eq!(Coded::byte(number as u8).to_byte(), number as u8);
        }
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state
        };
        for count in [0, 1, 2, 3, 1000, 5000] {
            let one = |_| match random() >> 30 {
                0 => Coded::float(f32::from_bits(random())),
                1 => Coded::byte((random() >> 24) as u8),
                _ => Coded::number(random() >> (random() >> 27), random() >> 31 == 1),
            };
            let numbers: Vec<Coded> = (0..count).map(one).collect();
            assert_eq!(pairs(&again(&numbers)), pairs(&numbers), "{count}");
        }
    }

    /// Counts in the ratios of the Fibonacci numbers give the longest codes: 29 bits for 30 symbols.
    #[test]
    fn codes_are_not_too_long() {
        let (mut counts, mut numbers) = ([1, 1], Vec::new());
        for byte in 0..22 {
            numbers.extend(std::iter::repeat_n(Coded::byte(byte), counts[0]));
            counts = [counts[1], counts[0] + counts[1]];
        }
        assert_eq!(pairs(&again(&numbers)), pairs(&numbers));
    }

    #[test]
    fn a_frequent_symbol_takes_one_bit_and_a_rare_one_more() {
        let numbers: Vec<Coded> =
            (0..8000).map(|i| Coded::byte(u8::from(i % 100 == 0) + u8::from(i % 1000 == 0))).collect();
        let mut bytes = Vec::new();
        encode(&numbers, &mut bytes);
        assert!((1000..1030).contains(&bytes.len()), "{} bytes", bytes.len());
    }

    #[test]
    fn damaged_bytes_never_panic() {
        let numbers: Vec<Coded> = (0..300).map(|i| Coded::number(i * i, i % 3 == 0)).collect();
        let mut bytes = Vec::new();
        encode(&numbers, &mut bytes);
        for length in 0..bytes.len() {
            assert!(decode(&mut &bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        }
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << bit;
                let _ = decode(&mut &damaged[..]);
            }
        }
    }
}
