//! Encodes a page as PDF: shapes as paths, text as text, with the used glyphs of its typeface.

use std::collections::{BTreeMap, BTreeSet};

use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::types::{CidFontType, FontFlags, LineJoinStyle, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Name, Pdf, Rect, Ref, Str};
use subsetter::GlyphRemapper;

use super::scene::{Point, Scene, Shape, Text};
use super::style::{Rgb, WHITE, Weight};

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
/// Objects of the faces come after it.
const LAST: i32 = 4;

/// The whole document; it holds no time, so that the same page has the same bytes.
pub fn pdf(scene: &Scene) -> Result<Vec<u8>, subsetter::Error> {
    let weights = [Weight::Normal, Weight::Bold].into_iter();
    let faces: Vec<Subset> = weights.filter_map(|weight| Subset::of(scene, weight)).collect();
    let mut pdf = Pdf::new();
    pdf.catalog(CATALOG).pages(PAGES);
    pdf.pages(PAGES).kids([PAGE]).count(1);
    page(&mut pdf, scene, &faces);
    pdf.stream(CONTENT, &packed(&operations(scene, &faces))).filter(Filter::FlateDecode);
    for (i, face) in faces.iter().enumerate() {
        face.write(&mut pdf, objects(i))?;
    }
    Ok(pdf.finish())
}

fn page(pdf: &mut Pdf, scene: &Scene, faces: &[Subset]) {
    let [width, height] = [scene.width, scene.height].map(|length| (length * POINTS) as f32);
    let mut page = pdf.page(PAGE);
    page.parent(PAGES).media_box(Rect::new(0.0, 0.0, width, height)).contents(CONTENT);
    let mut resources = page.resources();
    let mut fonts = resources.fonts();
    for (i, face) in faces.iter().enumerate() {
        fonts.pair(Name(face.key()), objects(i)[0]);
    }
}

/// The objects of the i-th face.
fn objects(i: usize) -> [Ref; N_OBJECTS] {
    let first = LAST + 1 + (i * N_OBJECTS) as i32;
    std::array::from_fn(|k| Ref::new(first + k as i32))
}

/// The bytes of a stream with the filter `FlateDecode`, packed as hard as zlib does by default.
fn packed(bytes: &[u8]) -> Vec<u8> {
    compress_to_vec_zlib(bytes, 6)
}

// The shapes of a page as operations.

/// Points, of which an inch has 72, for one of the page's pixels, of which it has 96.
const POINTS: f64 = 0.75;
/// Length of the Bézier handles of a quarter of a unit circle.
const QUARTER: f64 = 0.552_284_75;

/// The operations that draw a page, in its pixels, y downwards.
fn operations(scene: &Scene, faces: &[Subset]) -> Vec<u8> {
    let mut content = Content::new();
    let (points, height) = (POINTS as f32, (scene.height * POINTS) as f32);
    content.transform([points, 0.0, 0.0, -points, 0.0, height]);
    content.set_line_join(LineJoinStyle::RoundJoin);
    area(&mut content, &scene.corners(), WHITE);
    for shape in &scene.shapes {
        match shape {
            Shape::Line { points, width, colour } => line(&mut content, points, *width, *colour),
            Shape::Area { points, colour } => area(&mut content, points, *colour),
            Shape::Disc { centre, radius, colour } => disc(&mut content, *centre, *radius, *colour),
            Shape::Text(text) => show(&mut content, text, faces),
        }
    }
    content.finish().into_vec()
}

fn line(content: &mut Content, points: &[Point], width: f64, colour: Rgb) {
    let [r, g, b] = parts(colour);
    content.set_stroke_rgb(r, g, b).set_line_width(width as f32);
    path(content, points);
    content.stroke();
}

fn area(content: &mut Content, points: &[Point], colour: Rgb) {
    fill(content, colour);
    path(content, points);
    content.close_path().fill_nonzero();
}

fn path(content: &mut Content, points: &[Point]) {
    for (i, (x, y)) in points.iter().map(|&(x, y)| (x as f32, y as f32)).enumerate() {
        if i == 0 {
            content.move_to(x, y)
        } else {
            content.line_to(x, y)
        };
    }
}

