//! Trees that branch by one rule, told apart by the numbers in it.
//!
//! A limb grows in short segments that bend toward the light and waver; it carries side limbs at
//! the golden angle, each a smaller limb by the same rule, and the thinnest carry leaves.

use treelet::math::{Affine, vec3};
use treelet::verify::Random;
use treelet_model::Object;

use super::noise;
use super::palette::Palette;

use super::shape::{Ring, Shape, across};

/// The angle between neighbouring leaves on most stems, radians: a turn by the golden ratio.
const GOLDEN_ANGLE: f32 = 2.399_963;

/// What makes one kind of tree.
pub(super) struct Species {
    pub(super) name: &'static str,
    pub(super) seed: u64,
    /// Length of the trunk and its radius at the foot.
    pub(super) trunk: (f32, f32),
    /// Side limbs of the trunk, of its limbs, and so on; the last carry leaves.
    pub(super) limbs: &'static [usize],
    /// Where on a limb its first side limb sits, `0 .. 1`, for the trunk.
    pub(super) bare: f32,
    /// The angle between a limb and its side limbs, radians.
    pub(super) spread: f32,
    /// A side limb's length over that of its limb.
    pub(super) shrink: f32,
    /// How much shorter side limbs are at the top: 0 a ball, 1 a cone.
    pub(super) taper: f32,
    /// How strongly limbs turn up (or, below 0, down).
    pub(super) lift: f32,
    /// How much limbs waver.
    pub(super) waver: f32,
    /// Leaves on each thinnest limb, and the length and width of one.
    pub(super) leaves: usize,
    pub(super) leaf: (f32, f32),
    pub(super) bark: Palette,
    /// The two tints of its leaves.
    pub(super) tints: [Palette; 2],
}

/// Everything that has grown so far.
struct Growth<'a> {
    species: &'a Species,
    random: Random,
    bark: Shape,
    leaves: [Shape; 2],
}

/// One limb before it grows.
#[derive(Clone, Copy)]
struct Limb {
    from: [f32; 3],
    along: [f32; 3],
    length: f32,
    radius: f32,
    level: usize,
}

impl Species {
    /// Grows the tree, its foot at the origin.
    pub(super) fn grow(&self) -> Object {
        let mut growth = Growth {
            species: self,
            random: Random::new(self.seed),
            bark: Shape::default(),
            leaves: Default::default(),
        };
        let (length, radius) = self.trunk;
        let trunk =
            Limb { from: [0.0, -0.3, 0.0], along: [0.0, 1.0, 0.0], length, radius, level: 0 };
        growth.grow(trunk);
        let [dark, light] = growth.leaves;
        let parts = vec![
            growth.bark.smooth_part(self.bark.index()),
            dark.flat_part(self.tints[0].index()),
            light.flat_part(self.tints[1].index()),
        ];
        Object { name: self.name.into(), parts }
    }
}

