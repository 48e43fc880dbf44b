//! A software rasteriser: triangles and edges with a depth buffer, seen in parallel projection, and polygons on top.
//!
//! Everything is drawn at [`SAMPLES`] samples per pixel and side, and averaged in the end. The result depends on nothing but
//! the input: one thread draws one picture.

use nalgebra::{Point3, Rotation3, Vector3};

use super::{DrawnPart, Placement, Rgb};

/// Samples per pixel and side. At 1 edges are jagged; at double, a picture takes four times as long and looks the same.
pub(super) const SAMPLES: usize = 3;
/// Samples. An edge is drawn if it is at most this far behind the surface at its place. At half, edges of slanted faces are
/// dotted; at double, edges shine through thin sheets.
const EDGE_BIAS: f32 = 3.0;
/// Share of the light that a face gets if it is turned away from the lamp. At half, undersides are nearly black; at 1, faces
/// do not differ.
const AMBIENT: f64 = 0.6;
/// No part.
const NOTHING: u32 = u32::MAX;

/// A parallel projection onto an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Camera {
    right: Vector3<f64>,
    up: Vector3<f64>,
    /// Unit direction from what is seen to the viewer.
    pub(super) back: Vector3<f64>,
    /// What is in the middle of the image.
    centre: Point3<f64>,
    /// Pixels per unit of length.
    scale: f64,
    /// Pixels.
    size: [usize; 2],
}

impl Camera {
    /// Looks against `back` with `up` upwards, so that all points are in the image, with a margin (share of the image).
    pub(super) fn fitting(
        back: &Vector3<f64>,
        up: &Vector3<f64>,
        points: &[Point3<f64>],
        size: [usize; 2],
        margin: f64,
    ) -> Self {
        let back = back.normalize();
        let right =
            up.cross(&back).try_normalize(1e-9).unwrap_or_else(|| back.cross(&Vector3::x()).normalize());
        let up = back.cross(&right);
        let span = |axis: &Vector3<f64>| {
            let along = points.iter().map(|p| p.coords.dot(axis));
            let (low, high) =
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            if low <= high { [low, high] } else { [0.0; 2] }
        };
        let [x, y, z] = [span(&right), span(&up), span(&back)];
        let middle = |s: [f64; 2]| (s[0] + s[1]) / 2.0;
        let centre = Point3::from(right * middle(x) + up * middle(y) + back * middle(z));
        let inner = size.map(|s| s as f64 * (1.0 - 2.0 * margin));
        let extent = |s: [f64; 2]| (s[1] - s[0]).max(f64::MIN_POSITIVE);
        let scale = (inner[0] / extent(x)).min(inner[1] / extent(y)).min(1e12);
        Self { right, up, back, centre, scale, size }
    }

    /// The same view of another image, with more samples per pixel.
    pub(super) fn supersampled(&self) -> Self {
        Self { scale: self.scale * SAMPLES as f64, size: self.size.map(|s| s * SAMPLES), ..*self }
    }

    /// Where a point is in the image: to the right, down and towards the viewer, all in pixels.
    pub(super) fn project(&self, point: &Point3<f64>) -> [f64; 3] {
        let at = (point - self.centre) * self.scale;
        let [w, h] = self.size.map(|s| s as f64 / 2.0);
        [w + at.dot(&self.right), h - at.dot(&self.up), at.dot(&self.back)]
    }

    /// Units of length per pixel.
    pub(super) fn pixel(&self) -> f64 {
        1.0 / self.scale
    }
}

/// What is seen of some parts: at each sample the nearest one, how far it is and how bright.
pub(super) struct Layer {
    size: [usize; 2],
    depth: Vec<f32>,
    part: Vec<u32>,
    shade: Vec<u8>,
    /// Whether an edge is there.
    edge: Vec<bool>,
}

impl Layer {
    pub(super) fn new(camera: &Camera) -> Self {
        let count = camera.size[0] * camera.size[1];
        Self {
            size: camera.size,
            depth: vec![f32::NEG_INFINITY; count],
            part: vec![NOTHING; count],
            shade: vec![0; count],
            edge: vec![false; count],
        }
    }

