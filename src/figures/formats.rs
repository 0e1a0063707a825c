//! Encodes a page as a file: SVG, with selectable and searchable text; PNG, through plotters'
//! bitmap backend; PDF in [`pdf`].
//!
//! plotters counts in whole pixels, so a PNG is drawn at `SUPERSAMPLE` times its size and averaged down.

use std::io::Cursor;

use image::{ImageOutputFormat, RgbImage, imageops};
use plotters::backend::{BitMapBackend, DrawingBackend};
use plotters::style::{Color, RGBColor};

use super::pdf::pdf;
use super::scene::{Point, Scene, Shape, Text};
use super::style::{FAMILY, Rgb, WHITE, Weight, font, measure, side_bearing};

/// A backend's complaint.
pub type DrawError = Box<dyn std::error::Error + Send + Sync>;

/// A kind of file that a figure is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text that can be selected, lines of any size: for pages.
    Svg,
    /// Pixels, twice those of the page: for slides and chats.
    Png,
    /// Text and lines with the typeface within: for papers.
    Pdf,
}

impl Format {
    /// All of them.
    pub const ALL: [Format; 3] = [Format::Svg, Format::Png, Format::Pdf];

    /// How the names of its files end.
    pub fn extension(self) -> &'static str {
        ["svg", "png", "pdf"][self as usize]
    }

    pub(super) fn bytes(self, scene: &Scene) -> Result<Vec<u8>, DrawError> {
        match self {
            Format::Svg => Ok(svg(scene, "", "").into_bytes()),
            Format::Png => png(&raster(scene)?),
            Format::Pdf => Ok(pdf(scene)?),
        }
    }
}

// SVG.

/// Coordinates are whole numbers of this fraction of a page pixel.
const SVG_UNITS: f64 = 10.0;
/// A text's point is this many ems above its baseline.
const HANG_EM: f64 = 0.76;

/// The whole document, with extra elements before and after those of the page.
pub fn svg(scene: &Scene, before: &str, after: &str) -> String {
    let (w, h) = (scene.width, scene.height);
    let mut document = format!(
        "<svg width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {} {}\" \
         stroke-linejoin=\"round\" xmlns=\"http://www.w3.org/2000/svg\">\n{before}",
        w * SVG_UNITS,
        h * SVG_UNITS
    );
    document += &area(&scene.corners(), WHITE);
    document.extend(scene.shapes.iter().map(element));
    document + after + "</svg>\n"
}

fn element(shape: &Shape) -> String {
    match shape {
        Shape::Line { points, width, colour } => {
            let (width, corners) = (unit(*width), corners(points));
            format!(
                "<polyline fill=\"none\" opacity=\"1\" stroke=\"{colour}\" stroke-width=\"{width}\" \
                 points=\"{corners}\"/>\n"
            )
        }
        Shape::Area { points, colour } => area(points, *colour),
        Shape::Disc { centre: (x, y), radius, colour } => {
            let [x, y, radius] = [x, y, radius].map(|length| unit(*length));
            format!(
                "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" opacity=\"1\" fill=\"{colour}\" \
                 stroke=\"none\" stroke-width=\"1\"/>\n"
            )
        }
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
    let anchor = ["start", "middle", "end"][text.anchor as usize];
    // Rounded as in the figures that papers already show.
    let size = text.em * SVG_UNITS * 1.24 / 1.24;
    let weight = if text.weight == Weight::Bold { " font-weight=\"bold\"" } else { "" };
    let turn = format!(" transform=\"rotate(270, {x}, {y})\"");
    let turn = if text.upward { turn.as_str() } else { "" };
    let (colour, content) = (text.colour, escaped(&text.content));
    format!(
        "<text x=\"{x}\" y=\"{y}\" dy=\"{HANG_EM}em\" text-anchor=\"{anchor}\" \
         font-family=\"{FAMILY}\" font-size=\"{size}\" opacity=\"1\" fill=\"{colour}\"{weight}{turn}>\n\
         {content}\n</text>\n"
    )
}

/// Page pixels in whole units of the view box.
pub fn unit(pixels: f64) -> i64 {
    (pixels * SVG_UNITS).round() as i64
}

/// Text between the tags of an XML document.
pub fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;").replace('\'', "&apos;")
}

// PNG.

/// A PNG has this many pixels for one of the page.
const PNG_SCALE: u32 = 2;
/// Samples along each side of a PNG's pixel.
const SUPERSAMPLE: u32 = 3;
/// Samples along a page pixel.
const SAMPLES: f64 = (PNG_SCALE * SUPERSAMPLE) as f64;

/// The whole PNG.
pub fn png(picture: &RgbImage) -> Result<Vec<u8>, DrawError> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageOutputFormat::Png)?;
    Ok(bytes.into_inner())
}

