//! Where everything stands.

use treelet::math::Affine;
use treelet::verify::Random;
use treelet_model::{Model, Object, Placement};

use super::forest::SPECIES;
use super::furniture::{flagstone, lantern, sphere, stone};
use super::knot::knot;
use super::meadow::{flowers, tuft};
use super::noise::fractal;
use super::palette::Palette;

use super::shape::turn;
use super::terrace::{FLOOR, PLINTH, RADIUS, terrace};
use super::terrain::{ground, height};

/// Where the path lies in front of the terrace: its middle for a z.
fn path_x(z: f32) -> f32 {
    0.55 * libm::sinf(0.55 * (z - RADIUS)) + 0.25
}

/// Adds the objects and the placements of the garden.
pub(super) fn plant(model: &mut Model) {
    let mut garden = Garden { model, random: Random::new(2024) };
    garden.sculpture();
    garden.furnish();
    garden.pave();
    garden.trees();
    garden.meadow();
}

/// A model that is being filled.
struct Garden<'a> {
    model: &'a mut Model,
    random: Random,
}

impl Garden<'_> {
    /// Adds an object; its place in the list.
    fn object(&mut self, object: Object) -> usize {
        self.model.objects.push(object);
        self.model.objects.len() - 1
    }

    /// Places an object: turned about y by a share of a full turn, then scaled, then moved.
    fn place(&mut self, object: usize, at: [f32; 3], share: f32, scale: f32) {
        let (sin, cos) = turn(share);
        let (sin, cos) = (scale * sin, scale * cos);
        let world_from_object =
            Affine([[cos, 0.0, sin, at[0]], [0.0, scale, 0.0, at[1]], [-sin, 0.0, cos, at[2]]]);
        self.model.placements.push(Placement { object, world_from_object });
    }

    /// Places an object on the ground, turned anyhow.
    fn root(&mut self, object: usize, x: f32, z: f32, scale: f32) {
        let share = self.random.unit();
        self.place(object, [x, height(x, z), z], share, scale);
    }

    /// The ground, the terrace and the knot on its plinth.
    fn sculpture(&mut self) {
        let ground = self.object(Object { name: "ground".into(), parts: vec![ground()] });
        self.place(ground, [0.0; 3], 0.0, 1.0);
        let terrace = self.object(terrace());
        self.place(terrace, [0.0; 3], 0.0, 1.0);
        let knot = self.object(knot(3.3));
        self.place(knot, [0.0, PLINTH + 1.50, 0.0], 0.03, 1.0);
    }

    /// Spheres and lanterns on the terrace, old stones around it.
    fn furnish(&mut self) {
        let spheres = [Palette::Glass, Palette::Steel, Palette::Gold, Palette::Copper];
        let spheres = spheres.map(|material| self.object(sphere(material)));
        // From the left front around the back to the right front: share of a turn, and which.
        let ring = [(0.645, 0), (0.53, 2), (0.42, 1), (0.08, 3), (0.97, 1), (0.855, 0)];
        for (share, kind) in ring {
            let (sin, cos) = turn(share);
            self.place(spheres[kind], [3.95 * cos, FLOOR, -3.95 * sin], share, 1.0);
        }
        let lantern = self.object(lantern());
        for share in [0.60, 0.475, 0.35, 0.15, 0.025, 0.90] {
            let (sin, cos) = turn(share);
            self.place(lantern, [5.45 * cos, FLOOR, -5.45 * sin], share, 1.0);
        }
        let stones = [0.3, 4.1, 8.7].map(|seed| self.object(stone(seed)));
        for index in 0..13 {
            // Behind and beside the terrace, from a little right of the front to the left.
            let share = -0.07 + 0.64 * index as f32 / 12.0 + self.random.between(-0.006, 0.006);
            let far = 9.4 + self.random.between(-0.3, 0.3);
            let (sin, cos) = turn(share);
            let (x, z) = (far * cos, -far * sin);
            let facing = share + 0.25 + self.random.between(-0.03, 0.03);
            let scale = self.random.between(0.8, 1.15);
            self.place(stones[index % 3], [x, height(x, z) - 0.1, z], facing, scale);
        }
    }

    /// Flagstones from the steps toward the camera.
    fn pave(&mut self) {
        let stones = [1.5, 6.2, 9.9].map(|seed| self.object(flagstone(seed)));
        for index in 0..14 {
            let z = RADIUS + 0.45 + 0.62 * index as f32;
            let x = path_x(z) + self.random.between(-0.12, 0.12);
            let scale = self.random.between(0.85, 1.15);
            self.root(stones[index % 3], x, z, scale);
        }
    }

    /// Trees chosen by hand near the terrace, woods on the hills.
    fn trees(&mut self) {
        let kinds: Vec<usize> = SPECIES.iter().map(|kind| self.object(kind.grow())).collect();
        for (kind, x, z, scale) in NEAR_TREES {
            self.root(kinds[kind], x, z, scale);
        }
        let mut planted = 0;
        while planted < WOODS {
            let (sin, cos) = turn(self.random.unit());
            // Even over the area between the two radii.
            let far = self.random.between(27.0 * 27.0, 300.0 * 300.0).sqrt();
            let (x, z) = (far * cos, far * sin);
            // Glades where the noise is low; nothing between the camera and the hills in front.
            let dense = fractal([x * 0.013, 7.7, z * 0.013], 3) + 0.10;
            let in_view = z > -20.0 && x.abs() < 30.0;
            if in_view || self.random.unit() > 0.25 + 2.5 * dense {
                continue;
            }
            // Firs prefer the heights.
            let high = height(x, z) + self.random.between(-12.0, 12.0);
            let kind = if high > 17.0 { 4 } else { self.random.below(kinds.len() as u64) as usize };
            let scale = self.random.between(0.8, 1.5);
            self.root(kinds[kind], x, z, scale);
            planted += 1;
        }
    }

    /// Grass everywhere, thick in front, and flowers in drifts.
    fn meadow(&mut self) {
        let tufts =
            [(1, Palette::Grass), (2, Palette::Grass), (3, Palette::Grass), (4, Palette::GrassDry)];
        let tufts = tufts.map(|(seed, tint)| self.object(tuft(seed, 46, 0.34, tint)));
        let flowers = [Palette::PetalWhite, Palette::PetalRed, Palette::PetalViolet]
            .map(|petals| self.object(flowers(petals.index() as u64, 6, petals)));
        for index in 0..GRASS {
            let (x, z) = self.meadow_place(index);
            let far = (x * x + z * z).sqrt();
            let on_path = z > 0.0 && (x - path_x(z)).abs() < 0.75 && z < 17.0;
            if far < RADIUS + 0.12 || (on_path && self.random.unit() < 0.93) {
                continue;
            }
            let drift = fractal([x * 0.30, 2.2, z * 0.30], 2);
            let flower = far < 26.0 && self.random.unit() < 0.03 + 0.35 * (drift - 0.12).max(0.0);
            let object = if flower {
                let kind = fractal([x * 0.12, 5.5, z * 0.12], 2) + self.random.between(-0.15, 0.15);
                flowers[usize::from(kind > -0.08) + usize::from(kind > 0.10)]
            } else {
                tufts[self.random.below(tufts.len() as u64) as usize]
            };
            // Short beside the terrace, so that the steps stay in sight; longer in the open.
            let grown = ((far - RADIUS) * 0.18).clamp(0.35, 1.0);
            let scale = grown * self.random.between(0.7, 1.3);
            self.root(object, x, z, if flower { scale.max(0.7) } else { scale });
        }
    }

    /// A place for the next plant of the meadow: two in five in front, near the camera.
    fn meadow_place(&mut self, index: usize) -> (f32, f32) {
        if index % 5 < 2 {
            return (self.random.between(-9.0, 9.0), self.random.between(3.0, 13.0));
        }
        let (sin, cos) = turn(self.random.unit());
        let near = self.random.unit();
        let far = RADIUS + 36.0 * near * (0.35 + 0.65 * near);
        (far * cos, far * sin)
    }
}

/// Trees on the hills.
const WOODS: usize = 1700;
/// Plants of the meadow, tried.
const GRASS: usize = 21_000;

/// Kind, x, z and scale of the trees near the terrace.
const NEAR_TREES: [(usize, f32, f32, f32); 16] = [
    (0, -8.6, -7.2, 1.05),
    (2, 9.6, -5.4, 1.1),
    (1, -13.5, -1.5, 1.1),
    (3, -4.6, -13.8, 1.05),
    (3, -6.3, -15.2, 0.95),
    (1, 4.8, -15.0, 1.1),
    (0, 13.6, -11.0, 1.15),
    (4, -14.6, -13.0, 1.2),
    (4, -18.0, -10.5, 1.0),
    (4, 17.5, -17.5, 1.3),
    (2, 0.8, -19.5, 1.2),
    (3, 18.0, -3.5, 1.0),
    (2, -19.5, 0.5, 1.0),
    (4, 10.5, -22.0, 1.3),
    (0, -10.8, -22.0, 1.25),
    (1, 21.0, -9.0, 1.2),
];
