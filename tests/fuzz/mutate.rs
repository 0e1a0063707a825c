//! Files that are nearly as they should be: a few changes to one that is accepted.

use std::ops::Range;

use isoflop::draws::{below, unit};
use rand_chacha::ChaCha8Rng;

/// Bytes of a mutated file, at most.
const LARGEST: usize = 1 << 20;

/// Numbers at the ends of what types and readers hold.
const NUMBERS: [&str; 36] = [
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "0.0",
    "1e-320",
    "1e-30",
    "0.1",
    "3",
    "7",
    "64",
    "255",
    "1000",
    "65536",
    "1e5",
    "1e9",
    "2147483648",
    "4294967295",
    "4294967296",
    "1e15",
    "9007199254740993",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "-9223372036854775809",
    "1e18",
    "1e30",
    "1e300",
    "-1e300",
    "1.7976931348623157e308",
    "1e999",
    "NaN",
    "inf",
    "-inf",
];

/// What stands in files by accident, or by malice.
const ODD: [&str; 40] = [
    "",
    " ",
    "\t",
    "\n",
    "\r\n",
    "\r",
    "\u{0}",
    "\u{1b}[31m",
    "\u{7f}",
    "\u{85}",
    "\u{feff}",
    "\u{2028}",
    "\u{202e}",
    "é",
    "٣",
    "😀",
    "ß",
    "İ",
    "\"",
    "'",
    "`",
    ",",
    ";",
    ":",
    "#",
    "#1#2",
    "{",
    "}",
    "[",
    "]",
    "(",
    ")",
    "&a ",
    "*a",
    "!x ",
    "~",
    "null",
    "true",
    "../..",
    "%",
];

/// One to eight changes to one of the seeds.
pub fn text(seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = seeds[below(rng, seeds.len())].clone();
    for _ in 0..changes(rng) {
        change(&mut bytes, seeds, rng);
        bytes.truncate(LARGEST);
    }
    bytes
}

/// How many changes an input has: half of them one, few of them eight.
pub fn changes(rng: &mut ChaCha8Rng) -> usize {
    (1..8).find(|_| below(rng, 2) == 0).unwrap_or(8)
}

fn change(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) {
    match below(rng, 20) {
        0..=5 => replace(bytes, numbers, |rng| NUMBERS[below(rng, NUMBERS.len())].into(), rng),
        6 => replace(bytes, numbers, random_number, rng),
        7 | 8 => lines(bytes, rng),
        9 | 10 => {
            let word = of_another(seeds, words, rng);
            replace(bytes, words, |_| word, rng);
        }
        11 => replace(bytes, words, |_| Vec::new(), rng),
        12 => replace(bytes, words, |rng| ODD[below(rng, ODD.len())].into(), rng),
        13 => insert(bytes, ODD[below(rng, ODD.len())].as_bytes(), rng),
        14 => replace(bytes, words, long_word, rng),
        15 => {
            let to = below(rng, bytes.len() + 1);
            bytes.truncate(to);
        }
        16 => repeat(bytes, rng),
        17 => splice(bytes, &seeds[below(rng, seeds.len())], rng),
        _ => raw(bytes, rng),
    }
}

// Parts of a file: numbers, words, lines.

fn numbers(bytes: &[u8]) -> Vec<Range<usize>> {
    let is_part = |b: u8| b.is_ascii_digit() || b".-+".contains(&b);
    let mut found = runs(bytes, is_part);
    found.retain(|range| bytes[range.clone()].iter().any(u8::is_ascii_digit));
    found
}

fn words(bytes: &[u8]) -> Vec<Range<usize>> {
    runs(bytes, |b| b.is_ascii_alphanumeric() || b"_.-".contains(&b))
}

fn runs(bytes: &[u8], is_part: impl Fn(u8) -> bool) -> Vec<Range<usize>> {
    let (mut found, mut start) = (Vec::new(), None);
    for (at, byte) in bytes.iter().chain(b"\n").enumerate() {
        match (start, is_part(*byte)) {
            (None, true) => start = Some(at),
            (Some(from), false) => {
                found.push(from..at);
                start = None;
            }
            _ => {}
        }
    }
    found
}

