//! Quads, spheres, discs, curves and primitives of the caller's own: the same bits as brute force from every
//! builder, level and layout, and hits where the shapes are.

use treelet::build::{self, BinnedSah};
use treelet::geometry::{
    Curves, Defect, Disc, Discs, Meeting, Primitives, Quads, Shape, Spheres, User,
};
use treelet::scene::{Action, LayoutChoice, Policy};
use treelet::simd::Level;
use treelet::verify::{self, BruteForce, Random};
use treelet::{Aabb, Affine, BuildOptions, Invalid, Mesh, Ray, Scene, SceneBuilder, SceneError};
use treelet_testkit::awkward;

const SEED: u64 = 0x5AFE;

fn point(random: &mut Random) -> [f32; 3] {
    [(); 3].map(|()| random.between(-4.0, 4.0))
}

fn ball(random: &mut Random) -> [f32; 4] {
    let [x, y, z] = point(random);
    [x, y, z, random.between(0.05, 0.7)]
}

fn spheres(count: usize, random: &mut Random) -> Vec<[f32; 4]> {
    (0..count).map(|_| ball(random)).collect()
}

fn discs(count: usize, random: &mut Random) -> Discs {
    let disc = |_| {
        let [x, y, z, radius] = ball(random);
        let length = random.between(0.1, 10.0);
        Disc { center: [x, y, z], radius, normal: random.direction().map(|x| x * length) }
    };
    Discs::new((0..count).map(disc).collect::<Vec<_>>())
}

/// Strands of four segments, thick at the root; every fifth point's ball holds its neighbours.
fn curves(strands: u32, random: &mut Random) -> Curves {
    let (mut points, mut segments) = (Vec::new(), Vec::new());
    for strand in 0..strands {
        let mut at = point(random);
        for step in 0..5_u32 {
            let radius = if random.below(5) == 0 { 0.9 } else { 0.25 - 0.05 * step as f32 };
            points.push([at[0], at[1], at[2], radius]);
            at = at.map(|x| x + random.between(-0.6, 0.6));
            if step < 4 {
                segments.push(5 * strand + step);
            }
        }
    }
    Curves::new(points, segments)
}

/// A bent sheet of quads: none is flat, neighbours share edges.
fn sheet(side: u32, random: &mut Random) -> Quads {
    let row = side + 1;
    let vertices = 0..row * row;
    let positions: Vec<[f32; 3]> = vertices
        .map(|at| {
            let [x, y] = [at % row, at / row].map(|k| 8.0 * k as f32 / side as f32 - 4.0);
            [x, y, random.between(-0.4, 0.4)]
        })
        .collect();
    let corner = |at: u32| at / side * row + at % side;
    let quads = (0..side * side).map(corner).map(|at| [at, at + 1, at + row + 1, at + row]);
    Quads::new(positions, quads.collect::<Vec<_>>())
}

/// Balls as a caller would write them.
struct Balls(Vec<[f32; 4]>);

impl Primitives for Balls {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn bounds(&self, prim: usize) -> Aabb {
        let [x, y, z, r] = self.0[prim];
        let grown = r * 1.0001 + 1e-5;
        Aabb { lo: [x - grown, y - grown, z - grown], hi: [x + grown, y + grown, z + grown] }
    }

    fn hit(&self, prim: usize, ray: &Ray) -> Option<Meeting> {
        let [x, y, z, r] = self.0[prim];
        let o = [ray.origin[0] - x, ray.origin[1] - y, ray.origin[2] - z];
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (a, b) = (dot(ray.direction, ray.direction), dot(o, ray.direction));
        let root = (b * b - a * (dot(o, o) - r * r)).sqrt();
        let within = |t: &f32| ray.t_min <= *t && *t <= ray.t_max;
        let t = [(-b - root) / a, (-b + root) / a].into_iter().find(within)?;
        Some(Meeting { t, u: 0.25, v: 0.5 })
    }

    fn normal(&self, prim: usize, point: [f32; 3]) -> Option<[f32; 3]> {
        let [x, y, z, _] = self.0[prim];
        Some([point[0] - x, point[1] - y, point[2] - z])
    }
}

fn soup(count: usize) -> Mesh {
    let soup = awkward::random_triangles(count, 4.0, 0.7);
    Mesh::new(soup.positions, soup.triangles)
}

