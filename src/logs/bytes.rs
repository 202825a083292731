//! Numbers within the bytes of a message.

/// Bytes of a message, read in order; `None` beyond their end.
#[derive(Clone, Copy)]
pub(crate) struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
    is_big_endian: bool,
    /// Numbers are aligned to their own size, at most to so many bytes.
    alignment: usize,
}

impl<'a> Bytes<'a> {
    pub(crate) const fn little(all: &'a [u8]) -> Self {
        Self::new(all, false, 1)
    }

    pub(crate) const fn new(all: &'a [u8], is_big_endian: bool, alignment: usize) -> Self {
        Self {
            all,
            at: 0,
            is_big_endian,
            alignment,
        }
    }

    pub(crate) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.all.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = self.at.next_multiple_of(N.min(self.alignment));
        let mut bytes = *self.take(N)?.first_chunk::<N>()?;
        if self.is_big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.number().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.number().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub(crate) fn i32(&mut self) -> Option<i32> {
        self.number().map(i32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.number().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    pub(crate) fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Some(values)
    }

    /// A string behind its length.
    pub(crate) fn string(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.take(length as usize)
    }
}

/// Text of a name in a file.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Types of numbers, with their bytes.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Number {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Number {
    pub(crate) const fn size(self) -> usize {
        let (Self::Signed(size) | Self::Unsigned(size) | Self::Float(size)) = self;
        size
    }

    pub(crate) fn read(self, bytes: &mut Bytes<'_>) -> Option<f64> {
        Some(match self {
            Self::Signed(1) => bytes.u8()?.cast_signed().into(),
            Self::Signed(2) => bytes.u16()?.cast_signed().into(),
            Self::Signed(4) => bytes.i32()?.into(),
            Self::Signed(_) => bytes.u64()?.cast_signed() as f64,
            Self::Unsigned(1) => bytes.u8()?.into(),
            Self::Unsigned(2) => bytes.u16()?.into(),
            Self::Unsigned(4) => bytes.u32()?.into(),
            Self::Unsigned(_) => bytes.u64()? as f64,
            Self::Float(4) => f32::from_bits(bytes.u32()?).into(),
            Self::Float(_) => bytes.f64()?,
        })
    }
}
