//! Checks the footer of a Parquet file and the headers of its columns' pages before polars decodes them.
//!
//! Polars sizes its buffers by the counts that they give. A damaged count asks for exabytes, and an
//! allocation that fails ends the process: no panic that could be caught. So the lists of the footer
//! are walked here to their ends, and the counts of the headers are checked against it. Both are structs
//! in Thrift's compact protocol; all of their fields are read, but only whole numbers are kept.

/// Structs, lists and maps within each other that a footer may hold.
const MAX_DEPTH: usize = 16;
/// The length of the footer and the mark, at the end of a file.
const TAIL: usize = 8;

/// Checks that the footer of a whole file has the length that it says, so that no list in it holds more
/// than its bytes.
pub(super) fn check_footer(file: &[u8]) -> Result<(), &'static str> {
    let footer = footer(file).ok_or("the footer goes beyond the file")?;
    let mut reader = Compact { bytes: footer, at: 0 };
    let walked = reader.read_struct(0, &mut |_, _, _| ());
    match walked.filter(|()| reader.at == footer.len()) {
        Some(()) => Ok(()),
        None => Err("the footer is not readable"),
    }
}

fn footer(file: &[u8]) -> Option<&[u8]> {
    let end = file.len().checked_sub(TAIL)?;
    let length = u32::from_le_bytes(*file[end..].first_chunk()?);
    file.get(end.checked_sub(usize::try_from(length).ok()?)?..end)
}

/// Bytes of a page at most, before compression; writers make pages of about 1 MB.
const MAX_PAGE: i64 = 1 << 28;
/// How often a page can hold its compressed bytes: the runs of Zstandard hold 128 KiB in 4 bytes.
const MAX_EXPANSION: i64 = 1 << 15;

/// The counts of a page header, by the ids of `parquet.thrift`; -1 if it has none.
#[derive(Debug, PartialEq)]
struct Header {
    /// `type`: 0 and 3 for data, 2 for a dictionary.
    kind: i64,
    uncompressed_page_size: i64,
    compressed_page_size: i64,
    num_values: i64,
}

/// Checks the pages that begin with `bytes` and hold `num_values` values in all.
pub(super) fn check_pages(mut bytes: &[u8], num_values: i64) -> Result<(), &'static str> {
    let mut seen = 0;
    while seen < num_values {
        let (header, length) = header(bytes).ok_or("a page header is not readable")?;
        if !matches!(header.kind, 0 | 2 | 3) {
            return Err("a page is of an unknown type");
        }
        let (size, compressed) = (header.uncompressed_page_size, header.compressed_page_size);
        let most = MAX_PAGE.min(MAX_EXPANSION.saturating_mul(compressed));
        if compressed < 0 || !(0..=most).contains(&size) {
            return Err("a page has an impossible size");
        }
        if !(0..=num_values).contains(&header.num_values) {
            return Err("a page holds more values than its column");
        }
        seen += if header.kind == 2 { 0 } else { header.num_values };
        let end = length.saturating_add(compressed as usize);
        bytes = bytes.get(end..).ok_or("a page goes beyond the end of the file")?;
    }
    if seen == num_values { Ok(()) } else { Err("the pages hold more values than their column") }
}

fn header(bytes: &[u8]) -> Option<(Header, usize)> {
    let mut reader = Compact { bytes, at: 0 };
    let mut header =
        Header { kind: -1, uncompressed_page_size: -1, compressed_page_size: -1, num_values: -1 };
    let mut is_typed = true;
    reader.read_struct(0, &mut |path, kind, value| {
        is_typed &= type_of(path).is_none_or(|own| own == kind);
        match path {
            [1] => header.kind = value,
            [2] => header.uncompressed_page_size = value,
            [3] => header.compressed_page_size = value,
            // Of a data page, a dictionary page and a data page of version 2.
            [5 | 7 | 8, 1] => header.num_values = value,
            _ => (),
        }
    })?;
    is_typed.then_some((header, reader.at))
}

// Types of fields in Thrift's compact protocol.
const BOOL: u8 = 1;
const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const STRUCT: u8 = 12;

/// The type of a field of a page header, by `parquet.thrift`; polars reads the field by it, whatever the file says.
fn type_of(path: &[i64]) -> Option<u8> {
    match path {
        [1..=4] | [5, 1..=4] | [7, 1..=2] | [8, 1..=6] => Some(I32),
        [7, 3] | [8, 7] => Some(BOOL),
        [5..=8] | [5, 5] | [8, 8] => Some(STRUCT),
        // Statistics of a data page.
        [5, 5, field] | [8, 8, field] => match field {
            1 | 2 | 5 | 6 => Some(BINARY),
            3 | 4 => Some(I64),
            7 | 8 => Some(BOOL),
            _ => None,
        },
        _ => None,
    }
}

/// A reader of Thrift's compact protocol; none at the first byte that does not fit.
struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// Called with the ids of the fields down to a field, its type, and its value if that is a whole number, or 0.
type Seen<'s> = &'s mut dyn FnMut(&[i64], u8, i64);