/// One shape of each kind, masks among them.
fn kinds(random: &mut Random) -> SceneBuilder {
    Scene::builder()
        .shape(sheet(6, random))
        .mesh(soup(60))
        .shape_masked(Spheres::new(spheres(60, random)), 0b101)
        .shape(discs(40, random))
        .mesh_masked(soup(40), 0b10)
        .shape(curves(15, random))
        .shape(User::new(Balls(spheres(30, random))))
}

/// Everything there is, and the same again behind maps.
fn everything(options: &BuildOptions<'_>) -> Scene {
    let mut random = Random::new(SEED);
    let random = &mut random;
    let all = kinds(random);
    let inner = all.clone().build(options).unwrap();
    let map = |random: &mut Random| {
        let turn = Affine::rotation(random.direction(), random.between(0.0, 6.0));
        let sizes = [(); 3].map(|()| random.between(-1.5, 1.5));
        Affine::translation(point(random)).then_from(&turn).then_from(&Affine::scaling(sizes))
    };
    let outer = all.instance(&inner, map(random)).instance_masked(&inner, map(random), 0b110);
    outer.shape(Spheres::new(spheres(20, random))).build(options).unwrap()
}

fn check(scene: &Scene, what: &str) {
    let mut rays = verify::rays(scene, 250, SEED);
    // As a camera's, so that they go together: slices make packets of them.
    rays.extend((0..256_u16).map(|at| {
        let [x, y] = [at % 16, at / 16].map(|k| (f32::from(k) - 7.5) / 16.0);
        Ray::new([0.0, 0.0, -12.0], [x, y, 1.0])
    }));
    let brute = BruteForce::new(scene);
    let hits: usize = rays.iter().map(|ray| brute.all(ray).len()).sum();
    assert!(hits > rays.len(), "{hits} hits test little");
    if let Err(mismatch) = verify::check_many(scene, &rays, |ray| brute.all(ray)) {
        panic!("{what}, seed {SEED:#x}: {mismatch}");
    }
}

#[test]
fn every_builder_answers_like_brute_force() {
    for &builder in build::ALL {
        let options = BuildOptions { builder: Some(builder), ..BuildOptions::default() };
        check(&everything(&options), builder.info().name);
    }
}

#[test]
fn every_level_and_layout_answers_like_brute_force() {
    for &level in Level::ALL.iter().filter(|level| level.is_available()) {
        for &layout in LayoutChoice::ALL {
            let builder = Some(&BinnedSah::DEFAULT as &dyn build::Builder);
            let layout = Some(layout);
            let options = BuildOptions { builder, level, layout, ..BuildOptions::default() };
            let name = format!("{}, {layout:?}", level.name());
            check(&everything(&options), &name);
            // Without instances, packets write their answers in another way.
            let kinds = kinds(&mut Random::new(SEED)).build(&options).unwrap();
            check(&kinds, &name);
        }
    }
}

fn only(shape: impl Into<Shape>) -> Scene {
    Scene::builder().shape(shape).build(&BuildOptions::default()).unwrap()
}

