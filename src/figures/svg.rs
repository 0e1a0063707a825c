//! From a `Scene` to an SVG document, whose text a reader can select and search.

use super::colour::{Rgb, WHITE};
use super::font::{FAMILY, Weight};
use super::scene::{Anchor, Point, Scene, Shape, Text};

/// Coordinates are whole numbers of this fraction of a page pixel.
const SCALE: f64 = 10.0;
/// A text's point is this many ems above its baseline.
const HANG_EM: f64 = 0.76;

/// The whole document, with elements of one's own before and after those of the page.
pub fn svg(scene: &Scene, before: &str, after: &str) -> String {
    let (w, h) = (scene.width, scene.height);
    let mut document = format!(
        "<svg width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {} {}\" \
         stroke-linejoin=\"round\" xmlns=\"http://www.w3.org/2000/svg\">\n{before}",
        w * SCALE,
        h * SCALE
    );
    document += &area(&scene.corners(), WHITE);
    document.extend(scene.shapes.iter().map(element));
    document + after + "</svg>\n"
}

fn element(shape: &Shape) -> String {
    match shape {
        Shape::Line { points, width, colour } => format!(
            "<polyline fill=\"none\" opacity=\"1\" stroke=\"{colour}\" stroke-width=\"{}\" \
             points=\"{}\"/>\n",
            unit(*width),
            corners(points)
        ),
        Shape::Area { points, colour } => area(points, *colour),
        Shape::Disc { centre: (x, y), radius, colour } => format!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" opacity=\"1\" fill=\"{colour}\" \
             stroke=\"none\" stroke-width=\"1\"/>\n",
            unit(*x),
            unit(*y),
            unit(*radius)
        ),
        Shape::Text(text) => line_of_text(text),
    }
}

fn area(points: &[Point], colour: Rgb) -> String {
    let corners = corners(points);
    format!("<polygon opacity=\"1\" fill=\"{colour}\" points=\"{corners}\"/>\n")
}

fn corners(points: &[Point]) -> String {
    points.iter().map(|(x, y)| format!("{},{} ", unit(*x), unit(*y))).collect()
}

fn line_of_text(text: &Text) -> String {
    let hang = HANG_EM * text.em;
    let (x, y) = text.at;
    let (x, y) = if text.upward { (unit(x - hang), unit(y)) } else { (unit(x), unit(y - hang)) };
    let anchor = match text.anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    // Rounded as in the figures that papers already show.
    let size = text.em * SCALE * 1.24 / 1.24;
    let weight = if text.weight == Weight::Bold { " font-weight=\"bold\"" } else { "" };
    let turn = match text.upward {
        true => format!(" transform=\"rotate(270, {x}, {y})\""),
        false => String::new(),
    };
    format!(
        "<text x=\"{x}\" y=\"{y}\" dy=\"{HANG_EM}em\" text-anchor=\"{anchor}\" \
         font-family=\"{FAMILY}\" font-size=\"{size}\" opacity=\"1\" fill=\"{}\"{weight}{turn}>\n\
         {}\n</text>\n",
        text.colour,
        escaped(&text.content)
    )
}

/// Page pixels in whole units of the view box.
pub fn unit(pixels: f64) -> i64 {
    (pixels * SCALE).round() as i64
}

/// Text between the tags of an XML document.
pub fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;").replace('\'', "&apos;")
}
