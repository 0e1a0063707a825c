//! From a `Scene` to the bytes of an SVG and of a PNG, through plotters' backends.
//!
//! plotters counts in whole pixels, so an SVG is drawn in tenths of a page pixel under a view
//! box, and a PNG at `SUPERSAMPLE` times its size and averaged down.

use image::codecs::png::PngEncoder;
use image::{ColorType, ImageEncoder};
use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontTransform, RGBColor, ShapeStyle, TextStyle};

use super::colour::{Rgb, WHITE};
use super::font::{FAMILY, font, measure, side_bearing};
use super::scene::{Anchor, Point, Scene, Shape, Text};

/// A PNG has this many pixels for one of the page.
const PNG_SCALE: usize = 2;
/// Samples along each side of a PNG's pixel.
const SUPERSAMPLE: usize = 3;
/// An SVG's coordinates are in this fraction of a page pixel.
pub const SVG_SCALE: f64 = 10.0;
/// plotters writes an SVG's `font-size` as its own size over this.
const SVG_SIZE_PER_EM: f64 = 1.24;
/// plotters hangs an SVG's text this many ems above its baseline.
const SVG_HANG_EM: f64 = 0.76;

/// A backend's complaint, in words.
pub type DrawError = String;

/// The whole SVG document.
pub fn svg(scene: &Scene) -> Result<String, DrawError> {
    let mut document = String::new();
    let size = (pixels(scene.width, SVG_SCALE), pixels(scene.height, SVG_SCALE));
    let mut backend = SVGBackend::with_string(&mut document, size);
    let mut pen = Pen { backend: &mut backend, scale: SVG_SCALE };
    pen.area(&page_corners(scene), WHITE)?;
    for shape in &scene.shapes {
        match shape {
            Shape::Line { points, width, colour } => pen.path(points, *width, *colour)?,
            Shape::Text(text) => pen.svg_text(text)?,
            other => pen.filled(other)?,
        }
    }
    pen.backend.present().map_err(|error| error.to_string())?;
    drop(backend);
    Ok(with_page_size(&document, scene))
}

/// The whole PNG.
pub fn png(scene: &Scene) -> Result<Vec<u8>, DrawError> {
    raster(scene)?.png()
}

/// Pixels, RGB row by row.
pub struct Raster {
    width: u32,
    height: u32,
    samples: Vec<u8>,
}

impl Raster {
    pub fn png(&self) -> Result<Vec<u8>, DrawError> {
        let mut bytes = Vec::new();
        PngEncoder::new(&mut bytes)
            .write_image(&self.samples, self.width, self.height, ColorType::Rgb8)
            .map_err(|error| error.to_string())?;
        Ok(bytes)
    }

    /// Both pictures, `other` below; they are of one width.
    pub fn above(mut self, other: &Raster) -> Raster {
        assert_eq!(self.width, other.width, "pictures of one width");
        self.height += other.height;
        self.samples.extend(&other.samples);
        self
    }
}

/// A page as pixels.
pub fn raster(scene: &Scene) -> Result<Raster, DrawError> {
    let scale = PNG_SCALE * SUPERSAMPLE;
    let (width, height) = (pixels(scene.width, scale as f64), pixels(scene.height, scale as f64));
    let mut samples = vec![255; 3 * width as usize * height as usize];
    let mut backend = BitMapBackend::with_buffer(&mut samples, (width, height));
    let mut pen = Pen { backend: &mut backend, scale: scale as f64 };
    for shape in &scene.shapes {
        match shape {
            Shape::Line { points, width, colour } => pen.thick_line(points, *width, *colour)?,
            Shape::Text(text) => pen.glyphs(text)?,
            other => pen.filled(other)?,
        }
    }
    drop(backend);
    let samples = box_average(&samples, width as usize, height as usize);
    let step = SUPERSAMPLE as u32;
    Ok(Raster { width: width / step, height: height / step, samples })
}

fn pixels(length: f64, scale: f64) -> u32 {
    (length * scale).round() as u32
}

fn page_corners(scene: &Scene) -> [Point; 4] {
    let (w, h) = (scene.width, scene.height);
    [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)]
}

/// Replaces plotters' opening tag by one whose size is the page's.
fn with_page_size(document: &str, scene: &Scene) -> String {
    let body = document.split_once('\n').map_or("", |(_, body)| body);
    let (w, h) = (scene.width, scene.height);
    let (box_w, box_h) = (w * SVG_SCALE, h * SVG_SCALE);
    format!(
        "<svg width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {box_w} {box_h}\" \
         stroke-linejoin=\"round\" xmlns=\"http://www.w3.org/2000/svg\">\n{body}"
    )
}

/// Averages squares of [`SUPERSAMPLE`]² RGB samples.
fn box_average(samples: &[u8], width: usize, height: usize) -> Vec<u8> {
    let (step, area) = (SUPERSAMPLE, (SUPERSAMPLE * SUPERSAMPLE) as u32);
    let mut averaged = Vec::with_capacity(samples.len() / area as usize);
    for y in 0..height / step {
        for x in 0..width / step {
            for channel in 0..3 {
                let sum: u32 = (0..step * step)
                    .map(|i| (y * step + i / step) * width + x * step + i % step)
                    .map(|sample| u32::from(samples[3 * sample + channel]))
                    .sum();
                averaged.push(((sum + area / 2) / area) as u8);
            }
        }
    }
    averaged
}

