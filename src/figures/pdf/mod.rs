//! From a `Scene` to the bytes of a PDF of one page: shapes as paths, text as text, its typeface within.

mod content;
mod packed;
mod subset;

use pdf_writer::{Filter, Finish, Name, Pdf, Rect, Ref};

use super::font::Weight;
use super::render::DrawError;
use super::scene::Scene;
use content::POINTS;
use packed::packed;
use subset::Subset;

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
/// Objects of the faces come after it.
const LAST: i32 = 4;

/// The whole document; it holds no time, so that the same page has the same bytes.
pub fn pdf(scene: &Scene) -> Result<Vec<u8>, DrawError> {
    let faces = [Weight::Normal, Weight::Bold].map(|weight| Subset::of(scene, weight));
    let faces: Vec<Subset> = faces.into_iter().flatten().collect();
    let mut pdf = Pdf::new();
    pdf.catalog(CATALOG).pages(PAGES);
    pdf.pages(PAGES).kids([PAGE]).count(1);
    page(&mut pdf, scene, &faces);
    pdf.stream(CONTENT, &packed(&content::operations(scene, &faces))).filter(Filter::FlateDecode);
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
    fonts.finish();
    resources.finish();
    page.finish();
}

/// The objects of the i-th face.
fn objects(i: usize) -> [Ref; subset::N_OBJECTS] {
    let first = LAST + 1 + (i * subset::N_OBJECTS) as i32;
    std::array::from_fn(|k| Ref::new(first + k as i32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::colour::Rgb;
    use crate::figures::scene::{Anchor, Text};

    fn page_of(content: &str) -> Scene {
        let mut scene = Scene::new(200.0, 100.0);
        scene.text(Text {
            content: content.to_owned(),
            at: (10.0, 20.0),
            anchor: Anchor::Start,
            em: 12.0,
            weight: Weight::Bold,
            colour: Rgb(0, 0, 0),
            upward: false,
        });
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
}