fn at(ray: &Ray, t: f32) -> [f64; 3] {
    [0, 1, 2].map(|i: usize| f64::from(ray.origin[i]) + f64::from(t) * f64::from(ray.direction[i]))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// How far a point is outside of the balls between two: least where it is, since a distance less what is linear
/// is convex.
fn outside(p: [f64; 3], [a, b]: [[f32; 4]; 2]) -> f64 {
    let ball = |s: f64| {
        let [x, y, z, r] =
            [0, 1, 2, 3].map(|i: usize| f64::from(a[i]) * (1.0 - s) + f64::from(b[i]) * s);
        distance(p, [x, y, z]) - r
    };
    let (mut lo, mut hi) = (0.0, 1.0);
    for _ in 0..60 {
        let third = (hi - lo) / 3.0;
        if ball(lo + third) < ball(hi - third) { hi -= third } else { lo += third }
    }
    ball(lo)
}

/// Hits lie on the surface, and nothing is before them.
#[test]
fn curves_are_met_where_their_balls_begin() {
    let mut random = Random::new(SEED);
    let mut met = 0;
    for _ in 0..400 {
        let ends = [ball(&mut random), ball(&mut random)];
        let scene = only(Curves::new(ends, [0]));
        let origin = point(&mut random);
        let target = [0, 1, 2].map(|i: usize| ends[0][i] + random.between(-0.8, 0.8));
        let direction = [0, 1, 2].map(|i: usize| target[i] - origin[i]);
        let ray = Ray::new(origin, direction);
        let length = distance([0.0; 3], direction.map(f64::from));
        let Some(hit) = scene.closest(&ray) else {
            // Grazing apart, it is outside all along.
            let least = (0..400).map(|k| outside(at(&ray, k as f32 * 0.02), ends));
            let least = least.fold(f64::INFINITY, f64::min);
            assert!(least > -1e-3, "{ends:?} {ray:?} is {least} inside, and missed");
            continue;
        };
        met += 1;
        let off = outside(at(&ray, hit.t), ends);
        assert!(off.abs() < 2e-5, "{ends:?} {ray:?} {hit:?}: {off} off");
        // On the way there it stays on the side where it began.
        let began = outside(at(&ray, 0.0), ends);
        for share in 1..40 {
            let here = outside(at(&ray, hit.t * share as f32 / 40.0), ends);
            assert!(here * began.signum() > -1e-5 * length, "{ends:?} {ray:?}: {here} at {share}");
        }
        // The normal is the gradient of the distance.
        let normal = scene.normal(&ray, &hit).unwrap().map(f64::from);
        let p = at(&ray, hit.t);
        let up = outside([0, 1, 2].map(|i: usize| p[i] + 0.01 * normal[i]), ends);
        assert!((up - off - 0.01).abs() < 2e-4, "{ends:?} {ray:?}: {normal:?} rises by {up}");
    }
    assert!(met > 60, "{met} hits test little");
}

#[test]
fn spheres_are_met_from_outside_from_inside_and_from_afar() {
    let scene = only(Spheres::new([[1.0, 2.0, 3.0, 0.5]]));
    let ray = Ray::new([1.0, 2.0, 0.0], [0.0, 0.0, 2.0]);
    assert_eq!(scene.closest(&ray).unwrap().t, 1.25);
    assert_eq!(scene.closest(&ray.from(1.3)).unwrap().t, 1.75);
    assert_eq!(scene.closest(&ray.from(1.8)), None);
    assert_eq!(scene.closest(&ray.up_to(1.2)), None);
    assert_eq!((scene.count(&ray), scene.any(&ray)), (1, true));
    // From a million radii away, good to a rounding.
    let mut random = Random::new(SEED);
    for _ in 0..300 {
        let from = random.direction().map(|x| 1e6 * x);
        let target = random.direction().map(|x| 0.9 * x);
        let ray = Ray::new(from, [0, 1, 2].map(|i: usize| target[i] - from[i]));
        let hit = only(Spheres::new([[0.0, 0.0, 0.0, 1.0]])).closest(&ray).unwrap();
        // A rounding of `t`, in lengths of the direction, is 0.06.
        let off = distance(at(&ray, hit.t), [0.0; 3]) - 1.0;
        assert!(off.abs() < 0.07, "{ray:?}: {off}");
    }
}

#[test]
fn discs_have_a_rim_and_no_thickness() {
    let disc = Disc { center: [0.0, 0.0, 5.0], radius: 2.0, normal: [0.0, 0.0, -3.0] };
    let scene = only(Discs::new([disc]));
    let down = |x: f32| Ray::new([x, 0.0, 0.0], [0.0, 0.0, 1.0]);
    for (x, met) in [(0.0, true), (1.99, true), (2.0, true), (2.01, false)] {
        assert_eq!(scene.closest(&down(x)).map(|hit| hit.t), met.then_some(5.0), "{x}");
    }
    let hit = scene.closest(&down(0.5)).unwrap();
    assert_eq!(scene.normal(&down(0.5), &hit), Some([0.0, 0.0, -1.0]));
    assert!(!scene.any(&Ray::new([-9.0, 0.0, 5.0], [1.0, 0.0, 0.0])), "seen from the side");
}

/// A quad is its two triangles: the same `t`, and no ray between neighbours.
#[test]
fn quads_are_pairs_of_triangles() {
    let mut random = Random::new(SEED);
    let quads = sheet(8, &mut random);
    let halves = quads.quads().iter().flat_map(|&[a, b, c, d]| [[a, b, d], [c, d, b]]);
    let mesh = Mesh::new(quads.positions(), halves.collect::<Vec<_>>());
    let (scene, triangles) = (only(quads.clone()), only(mesh));
    let mut seconds = 0;
    for round in 0..4000 {
        // Through vertices and edges, too.
        let [row, column] = [0, 1].map(|_| 1 + random.below(6) as u32);
        let share = || [0.0, 0.5, 1.0][round % 3];
        let (u, v) = if round % 2 == 0 { (share(), 0.5) } else { (random.unit(), random.unit()) };
        let prim = 8 * row + column;
        let [a, b, c, d] = quads.corners(prim as usize).unwrap();
        let target = [0, 1, 2].map(|i: usize| {
            (1.0 - u) * (1.0 - v) * a[i]
                + u * (1.0 - v) * b[i]
                + u * v * c[i]
                + (1.0 - u) * v * d[i]
        });
        let origin = [random.between(-3.0, 3.0), random.between(-3.0, 3.0), 7.0];
        let ray = Ray::new(origin, [0, 1, 2].map(|i: usize| target[i] - origin[i]));
        let expected = triangles.closest(&ray).expect("nothing slips through a sheet");
        let hit = scene.closest(&ray).unwrap();
        assert_eq!((hit.t, hit.prim), (expected.t, expected.prim / 2), "{ray:?}");
        assert_eq!(scene.normal(&ray, &hit), triangles.normal(&ray, &expected), "{ray:?}");
        seconds += expected.prim % 2;
    }
    assert!(seconds > 500, "{seconds} hits of second triangles test little");
    // `u` and `v` count from the first corner on both sides of the diagonal.
    let square = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
    let square = only(Quads::new(square, [[0, 1, 2, 3]]));
    for (x, y) in [(0.25, 0.5), (0.75, 0.5), (0.5, 0.5), (1.0, 1.0), (0.0, 0.0)] {
        let hit = square.closest(&Ray::new([x, y, 0.0], [0.0, 0.0, 1.0])).unwrap();
        assert_eq!((hit.u, hit.v), (x, y));
    }
}

/// What its boxes promise counts, whatever the code says.
#[test]
fn what_a_caller_says_outside_of_a_box_is_discarded() {
    struct Liar(f32);
    impl Primitives for Liar {
        fn len(&self) -> usize {
            2
        }
        fn bounds(&self, prim: usize) -> Aabb {
            let z = prim as f32 * 10.0;
            Aabb { lo: [0.0, 0.0, z], hi: [1.0, 1.0, z + 1.0] }
        }
        fn hit(&self, _: usize, _: &Ray) -> Option<Meeting> {
            Some(Meeting { t: self.0, u: 0.5, v: 0.5 })
        }
    }
    let ray = Ray::new([0.5, 0.5, -1.0], [0.0, 0.0, 1.0]);
    for (said, met) in [(1.5, vec![0]), (11.5, vec![1]), (5.0, vec![]), (f32::NAN, vec![])] {
        let scene = only(User::new(Liar(said)));
        let prims: Vec<u32> = scene.all(&ray).iter().map(|hit| hit.prim).collect();
        assert_eq!(prims, met, "{said}");
    }
}

#[test]
fn bad_primitives_are_named_or_skipped() {
    let nan = f32::NAN;
    let bad: [(Shape, Defect); 6] = [
        (
            Spheres::new([[0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 3.0, -0.5]]).into(),
            Defect::BadRadius { center: [1.0, 2.0, 3.0], radius: -0.5 },
        ),
        (
            Discs::new([
                Disc { radius: 1.0, normal: [1.0; 3], ..Disc::default() },
                Disc::default(),
            ])
            .into(),
            Defect::BadNormal { normal: [0.0; 3] },
        ),
        (
            Curves::new([[0.0; 4]; 3], [1, 2]).into(),
            Defect::IndexOutOfRange { vertex: 3, vertices: 3 },
        ),
        (
            Quads::new([[0.0; 3]; 4], [[0, 1, 2, 3], [0, 1, 2, 9]]).into(),
            Defect::IndexOutOfRange { vertex: 9, vertices: 4 },
        ),
        (
            Spheres::new([[0.0, 0.0, 0.0, 1.0], [0.0, 4e18, 0.0, 1e18]]).into(),
            Defect::BadBox { lo: [-1e18, 3e18, -1e18], hi: [1e18, 5e18, 1e18] },
        ),
        (
            Spheres::new([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, f32::INFINITY]]).into(),
            Defect::BadRadius { center: [0.0; 3], radius: f32::INFINITY },
        ),
    ];
    for (shape, expected) in bad {
        let scene = Scene::builder().mesh(soup(3)).shape(shape.clone());
        let options = BuildOptions { invalid: Invalid::Error, ..BuildOptions::default() };
        match scene.clone().build(&options) {
            Err(SceneError::Primitive { geom: 1, prim: 1, defect, kind }) => {
                assert_eq!((defect, kind), (expected, shape.kind()));
            }
            other => panic!("{expected:?}: {other:?}"),
        }
        let scene = scene.build(&BuildOptions::default()).unwrap();
        let skipped = &scene.report().skipped;
        assert_eq!((skipped.others, skipped.first_other), (1, Some((1, 1, expected))));
        assert_eq!(scene.report().others, 1);
    }
    let hollow = User::new(Balls(vec![[nan, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]));
    assert_eq!(only(hollow).report().skipped.others, 1);
}

/// Refitted, masked, added and removed: as built anew.
#[test]
fn edits_move_every_kind() {
    let options = BuildOptions::default();
    let mut random = Random::new(SEED);
    let random = &mut random;
    let scene = everything(&options);
    let kinds: Vec<Shape> = vec![
        sheet(6, random).into(),
        Spheres::new(spheres(60, random)).into(),
        discs(40, random).into(),
        curves(15, random).into(),
        User::new(Balls(spheres(30, random))).into(),
    ];
    let mut edit = scene.edit();
    edit.policy = Policy::Refit;
    for (&geom, shape) in [0, 2, 3, 5, 6].iter().zip(&kinds) {
        edit.set_shape(geom, shape.clone()).unwrap();
    }
    let refitted = edit.commit(&options).unwrap();
    assert_eq!(refitted.action, Action::Refitted);
    check(&refitted.scene, "refitted");

    let mut edit = refitted.scene.edit();
    edit.set_mask(2, 0).unwrap();
    edit.remove_shape(3).unwrap();
    let added = edit.add_shape(discs(30, random));
    edit.policy = Policy::Refit;
    let edited = edit.commit(&options).unwrap();
    assert_eq!((edited.action, added), (Action::Refitted, 8), "{edited}");
    check(&edited.scene, "edited");
    assert!(edited.scene.edit().set_positions(2, [[0.0; 3]]).is_err());
}

/// Many of them: the tree is worth it, and slices agree.
#[test]
fn a_cloud_of_spheres() {
    let mut random = Random::new(SEED);
    let balls = (0..20_000).map(|_| {
        let [x, y, z] = point(&mut random);
        [x, y, z, random.between(0.03, 0.1)]
    });
    let build = |scene: SceneBuilder| scene.build(&BuildOptions::default()).unwrap();
    let balls: Vec<_> = balls.collect();
    let scene = build(Scene::builder().shape(Spheres::new(balls.clone())));
    let mut counters = treelet::Counters::default();
    let (mut rays, mut met) = (Vec::new(), 0);
    for _ in 0..500 {
        rays.push(Ray::new(point(&mut random), random.direction()));
        let hit = scene.closest_counted(rays.last().unwrap(), &mut counters);
        met += u32::from(hit.is_some());
    }
    assert!(met > 300, "{met} hits test little");
    assert!(counters.triangles < 40 * 500, "{counters:?}");
    let mut hits = vec![treelet::Hit::MISS; rays.len()];
    scene.closest_many(&rays, &mut hits).unwrap();
    for (ray, hit) in rays.iter().zip(&hits) {
        assert_eq!(scene.closest(ray).unwrap_or(treelet::Hit::MISS), *hit);
    }
    // The caller's own balls are met as treelet's are, but for what f32 loses.
    let own = build(Scene::builder().shape(User::new(Balls(balls))));
    let same = rays.iter().filter(|ray| {
        let [a, b] = [&scene, &own].map(|scene| scene.closest(ray).map(|hit| hit.prim));
        a == b
    });
    assert!(same.count() >= 498);
}
