//! The shapes of a page as a PDF's operations.

use pdf_writer::types::LineJoinStyle;
use pdf_writer::{Content, Name, Str};

use super::subset::Subset;
use crate::figures::colour::{Rgb, WHITE};
use crate::figures::scene::{Point, Scene, Shape, Text};

/// Points, of which an inch has 72, for one of the page's pixels, of which it has 96.
pub const POINTS: f64 = 0.75;
/// How far the handles of a quarter of a circle of radius 1 reach, for the Bézier curve nearest to it.
const QUARTER: f64 = 0.552_284_75;

/// The operations that draw a page, in its pixels, y downwards.
pub fn operations(scene: &Scene, faces: &[Subset]) -> Vec<u8> {
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
    let [r, g, b] = parts(colour);
    content.set_fill_rgb(r, g, b);
    path(content, points);
    content.close_path().fill_nonzero();
}

fn path(content: &mut Content, points: &[Point]) {
    for (i, &(x, y)) in points.iter().enumerate() {
        match i {
            0 => content.move_to(x as f32, y as f32),
            _ => content.line_to(x as f32, y as f32),
        };
    }
}

fn disc(content: &mut Content, (x, y): Point, radius: f64, colour: Rgb) {
    let [r, g, b] = parts(colour);
    content.set_fill_rgb(r, g, b);
    let at = |right: f64, down: f64| ((x + radius * right) as f32, (y + radius * down) as f32);
    let (start_x, start_y) = at(1.0, 0.0);
    content.move_to(start_x, start_y);
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
    let [r, g, b] = parts(text.colour);
    content.set_fill_rgb(r, g, b).begin_text();
    content.set_font(Name(face.key()), text.em as f32).set_text_matrix(matrix);
    content.show(Str(&face.encoded(&text.content))).end_text();
}

fn parts(Rgb(r, g, b): Rgb) -> [f32; 3] {
    [r, g, b].map(|part| f32::from(part) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::font::Weight;
    use crate::figures::scene::Anchor;

    #[test]
    fn shapes_stand_where_the_page_has_them() {
        let mut scene = Scene::new(40.0, 20.0);
        let red = Rgb(255, 0, 0);
        scene.shapes.push(Shape::Line {
            points: vec![(1.0, 2.0), (3.0, 4.0)],
            width: 2.0,
            colour: red,
        });
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
            let content = "ab".to_owned();
            let (em, weight, colour) = (10.0, Weight::Normal, Rgb(0, 0, 0));
            scene.text(Text {
                content,
                at: (20.0, 10.0),
                anchor,
                em,
                weight,
                colour,
                upward: false,
            });
            let face = Subset::of(&scene, weight).unwrap();
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
