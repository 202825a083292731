//! The bytes of a text table, made plain for its reader: blanks that align its columns, a last line that does not end.

use std::cell::Cell;
use std::io::{Read, Result};
use std::rc::Rc;

/// Where the bytes of a file end in a line that does not, once they are all read.
pub(super) type OpenAt = Rc<Cell<Option<u64>>>;

/// The bytes, with a line end after a last line that has none.
pub(super) struct Ended<R> {
    inner: R,
    read: u64,
    last: u8,
    open_at: OpenAt,
}

impl<R: Read> Ended<R> {
    pub(super) fn new(inner: R) -> (Self, OpenAt) {
        let open_at = OpenAt::default();
        (Self { inner, read: 0, last: b'\n', open_at: Rc::clone(&open_at) }, open_at)
    }
}

impl<R: Read> Read for Ended<R> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let count = self.inner.read(buffer)?;
        if count > 0 {
            self.read += count as u64;
            self.last = buffer[count - 1];
            return Ok(count);
        }
        if b"\r\n".contains(&self.last) {
            return Ok(0);
        }
        self.open_at.set(Some(self.read));
        self.last = b'\n';
        buffer[0] = b'\n';
        Ok(1)
    }
}

/// The bytes with one blank for several, and none at the beginning of a line.
pub(super) struct Blanks<R> {
    inner: R,
    /// Whether a blank may follow.
    inside: bool,
}

impl<R> Blanks<R> {
    pub(super) const fn new(inner: R) -> Self {
        Self { inner, inside: false }
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
    fn a_line_that_does_not_end_is_ended_and_told() {
        for (text, expected, open) in
            [("a\nb", "a\nb\n", Some(3)), ("a\n", "a\n", None), ("a\r\n", "a\r\n", None), ("", "", None)]
        {
            let (reader, open_at) = Ended::new(text.as_bytes());
            assert_eq!((all(reader).as_str(), open_at.get()), (expected, open));
        }
    }

    #[test]
    fn one_blank_for_several_wherever_the_bytes_are_cut() {
        let text: &[u8] = b"  a   b \r\n c  d\n\n";
        for cut in 0..text.len() {
            assert_eq!(all(Blanks::new(text[..cut].chain(&text[cut..]))), "a b \r\nc d\n\n");
        }
    }
}
