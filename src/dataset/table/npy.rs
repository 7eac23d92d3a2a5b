//! Arrays in numpy's `.npy` format: plain numbers only, so nothing in a file is ever executed.

use super::TableError;

/// Longest header accepted, bytes; that of a plain array has about 128.
const MAX_HEADER_BYTES: usize = 1 << 16;

/// Most dimensions accepted, as in numpy.
const MAX_DIMENSIONS: usize = 64;

/// An array that has been recognised, with its data still as bytes.
#[derive(Debug)]
pub(super) struct Array<'a> {
    /// Length of each dimension; none for a single number.
    pub(super) shape: Vec<usize>,
    kind: Kind,
    big_endian: bool,
    fortran_order: bool,
    data: &'a [u8],
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    F32,
    F64,
    Signed(usize),
    Unsigned(usize),
}

impl Kind {
    fn size(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F64 => 8,
            Self::Signed(size) | Self::Unsigned(size) => size,
        }
    }
}

/// Reads the header of an array and checks that its data are there.
pub(super) fn parse_npy(bytes: &[u8]) -> Result<Array<'_>, TableError> {
    let not_npy = |reason: &str| TableError::NotNpy { reason: reason.to_owned() };
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or_else(|| not_npy("it does not begin as one"))?;
    let (length, rest) = match rest {
        [1, _, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, rest),
        [1..=3, ..] | [] => return Err(not_npy("it is truncated")),
        _ => return Err(not_npy("its version is unknown")),
    };
    if length > MAX_HEADER_BYTES {
        return Err(not_npy("its header is too long"));
    }
    let (header, data) = rest.split_at_checked(length).ok_or_else(|| not_npy("it is truncated"))?;
    let header = std::str::from_utf8(header).map_err(|_| not_npy("its header is not text"))?;
    let (descr, fortran_order, shape) =
        Header { rest: header }.parse().ok_or_else(|| not_npy("its header is not that of a plain array"))?;

    let dtype_error = || TableError::Dtype { found: crate::dataset::one_line(descr) };
    let (order, kind) = descr.split_at_checked(1).ok_or_else(dtype_error)?;
    let kind = match kind {
        "f4" => Kind::F32,
        "f8" => Kind::F64,
        "i1" | "i2" | "i4" | "i8" => Kind::Signed(usize::from(kind.as_bytes()[1] - b'0')),
        "u1" | "u2" | "u4" | "u8" => Kind::Unsigned(usize::from(kind.as_bytes()[1] - b'0')),
        _ => return Err(dtype_error()),
    };
    let big_endian = match order {
        "<" => false,
        ">" => true,
        "|" if kind.size() == 1 => false,
        "=" => cfg!(target_endian = "big"),
        _ => return Err(dtype_error()),
    };
    let expected = shape.iter().try_fold(kind.size(), |size, &length| size.checked_mul(length));
    match expected {
        Some(expected) if expected <= data.len() => {
            Ok(Array { shape, kind, big_endian, fortran_order, data: &data[..expected] })
        }
        _ => Err(TableError::Truncated { shape: super::shape_text(&shape), found: data.len() }),
    }
}

impl Array<'_> {
    /// The only number of an array that holds just one.
    pub(super) fn scalar(&self) -> Option<f64> {
        (self.data.len() == self.kind.size()).then(|| self.number(0))
    }

    /// The element at `row`, `column` of a two-dimensional array.
    pub(super) fn at(&self, row: usize, column: usize) -> f64 {
        let [rows, columns] = [self.shape[0], self.shape[1]];
        self.number(if self.fortran_order { column * rows + row } else { row * columns + column })
    }

    /// The element at an index of a three-dimensional array.
    pub(super) fn at_3(&self, [i, j, k]: [usize; 3]) -> f64 {
        let [a, b, c] = [self.shape[0], self.shape[1], self.shape[2]];
        self.number(if self.fortran_order { (k * b + j) * a + i } else { (i * b + j) * c + k })
    }

    fn number(&self, index: usize) -> f64 {
        let size = self.kind.size();
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(&self.data[index * size..][..size]);
        if self.big_endian {
            bytes[..size].reverse();
        }
        let unsigned = u64::from_le_bytes(bytes);
        match self.kind {
            Kind::F32 => f64::from(f32::from_bits(unsigned as u32)),
            Kind::F64 => f64::from_bits(unsigned),
            Kind::Unsigned(_) => unsigned as f64,
            // Shifting up and down again spreads the sign over the whole word.
            Kind::Signed(size) => {
                let unused_bits = 64 - 8 * size;
                ((unsigned << unused_bits).cast_signed() >> unused_bits) as f64
            }
        }
    }
}

/// The header: a Python dictionary with the keys `descr`, `fortran_order` and `shape`.
///
/// Read by hand: general readers of Python literals recurse, and a nested header would overflow their stack.
struct Header<'a> {
    rest: &'a str,
}

