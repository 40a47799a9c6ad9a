//! Closed meshes leak nowhere: from inside, every ray hits. Ten million rays in all.

use treelet::build::{self, Builder};
use treelet::verify::Random;
use treelet::{Affine, BuildOptions, Hit, Mesh, Ray, Scene};
use treelet_testkit::{Shape, closed, rounds};

const SEED: u64 = 0x5EA1;

/// Rays are answered this many at a time.
const BLOCK: usize = 1 << 16;

/// A scene whose inside is closed, and what to aim at: all in the scene's own space.
struct Closed {
    name: String,
    scene: Scene,
    /// The outermost space from the space in which `inside` is drawn.
    world_from_object: Affine,
    vertices: Vec<[f32; 3]>,
    edges: Vec<[[f32; 3]; 2]>,
    /// Origins lie within this distance, per axis, of the object's origin.
    inside: f32,
}

fn build(shape: &Shape, builder: &dyn Builder) -> Scene {
    let mesh = Mesh::new(shape.positions.clone(), shape.triangles.clone());
    let options = BuildOptions { builder: Some(builder), ..BuildOptions::default() };
    Scene::builder().mesh(mesh).build(&options).expect("closed meshes build")
}

fn place(scene: &Scene, map: Affine) -> Scene {
    let outer = Scene::builder().instance(scene, map);
    outer.build(&BuildOptions::default()).expect("regular maps are fine")
}

impl Closed {
    /// The shape itself, seen in its own space.
    fn new(name: &str, shape: &Shape, inside: f32) -> Self {
        let scene = build(shape, build::by_name("binned-sah").unwrap());
        let corner = |vertex: u32| shape.positions[vertex as usize];
        let edges = shape.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        Self {
            name: name.to_owned(),
            scene,
            world_from_object: Affine::IDENTITY,
            vertices: shape.positions.clone(),
            edges: edges.map(|ends| ends.map(corner)).collect(),
            inside,
        }
    }

    /// The same with the scene inside another one.
    fn placed(self, name: &str, map: Affine) -> Self {
        let image = |p: [f32; 3]| map.point(p);
        Self {
            name: format!("{}, {name}", self.name),
            scene: place(&self.scene, map),
            world_from_object: map.then_from(&self.world_from_object),
            vertices: self.vertices.into_iter().map(image).collect(),
            edges: self.edges.into_iter().map(|ends| ends.map(image)).collect(),
            inside: self.inside,
        }
    }

    /// A point inside, as the outermost space rounds it.
    fn origin(&self, random: &mut Random) -> [f32; 3] {
        let point = [(); 3].map(|()| random.between(-self.inside, self.inside));
        self.world_from_object.point(point)
    }

    /// A ray from inside: anyhow, at a vertex, or at a point of an edge. A third of each.
    fn ray(&self, random: &mut Random) -> Ray {
        let origin = self.origin(random);
        let target = match random.below(3) {
            0 => self.world_from_object.point(random.direction().map(|x| 2.0 * x)),
            1 => self.vertices[random.below(self.vertices.len() as u64) as usize],
            _ => {
                let [a, b] = self.edges[random.below(self.edges.len() as u64) as usize];
                let share = random.unit();
                std::array::from_fn(|axis| a[axis] + share * (b[axis] - a[axis]))
            }
        };
        Ray::new(origin, std::array::from_fn(|axis| target[axis] - origin[axis]))
    }

    /// Panics with the first ray that slips through.
    fn hold(&self, rays: usize) {
        let mut random = Random::new(SEED);
        hold(&self.name, &self.scene, rays, || self.ray(&mut random));
    }
}

/// Panics with the first of `rays` rays that is invalid or meets nothing.
fn hold(name: &str, scene: &Scene, rays: usize, mut ray: impl FnMut() -> Ray) {
    let rays = rounds(rays);
    let (mut asked, mut leaks, mut first) = (0, 0, None);
    while asked < rays {
        let block: Vec<Ray> = (0..BLOCK.min(rays - asked)).map(|_| ray()).collect();
        let mut hits = vec![Hit::MISS; block.len()];
        scene.closest_many(&block, &mut hits).expect("as many hits as rays");
        for (ray, hit) in block.iter().zip(&hits) {
            assert!(ray.is_valid(), "{name}, seed {SEED:#x}: not a ray: {ray:?}");
            if !hit.is_hit() {
                leaks += 1;
                first.get_or_insert(*ray);
            }
        }
        asked += block.len();
    }
    assert_eq!(leaks, 0, "{name}, seed {SEED:#x}: of {rays} rays; the first is {first:?}");
}

fn sphere() -> Closed {
    Closed::new("sphere", &closed::sphere(64, 32), 0.5)
}