    /// Draws the surface of a part.
    pub(super) fn surface(&mut self, camera: &Camera, mesh: &DrawnPart, at: &Placement, part: u32) {
        let lamp = (camera.back * 0.85 + camera.up * 0.4 - camera.right * 0.3).normalize();
        let rotation = at.rotation.to_rotation_matrix();
        let shade = |n: &[f32; 3]| {
            let normal = rotation * Vector3::from(n.map(f64::from));
            // Surfaces may be open: both sides are lit.
            let facing = if normal.dot(&camera.back) < 0.0 { -normal } else { normal };
            AMBIENT + (1.0 - AMBIENT) * facing.dot(&lamp).max(0.0)
        };
        let points = projected(camera, mesh, at, &rotation);
        let shades: Vec<f64> = mesh.normals.iter().map(shade).collect();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| v as usize);
            self.triangle([points[a], points[b], points[c]], [shades[a], shades[b], shades[c]], part);
        }
    }

    fn triangle(&mut self, [a, b, c]: [[f64; 3]; 3], shades: [f64; 3], part: u32) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area.abs() < 1e-12 || !area.is_finite() {
            return;
        }
        let range = |k: usize| {
            let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            // Samples are taken in the middle. As a cast saturates, what is far outside is cut.
            ((low - 0.5).ceil().max(0.0) as usize, ((high + 0.5).floor().max(0.0) as usize).min(self.size[k]))
        };
        let ((left, right), (top, bottom)) = (range(0), range(1));
        for y in top..bottom {
            let py = y as f64 + 0.5;
            for x in left..right {
                let px = x as f64 + 0.5;
                let u = ((b[0] - px) * (c[1] - py) - (b[1] - py) * (c[0] - px)) / area;
                let v = ((c[0] - px) * (a[1] - py) - (c[1] - py) * (a[0] - px)) / area;
                let w = 1.0 - u - v;
                if u < 0.0 || v < 0.0 || w < 0.0 {
                    continue;
                }
                let depth = (u * a[2] + v * b[2] + w * c[2]) as f32;
                let at = y * self.size[0] + x;
                if depth > self.depth[at] {
                    let shade = u * shades[0] + v * shades[1] + w * shades[2];
                    self.depth[at] = depth;
                    self.part[at] = part;
                    self.shade[at] = (shade * 255.0) as u8;
                }
            }
        }
    }

    /// Marks the sharp edges of a part where they are not hidden. All surfaces are drawn before.
    pub(super) fn edges(&mut self, camera: &Camera, mesh: &DrawnPart, at: &Placement) {
        let points = projected(camera, mesh, at, &at.rotation.to_rotation_matrix());
        let limit = self.size.map(|s| s as f64);
        for [a, b] in &mesh.edges {
            let (a, b) = (points[*a as usize], points[*b as usize]);
            let beside = |k: usize| a[k].max(b[k]) < 0.0 || a[k].min(b[k]) > limit[k];
            if beside(0) || beside(1) {
                continue;
            }
            let length = (b[0] - a[0]).abs().max((b[1] - a[1]).abs());
            // A longer line reaches far outside the image, where nothing is drawn anyway.
            let count = length.ceil().clamp(1.0, 1e5);
            for i in 0..=count as usize {
                let u = i as f64 / count;
                let [x, y, z] = [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * u);
                self.mark(x, y, z as f32);
            }
        }
    }

    fn mark(&mut self, x: f64, y: f64, depth: f32) {
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
            let (x, y) = (x + dx, y + dy);
            if x < 0.0 || y < 0.0 || x >= self.size[0] as f64 || y >= self.size[1] as f64 {
                continue;
            }
            let at = y as usize * self.size[0] + x as usize;
            if depth + EDGE_BIAS >= self.depth[at] {
                self.edge[at] = true;
            }
        }
    }

    /// How many samples show each of some parts.
    pub(super) fn count(&self, is_counted: impl Fn(u32) -> bool) -> usize {
        self.part.iter().filter(|&&part| part != NOTHING && is_counted(part)).count()
    }

    /// How many samples of this layer another one covers.
    pub(super) fn covered_by(&self, other: &Self) -> usize {
        let covers = |i: &usize| self.part[*i] != NOTHING && other.depth[*i] > self.depth[*i];
        (0..self.part.len()).filter(covers).count()
    }

    /// Whether a sample is where one part ends: on an edge, or beside another part.
    fn is_line(&self, x: usize, y: usize, thick: usize) -> bool {
        let at = y * self.size[0] + x;
        let own = self.part[at];
        let other = |x: usize, y: usize| {
            self.part[y.min(self.size[1] - 1) * self.size[0] + x.min(self.size[0] - 1)] != own
        };
        self.edge[at]
            || (1..=thick).any(|d| {
                other(x + d, y)
                    || other(x, y + d)
                    || other(x.saturating_sub(d), y)
                    || other(x, y.saturating_sub(d))
            })
    }
}

