//! What is no recording is refused, and nothing panics.

use super::*;

use proptest::prelude::*;

fn parse(bytes: &[u8]) {
    let options = ReadOptions::default();
    let text = String::from_utf8_lossy(bytes);
    if let Ok(raw) = table::parse("a.csv", &text, &DICTIONARY) {
        let _ = recordings(raw, &options);
    }
}

proptest! {
    /// Sound files with some bytes overwritten, among them the dangerous ones.
    #[test]
    fn never_panics_on_damage(
        damage in prop::collection::vec((0usize..300, prop::sample::select(&b"\"\n\r,;\t-e9.#/\0\xff "[..])), 1..8),
    ) {
        let mut bytes = sound(20).join("\n").into_bytes();
        let n = bytes.len();
        for (at, byte) in damage {
            bytes[at % n] = byte;
        }
        parse(&bytes);
    }
}
