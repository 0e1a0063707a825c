//! Metrics of a TrueType file; offsets are those of Apple's and Microsoft's OpenType specification.

use std::collections::BTreeMap;

/// A glyph's place in its font, and its widths in ems.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Glyph {
    pub id: u16,
    /// From its pen to that of the next glyph.
    pub advance: f64,
    /// From its pen to its left edge.
    pub side_bearing: f64,
}

/// Lengths of a whole face, in ems.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metrics {
    pub ascender: f64,
    /// Below the baseline, so negative.
    pub descender: f64,
    /// Left, bottom, right and top of the box around all glyphs.
    pub bounds: [f64; 4],
}

/// A TrueType file.
#[derive(Clone, Copy)]
pub struct TrueType(&'static [u8]);

impl TrueType {
    /// The bytes of a font that is known to be sound: one in the binary.
    pub fn new(bytes: &'static [u8]) -> Self {
        Self(bytes)
    }

    pub fn metrics(self) -> Metrics {
        let (head, hhea) = (self.table(b"head"), self.table(b"hhea"));
        Metrics {
            ascender: self.ems(hhea + 4),
            descender: self.ems(hhea + 6),
            bounds: [36, 38, 40, 42].map(|at| self.ems(head + at)),
        }
    }

    /// The glyph of each character of the basic plane.
    pub fn glyphs(self) -> BTreeMap<char, Glyph> {
        self.characters().into_iter().map(|(character, id)| (character, self.glyph(id))).collect()
    }

    /// A length in ems.
    fn ems(self, at: usize) -> f64 {
        f64::from(self.i16(at)) / f64::from(self.u16(self.table(b"head") + 18))
    }

    fn u16(self, at: usize) -> u16 {
        u16::from_be_bytes([self.0[at], self.0[at + 1]])
    }

    fn i16(self, at: usize) -> i16 {
        self.u16(at) as i16
    }

    fn u32(self, at: usize) -> usize {
        (usize::from(self.u16(at)) << 16) | usize::from(self.u16(at + 2))
    }

    /// Where a table begins.
    fn table(self, tag: &[u8; 4]) -> usize {
        (0..usize::from(self.u16(4)))
            .map(|i| 12 + 16 * i)
            .find(|&entry| &self.0[entry..entry + 4] == tag)
            .map(|entry| self.u32(entry + 8))
            .expect("the bundled font has the tables that TrueType requires")
    }

    /// `hmtx`: pairs of advance and bearing, then bearings alone, whose advance is that of the last pair.
    fn glyph(self, id: u16) -> Glyph {
        let last_pair = self.u16(self.table(b"hhea") + 34) - 1;
        let hmtx = self.table(b"hmtx");
        let pair = hmtx + 4 * usize::from(id.min(last_pair));
        let bearing = match id.checked_sub(last_pair + 1) {
            None => pair + 2,
            Some(beyond) => hmtx + 4 * (usize::from(last_pair) + 1) + 2 * usize::from(beyond),
        };
        Glyph { id, advance: self.ems(pair), side_bearing: self.ems(bearing) }
    }

    /// `cmap` format 4 of Windows' Unicode encoding: each character with its glyph.
    fn characters(self) -> Vec<(char, u16)> {
        let sub = self.unicode_subtable();
        let twice_segments = usize::from(self.u16(sub + 6));
        (0..twice_segments).step_by(2).flat_map(|i| self.segment(sub, twice_segments, i)).collect()
    }

    fn unicode_subtable(self) -> usize {
        let cmap = self.table(b"cmap");
        (0..usize::from(self.u16(cmap + 2)))
            .map(|i| cmap + 4 + 8 * i)
            .find(|&entry| (self.u16(entry), self.u16(entry + 2)) == (3, 1))
            .map(|entry| cmap + self.u32(entry + 4))
            .expect("the bundled font has a Unicode character map")
    }

    fn segment(self, sub: usize, twice_segments: usize, i: usize) -> Vec<(char, u16)> {
        let end_at = sub + 14 + i;
        let start_at = end_at + twice_segments + 2;
        let delta_at = start_at + twice_segments;
        let range_at = delta_at + twice_segments;
        let (start, range) = (self.u16(start_at), usize::from(self.u16(range_at)));
        let glyph = |code: u16| match range {
            0 => code.wrapping_add(self.u16(delta_at)),
            _ => self.u16(range_at + range + 2 * usize::from(code - start)),
        };
        (start..=self.u16(end_at))
            .filter(|&code| code != u16::MAX)
            .filter_map(|code| Some((char::from_u32(u32::from(code))?, glyph(code))))
            .collect()
    }
}