/// A plotters backend that is told page pixels.
struct Pen<'a, B: DrawingBackend> {
    backend: &'a mut B,
    scale: f64,
}

impl<B: DrawingBackend> Pen<'_, B> {
    fn place(&self, (x, y): Point) -> (i32, i32) {
        ((x * self.scale).round() as i32, (y * self.scale).round() as i32)
    }

    fn filled(&mut self, shape: &Shape) -> Result<(), DrawError> {
        match shape {
            Shape::Area { points, colour } => self.area(points, *colour),
            Shape::Disc { centre, radius, colour } => self.disc(*centre, *radius, *colour),
            Shape::Line { .. } | Shape::Text(_) => unreachable!("drawn by each format's own way"),
        }
    }

    fn area(&mut self, points: &[Point], colour: Rgb) -> Result<(), DrawError> {
        let corners: Vec<_> = points.iter().map(|&point| self.place(point)).collect();
        self.backend.fill_polygon(corners, &rgb(colour)).map_err(|error| error.to_string())
    }

    fn disc(&mut self, centre: Point, radius: f64, colour: Rgb) -> Result<(), DrawError> {
        let (centre, radius) = (self.place(centre), pixels(radius, self.scale));
        let drawn = self.backend.draw_circle(centre, radius, &rgb(colour), true);
        drawn.map_err(|error| error.to_string())
    }

    fn path(&mut self, points: &[Point], width: f64, colour: Rgb) -> Result<(), DrawError> {
        let path: Vec<_> = points.iter().map(|&point| self.place(point)).collect();
        let stroke_width = pixels(width, self.scale);
        let style = ShapeStyle { color: rgb(colour).to_rgba(), filled: false, stroke_width };
        self.backend.draw_path(path, &style).map_err(|error| error.to_string())
    }

    /// Strokes by filling: plotters' own bitmap paths grow spikes at sharp corners.
    fn thick_line(&mut self, points: &[Point], width: f64, colour: Rgb) -> Result<(), DrawError> {
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
            return self.upright_segment(a, b, width, colour);
        }
        let half = width / 2.0 / dx.hypot(dy);
        let (nx, ny) = (-dy * half, dx * half);
        let corners = [(a.0 + nx, a.1 + ny), (b.0 + nx, b.1 + ny), (b.0 - nx, b.1 - ny)];
        self.area(&[corners[0], corners[1], corners[2], (a.0 - nx, a.1 - ny)], colour)
    }

    /// A horizontal or vertical segment as a rectangle, so that grids and frames stay crisp.
    fn upright_segment(
        &mut self,
        a: Point,
        b: Point,
        width: f64,
        colour: Rgb,
    ) -> Result<(), DrawError> {
        let (half_x, half_y) = if a.0 == b.0 { (width / 2.0, 0.0) } else { (0.0, width / 2.0) };
        let low = self.place((a.0.min(b.0) - half_x, a.1.min(b.1) - half_y));
        let high = self.place((a.0.max(b.0) + half_x, a.1.max(b.1) + half_y));
        let drawn = self.backend.draw_rect(low, high, &rgb(colour), true);
        drawn.map_err(|error| error.to_string())
    }

    /// Text as text, which a reader can select and search.
    fn svg_text(&mut self, text: &Text) -> Result<(), DrawError> {
        let size = text.em * self.scale * SVG_SIZE_PER_EM;
        let face = (FAMILY, size, text.weight.style());
        let anchor = match text.anchor {
            Anchor::Start => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::End => HPos::Right,
        };
        let ink = rgb(text.colour);
        let mut style = TextStyle::from(face).color(&ink);
        style.pos = Pos::new(anchor, VPos::Top);
        let hang = SVG_HANG_EM * text.em;
        let (x, y) = text.at;
        let at = if text.upward { (x - hang, y) } else { (x, y - hang) };
        if text.upward {
            style = style.transform(FontTransform::Rotate270);
        }
        let drawn = self.backend.draw_text(&text.content, &style, self.place(at));
        drawn.map_err(|error| error.to_string())
    }

    /// Text as pixels, glyph by glyph, each at its kerned place and side bearing.
    fn glyphs(&mut self, text: &Text) -> Result<(), DrawError> {
        let em = text.em * self.scale;
        let width = measure(&text.content, text.weight, em);
        let start = match text.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -width / 2.0,
            Anchor::End => -width,
        };
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
        let font = font(text.weight, text.em * self.scale);
        // plotters puts the baseline at half the size; an even size keeps that a whole pixel.
        let half = (font.get_size() / 2.0).round();
        let origin = self.place(text.at);
        let backend = &mut *self.backend;
        let drawn = font.resize(2.0 * half).draw(glyph, (0, 0), |x, y, cover| {
            let (right, down) = (along.round() as i32 + x, y - half as i32);
            let (dx, dy) = if text.upward { (down, -right) } else { (right, down) };
            let ink = rgb(text.colour).mix(f64::from(cover)).to_backend_color();
            backend.draw_pixel((origin.0 + dx, origin.1 + dy), ink)
        });
        match drawn {
            Ok(pixels) => pixels.map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        }
    }
}

fn rgb(Rgb(r, g, b): Rgb) -> RGBColor {
    RGBColor(r, g, b)
}
