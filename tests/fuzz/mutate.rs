//! Changes of files as accidents and editors make them, from a seed.

use rand::{Rng, RngExt};

/// Bytes and words that mean something to a reader.
const WORDS: [&[u8]; 30] = [
    b"0",
    b"-1",
    b"-0",
    b"1e308",
    b"-1e-320",
    b"1e999",
    b"nan",
    b"inf",
    b"18446744073709551616",
    b"9223372036854775807",
    b"4294967295",
    b"2147483648",
    b"\n",
    b"\r\n",
    b",",
    b";",
    b"\t",
    b"\"",
    b"'",
    b"[",
    b"]",
    b"{",
    b"}",
    b"=",
    b"#",
    b"\0",
    b"\xff\xff\xff\xff",
    b"\xef\xbb\xbf",
    b"\xe2\x80\xae",
    b"null",
];

/// One to four changes of a file; `other` is a file of the same kind.
pub(super) fn changed(file: &[u8], other: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..random.random_range(1..=4) {
        change(&mut bytes, other, random);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    let at = random.random_range(0..=bytes.len());
    let some = |length: usize, random: &mut _| part(length, random);
    match random.random_range(0..9) {
        0 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
        1 if at < bytes.len() => bytes[at] = random.random(),
        2 => bytes.truncate(at),
        3 => {
            let (from, to) = some(bytes.len(), random);
            bytes.drain(from..to);
        }
        4 => {
            let (from, to) = some(bytes.len(), random);
            let piece = bytes[from..to].to_vec();
            _ = bytes.splice(at..at, piece);
        }
        5 => {
            let (from, to) = some(other.len(), random);
            _ = bytes.splice(at..at, other[from..to].iter().copied());
        }
        6 => number(bytes, at, random),
        7 => {
            let word = WORDS[random.random_range(0..WORDS.len())];
            let end = (at + word.len()).min(bytes.len());
            _ = bytes.splice(at..end, word.iter().copied());
        }
        _ => {
            let word = WORDS[random.random_range(0..WORDS.len())];
            _ = bytes.splice(at..at, word.iter().copied());
        }
    }
}

/// A short part, sometimes a long one.
fn part(length: usize, random: &mut impl Rng) -> (usize, usize) {
    let from = random.random_range(0..=length);
    let most = if random.random_range(0..4) == 0 {
        length
    } else {
        40
    };
    (from, (from + random.random_range(0..=most)).min(length))
}

/// Another number in the place of the next one.
fn number(bytes: &mut Vec<u8>, at: usize, random: &mut impl Rng) {
    let is_of_number = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e');
    let Some(from) = bytes[at..]
        .iter()
        .position(u8::is_ascii_digit)
        .map(|k| at + k)
    else {
        return;
    };
    let to = bytes[from..]
        .iter()
        .position(|b| !is_of_number(b))
        .map_or(bytes.len(), |k| from + k);
    let word = WORDS[random.random_range(0..12)];
    _ = bytes.splice(from..to, word.iter().copied());
}