/// The vertices of a part in the image.
fn projected(camera: &Camera, mesh: &DrawnPart, at: &Placement, rotation: &Rotation3<f64>) -> Vec<[f64; 3]> {
    let place = |p: &[f32; 3]| camera.project(&(at.centre + rotation * Vector3::from(p.map(f64::from))));
    mesh.positions.iter().map(place).collect()
}

/// How a part is painted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Paint {
    pub(super) colour: Rgb,
    pub(super) edge: Rgb,
    /// Samples: half the width of its outline.
    pub(super) outline: usize,
}

/// An image under way, at all samples.
pub(super) struct Canvas {
    size: [usize; 2],
    colours: Vec<[f32; 3]>,
}

impl Canvas {
    pub(super) fn new(camera: &Camera, background: Rgb) -> Self {
        Self { size: camera.size, colours: vec![background.map(f32::from); camera.size[0] * camera.size[1]] }
    }

    /// Paints a layer over what is there, where `below` is not nearer. `opacity` is that of faces and of lines.
    pub(super) fn paint(
        &mut self,
        layer: &Layer,
        below: Option<&Layer>,
        opacity: [f32; 2],
        paint: impl Fn(u32) -> Paint,
    ) {
        for y in 0..self.size[1] {
            for x in 0..self.size[0] {
                let at = y * self.size[0] + x;
                let part = layer.part[at];
                let is_hidden = below.is_some_and(|below| below.depth[at] > layer.depth[at]);
                if is_hidden || (part == NOTHING && !layer.edge[at]) {
                    continue;
                }
                // An edge may reach a sample beyond its part.
                let look = paint(if part == NOTHING { self.beside(layer, x, y) } else { part });
                let is_line = layer.is_line(x, y, look.outline);
                let shade = f32::from(layer.shade[at]) / 255.0;
                let (colour, share) = match is_line {
                    true => (look.edge.map(f32::from), opacity[1]),
                    false => (look.colour.map(|c| f32::from(c) * shade), opacity[0]),
                };
                for (old, new) in self.colours[at].iter_mut().zip(colour) {
                    *old += (new - *old) * share;
                }
            }
        }
    }

    /// A part that is next to a sample without one.
    fn beside(&self, layer: &Layer, x: usize, y: usize) -> u32 {
        let [w, h] = self.size;
        let near =
            [(x.saturating_sub(1), y), (x, y.saturating_sub(1)), (x.saturating_sub(1), y.saturating_sub(1))];
        let found = near.iter().map(|&(x, y)| layer.part[y.min(h - 1) * w + x.min(w - 1)]);
        found.into_iter().find(|&part| part != NOTHING).unwrap_or(0)
    }

    /// Fills a polygon (samples; even-odd).
    pub(super) fn polygon(&mut self, points: &[[f64; 2]], colour: Rgb) {
        let (low, high) =
            points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[1]), h.max(p[1])));
        let rows = low.max(0.0) as usize..(high.ceil().max(0.0) as usize).min(self.size[1]);
        for y in rows {
            let py = y as f64 + 0.5;
            let mut crossings: Vec<f64> = Vec::new();
            for (i, a) in points.iter().enumerate() {
                let b = points[(i + 1) % points.len()];
                if (a[1] <= py) != (b[1] <= py) {
                    crossings.push(a[0] + (b[0] - a[0]) * (py - a[1]) / (b[1] - a[1]));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let (from, to) = (
                    pair[0].round().max(0.0) as usize,
                    (pair[1].round().max(0.0) as usize).min(self.size[0]),
                );
                for x in from..to {
                    self.colours[y * self.size[0] + x] = colour.map(f32::from);
                }
            }
        }
    }

    /// The image, with the samples of each pixel averaged.
    pub(super) fn image(&self) -> Image {
        let size = self.size.map(|s| s / SAMPLES);
        let mut pixels = Vec::with_capacity(size[0] * size[1]);
        for y in 0..size[1] {
            for x in 0..size[0] {
                let mut sum = [0.0f32; 3];
                for at in (0..SAMPLES * SAMPLES)
                    .map(|k| (y * SAMPLES + k / SAMPLES) * self.size[0] + x * SAMPLES + k % SAMPLES)
                {
                    (0..3).for_each(|k| sum[k] += self.colours[at][k]);
                }
                pixels.push(sum.map(|s| (s / (SAMPLES * SAMPLES) as f32).round() as u8));
            }
        }
        Image { size, pixels }
    }
}

