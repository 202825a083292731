//! The bytes of a table whose columns are aligned by blanks.

use std::io::{Read, Result};

/// The bytes with one blank for several, and none at the beginning of a line.
pub(super) struct Blanks<R> {
    inner: R,
    /// Whether a blank may follow.
    inside: bool,
}

impl<R> Blanks<R> {
    pub(super) const fn new(inner: R) -> Self {
        Self {
            inner,
            inside: false,
        }
    }
}

impl<R: Read> Read for Blanks<R> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        loop {
            let count = self.inner.read(buffer)?;
            let mut kept = 0;
            for i in 0..count {
                let byte = buffer[i];
                if byte != b' ' || self.inside {
                    buffer[kept] = byte;
                    kept += 1;
                }
                self.inside = !b" \r\n".contains(&byte);
            }
            // Blanks alone are not the end.
            if kept > 0 || count == 0 {
                return Ok(kept);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(mut reader: impl Read) -> String {
        let mut text = String::new();
        reader.read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn one_blank_for_several_wherever_the_bytes_are_cut() {
        let text: &[u8] = b"  a   b \r\n c  d\n\n";
        for cut in 0..text.len() {
            assert_eq!(
                all(Blanks::new(text[..cut].chain(&text[cut..]))),
                "a b \r\nc d\n\n"
            );
        }
    }
}
