//! Common Data Representation: how ROS 2 lays a message out in bytes.
//!
//! Plain CDR version 1, little endian: a four-byte header, then the fields one after another, each number aligned to its
//! own size counted from the end of that header (OMG DDS-RTPS, section 10, and the CDR rules of CORBA 3.3, section 9.3).

/// Bytes before the first field: representation "plain CDR, little endian" and no options.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Writes the fields of one message in order.
#[derive(Debug)]
pub(super) struct CdrWriter {
    bytes: Vec<u8>,
}

impl CdrWriter {
    pub(super) fn new() -> Self {
        Self { bytes: ENCAPSULATION.to_vec() }
    }

    /// The message, encapsulation header included.
    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    fn number<const SIZE: usize>(&mut self, little_endian: [u8; SIZE]) -> &mut Self {
        let body = self.bytes.len() - ENCAPSULATION.len();
        let padded = ENCAPSULATION.len() + body.next_multiple_of(SIZE);
        self.bytes.resize(padded, 0);
        self.bytes.extend(little_endian);
        self
    }

    pub(super) fn u8(&mut self, value: u8) -> &mut Self {
        self.number([value])
    }

    pub(super) fn bool(&mut self, value: bool) -> &mut Self {
        self.u8(u8::from(value))
    }

    pub(super) fn i32(&mut self, value: i32) -> &mut Self {
        self.number(value.to_le_bytes())
    }

    pub(super) fn u32(&mut self, value: u32) -> &mut Self {
        self.number(value.to_le_bytes())
    }

    pub(super) fn f64(&mut self, value: f64) -> &mut Self {
        self.number(value.to_le_bytes())
    }

    /// Number of elements of the sequence that follows.
    pub(super) fn len(&mut self, len: usize) -> &mut Self {
        self.u32(len as u32)
    }

    /// Length with the terminating zero, the bytes, the zero.
    pub(super) fn string(&mut self, text: &str) -> &mut Self {
        self.len(text.len() + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
        self
    }

    pub(super) fn strings<'a>(&mut self, texts: impl ExactSizeIterator<Item = &'a str>) -> &mut Self {
        self.len(texts.len());
        for text in texts {
            self.string(text);
        }
        self
    }

    pub(super) fn f64s(&mut self, values: &[f64]) -> &mut Self {
        self.len(values.len());
        for value in values {
            self.f64(*value);
        }
        self
    }

    /// A sequence of bytes.
    pub(super) fn blob(&mut self, bytes: &[u8]) -> &mut Self {
        self.len(bytes.len());
        self.bytes.extend(bytes);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aligns_each_number_to_its_own_size_after_the_header() {
        let mut cdr = CdrWriter::new();
        cdr.u8(7).u32(1).string("ab").f64(1.0).bool(true).i32(-2);
        #[rustfmt::skip]
        let expected = [
            0, 1, 0, 0,
            7, 0, 0, 0,
            1, 0, 0, 0,
            3, 0, 0, 0, b'a', b'b', 0,
            0, // 15 bytes so far; the double starts at 16
            0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
            1, 0, 0, 0,
            0xfe, 0xff, 0xff, 0xff,
        ];
        assert_eq!(cdr.into_bytes(), expected);
    }

    #[test]
    fn counts_the_elements_of_sequences() {
        let mut cdr = CdrWriter::new();
        cdr.strings(["a"].into_iter()).f64s(&[]).blob(&[9, 8]);
        let expected = [0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 9, 8];
        assert_eq!(cdr.into_bytes(), expected);
    }
}
