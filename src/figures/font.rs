//! The one typeface of the figures: DejaVu Sans, carried in the binary.
//!
//! plotters measures and rasterises the glyphs. It draws each glyph from its own left edge and
//! drops the side bearing, so the bearings are read here, from the font's `cmap` and `hmtx`.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use plotters::style::{FontDesc, FontFamily, FontStyle, register_font};

/// The CSS family written into an SVG; the first name is the face that the layout measured.
pub const FAMILY: &str = "DejaVu Sans, sans-serif";

/// Size at which strings are measured, so that plotters' whole pixels are fine enough.
const MEASURE_EM: f64 = 2048.0;

/// A face of the family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    Normal,
    Bold,
}

impl Weight {
    pub fn style(self) -> FontStyle {
        match self {
            Weight::Normal => FontStyle::Normal,
            Weight::Bold => FontStyle::Bold,
        }
    }

    fn face(self) -> &'static Face {
        static FACES: OnceLock<[Face; 2]> = OnceLock::new();
        let faces = FACES.get_or_init(|| {
            [(Weight::Normal, dejavu::sans::regular()), (Weight::Bold, dejavu::sans::bold())]
                .map(|(weight, bytes)| Face::register(weight, bytes))
        });
        &faces[self as usize]
    }
}

/// plotters' font at `em` pixels; plotters counts a font's size from ascender to descender.
pub fn font(weight: Weight, em: f64) -> FontDesc<'static> {
    let size = em * weight.face().line_per_em;
    FontDesc::new(FontFamily::Name(FAMILY), size, weight.style())
}

/// Width of a line of text, in the unit of `em`.
pub fn measure(text: &str, weight: Weight, em: f64) -> f64 {
    let layout = font(weight, MEASURE_EM).layout_box(text);
    let ((left, _), (right, _)) = layout.expect("the bundled font is registered");
    f64::from(right - left) * em / MEASURE_EM
}

/// Distance from the pen to the left edge of a glyph, in the unit of `em`.
pub fn side_bearing(glyph: char, weight: Weight, em: f64) -> f64 {
    weight.face().side_bearings.get(&glyph).copied().unwrap_or(0.0) * em
}

/// Breaks a text at spaces into lines no wider than `width`.
pub fn wrap(text: &str, weight: Weight, em: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if measure(&format!("{line} {word}"), weight, em) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// What plotters does not tell about a TrueType face.
struct Face {
    /// Ascender minus descender, in ems.
    line_per_em: f64,
    /// In ems, for the characters of the basic plane.
    side_bearings: BTreeMap<char, f64>,
}

impl Face {
    fn register(weight: Weight, bytes: &'static [u8]) -> Face {
        let registered = register_font(FAMILY, weight.style(), bytes);
        assert!(registered.is_ok(), "the bundled DejaVu Sans is a valid font");
        Face::read(TrueType(bytes))
    }

    fn read(font: TrueType) -> Face {
        let (head, hhea) = (font.table(b"head"), font.table(b"hhea"));
        let units_per_em = f64::from(font.u16(head + 18));
        let line = f64::from(font.i16(hhea + 4)) - f64::from(font.i16(hhea + 6));
        let bearing = |glyph| f64::from(font.side_bearing(glyph)) / units_per_em;
        let side_bearings =
            font.characters().into_iter().map(|(c, glyph)| (c, bearing(glyph))).collect();
        Face { line_per_em: line / units_per_em, side_bearings }
    }
}

/// A TrueType file; offsets are those of Apple's and Microsoft's OpenType specification.
#[derive(Clone, Copy)]
struct TrueType(&'static [u8]);

impl TrueType {
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

    /// `hmtx`: pairs of advance and bearing, then bearings alone.
    fn side_bearing(self, glyph: u16) -> i16 {
        let pairs = usize::from(self.u16(self.table(b"hhea") + 34));
        let (hmtx, glyph) = (self.table(b"hmtx"), usize::from(glyph));
        let beyond = glyph.saturating_sub(pairs - 1);
        if beyond == 0 {
            self.i16(hmtx + 4 * glyph + 2)
        } else {
            self.i16(hmtx + 4 * pairs + 2 * (beyond - 1))
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn side_bearings_are_those_of_the_face() {
        // As fontTools reads DejaVuSans.ttf 2.37, in units of 1/2048 em.
        for (glyph, units) in [('1', 225.0), ('l', 193.0), ('J', -106.0), ('o', 113.0)] {
            assert_eq!(side_bearing(glyph, Weight::Normal, 2048.0), units, "{glyph}");
        }
    }

    #[test]
    fn every_symbol_of_the_figures_has_a_glyph() {
        for symbol in "⁰¹²³⁴⁵⁶⁷⁸⁹⁻ₙᵥᵤ₁₀ᵃᵇᶜγ∝−×·–≥…".chars()
        {
            for weight in [Weight::Normal, Weight::Bold] {
                assert!(weight.face().side_bearings.contains_key(&symbol), "{symbol}");
            }
        }
    }

    #[test]
    fn wrapped_lines_fit_and_lose_no_word() {
        let text = "one two three four five six seven eight nine ten";
        let lines = wrap(text, Weight::Normal, 12.0, 90.0);
        assert!(lines.len() > 2);
        assert!(lines.iter().all(|line| measure(line, Weight::Normal, 12.0) <= 90.0));
        assert_eq!(lines.join(" "), text);
    }
}
