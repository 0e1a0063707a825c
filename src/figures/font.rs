//! The one typeface of the figures: DejaVu Sans, carried in the binary.
//!
//! plotters measures and rasterises the glyphs. It draws each glyph from its own left edge and
//! drops the side bearing, so the bearings are read from the font; a PDF wants the rest of its metrics.

use std::sync::OnceLock;

use plotters::style::{FontDesc, FontFamily, FontStyle, register_font};
use ttf_parser::Face;

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
        [FontStyle::Normal, FontStyle::Bold][self as usize]
    }

    pub fn face(self) -> &'static Face<'static> {
        static FACES: OnceLock<[Face<'static>; 2]> = OnceLock::new();
        let faces = FACES.get_or_init(|| {
            [(Weight::Normal, dejavu::sans::regular()), (Weight::Bold, dejavu::sans::bold())]
                .map(|(weight, bytes)| registered(weight, bytes))
        });
        &faces[self as usize]
    }

    /// Units of the face in ems.
    pub fn ems(self, units: impl Into<f64>) -> f64 {
        units.into() / f64::from(self.face().units_per_em())
    }
}

fn registered(weight: Weight, bytes: &'static [u8]) -> Face<'static> {
    let registered = register_font(FAMILY, weight.style(), bytes);
    assert!(registered.is_ok(), "the bundled DejaVu Sans is a valid font");
    Face::parse(bytes, 0).expect("the bundled DejaVu Sans is a valid font")
}

/// plotters' font at `em` pixels; plotters counts a font's size from ascender to descender.
pub fn font(weight: Weight, em: f64) -> FontDesc<'static> {
    let face = weight.face();
    let size = em * weight.ems(face.ascender() - face.descender());
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
    let face = weight.face();
    let units = face.glyph_index(glyph).and_then(|glyph| face.glyph_hor_side_bearing(glyph));
    units.map_or(0.0, |units| weight.ems(units) * em)
}

/// Breaks a text at spaces into lines no wider than `width`.
pub fn wrap(text: &str, weight: Weight, em: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        let fits = |line: &String| measure(&format!("{line} {word}"), weight, em) <= width;
        match lines.last_mut() {
            Some(line) if fits(line) => line.extend([" ", word]),
            _ => lines.push(word.to_owned()),
        }
    }
    lines
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
                assert!(weight.face().glyph_index(symbol).is_some(), "{symbol}");
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