impl Compact<'_> {
    fn byte(&mut self) -> Option<u8> {
        self.at += 1;
        self.bytes.get(self.at - 1).copied()
    }

    fn skip(&mut self, count: u64) -> Option<()> {
        self.at = self.at.checked_add(usize::try_from(count).ok()?)?;
        (self.at <= self.bytes.len()).then_some(())
    }

    /// Seven bits a byte, the lowest first.
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    /// A signed number: 0, −1, 1, −2, … are 0, 1, 2, 3, …
    fn zigzag(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn read_struct(&mut self, depth: usize, seen: Seen) -> Option<()> {
        let mut id = 0i64;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            let step = i64::from(head >> 4);
            id = if step == 0 { self.zigzag()? } else { id.checked_add(step)? };
            self.value(head & 0x0f, depth, &mut |path, kind, value| {
                seen(&[&[id], path].concat(), kind, value);
            })?;
        }
    }

    fn value(&mut self, kind: u8, depth: usize, seen: Seen) -> Option<()> {
        let number = if matches!(kind, 4..=6) { self.zigzag()? } else { 0 };
        // Of a boolean the type is the value.
        seen(&[], if kind == 2 { BOOL } else { kind }, number);
        match kind {
            1 | 2 | 4..=6 => Some(()),
            3 => self.skip(1),
            7 => self.skip(8),
            8 => {
                let length = self.varint()?;
                self.skip(length)
            }
            9 | 10 if depth < MAX_DEPTH => self.list(depth + 1),
            12 if depth < MAX_DEPTH => self.read_struct(depth + 1, seen),
            _ => None,
        }
    }

    /// The elements of a list or set; a boolean takes a byte there.
    fn list(&mut self, depth: usize) -> Option<()> {
        let head = self.byte()?;
        let long = head >> 4 == 15;
        let count = if long { self.varint()? } else { u64::from(head >> 4) };
        for _ in 0..count {
            match head & 0x0f {
                1 | 2 => self.skip(1)?,
                kind => self.value(kind, depth, &mut |_, _, _| ())?,
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A data page of 5 values in 3 bytes: type 0, sizes 3 and 3, five.num_values 5.
    const PAGE: [u8; 14] = [0x15, 0, 0x15, 6, 0x15, 6, 0x2c, 0x15, 10, 0, 0, 7, 7, 7];

    #[test]
    fn a_footer_is_as_long_as_its_lists() {
        // Field 2, a list of structs: so many as the first byte of the list says, each of no field.
        let file = |list: &[u8]| {
            let footer = [&[0x29], list, &[0]].concat();
            let length = (footer.len() as u32).to_le_bytes();
            [b"PAR1", &footer[..], &length, b"PAR1"].concat()
        };
        assert_eq!(check_footer(&file(&[0x2c, 0, 0])), Ok(()));
        assert!(check_footer(&file(&[0x3c, 0, 0])).is_err(), "a list of three");
        let billions = [0xfc, 0xff, 0xff, 0xff, 0xff, 0x0f, 0, 0];
        assert_eq!(check_footer(&file(&billions)), Err("the footer is not readable"));
        assert_eq!(check_footer(&file(&[0x2c, 0, 0])[5..]), Err("the footer goes beyond the file"));
        assert!(check_footer(b"PAR1PAR1").is_err());
    }

    #[test]
    fn a_header_is_read_by_its_field_ids() {
        let expected =
            Header { kind: 0, uncompressed_page_size: 3, compressed_page_size: 3, num_values: 5 };
        assert_eq!(header(&PAGE), Some((expected, 11)));
        assert_eq!(header(&PAGE[..10]), None);
        for (at, other) in [(0, 0x16), (7, 0x16)] {
            let mut page = PAGE;
            page[at] = other;
            assert_eq!(header(&page), None, "field {at} of another type");
        }
    }

    #[test]
    fn pages_hold_what_their_column_says() {
        assert_eq!(check_pages(&PAGE, 5), Ok(()));
        assert_eq!(check_pages(&[PAGE, PAGE].concat(), 10), Ok(()));
        assert!(check_pages(&PAGE, 4).unwrap_err().contains("more values"));
        assert!(check_pages(&PAGE, 6).unwrap_err().contains("not readable"));
        assert!(check_pages(&PAGE[..13], 5).unwrap_err().contains("beyond the end"));
    }

    #[test]
    fn a_negative_count_or_size_is_refused() {
        let with = |at: usize, byte: u8| {
            let mut page = PAGE;
            page[at] = byte;
            check_pages(&page, 5)
        };
        assert!(with(8, 1).unwrap_err().contains("more values"));
        assert!(with(5, 1).unwrap_err().contains("impossible size"));
        assert!(check_pages(&[0; 9], 5).unwrap_err().contains("unknown type"), "an empty header");
        let of_sizes = |uncompressed: &[u8]| {
            check_pages(&[&PAGE[..3], uncompressed, &PAGE[4..]].concat(), 5).map_err(String::from)
        };
        assert_eq!(of_sizes(&[0x80, 0x80, 0x0c]), Ok(()), "3 times 2^15");
        assert!(of_sizes(&[0x82, 0x80, 0x0c]).unwrap_err().contains("impossible size"));
    }
}