impl<'a> Header<'a> {
    fn parse(mut self) -> Option<(&'a str, bool, Vec<usize>)> {
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        self.expect("{")?;
        while !self.accept("}") {
            let key = self.string()?;
            self.expect(":")?;
            match key {
                "descr" => descr = Some(self.string()?),
                "fortran_order" if self.accept("True") => fortran_order = Some(true),
                "fortran_order" if self.accept("False") => fortran_order = Some(false),
                "shape" => shape = Some(self.tuple()?),
                _ => return None,
            }
            if !self.accept(",") {
                self.expect("}")?;
                break;
            }
        }
        self.rest.trim().is_empty().then_some(())?;
        Some((descr?, fortran_order?, shape?))
    }

    fn accept(&mut self, token: &str) -> bool {
        let rest = self.rest.trim_start().strip_prefix(token);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn expect(&mut self, token: &str) -> Option<()> {
        self.accept(token).then_some(())
    }

    fn string(&mut self) -> Option<&'a str> {
        let quote = if self.accept("'") { '\'' } else { self.accept("\"").then_some('"')? };
        let (text, rest) = self.rest.split_once(quote)?;
        self.rest = rest;
        Some(text)
    }

    fn tuple(&mut self) -> Option<Vec<usize>> {
        let mut lengths = Vec::new();
        self.expect("(")?;
        while !self.accept(")") {
            let text = self.rest.trim_start();
            let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
            lengths.push(text[..end].parse().ok()?);
            self.rest = text[end..].strip_prefix('L').unwrap_or(&text[end..]);
            if lengths.len() > MAX_DIMENSIONS {
                return None;
            }
            if !self.accept(",") {
                self.expect(")")?;
                break;
            }
        }
        Some(lengths)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A version 1 file.
    pub(crate) fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn header(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}      \n")
    }

    fn table(bytes: &[u8]) -> Vec<Vec<f64>> {
        let array = parse_npy(bytes).unwrap();
        (0..array.shape[0])
            .map(|row| (0..array.shape[1]).map(|column| array.at(row, column)).collect())
            .collect()
    }

    #[test]
    fn every_layout_of_numbers_gives_the_same_table() {
        let expected = vec![vec![1.0, -2.0, 3.0], vec![4.0, 5.0, -6.0]];
        let rows = [1.0_f32, -2.0, 3.0, 4.0, 5.0, -6.0];
        let columns = [1.0_f32, 4.0, -2.0, 5.0, 3.0, -6.0];
        let little = rows.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
        let big = rows.iter().flat_map(|x| f64::from(*x).to_be_bytes()).collect::<Vec<_>>();
        let fortran = columns.iter().flat_map(|x| f64::from(*x).to_le_bytes()).collect::<Vec<_>>();
        let small = rows.iter().map(|x| (*x as i8).cast_unsigned()).collect::<Vec<_>>();
        let short = rows.iter().flat_map(|x| (*x as i16).to_be_bytes()).collect::<Vec<_>>();
        for (descr, order, data) in [
            ("<f4", "False", little),
            (">f8", "False", big),
            ("<f8", "True", fortran),
            ("|i1", "False", small),
            (">i2", "False", short),
        ] {
            assert_eq!(table(&npy(&header(descr, order, "(2, 3)"), &data)), expected, "{descr}");
        }
    }

    #[test]
    fn a_single_number_is_a_scalar() {
        for shape in ["()", "(1,)", "(1, 1)"] {
            let bytes = npy(&header("<i8", "False", shape), &30_i64.to_le_bytes());
            assert_eq!(parse_npy(&bytes).unwrap().scalar(), Some(30.0));
        }
    }

    #[test]
    fn what_is_not_a_plain_array_is_refused() {
        let data = [0; 64];
        for (bytes, reason) in [
            (npy(&header("|O", "False", "(2, 2)"), &data), "\"|O\""),
            (npy(&header("<c16", "False", "(2, 2)"), &data), "\"<c16\""),
            (npy(&header("<f2", "False", "(2, 2)"), &data), "\"<f2\""),
            (npy(&header("", "False", "(2, 2)"), &data), "\"\""),
            (npy("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (2,)}", &data), "plain array"),
            (npy(&header("<f8", "False", "(2, -2)"), &data), "plain array"),
            (npy(&header("<f8", "False", "(99999999999999999999,)"), &data), "plain array"),
            (npy(&header("<f8", "Maybe", "(2, 2)"), &data), "plain array"),
            (npy(&"(".repeat(60_000), &data), "plain array"),
            (npy(&header("<f8", "False", &format!("({})", "1,".repeat(20_000))), &data), "plain array"),
            (npy(&header("<f8", "False", "(9, 9)"), &data), "9 x 9"),
            (npy(&header("<f8", "False", "(4611686018427387904, 4611686018427387904)"), &data), "holds"),
            (b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "too long"),
            (b"\x93NUMPY\x01\x00\xff".to_vec(), "truncated"),
            (b"\x93NUMPY\x09\x00\xff\x00".to_vec(), "version"),
            (b"\x80\x04pickle".to_vec(), "begin"),
            (Vec::new(), "begin"),
        ] {
            let message = parse_npy(&bytes).unwrap_err().to_string();
            assert!(message.contains(reason), "{message} should contain {reason}");
        }
    }
}
