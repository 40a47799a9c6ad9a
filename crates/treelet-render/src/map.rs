//! A picture of all that is far away, sampled by its brightness.
//!
//! The picture is parted into at most 512 by 256 cells; one is chosen by its mean luminance times
//! its solid angle (`alias.rs`), and a direction is uniform in it. A cell counts the pixels around
//! it too, as bilinear lookups do: whatever shines can be drawn.

use crate::alias::AliasTable;
use crate::color;
use crate::error::RenderError;
use crate::texture::Sampler2;
use core::f64::consts::PI;
use treelet::math::vec3;
use treelet_model::light::Projection;
use treelet_model::texture::{ColorSpace, Wrap};
use treelet_model::{Environment, Image, Texture};

/// The most cells along each side.
const COLUMNS: u32 = 512;
const ROWS: u32 = 256;
/// What a turn may be off by: entries of the product with its transpose.
const TURN_ERROR: f32 = 1e-3;

/// An environment, prepared for sampling.
#[derive(Clone, Debug)]
pub(crate) struct MapLight<'a> {
    texture: Sampler2<'a>,
    projection: Projection,
    scale: [f32; 3],
    /// Columns of the turn from the environment's directions to the world's.
    axes: [[f32; 3]; 3],
    columns: u32,
    rows: u32,
    table: AliasTable,
    /// Density over solid angle, by cell.
    density: Vec<f32>,
    irradiance: f64,
}

impl<'a> MapLight<'a> {
    /// Checks and tabulates an environment.
    pub(crate) fn new(environment: &Environment, images: &'a [Image]) -> Result<Self, RenderError> {
        let wrap = match environment.projection {
            Projection::LatLong => [Wrap::Repeat, Wrap::Clamp],
            Projection::EqualAreaOctahedral => [Wrap::Clamp; 2],
        };
        let texture = Texture { wrap, ..Texture::new(environment.image, ColorSpace::Srgb) };
        let texture = Sampler2::new(&texture, images, &|| "the environment".to_owned())?;
        let [r, g, b] = environment.scale;
        if let Some(value) = [r, g, b].into_iter().find(|c| !(c.is_finite() && *c >= 0.0)) {
            let remedy = "it must be finite and not negative";
            return Err(RenderError::Sky { factor: "environment scale", value, remedy });
        }
        let rows = environment.world_from_environment.0;
        let axes = [0, 1, 2].map(|k| rows.map(|row| row[k]));
        let off = (0..9).map(|i| {
            let (a, b) = (i / 3, i % 3);
            (vec3::dot(axes[a], axes[b]) - if a == b { 1.0 } else { 0.0 }).abs()
        });
        let off = off.fold(0.0, |most: f32, x| if x <= most { most } else { x });
        if off.is_nan() || off >= TURN_ERROR {
            let remedy = "its matrix must be a rotation or a mirror image";
            return Err(RenderError::Sky { factor: "environment turn", value: off, remedy });
        }
        let image = &images[environment.image];
        let (columns, rows) = (image.width.min(COLUMNS), image.height.min(ROWS));
        let mut out = Self {
            texture,
            projection: environment.projection,
            scale: environment.scale,
            axes,
            columns,
            rows,
            table: AliasTable::new(&[1.0])?,
            density: Vec::new(),
            irradiance: 0.0,
        };
        out.tabulate(image)?;
        Ok(out)
    }

    fn tabulate(&mut self, image: &Image) -> Result<(), RenderError> {
        let cells = (self.columns * self.rows) as usize;
        let (mut weights, mut sum) = (Vec::with_capacity(cells), 0.0);
        for row in 0..self.rows {
            let solid_angle = self.solid_angle(row);
            for column in 0..self.columns {
                let luminance = self.cell_luminance(image, column, row);
                weights.push(luminance * solid_angle);
                sum += luminance * solid_angle;
            }
        }
        // A quarter of the sphere's flux is about what a surface gets.
        self.irradiance = 0.25 * sum;
        if !(sum > 0.0 && sum.is_finite()) {
            self.irradiance = 0.0;
            weights.fill(1.0);
            sum = cells as f64;
        }
        self.table = AliasTable::new(&weights)?;
        let solid_angles = (0..cells).map(|cell| self.solid_angle(cell as u32 / self.columns));
        self.density = solid_angles
            .zip(&weights)
            .map(|(solid_angle, weight)| (weight / sum / solid_angle) as f32)
            .collect();
        Ok(())
    }