/// A picture in pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Image {
    pub(super) size: [usize; 2],
    /// Row by row from the top.
    pub(super) pixels: Vec<Rgb>,
}

impl Image {
    /// Puts another image on top, with its upper left corner at a pixel.
    pub(super) fn put(&mut self, other: &Self, [left, top]: [usize; 2]) {
        for (y, row) in other.pixels.chunks(other.size[0].max(1)).enumerate() {
            let to = (top + y) * self.size[0] + left;
            self.pixels[to..to + row.len()].copy_from_slice(row);
        }
    }

    /// Draws a frame of one pixel, from an upper left to a lower right pixel; what is outside is cut.
    pub(super) fn frame(&mut self, from: [f64; 2], to: [f64; 2], colour: Rgb) {
        let [w, h] = self.size;
        let inside = |x: f64, limit: usize| (x.round().max(0.0) as usize).min(limit.saturating_sub(1));
        let ([left, top], [right, bottom]) =
            ([inside(from[0], w), inside(from[1], h)], [inside(to[0], w), inside(to[1], h)]);
        for x in left..=right {
            self.pixels[top * w + x] = colour;
            self.pixels[bottom * w + x] = colour;
        }
        for y in top..=bottom {
            self.pixels[y * w + left] = colour;
            self.pixels[y * w + right] = colour;
        }
    }

    /// As the bytes of a PNG file.
    pub(super) fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.size[0] as u32, self.size[1] as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    /// A square in the plane z = 0, with sides of 2 about its placement.
    fn square() -> DrawnPart {
        DrawnPart {
            positions: vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            edges: vec![[0, 1], [1, 2], [2, 3], [3, 0]],
        }
    }

    fn at(x: f64, z: f64) -> Placement {
        Placement { centre: Point3::new(x, 0.0, z), rotation: UnitQuaternion::identity() }
    }

    /// Ten units are a hundred pixels, seen from +z with +y up.
    fn from_above() -> Camera {
        let corners = [Point3::new(-5.0, -5.0, 0.0), Point3::new(5.0, 5.0, 0.0)];
        Camera::fitting(&Vector3::z(), &Vector3::y(), &corners, [100, 100], 0.0)
    }

    #[test]
    fn the_nearer_surface_is_seen() {
        let camera = from_above();
        let mut layer = Layer::new(&camera);
        layer.surface(&camera, &square(), &at(0.0, 1.0), 0);
        assert_eq!(layer.count(|part| part == 0), 400);
        layer.surface(&camera, &square(), &at(1.0, 0.0), 1);
        layer.surface(&camera, &square(), &at(-1.0, 2.0), 2);
        let counts = [0, 1, 2].map(|part| layer.count(|p| p == part));
        assert_eq!(counts, [200, 200, 400]);
    }

    #[test]
    fn what_covers_is_counted() {
        let camera = from_above();
        let [mut low, mut high] = [Layer::new(&camera), Layer::new(&camera)];
        low.surface(&camera, &square(), &at(0.0, 0.0), 0);
        high.surface(&camera, &square(), &at(0.5, 1.0), 1);
        assert_eq!((low.covered_by(&high), high.covered_by(&low)), (300, 0));
    }

    #[test]
    fn hidden_edges_are_not_marked() {
        let camera = from_above();
        let mut layer = Layer::new(&camera);
        layer.surface(&camera, &square(), &at(0.0, 9.0), 0);
        let mut small = square();
        small.positions.iter_mut().for_each(|p| *p = p.map(|x| x / 2.0));
        layer.edges(&camera, &small, &at(0.0, 0.0));
        assert!(!layer.edge.contains(&true));
        layer.edges(&camera, &square(), &at(0.0, 9.0));
        assert!(layer.edge.contains(&true));
    }

    #[test]
    fn polygons_are_filled_inside_alone() {
        let camera = from_above();
        let mut canvas = Canvas::new(&camera.supersampled(), [255; 3]);
        let corners = [[30.0, 30.0], [60.0, 30.0], [60.0, 90.0], [30.0, 90.0]];
        canvas.polygon(&corners, [255, 0, 0]);
        let image = canvas.image();
        assert_eq!(image.pixels.iter().filter(|p| **p == [255, 0, 0]).count(), 10 * 20);
        assert_eq!(image.pixels.iter().filter(|p| **p == [255; 3]).count(), 100 * 100 - 10 * 20);
    }
}