fn disc(content: &mut Content, (x, y): Point, radius: f64, colour: Rgb) {
    fill(content, colour);
    let at = |right: f64, down: f64| ((x + radius * right) as f32, (y + radius * down) as f32);
    let (x0, y0) = at(1.0, 0.0);
    content.move_to(x0, y0);
    for (c, s) in [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)] {
        // From the direction (c, s) to (−s, c), a quarter further round.
        let (x1, y1) = at(c - QUARTER * s, s + QUARTER * c);
        let (x2, y2) = at(-s + QUARTER * c, c + QUARTER * s);
        let (x3, y3) = at(-s, c);
        content.cubic_to(x1, y1, x2, y2, x3, y3);
    }
    content.fill_nonzero();
}

fn show(content: &mut Content, text: &Text, faces: &[Subset]) {
    let Some(face) = faces.iter().find(|face| face.weight == text.weight) else { return };
    let back = text.anchor.share() * face.width(&text.content) * text.em;
    let (x, y) = text.at;
    // The page is upside down, and so is its text but for this.
    let matrix = if text.upward {
        [0.0, -1.0, -1.0, 0.0, x as f32, (y + back) as f32]
    } else {
        [1.0, 0.0, 0.0, -1.0, (x - back) as f32, y as f32]
    };
    fill(content, text.colour).begin_text();
    content.set_font(Name(face.key()), text.em as f32).set_text_matrix(matrix);
    content.show(Str(&face.encoded(&text.content))).end_text();
}

fn fill(content: &mut Content, colour: Rgb) -> &mut Content {
    let [r, g, b] = parts(colour);
    content.set_fill_rgb(r, g, b)
}

fn parts(Rgb(r, g, b): Rgb) -> [f32; 3] {
    [r, g, b].map(|part| f32::from(part) / 255.0)
}

// Its typeface.

/// Objects of a face in a PDF: the font, its glyphs, their metrics, their characters, the file.
const N_OBJECTS: usize = 5;
/// The thickness of a face's stems, in thousandths of an em; viewers use it only without the font.
const STEM: f32 = 80.0;

/// A glyph of a character.
struct Glyph {
    number: u16,
    /// Its number in the whole face.
    id: u16,
    /// Its advance, in ems.
    advance: f64,
}

/// A subset of a face's glyphs, renumbered from 1.
struct Subset {
    weight: Weight,
    glyphs: GlyphRemapper,
    of: BTreeMap<char, Glyph>,
}

impl Subset {
    /// The glyphs of a weight on a page; `None` if there are none.
    fn of(scene: &Scene, weight: Weight) -> Option<Subset> {
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
    fn key(&self) -> &'static [u8] {
        if self.weight == Weight::Bold { b"Bold" } else { b"Normal" }
    }

    /// The width of a text of its characters, in ems.
    fn width(&self, text: &str) -> f64 {
        text.chars().map(|character| self.of[&character].advance).sum()
    }

    /// The numbers of a text of its characters, two bytes each.
    fn encoded(&self, text: &str) -> Vec<u8> {
        text.chars().flat_map(|character| self.of[&character].number.to_be_bytes()).collect()
    }