    /// The mean luminance of a cell and the pixels around it.
    fn cell_luminance(&self, image: &Image, column: u32, row: u32) -> f64 {
        let span = |cell: u32, cells: u32, side: u32| {
            let edge = |cell: u32| (u64::from(cell) * u64::from(side) / u64::from(cells)) as i64;
            let end = (u64::from(cell + 1) * u64::from(side)).div_ceil(u64::from(cells)) as i64;
            (edge(cell) - 1, end + 1)
        };
        let (left, right) = span(column, self.columns, image.width);
        let (top, bottom) = span(row, self.rows, image.height);
        let mut sum = 0.0;
        for y in top..bottom {
            for x in left..right {
                let [r, g, b, _] = self.texture.pixel(x, y);
                let shown = color::mul([r, g, b].map(|c| c.max(0.0)), self.scale);
                sum += f64::from(color::luminance(shown));
            }
        }
        sum / ((right - left) * (bottom - top)) as f64
    }

    /// Of a cell in a row.
    fn solid_angle(&self, row: u32) -> f64 {
        match self.projection {
            Projection::LatLong => {
                let cos = |row: u32| libm::cos(PI * f64::from(row) / f64::from(self.rows));
                2.0 * PI / f64::from(self.columns) * (cos(row) - cos(row + 1))
            }
            Projection::EqualAreaOctahedral => {
                4.0 * PI / (f64::from(self.columns) * f64::from(self.rows))
            }
        }
    }

    /// About the irradiance of a surface that sees half of it.
    pub(crate) fn irradiance(&self) -> f64 {
        self.irradiance
    }

    /// Radiance from a unit direction.
    pub(crate) fn radiance(&self, direction: [f32; 3]) -> [f32; 3] {
        let [r, g, b, _] = self.texture.at(self.place(direction));
        color::mul([r, g, b].map(|c| c.max(0.0)), self.scale)
    }

    /// A direction, for a number that chooses and a point of the unit square.
    pub(crate) fn sample(&self, choice: f32, [u, v]: [f32; 2]) -> [f32; 3] {
        // Part one coordinate into 32 bits for the cell, and what is left.
        let scaled = f64::from(choice) * 4_294_967_296.0;
        let bits = scaled as u32;
        // The lowest bits of one coordinate decide between a cell and its alias.
        let cells = u32::try_from(self.density.len()).unwrap_or(u32::MAX);
        let fine = u * 256.0;
        let coin = fine - libm::floorf(fine);
        let cell = self.table.sample(bits, coin).min(cells - 1);
        let (column, row) = (cell % self.columns, cell / self.columns);
        let x = (column as f32 + u) / self.columns as f32;
        let local = match self.projection {
            Projection::LatLong => {
                let cos =
                    |row: u32| libm::cosf(core::f32::consts::PI * row as f32 / self.rows as f32);
                let (upper, lower) = (cos(row), cos(row + 1));
                let y = upper + v * (lower - upper);
                let sin = (1.0 - y * y).max(0.0).sqrt();
                let (across, along) = libm::sincosf(core::f32::consts::TAU * (x - 0.5));
                [sin * across, y, -sin * along]
            }
            Projection::EqualAreaOctahedral => {
                octahedral_direction([x, (row as f32 + v) / self.rows as f32])
            }
        };
        let [a, b, c] = self.axes;
        let world: [f32; 3] =
            core::array::from_fn(|k| a[k] * local[0] + b[k] * local[1] + c[k] * local[2]);
        vec3::normalize(world).unwrap_or([0.0, 1.0, 0.0])
    }

