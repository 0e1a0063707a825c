//! [`Subset`]: the glyphs of a face that a page shows, as a font within its PDF.

use std::collections::{BTreeMap, BTreeSet};

use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Filter, Name, Pdf, Rect, Ref, Str};
use subsetter::GlyphRemapper;

use super::packed::packed;
use crate::figures::font::Weight;
use crate::figures::render::DrawError;
use crate::figures::scene::{Scene, Shape};

/// Objects of a face in a PDF: the font, its glyphs, their metrics, their characters, the file.
pub const N_OBJECTS: usize = 5;
/// A PDF counts glyphs in thousandths of an em.
const PER_EM: f64 = 1000.0;
/// The thickness of a face's stems, in thousandths of an em; viewers use it only where they have not the font.
const STEM: f32 = 80.0;

/// What a character is shown by.
struct Glyph {
    number: u16,
    /// Its number in the whole face.
    id: u16,
    /// From its pen to that of the next glyph, in ems.
    advance: f64,
}

/// Some glyphs of a face, numbered anew from 1.
pub struct Subset {
    pub weight: Weight,
    glyphs: GlyphRemapper,
    of: BTreeMap<char, Glyph>,
}

impl Subset {
    /// Those of a weight that a page shows; `None` where it shows none.
    pub fn of(scene: &Scene, weight: Weight) -> Option<Subset> {
        let texts = scene.shapes.iter().filter_map(|shape| match shape {
            Shape::Text(text) if text.weight == weight => Some(&text.content),
            _ => None,
        });
        let characters: BTreeSet<char> = texts.flat_map(|text| text.chars()).collect();
        let mut glyphs = GlyphRemapper::new();
        let mut numbered = |character| {
            // A missing one is shown by an empty box.
            let known = weight.face().glyph_index(character);
            let advance = known.and_then(|glyph| weight.face().glyph_hor_advance(glyph));
            let (id, advance) = (known.unwrap_or_default().0, weight.ems(advance.unwrap_or(0)));
            (character, Glyph { number: glyphs.remap(id), id, advance })
        };
        let of: BTreeMap<_, _> = characters.into_iter().map(&mut numbered).collect();
        (!of.is_empty()).then_some(Subset { weight, glyphs, of })
    }

    /// Its name among the page's fonts.
    pub fn key(&self) -> &'static [u8] {
        match self.weight {
            Weight::Normal => b"Normal",
            Weight::Bold => b"Bold",
        }
    }

    /// The width of a text of its characters, in ems.
    pub fn width(&self, text: &str) -> f64 {
        text.chars().map(|character| self.of[&character].advance).sum()
    }

    /// The numbers of a text of its characters, two bytes each.
    pub fn encoded(&self, text: &str) -> Vec<u8> {
        text.chars().flat_map(|character| self.of[&character].number.to_be_bytes()).collect()
    }

    /// Writes it as those objects.
    ///
    /// # Errors
    /// The face cannot be cut.
    pub fn write(&self, pdf: &mut Pdf, objects: [Ref; N_OBJECTS]) -> Result<(), DrawError> {
        let [font, glyphs, descriptor, characters, file] = objects;
        let face = self.weight.face();
        let cut = subsetter::subset(face.raw_face().data, 0, &self.glyphs)?;
        let name = self.name();
        let name = Name(name.as_bytes());
        pdf.type0_font(font)
            .base_font(name)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(glyphs)
            .to_unicode(characters);
        let mut glyph_font = pdf.cid_font(glyphs);
        glyph_font
            .subtype(CidFontType::Type2)
            .base_font(name)
            .system_info(IDENTITY)
            .font_descriptor(descriptor)
            .default_width(0.0)
            .cid_to_gid_map_predefined(Name(b"Identity"));
        glyph_font.widths().consecutive(0, self.widths());
        drop(glyph_font);
        let units = |units: i16| thousandths(self.weight.ems(units));
        let [ascent, descent] = [face.ascender(), face.descender()].map(units);
        let bounds = face.global_bounding_box();
        let [left, bottom, right, top] =
            [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(units);
        pdf.font_descriptor(descriptor)
            .name(name)
            .flags(FontFlags::SYMBOLIC)
            .bbox(Rect::new(left, bottom, right, top))
            .italic_angle(0.0)
            .ascent(ascent)
            .descent(descent)
            .cap_height(ascent)
            .stem_v(STEM)
            .font_file2(file);
        pdf.cmap(characters, &self.characters());
        pdf.stream(file, &packed(&cut))
            .filter(Filter::FlateDecode)
            .pair(Name(b"Length1"), cut.len() as i32);
        Ok(())
    }

    /// Six letters that differ with its glyphs, and the face's name, as PDF wants of parts of fonts.
    fn name(&self) -> String {
        let glyphs: Vec<u8> = self.of.values().flat_map(|glyph| glyph.id.to_be_bytes()).collect();
        let hash = blake3::hash(&glyphs);
        let letters: String =
            hash.as_bytes()[..6].iter().map(|byte| char::from(b'A' + byte % 26)).collect();
        let style = if self.weight == Weight::Bold { "-Bold" } else { "" };
        format!("{letters}+DejaVuSans{style}")
    }

    /// The widths of glyph 0, which stands for a missing one, and of all others.
    fn widths(&self) -> Vec<f32> {
        let mut widths = vec![0.0; usize::from(self.glyphs.num_gids())];
        for glyph in self.of.values() {
            widths[usize::from(glyph.number)] = thousandths(glyph.advance);
        }
        widths
    }

    /// What character each number stands for, so that text can be searched and copied.
    fn characters(&self) -> Vec<u8> {
        let mut map = UnicodeCmap::new(Name(b"Custom"), IDENTITY);
        self.of.iter().for_each(|(character, glyph)| map.pair(glyph.number, *character));
        map.finish().into_vec()
    }
}

/// Glyphs go by their numbers.
const IDENTITY: SystemInfo<'static> =
    SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

fn thousandths(ems: f64) -> f32 {
    (ems * PER_EM) as f32
}