    /// Writes it as those objects.
    ///
    /// # Errors
    /// The face cannot be cut.
    fn write(&self, pdf: &mut Pdf, objects: [Ref; N_OBJECTS]) -> Result<(), subsetter::Error> {
        let [font, glyphs, descriptor, characters, file] = objects;
        let face = self.weight.face();
        let cut = subsetter::subset(face.raw_face().data, 0, &self.glyphs)?;
        let name = &self.name();
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

    /// The widths of glyph 0 (the missing glyph) and of all others.
    fn widths(&self) -> Vec<f32> {
        let mut widths = vec![0.0; usize::from(self.glyphs.num_gids())];
        for glyph in self.of.values() {
            widths[usize::from(glyph.number)] = thousandths(glyph.advance);
        }
        widths
    }

    /// The character of each number, so that text can be searched and copied.
    fn characters(&self) -> Vec<u8> {
        let mut map = UnicodeCmap::new(Name(b"Custom"), IDENTITY);
        self.of.iter().for_each(|(character, glyph)| map.pair(glyph.number, *character));
        map.finish().into_vec()
    }
}

/// Glyphs go by their numbers.
const IDENTITY: SystemInfo<'static> =
    SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

/// A PDF counts glyphs in thousandths of an em.
fn thousandths(ems: f64) -> f32 {
    (ems * 1000.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::scene::{Anchor, plain_text};

    fn page_of(content: &str) -> Scene {
        let mut scene = Scene::new(200.0, 100.0);
        let text = plain_text(content, (10.0, 20.0), Anchor::Start, 12.0);
        scene.text(Text { weight: Weight::Bold, ..text });
        scene
    }

    fn has(bytes: &[u8], part: &str) -> bool {
        bytes.windows(part.len()).any(|window| window == part.as_bytes())
    }

    #[test]
    fn a_page_has_its_size_in_points_and_its_face_alone() {
        let document = pdf(&page_of("Nₙᵥ ∝ Cᵇ")).unwrap();
        assert!(document.starts_with(b"%PDF-") && document.trim_ascii_end().ends_with(b"%%EOF"));
        assert!(has(&document, "/MediaBox [0 0 150 75]"));
        assert!(has(&document, "+DejaVuSans-Bold") && !has(&document, "+DejaVuSans/"));
        assert!(document.len() < 20_000, "{} bytes: a few glyphs of the face", document.len());
    }

    #[test]
    fn the_same_page_has_the_same_bytes_and_other_glyphs_another_name() {
        let name = |content: &str| {
            let document = pdf(&page_of(content)).unwrap();
            assert_eq!(document, pdf(&page_of(content)).unwrap());
            let text = String::from_utf8_lossy(&document).into_owned();
            let end = text.find("+DejaVuSans").expect("the name of a subset");
            text[end - 6..end].to_string()
        };
        assert_eq!(name("abc"), name("cab"));
        assert_ne!(name("abc"), name("abd"));
    }

    #[test]
    fn shapes_stand_where_the_page_has_them() {
        let mut scene = Scene::new(40.0, 20.0);
        let red = Rgb(255, 0, 0);
        let points = vec![(1.0, 2.0), (3.0, 4.0)];
        scene.shapes.push(Shape::Line { points, width: 2.0, colour: red });
        scene.shapes.push(Shape::Disc { centre: (10.0, 10.0), radius: 4.0, colour: red });
        let text = String::from_utf8(operations(&scene, &[])).unwrap();
        assert!(text.starts_with("0.75 0 0 -0.75 0 15 cm\n"), "{text}");
        assert!(text.contains("1 0 0 RG\n2 w\n1 2 m\n3 4 l\nS"), "{text}");
        assert!(
            text.contains("14 10 m") && text.contains(" 10 14 c") && text.contains(" 6 10 c"),
            "{text}"
        );
    }

    #[test]
    fn text_ends_or_is_centred_at_its_point() {
        let x_of = |anchor| {
            let mut scene = Scene::new(40.0, 20.0);
            scene.text(plain_text("ab", (20.0, 10.0), anchor, 10.0));
            let face = Subset::of(&scene, Weight::Normal).unwrap();
            let text = String::from_utf8_lossy(&operations(&scene, &[face])).into_owned();
            let matrix =
                text.lines().find_map(|line| line.strip_suffix(" 10 Tm")).expect("a place");
            matrix.rsplit(' ').next().unwrap().parse::<f64>().unwrap()
        };
        let [start, middle, end] = [Anchor::Start, Anchor::Middle, Anchor::End].map(x_of);
        // DejaVu Sans: a is 1255 and b is 1300 of 2048 wide.
        let width = 10.0 * (1255.0 + 1300.0) / 2048.0;
        assert!((start - 20.0).abs() < 1e-4 && (start - end - width).abs() < 1e-4, "{start} {end}");
        assert!((start - middle - width / 2.0).abs() < 1e-4, "{middle}");
    }
}