    /// The density over solid angle with which [`MapLight::sample`] draws a unit direction.
    pub(crate) fn pdf(&self, direction: [f32; 3]) -> f32 {
        let [x, y] = self.place(direction);
        let column = ((x * self.columns as f32) as u32).min(self.columns - 1);
        let row = ((y * self.rows as f32) as u32).min(self.rows - 1);
        self.density[(row * self.columns + column) as usize]
    }

    /// Coordinates of the picture, each in `0 ..= 1`.
    #[inline]
    fn place(&self, direction: [f32; 3]) -> [f32; 2] {
        let local = self.axes.map(|axis| vec3::dot(axis, direction));
        match self.projection {
            Projection::LatLong => {
                let turn = libm::atan2f(local[0], -local[2]) * (0.5 * core::f32::consts::FRAC_1_PI);
                let height = libm::acosf(local[1].clamp(-1.0, 1.0));
                [0.5 + turn, height * core::f32::consts::FRAC_1_PI]
            }
            Projection::EqualAreaOctahedral => octahedral_place(local),
        }
    }
}

/// A direction of the equal-area octahedron (Clarberg 2008), for a point of the unit square.
fn octahedral_direction(place: [f32; 2]) -> [f32; 3] {
    let [u, v] = place.map(|c| 2.0 * c - 1.0);
    let (across, along) = (u.abs(), v.abs());
    // Inside the diamond is the upper half; the corners are folded over.
    let inside = 1.0 - (across + along);
    let radius = 1.0 - inside.abs();
    let turn = if radius == 0.0 { 1.0 } else { (along - across) / radius + 1.0 };
    let (sin, cos) = libm::sincosf(turn * core::f32::consts::FRAC_PI_4);
    let flat = radius * (2.0 - radius * radius).max(0.0).sqrt();
    let height = (1.0 - radius * radius).copysign(inside);
    [(cos * flat).copysign(u), (sin * flat).copysign(v), height]
}

/// The inverse of [`octahedral_direction`], for a unit vector.
fn octahedral_place(direction: [f32; 3]) -> [f32; 2] {
    let [x, y, z] = direction.map(f32::abs);
    let radius = (1.0 - z).max(0.0).sqrt();
    let (most, least) = (x.max(y), x.min(y));
    let turn = libm::atan2f(least, most) * core::f32::consts::FRAC_2_PI;
    let turn = if x < y { 1.0 - turn } else { turn };
    let along = turn * radius;
    let across = radius - along;
    let (across, along) =
        if direction[2] < 0.0 { (1.0 - along, 1.0 - across) } else { (across, along) };
    [across.copysign(direction[0]), along.copysign(direction[1])].map(|c| 0.5 * (c + 1.0))
}

#[cfg(test)]
mod tests {
    use super::{MapLight, octahedral_direction, octahedral_place};
    use crate::sampler::{Sampler, sobol};
    use core::f32::consts::TAU;
    use treelet::math::Affine;
    use treelet_model::light::Projection;
    use treelet_model::{Environment, Image, Pixels};

    fn sphere(i: u32) -> [f32; 3] {
        let u = sobol(i);
        let z = 2.0 * u[0] - 1.0;
        let radius = (1.0 - z * z).sqrt();
        [radius * libm::cosf(TAU * u[1]), radius * libm::sinf(TAU * u[1]), z]
    }

    /// A dim picture with one bright pixel.
    fn image(width: u32, height: u32) -> Image {
        let mut pixels = vec![[0.1, 0.2, 0.3, 1.0]; (width * height) as usize];
        pixels[(height / 3 * width + width / 4) as usize] = [50.0, 40.0, 30.0, 1.0];
        Image { name: String::new(), width, height, pixels: Pixels::Rgba32F(pixels.into()) }
    }

