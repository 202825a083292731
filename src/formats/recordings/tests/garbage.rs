//! What is no recording is refused, and nothing panics.

use super::*;

use proptest::prelude::*;
use std::io::Cursor;

fn parse(bytes: Vec<u8>) {
    let options = ReadOptions::default();
    if let Ok(raw) = text::parse("a.csv", Box::new(Cursor::new(bytes)), &options) {
        let _ = Prepared::new(raw, &options).map(|(prepared, _)| prepared.recordings());
    }
}

proptest! {
    #[test]
    fn never_panics_on_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        parse(bytes);
    }

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
        parse(bytes);
    }
}