fn star(seed: u64) -> Closed {
    Closed::new(&format!("star {seed}"), &closed::random_star(48, 24, seed), 0.02)
}

/// Rotated, mirrored, scaled differently along each axis, and moved.
fn awry() -> Affine {
    Affine::translation([31.0, -7.5, 260.0])
        .then_from(&Affine::rotation([3.0, -1.0, 2.0], 2.1))
        .then_from(&Affine::scaling([0.3, -4.0, 25.0]))
}

#[test]
fn at_the_origin() {
    sphere().hold(1_000_000);
    (0..3).for_each(|seed| star(seed).hold(500_000));
}

#[test]
fn far_from_the_origin() {
    // Moved there as vertices; coarse coordinates crumple the star, which stays closed.
    for (name, shape, inside) in [
        ("far sphere", closed::sphere(64, 32), 0.5),
        ("far star", closed::random_star(48, 24, 9), 0.02),
    ] {
        let mut far = Closed::new(name, &shape.mapped(closed::far_away), inside);
        far.world_from_object = Affine::translation(closed::far_away([0.0; 3]));
        far.hold(750_000);
    }
    // Moved there as an instance.
    let there = Affine::translation(closed::far_away([0.0; 3]));
    sphere().placed("far", there).hold(500_000);
    star(10).placed("far", there).hold(500_000);
}

#[test]
fn through_instances() {
    sphere().placed("awry", awry()).hold(500_000);
    star(1).placed("awry", awry()).hold(500_000);
    let shear = Affine([[1.0, 0.7, -0.2, 4.0], [0.0, 1.0, 1.5, -3.0], [0.1, 0.0, -1.0, 9.0]]);
    star(2).placed("awry", awry()).placed("sheared", shear).hold(250_000);
    let turned = Affine::rotation([1.0, 1.0, -1.0], 4.0);
    let deep = sphere().placed("awry", awry()).placed("sheared", shear).placed("turned", turned);
    deep.hold(500_000);
    star(3).placed("awry", awry()).placed("far", far()).hold(250_000);
}

fn far() -> Affine {
    Affine::translation(closed::far_away([0.0; 3]))
}

#[test]
fn through_random_instances() {
    // Scales within a factor of 16: beyond, the rounded origin itself leaves the small inside.
    for seed in 0..100_u64 {
        let mut random = Random::new(SEED ^ seed);
        let mut closed = if seed % 2 == 0 { sphere() } else { star(seed) };
        for level in 0..1 + seed % 3 {
            let scales = [(); 3].map(|()| {
                let size = random.between(0.25, 4.0);
                if random.below(2) == 0 { -size } else { size }
            });
            let offset = [(); 3].map(|()| random.between(-50.0, 50.0));
            let map = Affine::translation(offset)
                .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.0)))
                .then_from(&Affine::scaling(scales))
                .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.0)));
            closed = closed.placed(&format!("level {level} of random placement {seed}"), map);
        }
        closed.hold(5_000);
    }
}

#[test]
fn at_every_scale() {
    for scale in [1e-18_f32, 1e-9, 1e9, 1e18] {
        let scaled = Affine::scaling([scale; 3]);
        for (name, shape, inside) in [
            ("sphere", closed::sphere(64, 32), 0.5),
            ("star", closed::random_star(48, 24, 4), 0.02),
        ] {
            let small = shape.mapped(|p| scaled.point(p));
            let mut closed = Closed::new(&format!("{name} scaled by {scale}"), &small, inside);
            closed.world_from_object = scaled;
            closed.hold(50_000);
        }
        sphere().placed(&format!("scaled by {scale}"), scaled).hold(25_000);
    }
}

#[test]
fn for_directions_of_every_length() {
    // Components down to a millionth of the longest one: their reciprocals leave f32 first.
    let closed = sphere();
    for power in (-126..=127).step_by(2) {
        let mut random = Random::new(SEED ^ power as u64);
        let mut rays = Vec::new();
        while rays.len() < rounds(4000) {
            let mut direction = random.direction();
            direction[random.below(3) as usize] *= 2.0_f32.powi(-(random.below(20) as i32));
            let longest = direction.iter().fold(0.0_f32, |longest, x| longest.max(x.abs()));
            let direction = direction.map(|x| x / longest * 2.0_f32.powi(power));
            rays.push(Ray::new(closed.origin(&mut random), direction));
        }
        // Too short or too long: documented to meet nothing.
        if rays.iter().all(Ray::is_valid) {
            let mut next = rays.iter().copied();
            let name = format!("sphere, directions of length 2^{power}");
            hold(&name, &closed.scene, 4000, || next.next().unwrap());
        } else {
            assert!(!(-96..=120).contains(&power), "2^{power} is a usual length");
        }
    }
}