    fn environment(projection: Projection) -> Environment {
        let world_from_environment = Affine::rotation([1.0, 2.0, 0.5], 1.0);
        Environment { image: 0, projection, world_from_environment, scale: [1.0, 2.0, 1.0] }
    }

    /// The density integrates to 1, and sampling and uniform directions agree on the flux.
    #[test]
    fn density_and_samples_agree() {
        for (projection, width, height) in [
            (Projection::LatLong, 32, 16),
            (Projection::LatLong, 700, 300),
            (Projection::EqualAreaOctahedral, 40, 40),
        ] {
            let images = [image(width, height)];
            let map = MapLight::new(&environment(projection), &images).unwrap();
            let n = 1 << 17;
            let (mut density, mut flux, mut sampled) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let direction = sphere(i);
                density += f64::from(map.pdf(direction)) * f64::from(2.0 * TAU);
                flux += f64::from(map.radiance(direction)[1] * 2.0 * TAU);
                let sampler = Sampler::new(4, 0, 0, i);
                let direction = map.sample(sampler.pair(0)[0], sampler.pair(1));
                sampled += f64::from(map.radiance(direction)[1] / map.pdf(direction));
            }
            let n = f64::from(n);
            let case = format!("{projection:?} {width}");
            assert!((density / n - 1.0).abs() < 0.02, "{case}: {}", density / n);
            let (flux, sampled) = (flux / n, sampled / n);
            assert!((flux / sampled - 1.0).abs() < 0.02, "{case}: {flux} {sampled}");
        }
    }

    #[test]
    fn directions_lead_to_the_pixels_that_are_promised() {
        let images = [image(8, 4)];
        let plain = |projection| Environment {
            world_from_environment: Affine::IDENTITY,
            ..environment(projection)
        };
        let map = MapLight::new(&plain(Projection::LatLong), &images).unwrap();
        for (direction, place) in [
            ([0.0, 0.0, -1.0], [0.5, 0.5]),
            ([1.0, 0.0, 0.0], [0.75, 0.5]),
            ([-1.0, 0.0, 0.0], [0.25, 0.5]),
        ] {
            let got = map.place(direction);
            assert!((0..2).all(|k| (got[k] - place[k]).abs() < 1e-6), "{direction:?}: {got:?}");
        }
        assert!(map.place([0.0, 1.0, 0.0])[1] < 1e-6, "+y is the top row");
        assert_eq!(octahedral_place([0.0, 0.0, 1.0]), [0.5, 0.5]);
        assert!(octahedral_place([1.0, 0.0, 0.0])[0] > 0.99);
        assert!(octahedral_place([0.0, 1.0, 0.0])[1] > 0.99);
        for i in 0..1000 {
            let place = sobol(i + 1);
            let direction = octahedral_direction(place);
            let length: f32 = direction.iter().map(|c| c * c).sum();
            assert!((length - 1.0).abs() < 1e-5);
            let back = octahedral_place(direction);
            assert!((0..2).all(|k| (back[k] - place[k]).abs() < 1e-3), "{place:?} {back:?}");
        }
    }

    #[test]
    fn black_pictures_and_bent_turns() {
        let mut black = image(4, 4);
        black.pixels = Pixels::Rgba32F(vec![[0.0, 0.0, 0.0, 1.0]; 16].into());
        let images = [black];
        let map = MapLight::new(&environment(Projection::LatLong), &images).unwrap();
        assert_eq!(map.irradiance(), 0.0);
        assert!(map.pdf([0.0, 1.0, 0.0]) > 0.0);
        let stretched = Environment {
            world_from_environment: Affine::scaling([1.0, 2.0, 1.0]),
            ..environment(Projection::LatLong)
        };
        assert!(MapLight::new(&stretched, &images).is_err());
        let nowhere = Environment { image: 3, ..environment(Projection::LatLong) };
        assert!(MapLight::new(&nowhere, &images).is_err());
    }
}