/// Puts something in the place of a part.
fn replace(
    bytes: &mut Vec<u8>,
    parts: fn(&[u8]) -> Vec<Range<usize>>,
    new: impl FnOnce(&mut ChaCha8Rng) -> Vec<u8>,
    rng: &mut ChaCha8Rng,
) {
    let parts = parts(bytes);
    if !parts.is_empty() {
        let part = parts[below(rng, parts.len())].clone();
        bytes.splice(part, new(rng));
    }
}

fn of_another(
    seeds: &[Vec<u8>],
    parts: fn(&[u8]) -> Vec<Range<usize>>,
    rng: &mut ChaCha8Rng,
) -> Vec<u8> {
    let seed = &seeds[below(rng, seeds.len())];
    let parts = parts(seed);
    if parts.is_empty() {
        Vec::new()
    } else {
        seed[parts[below(rng, parts.len())].clone()].to_vec()
    }
}

fn random_number(rng: &mut ChaCha8Rng) -> Vec<u8> {
    let magnitude = 10f64.powf(40.0 * unit(rng) - 20.0);
    match below(rng, 3) {
        0 => format!("{}", small(rng, 40)),
        1 => format!("{magnitude:e}"),
        _ => format!("{}", -magnitude),
    }
    .into()
}

/// A whole number of so many bits at most, small ones as often as large ones.
fn small(rng: &mut ChaCha8Rng, bits: usize) -> usize {
    let most = 1 << below(rng, bits);
    1 + below(rng, most)
}

fn long_word(rng: &mut ChaCha8Rng) -> Vec<u8> {
    let letters = [b'a', b'9', b'_', b'-', b'(', b'[', b' ', 0xc3];
    vec![letters[below(rng, letters.len())]; 1 << below(rng, 17)]
}

/// Doubles, removes or moves lines.
fn lines(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
    let mut lines: Vec<Vec<u8>> =
        bytes.split_inclusive(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    if lines.is_empty() {
        return;
    }
    let (one, other) = (below(rng, lines.len()), below(rng, lines.len()));
    match below(rng, 4) {
        0 => lines.insert(other, lines[one].clone()),
        1 => drop(lines.remove(one)),
        2 => drop(lines.drain(one.min(other)..one.max(other))),
        _ => lines.swap(one, other),
    }
    *bytes = lines.concat();
}

// Bytes wherever they stand.

fn insert(bytes: &mut Vec<u8>, new: &[u8], rng: &mut ChaCha8Rng) {
    let at = below(rng, bytes.len() + 1);
    bytes.splice(at..at, new.iter().copied());
}

fn span(n: usize, rng: &mut ChaCha8Rng) -> Range<usize> {
    let from = below(rng, n + 1);
    from..(from + small(rng, 12)).min(n)
}

/// A part many times over.
fn repeat(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
    let part = bytes[span(bytes.len(), rng)].to_vec();
    let times = small(rng, 12).min(LARGEST / 4 / part.len().max(1));
    insert(bytes, &part.repeat(times), rng);
}

fn splice(bytes: &mut Vec<u8>, other: &[u8], rng: &mut ChaCha8Rng) {
    bytes.truncate(below(rng, bytes.len() + 1));
    bytes.extend(&other[below(rng, other.len() + 1)..]);
}

/// Whole numbers as machines write them.
const WHOLE: [u64; 12] =
    [0, 1, 2, 127, 128, 255, 1 << 16, (1 << 31) - 1, 1 << 31, u32::MAX as u64, 1 << 62, u64::MAX];

/// Bytes changed, put in, taken out, or overwritten by a whole number.
pub fn raw(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
    if bytes.is_empty() {
        return;
    }
    let at = below(rng, bytes.len());
    match below(rng, 4) {
        0 => bytes[at] ^= 1 << below(rng, 8),
        1 => bytes[at] = below(rng, 256) as u8,
        2 => drop(bytes.drain(span(bytes.len(), rng))),
        _ => {
            let (number, width) =
                (WHOLE[below(rng, WHOLE.len())].to_le_bytes(), [1, 2, 4, 8][below(rng, 4)]);
            let end = (at + width).min(bytes.len());
            bytes[at..end].copy_from_slice(&number[..end - at]);
        }
    }
}

/// Mostly bytes, and text where there is some: a file that is not of text.
pub fn binary(seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    if below(rng, 3) == 0 {
        return text(seeds, rng);
    }
    let mut bytes = seeds[below(rng, seeds.len())].clone();
    (0..changes(rng)).for_each(|_| raw(&mut bytes, rng));
    bytes
}