/// A page as pixels.
pub fn raster(scene: &Scene) -> Result<RgbImage, DrawError> {
    let (width, height) = (pixels(scene.width), pixels(scene.height));
    let mut samples = RgbImage::from_pixel(width, height, image::Rgb([255; 3]));
    let mut pen = Pen(BitMapBackend::with_buffer(&mut samples, (width, height)));
    for shape in &scene.shapes {
        match shape {
            Shape::Line { points, width, colour } => pen.line(points, *width, *colour)?,
            Shape::Area { points, colour } => pen.area(points, *colour)?,
            Shape::Disc { centre, radius, colour } => pen.disc(*centre, *radius, *colour)?,
            Shape::Text(text) => pen.text(text)?,
        }
    }
    drop(pen);
    Ok(imageops::thumbnail(&samples, width / SUPERSAMPLE, height / SUPERSAMPLE))
}

fn pixels(length: f64) -> u32 {
    (length * SAMPLES).round() as u32
}

fn place((x, y): Point) -> (i32, i32) {
    ((x * SAMPLES).round() as i32, (y * SAMPLES).round() as i32)
}

/// A plotters backend in page pixels.
struct Pen<'a>(BitMapBackend<'a>);

impl Pen<'_> {
    fn area(&mut self, points: &[Point], colour: Rgb) -> Result<(), DrawError> {
        let corners: Vec<_> = points.iter().map(|&point| place(point)).collect();
        Ok(self.0.fill_polygon(corners, &rgb(colour))?)
    }

    fn disc(&mut self, centre: Point, radius: f64, colour: Rgb) -> Result<(), DrawError> {
        Ok(self.0.draw_circle(place(centre), pixels(radius), &rgb(colour), true)?)
    }

    /// Strokes by filling: plotters' own bitmap paths grow spikes at sharp corners.
    fn line(&mut self, points: &[Point], width: f64, colour: Rgb) -> Result<(), DrawError> {
        for pair in points.windows(2) {
            self.segment(pair[0], pair[1], width, colour)?;
        }
        for &joint in &points[1..points.len().max(2) - 1] {
            self.disc(joint, width / 2.0, colour)?;
        }
        Ok(())
    }

    fn segment(&mut self, a: Point, b: Point, width: f64, colour: Rgb) -> Result<(), DrawError> {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        if dx == 0.0 || dy == 0.0 {
            // A rectangle, so that grids and frames stay crisp.
            let (half_x, half_y) = if dx == 0.0 { (width / 2.0, 0.0) } else { (0.0, width / 2.0) };
            let low = place((a.0.min(b.0) - half_x, a.1.min(b.1) - half_y));
            let high = place((a.0.max(b.0) + half_x, a.1.max(b.1) + half_y));
            return Ok(self.0.draw_rect(low, high, &rgb(colour), true)?);
        }
        let half = width / 2.0 / dx.hypot(dy);
        let (nx, ny) = (-dy * half, dx * half);
        let [p, q] = [(a.0 + nx, a.1 + ny), (b.0 + nx, b.1 + ny)];
        self.area(&[p, q, (b.0 - nx, b.1 - ny), (a.0 - nx, a.1 - ny)], colour)
    }

    /// Text as pixels, glyph by glyph, each at its kerned place and side bearing.
    fn text(&mut self, text: &Text) -> Result<(), DrawError> {
        let em = text.em * SAMPLES;
        let start = -text.anchor.share() * measure(&text.content, text.weight, em);
        for (begin, glyph) in text.content.char_indices() {
            let end = begin + glyph.len_utf8();
            let (upto, own) = (&text.content[..end], &text.content[begin..end]);
            let pen = start + measure(upto, text.weight, em) - measure(own, text.weight, em);
            self.glyph(text, own, pen + side_bearing(glyph, text.weight, em).floor())?;
        }
        Ok(())
    }

    /// One glyph, its left edge `along` device pixels from the text's point.
    fn glyph(&mut self, text: &Text, glyph: &str, along: f64) -> Result<(), DrawError> {
        let font = font(text.weight, text.em * SAMPLES);
        // plotters puts the baseline at half the size; an even size keeps that a whole pixel.
        let half = (font.get_size() / 2.0).round();
        let origin = place(text.at);
        font.resize(2.0 * half).draw(glyph, (0, 0), |x, y, cover| {
            let (right, down) = (along.round() as i32 + x, y - half as i32);
            let (dx, dy) = if text.upward { (down, -right) } else { (right, down) };
            let ink = rgb(text.colour).mix(f64::from(cover)).to_backend_color();
            self.0.draw_pixel((origin.0 + dx, origin.1 + dy), ink)
        })??;
        Ok(())
    }
}

fn rgb(Rgb(r, g, b): Rgb) -> RGBColor {
    RGBColor(r, g, b)
}
