//! What all figures share: colours that colour-blind readers can distinguish, also on a grey printer, and one typeface.

use plotters::style::{FontDesc, FontFamily, FontStyle, register_font};
use std::sync::OnceLock;
use ttf_parser::Face;

/// An opaque colour; figures blend nothing, so SVG and PNG agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rgb(pub u8, pub u8, pub u8);

pub const WHITE: Rgb = Rgb(255, 255, 255);
pub const INK: Rgb = Rgb(34, 34, 34);
pub const MUTED: Rgb = Rgb(96, 96, 96);
pub const FRAME: Rgb = Rgb(120, 120, 120);
pub const GRID: Rgb = Rgb(228, 228, 228);
pub const ENVELOPE: Rgb = Rgb(205, 205, 205);
/// Okabe and Ito's vermillion: held-out data in all figures.
pub const HELD_OUT: Rgb = Rgb(213, 94, 0);
/// Okabe and Ito's blue: the first law of a figure.
pub const LAW: Rgb = Rgb(0, 114, 178);
/// Okabe and Ito's bluish green: the second law of a figure.
pub const SECOND_LAW: Rgb = Rgb(0, 158, 115);
/// Okabe and Ito's purple: the joint law.
pub const JOINT_LAW: Rgb = Rgb(204, 121, 167);

/// Okabe and Ito's vermillion: left arm and leg.
pub const LEFT_SIDE: Rgb = HELD_OUT;
/// Okabe and Ito's blue: right arm and leg.
pub const RIGHT_SIDE: Rgb = LAW;
/// Below a body, darker than the grid.
pub const SHADOW: Rgb = Rgb(210, 210, 210);

/// Okabe and Ito (2008) without yellow, which white paper swallows.
const OKABE_ITO: [Rgb; 7] =
    [LAW, HELD_OUT, SECOND_LAW, JOINT_LAW, Rgb(230, 159, 0), Rgb(86, 180, 233), INK];

/// Viridis (Smith and van der Walt 2015) at tenths, up to the last that shows on white.
const VIRIDIS: [Rgb; 10] = [
    Rgb(68, 1, 84),
    Rgb(72, 36, 117),
    Rgb(65, 68, 135),
    Rgb(53, 95, 141),
    Rgb(42, 120, 142),
    Rgb(33, 145, 140),
    Rgb(34, 168, 132),
    Rgb(68, 191, 112),
    Rgb(122, 209, 81),
    Rgb(189, 223, 38),
];

/// As CSS has it.
impl std::fmt::Display for Rgb {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{:02X}{:02X}{:02X}", self.0, self.1, self.2)
    }
}

impl Rgb {
    /// Mixes with white: `share` 1 is the colour itself, 0 is white.
    pub fn tint(self, share: f64) -> Rgb {
        mix(WHITE, self, share)
    }
}

/// `n` colours for things without an order; for more than seven, ordered ones.
pub fn categories(n: usize) -> Vec<Rgb> {
    if n <= OKABE_ITO.len() { OKABE_ITO[..n].to_vec() } else { ordered(n) }
}

/// `n` colours from dark to light, for things with an order such as budgets.
pub fn ordered(n: usize) -> Vec<Rgb> {
    let last = n.saturating_sub(1).max(1) as f64;
    (0..n).map(|i| viridis(i as f64 / last)).collect()
}

/// Viridis at `t` in 0..=1, by linear interpolation between the stops.
fn viridis(t: f64) -> Rgb {
    let place = t * (VIRIDIS.len() - 2) as f64;
    let stop = (place as usize).min(VIRIDIS.len() - 3);
    mix(VIRIDIS[stop], VIRIDIS[stop + 1], place - stop as f64)
}

fn mix(from: Rgb, to: Rgb, share: f64) -> Rgb {
    let channel =
        |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * share).round() as u8;
    Rgb(channel(from.0, to.0), channel(from.1, to.1), channel(from.2, to.2))
}

// The one typeface of the figures: DejaVu Sans, carried in the binary.
//
// plotters measures and rasterises the glyphs. It draws each glyph from its own left edge and
// drops the side bearing, so the bearings are read from the font; a PDF wants the rest of its metrics.

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

    fn luminance(colour: Rgb) -> f64 {
        0.2126 * f64::from(colour.0) + 0.7152 * f64::from(colour.1) + 0.0722 * f64::from(colour.2)
    }

    #[test]
    fn ordered_colours_grow_lighter() {
        let colours = ordered(9);
        assert_eq!(colours.len(), 9);
        assert!(colours.windows(2).all(|pair| luminance(pair[0]) < luminance(pair[1])));
    }

    #[test]
    fn no_two_categories_share_a_colour() {
        for n in [1, 7, 12] {
            let colours = categories(n);
            assert_eq!(colours.len(), n);
            assert!((0..n).all(|i| !colours[..i].contains(&colours[i])));
        }
    }
}

#[cfg(test)]
mod font_tests {
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