#[test]
fn along_the_axes() {
    // Exactly through vertices and along mirror planes, other components zeros of either sign.
    let sphere = sphere();
    let mut random = Random::new(SEED);
    hold("sphere along an axis", &sphere.scene, 250_000, || {
        let vertex = sphere.vertices[random.below(sphere.vertices.len() as u64) as usize];
        let axis = random.below(3) as usize;
        let mut origin = vertex.map(|x| x * 0.875);
        let mut direction = [(); 3].map(|()| [0.0, -0.0][random.below(2) as usize]);
        direction[axis] = [1.0, -1.0][random.below(2) as usize];
        // Toward the vertex where that is not along the surface.
        if vertex[axis].abs() > 0.5 {
            origin = vertex;
            origin[axis] *= 0.5;
            direction[axis] = vertex[axis];
        }
        Ray::new(origin, direction)
    });
    let cube = Closed::new("cube", &closed::cube().mapped(|p| p.map(|x| x - 0.5)), 0.5);
    hold("cube along an axis", &cube.scene, 250_000, || {
        let mut direction = [(); 3].map(|()| [0.0, -0.0][random.below(2) as usize]);
        direction[random.below(3) as usize] = [1.0, -1.0][random.below(2) as usize];
        // On the diagonals of the faces, seen from inside, and on the lattice of their middles.
        let origin = [(); 3].map(|()| [-0.25, 0.0, 0.25][random.below(3) as usize]);
        Ray::new(origin, direction)
    });
}

#[test]
fn with_every_builder() {
    for &builder in build::ALL {
        for (shape, inside) in
            [(closed::sphere(64, 32), 0.5), (closed::random_star(48, 24, 5), 0.02)]
        {
            let mut closed = Closed::new(builder.info().name, &shape, inside);
            closed.scene = build(&shape, builder);
            closed.hold(50_000);
            closed.placed("awry", awry()).hold(50_000);
        }
    }
}

/// Cuts every third triangle's first edge: the triangle gets a corner there, and a sliver without
/// area, or nearly so, closes the gap to the neighbour, which keeps its long edge.
fn with_slivers(mut shape: Shape, random: &mut Random) -> Shape {
    for triangle in (0..shape.triangles.len()).step_by(3) {
        let [a, b, c] = shape.triangles[triangle];
        let [from, to] = [a, b].map(|vertex| shape.positions[vertex as usize]);
        let share = random.unit();
        let middle = shape.positions.len() as u32;
        shape.positions.push(std::array::from_fn(|i| from[i] + share * (to[i] - from[i])));
        shape.triangles[triangle] = [a, middle, c];
        shape.triangles.push([middle, b, c]);
        shape.triangles.push([a, b, middle]);
        // Triangles that are a line or a point open nothing.
        shape.triangles.push([a, middle, a]);
        shape.triangles.push([b, b, b]);
    }
    shape
}

#[test]
fn with_slivers_in_the_edges() {
    let mut random = Random::new(SEED);
    let sphere = with_slivers(closed::sphere(48, 24), &mut random);
    Closed::new("sphere with slivers", &sphere, 0.5).hold(500_000);
    let star = with_slivers(closed::random_star(48, 24, 6), &mut random);
    let star = Closed::new("star with slivers", &star, 0.02);
    star.hold(250_000);
    star.placed("awry", awry()).hold(250_000);
}

#[test]
fn in_beams() {
    // Long and thin, turned away from the axes. Origins keep a distance of 100 roundings from the
    // faces: far more than the 16 that the derivation allows for.
    for width in [0.1_f32, 3e-2, 1e-2, 3e-3, 1e-3, 6e-4, 5e-4, 4e-4, 3e-4, 2e-4] {
        let turn = Affine::rotation([1.0, 2.0, 3.0], 0.7);
        let thin = |p: [f32; 3]| [p[0] - 0.5, (p[1] - 0.5) * width, (p[2] - 0.5) * width];
        let beam = Closed::new("beam", &closed::cube().mapped(|p| turn.point(thin(p))), 0.0);
        let mut random = Random::new(SEED);
        let deepest = 0.5 * width - 100.0 * f32::EPSILON / 2.0;
        hold(&format!("beam of width {width}"), &beam.scene, 50_000, || {
            let [y, z] = [(); 2].map(|()| random.between(-1.0, 1.0) * deepest);
            let at_a_face = if random.below(2) == 0 { [deepest, z] } else { [y, z] };
            let origin = [random.between(-0.45, 0.45), at_a_face[0], at_a_face[1]];
            Ray::new(turn.point(origin), random.direction())
        });
    }
}