impl Growth<'_> {
    /// Grows one limb and all it carries; the depth is the length of `Species::limbs`.
    fn grow(&mut self, limb: Limb) {
        let spine = self.spine(limb);
        let sides = [10, 6, 4, 3][limb.level.min(3)];
        self.bark.append(&Shape::tube(&spine, sides));
        match self.species.limbs.get(limb.level) {
            Some(&count) => self.branch(limb, &spine, count),
            None => self.leaf_out(limb, &spine),
        }
    }

    /// The limb's rings: thinner toward the tip, wavering, bending up or down.
    fn spine(&mut self, limb: Limb) -> Vec<Ring> {
        let segments = [14, 7, 4, 3][limb.level.min(3)];
        let mut along = limb.along;
        let mut center = limb.from;
        let mut spine = Vec::new();
        for segment in 0..=segments {
            let t = segment as f32 / segments as f32;
            // The trunk widens into the ground.
            let foot = if limb.level == 0 { 0.9 * noise::step(0.16, 0.0, t) } else { 0.0 };
            spine.push(Ring { center, radius: limb.radius * (1.0 - 0.86 * t + foot) });
            let step = limb.length / segments as f32;
            center = vec3::add(center, vec3::scale(along, step));
            let waver = self.species.waver * if limb.level == 0 { 0.4 } else { 1.0 };
            let bend = [
                self.random.between(-waver, waver),
                self.random.between(-waver, waver) + self.species.lift * t.min(0.6),
                self.random.between(-waver, waver),
            ];
            let bend = if limb.level == 0 { [bend[0], 0.1, bend[2]] } else { bend };
            along = vec3::normalize(vec3::add(along, bend)).unwrap_or(along);
        }
        spine
    }

    /// Side limbs along the spine, turning by the golden angle.
    fn branch(&mut self, limb: Limb, spine: &[Ring], count: usize) {
        let species = self.species;
        let bare = if limb.level == 0 { species.bare } else { 0.25 };
        let mut angle = self.random.between(0.0, std::f32::consts::TAU);
        for index in 0..count {
            let share = (index as f32 + self.random.unit()) / count as f32;
            let t = bare + (1.0 - bare) * share;
            let (place, along) = along_spine(spine, t);
            angle += GOLDEN_ANGLE + self.random.between(-0.3, 0.3);
            let spread = species.spread * self.random.between(0.8, 1.15) * (1.05 - 0.45 * share);
            // Shorter toward the top, and a little at the foot, where light is scarce.
            let shape = 1.0 - species.taper * share;
            let length = limb.length * species.shrink * shape * self.random.between(0.8, 1.15);
            let side = Affine::rotation(along, angle).vector(across([0.3, 0.1, 1.0], along));
            let (sin, cos) = libm::sincosf(spread);
            let direction = vec3::add(vec3::scale(along, cos), vec3::scale(side, sin));
            self.grow(Limb {
                from: place.center,
                along: vec3::normalize(direction).unwrap_or(along),
                length,
                radius: (0.62 * place.radius).min(0.05 * length).max(0.004),
                level: limb.level + 1,
            });
        }
    }

    /// Leaves along a thin limb and at its tip.
    fn leaf_out(&mut self, limb: Limb, spine: &[Ring]) {
        let (length, width) = self.species.leaf;
        for index in 0..self.species.leaves {
            let t = (index as f32 + self.random.unit()) / self.species.leaves as f32;
            let (place, along) = along_spine(spine, 0.15 + 0.85 * t);
            let angle = index as f32 * GOLDEN_ANGLE + self.random.between(-0.5, 0.5);
            let side = Affine::rotation(along, angle).vector(across(limb.along, along));
            let out = vec3::add(side, vec3::scale(along, self.random.between(0.2, 1.0)));
            let out = vec3::add(out, [0.0, self.random.between(-0.5, 0.35), 0.0]);
            let out = vec3::normalize(out).unwrap_or(along);
            let size = self.random.between(0.7, 1.25);
            let tint = usize::from(self.random.unit() < 0.42);
            let up = [self.random.between(-0.6, 0.6), 1.0, self.random.between(-0.6, 0.6)];
            leaf(&mut self.leaves[tint], place.center, out, up, [size * length, size * width]);
        }
    }
}

/// A leaf: two triangles that meet at a folded middle rib.
fn leaf(shape: &mut Shape, base: [f32; 3], out: [f32; 3], up: [f32; 3], size: [f32; 2]) {
    let [length, width] = size;
    let up = across(up, out);
    let side = vec3::cross(out, up);
    let tip = vec3::add(base, vec3::scale(out, length));
    let edge = |sign: f32| {
        let middle = vec3::add(base, vec3::scale(out, 0.42 * length));
        let raised = vec3::add(middle, vec3::scale(up, 0.22 * width));
        vec3::add(raised, vec3::scale(side, sign * 0.5 * width))
    };
    shape.push_triangle([base, edge(1.0), tip]);
    shape.push_triangle([base, tip, edge(-1.0)]);
}

/// The ring at `t` of the spine, `0 ..= 1`, and the direction there.
fn along_spine(spine: &[Ring], t: f32) -> (Ring, [f32; 3]) {
    let scaled = t * (spine.len() - 1) as f32;
    let index = (scaled as usize).min(spine.len() - 2);
    let (a, b) = (spine[index], spine[index + 1]);
    let share = (scaled - index as f32).clamp(0.0, 1.0);
    let step = vec3::sub(b.center, a.center);
    let center = vec3::add(a.center, vec3::scale(step, share));
    let radius = a.radius + (b.radius - a.radius) * share;
    (Ring { center, radius }, vec3::normalize(step).unwrap_or([0.0, 1.0, 0.0]))
}
