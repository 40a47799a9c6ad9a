//! Instances against the same triangles copied to where they are placed: `t` within what both may be off, the same ids
//! except where a ray passes an edge, or two hits lie, within that.

use treelet::verify::{self, Random};
use treelet::{Affine, BuildOptions, Hit, Mesh, Ray, Scene, SceneBuilder};
use treelet_testkit::awkward;

const SEED: u64 = 0xF1A7;
/// `2^-24`: what f32 rounds by.
const U: f64 = 5.960_464_477_539_063e-8;

/// Linear parts in f64, and their largest absolute row sums.
fn linear(map: &Affine) -> [[f64; 3]; 3] {
    map.0.map(|[a, b, c, _]| [a, b, c].map(f64::from))
}

fn row_sum(rows: &[[f64; 3]; 3]) -> f64 {
    rows.iter().map(|row| row.iter().map(|x| x.abs()).sum()).fold(0.0, f64::max)
}

/// How far off, in the world, a point may be that is hit inside: `trace/slack.rs` for rays that start within `reach` of
/// everything, coordinates up to `most`; and how far off a copied vertex is.
fn off(map: &Affine, inner_reach: f64, reach: f64, most: f64) -> f64 {
    let back = map.inverse().unwrap();
    let (there, here) = (linear(&back), linear(map));
    let [m, n] = [row_sum(&there), row_sum(&here)];
    let product = |row: usize, column: usize| -> f64 {
        (0..3).map(|k| here[row][k].abs() * there[k][column].abs()).sum()
    };
    let k = (0..3).map(|row| (0..3).map(|c| product(row, c)).sum()).fold(0.0, f64::max);
    let moved = back.0.map(|row| f64::from(row[3].abs()));
    let v = here
        .iter()
        .map(|row| (0..3).map(|k| row[k].abs() * moved[k]).sum::<f64>())
        .fold(0.0, f64::max);
    // The inner level's slack and slab test; the ray's roundings; the inverse's own rounding, by which the map
    // that rays go through is off.
    let inside = n * (16.0 * m * reach + 4.0 * (2.0 * m * reach + inner_reach));
    let ray = 4.0 * (k * (2.0 * reach + 3.0 * most) + v) + k * most + v;
    let vertex = 4.0 * (n * inner_reach + most);
    U * (inside + ray + vertex + 16.0 * reach)
}

/// The least distance of the hit from an edge of its triangle, and the sine of the angle between ray and plane.
fn margin(scene: &Scene, hit: &Hit, ray: &Ray) -> (f64, f64) {
    let corners = scene.corners(hit).unwrap().map(|corner| corner.map(f64::from));
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let length = |a: [f64; 3]| dot(a, a).sqrt();
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let [a, b, c] = corners;
    let normal = cross(sub(b, a), sub(c, a));
    let (u, v) = (f64::from(hit.u), f64::from(hit.v));
    let twice_area = length(normal);
    let heights = [
        twice_area / length(sub(c, b)),
        twice_area / length(sub(c, a)),
        twice_area / length(sub(b, a)),
    ];
    let least =
        [1.0 - u - v, u, v].iter().zip(heights).map(|(w, h)| w * h).fold(f64::INFINITY, f64::min);
    let direction = ray.direction.map(f64::from);
    (least, dot(normal, direction).abs() / (twice_area * length(direction)))
}

fn turned(random: &mut Random) -> Affine {
    let scales = [(); 3].map(|()| random.between(0.4, 2.5));
    let offset = [(); 3].map(|()| random.between(-12.0, 12.0));
    Affine::translation(offset)
        .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.3)))
        .then_from(&Affine::scaling(scales))
}

/// Hits of one scene that are far enough from every edge are hits of the other, nearly there.
fn found_again(
    (flat, hits, others): (&Scene, &[Hit], &[Hit]),
    ray: &Ray,
    off: f64,
    place: &str,
) -> usize {
    let length = ray.direction.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
    let mut sure = 0;
    for hit in hits {
        let (least, sine) = margin(flat, &Hit { inst: 0, ..*hit }, ray);
        // In its plane, a point moves by what it is off over the sine.
        if least * sine <= 4.0 * off || least.is_nan() {
            continue;
        }
        let other = others.iter().find(|other| other.prim == hit.prim);
        let Some(other) = other else {
            panic!("{place}: {hit:?} is lost, {least} from an edge, off {off}")
        };
        let apart = f64::from((hit.t - other.t).abs()) * length;
        assert!(
            apart * sine <= 2.0 * off,
            "{place}: {hit:?} and {other:?} are {apart} apart, off {off}"
        );
        sure += 1;
    }
    sure
}

#[test]
fn instances_are_hit_where_copies_of_them_are() {
    let mut random = Random::new(SEED);
    let (mut sure, mut closest_same) = (0, 0);
    for round in 0..12 {
        let shape = awkward::random_triangles(40, 3.0, 2.0);
        let mesh = Mesh::new(shape.positions.clone(), shape.triangles.clone());
        let options = BuildOptions::default();
        let object = Scene::builder().mesh(mesh).build(&options).unwrap();
        let maps: Vec<_> = (0..12).map(|_| turned(&mut random)).collect();
        let add = |scene: SceneBuilder, map: &Affine| scene.instance(&object, *map);
        let scene = maps.iter().fold(Scene::builder(), add).build(&options).unwrap();
        let points = maps.iter().flat_map(|map| shape.positions.iter().map(|p| map.point(*p)));
        let vertices = shape.positions.len() as u32;
        let triangles =
            (0..12).flat_map(|i| shape.triangles.iter().map(move |t| t.map(|v| v + i * vertices)));
        let copies = Mesh::new(points.collect::<Vec<_>>(), triangles.collect::<Vec<_>>());
        let flat = Scene::builder().mesh(copies).build(&options).unwrap();

        let most = f64::from(scene.bounds().max_abs());
        let inner = f64::from(object.bounds().max_abs());
        for ray in verify::rays(&scene, 300, SEED + round) {
            let ray = ray.from(f32::NEG_INFINITY).up_to(f32::INFINITY);
            let start = ray.origin.iter().fold(0.0_f64, |most, &x| most.max(f64::from(x.abs())));
            let off =
                maps.iter().map(|map| off(map, inner, most + start, most)).fold(0.0, f64::max);
            // By the copies' numbers.
            let renamed = |hit: &Hit| Hit { prim: (hit.inst as u32 - 1) * 40 + hit.prim, ..*hit };
            let placed: Vec<_> = scene.all(&ray).iter().map(renamed).collect();
            let copied = flat.all(&ray);
            let place = format!("round {round}, {ray:?}");
            sure += found_again((&flat, &placed, &copied), &ray, off, &place);
            sure += found_again((&flat, &copied, &placed), &ray, off, &place);
            // The first of both are the same triangle, or one passes an edge, or they are as near to each other.
            let (Some(first), Some(other)) = (placed.first(), copied.first()) else { continue };
            if first.prim == other.prim {
                closest_same += 1;
                continue;
            }
            let length = ray.direction.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
            let apart = f64::from((first.t - other.t).abs()) * length;
            let excused = [first, other].iter().any(|hit| {
                let (least, sine) = margin(&flat, &Hit { inst: 0, ..**hit }, &ray);
                least * sine <= 4.0 * off || apart * sine <= 4.0 * off || least.is_nan()
            });
            assert!(excused, "{place}: {first:?} first, but {other:?} of the copies; off {off}");
        }
    }
    assert!(sure > 2000, "{sure} sure hits");
    assert!(closest_same > 12 * 300 / 2, "{closest_same} of {}", 12 * 300);
}
