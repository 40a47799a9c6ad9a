//! Bounding volumes contain what they should, and their ray tests miss nothing.
//!
//! All judges work in f64, a billion times finer than what they judge.

use treelet::Affine;
use treelet::bounds::{Aabb, Dop14, Dop18, Dop26, Obb, Sphere, Volume};
use treelet::verify::Random;
use treelet_testkit::rounds;

type Double = [f64; 3];

/// The smallest f32 above 0: between the two, an interval of f32 has no ends.
const LEAST: f64 = 1.5e-45;

/// What f64 may be wrong by, of the largest coordinate.
const ROUNDING: f64 = 1e-14;

/// Runs a generic test for every volume.
macro_rules! for_each_volume {
    ($test:ident) => {
        $test::<Aabb>();
        $test::<Sphere>();
        $test::<Obb>();
        $test::<Dop14>();
        $test::<Dop18>();
        $test::<Dop26>();
    };
}

/// Points of many sorts: clouds and needles, lines and single points, near and far, large and tiny.
fn cloud(random: &mut Random) -> Vec<[f32; 3]> {
    let size = [1.0, 1.0, 1e-3, 1e15, 1e-30, 1e-38][random.below(6) as usize];
    let away = [0.0, 1.0, 1e3, 1e6][random.below(4) as usize];
    let most = [1, 4, 40, 40][random.below(4) as usize];
    let count = 1 + random.below(most) as usize;
    let place = random.direction().map(|x| x * away);
    let stretch = [[1.0; 3], [1.0, 1e-3, 1e-5], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    let stretch = stretch[[0, 0, 0, 1, 2, 3][random.below(6) as usize]];
    let turn = match random.below(3) {
        0 => Affine::IDENTITY,
        _ => Affine::rotation(random.direction(), 3.0 * random.unit()),
    };
    let points = (0..count).map(|_| {
        let point = random.direction();
        let point = turn.vector([0, 1, 2].map(|i: usize| point[i] * stretch[i]));
        [0, 1, 2].map(|i: usize| (point[i] + place[i]) * size)
    });
    points.collect()
}

/// A point between the points, as exactly as f64 can.
fn between(points: &[[f32; 3]], random: &mut Random) -> Double {
    let weights: Vec<f64> = points.iter().map(|_| f64::from(random.unit()).powi(4)).collect();
    let sum: f64 = weights.iter().sum();
    if sum == 0.0 {
        return points[0].map(f64::from);
    }
    let mut out = [0.0; 3];
    for (point, weight) in points.iter().zip(weights) {
        (0..3).for_each(|i| out[i] += f64::from(point[i]) * (weight / sum));
    }
    out
}

fn largest(points: &[[f32; 3]]) -> f64 {
    points.iter().flatten().map(|x| f64::from(x.abs())).fold(0.0, f64::max)
}

fn at(origin: [f32; 3], direction: [f32; 3], t: f64) -> Double {
    [0, 1, 2].map(|i: usize| f64::from(origin[i]) + t * f64::from(direction[i]))
}

fn mapped(map: &Affine, p: Double) -> Double {
    map.0.map(|row| {
        let [a, b, c, d] = row.map(f64::from);
        a * p[0] + b * p[1] + c * p[2] + d
    })
}

fn contains_its_points<V: Volume>() {
    let mut random = Random::new(0xC0);
    for round in 0..rounds(1500) {
        let points = cloud(&mut random);
        let volume = V::of_points(&points);
        let slop = ROUNDING * largest(&points);
        for _ in 0..8 {
            let inside = between(&points, &mut random);
            let excess = volume.excess(inside);
            assert!(excess <= slop, "{} {round}: {excess:e} outside of {points:?}", V::NAME);
        }
        // The points themselves, without any slop but f64's own.
        for point in &points {
            assert!(volume.excess(point.map(f64::from)) <= slop, "{} {round}", V::NAME);
        }
        assert!(volume.bounds().contains(&Aabb::of_points(&points)), "{} {round}", V::NAME);
    }
}

#[test]
fn volumes_contain_the_points_they_are_made_of() {
    for_each_volume!(contains_its_points);
}

fn unions_and_images<V: Volume>() {
    let mut random = Random::new(0x01);
    for round in 0..rounds(500) {
        let (mut one, other) = (cloud(&mut random), cloud(&mut random));
        let both = V::of_points(&one).union(&V::of_points(&other));
        let map = Affine::translation(random.direction().map(|x| 10.0 * x))
            .then_from(&Affine::rotation(random.direction(), 7.0 * random.unit()))
            .then_from(&Affine::scaling(random.direction().map(|x| 3.0 * x)))
            .then_from(&Affine::rotation(random.direction(), 7.0 * random.unit()));
        let image = both.image(&map);
        one.extend(&other);
        let slop = ROUNDING * largest(&one);
        let map_size: f64 = map.0.iter().flatten().map(|&m| f64::from(m.abs())).fold(0.0, f64::max);
        let image_slop = 4.0 * map_size * slop + ROUNDING * map_size;
        for _ in 0..8 {
            let inside = between(&one, &mut random);
            let name = V::NAME;
            assert!(both.excess(inside) <= slop, "{name} {round}: union lost {inside:?}");
            let excess = image.excess(mapped(&map, inside));
            assert!(excess <= image_slop, "{name} {round}: the image lost {inside:?}: {excess:e}");
        }
        // A union contains its parts, not only what they were made of.
        let part = V::of_points(&other);
        if let Some(edge) = boundary(&part, other[0].map(f64::from), &mut random) {
            assert!(
                both.excess(edge) <= 4.0 * slop,
                "{} {round}: {:e}",
                V::NAME,
                both.excess(edge)
            );
            let excess = image.excess(mapped(&map, edge));
            assert!(excess <= 4.0 * image_slop, "{} {round}: {excess:e}", V::NAME);
        }
    }
}

#[test]
fn unions_and_images_contain_what_they_should() {
    for_each_volume!(unions_and_images);
}

/// A point on the surface, in a random direction from one inside; none if there is no inside.
fn boundary<V: Volume>(volume: &V, inside: Double, random: &mut Random) -> Option<Double> {
    let (bounds, direction) = (volume.bounds(), random.direction().map(f64::from));
    let far = 20.0 * bounds.diagonal() + f64::from(f32::MIN_POSITIVE);
    let point = |s: f64| [0, 1, 2].map(|i: usize| inside[i] + s * direction[i]);
    let (mut low, mut high) = (0.0, far);
    for _ in 0..90 {
        let middle = 0.5 * (low + high);
        if volume.excess(point(middle)) <= 0.0 { low = middle } else { high = middle }
    }
    (low > 0.0).then(|| point(low))
}

/// Which way the surface faces near a point.
fn normal<V: Volume>(volume: &V, point: Double, step: f64) -> Double {
    [0, 1, 2].map(|axis: usize| {
        let moved = |by: f64| {
            let mut moved = point;
            moved[axis] += by;
            volume.excess(moved)
        };
        (moved(step) - moved(-step)) / (2.0 * step)
    })
}

/// Where along the line it is deepest inside: excess is convex.
fn deepest<V: Volume>(volume: &V, origin: [f32; 3], direction: [f32; 3], range: [f64; 2]) -> f64 {
    let excess = |t: f64| volume.excess(at(origin, direction, t));
    let [mut low, mut high] = range;
    for _ in 0..120 {
        let third = (high - low) / 3.0;
        let (a, b) = (low + third, high - third);
        if excess(a) < excess(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

/// The last place that is inside on the way from one that is to one that is not.
fn last_inside(mut inside: f64, mut outside: f64, is_inside: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..80 {
        let middle = 0.5 * (inside + outside);
        if is_inside(middle) { inside = middle } else { outside = middle }
    }
    inside
}

/// A ray that touches the volume, or nearly: through a point of its surface, at right angles to
/// where the surface faces; in every third case straight through the inside, or along an axis.
fn grazing<V: Volume>(
    volume: &V,
    inside: Double,
    random: &mut Random,
) -> Option<([f32; 3], [f32; 3])> {
    let mut target = boundary(volume, inside, random)?;
    let size = volume.bounds().diagonal();
    let facing = normal(volume, target, 1e-4 * size);
    let length = facing.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut way = random.direction().map(f64::from);
    if random.below(3) > 0 && length > 0.0 {
        let share = (0..3).map(|i| way[i] * facing[i]).sum::<f64>() / (length * length);
        (0..3).for_each(|i| way[i] -= share * facing[i]);
    }
    if random.below(4) == 0 {
        way[random.below(3) as usize] = 0.0;
    }
    let distance = size * [0.0, 1.0, 10.0, 1000.0][random.below(4) as usize];
    if random.below(4) == 0 && length > 0.0 {
        // Past it.
        (0..3).for_each(|i| target[i] += 1e-3 * (size + distance) * facing[i] / length);
    }
    let origin = [0, 1, 2].map(|i: usize| (target[i] - distance * way[i]) as f32);
    let stretch = [1.0, 1e-6, 1e10][random.below(3) as usize];
    let toward = |i: usize| if distance > 0.0 { target[i] - f64::from(origin[i]) } else { way[i] };
    let scale = [0, 1, 2].map(toward).into_iter().map(f64::abs).fold(0.0, f64::max);
    if scale <= 0.0 || !scale.is_finite() {
        return None;
    }
    let mut direction = [0, 1, 2].map(|i: usize| (toward(i) / scale * stretch) as f32);
    for component in &mut direction {
        if *component == 0.0 && random.below(2) == 0 {
            *component = -0.0;
        }
    }
    Some((origin, direction))
}

/// Rays with what f64 says about them: where they certainly are inside.
fn misses_nothing<V: Volume>() {
    let mut random = Random::new(0x6A);
    let (mut touched, mut close, mut missed, mut admitted) = (0, 0, 0, 0);
    let all = rounds(4000);
    for round in 0..all {
        let points = cloud(&mut random);
        let volume = V::of_points(&points);
        let inside = between(&points, &mut random);
        let Some((origin, direction)) = grazing(&volume, inside, &mut random) else { continue };
        let bounds = volume.bounds();
        let ray = V::ray(origin, direction, &bounds);
        let interval = volume.interval(&ray);

        // Bracket the part near the volume, in t.
        let longest = direction.iter().map(|d| f64::from(d.abs())).fold(0.0, f64::max);
        let size = bounds.diagonal();
        let reach = (0..3)
            .map(|i| {
                let away = |side: f32| (f64::from(side) - f64::from(origin[i])).abs();
                away(bounds.lo[i]).max(away(bounds.hi[i]))
            })
            .fold(0.0, f64::max);
        let limit = 2.0 * (reach + size) / longest;
        let best = deepest(&volume, origin, direction, [-limit, limit]);
        let excess = volume.excess(at(origin, direction, best));
        let scale = reach
            + largest(&points)
            + f64::from(origin.map(f32::abs).iter().fold(0.0, |a: f32, b| a.max(*b)));
        let sure = ROUNDING * scale;
        if excess < -sure {
            touched += 1;
            close += u32::from(excess > -1e-6 * scale);
            let (low, high) = (f64::from(interval.entry), f64::from(interval.exit));
            // Where it goes in and comes out, or a little deeper.
            let is_inside = |t: f64| volume.excess(at(origin, direction, t)) < -sure;
            let ends = [-limit, limit].map(|outside| last_inside(best, outside, is_inside));
            assert!(
                low - LEAST <= ends[0] && ends[1] <= high + LEAST,
                "{} {round}: {excess:e} inside at {best:e}, from {ends:?}, interval {interval:?}\n\
                 around {bounds:?}\n{origin:?} {direction:?}",
                V::NAME,
            );
        }
        if excess > 1e-4 * (size + reach) + 2e-6 * scale + 1e-36 {
            missed += 1;
            admitted += u32::from(!interval.is_empty());
        }
    }
    let share = |count: u32, of: usize| f64::from(count) / of as f64;
    assert!(share(touched, all) > 0.02, "{}: {touched} rays inside", V::NAME);
    assert!(share(close, all) > 0.001, "{}: {close} rays near the surface", V::NAME);
    assert!(share(missed, all) > 0.01, "{}: {missed} rays far off", V::NAME);
    assert!(admitted == 0, "{}: {admitted} of {missed} far off admitted", V::NAME);
}

#[test]
fn ray_tests_miss_nothing() {
    for_each_volume!(misses_nothing);
}

fn empty_and_flat<V: Volume>() {
    let empty = V::of_points(&[]);
    let reach = Aabb { lo: [-5.0; 3], hi: [5.0; 3] };
    assert_eq!(empty.half_area(), 0.0, "{}", V::NAME);
    assert!(empty.bounds().is_empty() && empty.excess([0.0; 3]) > 0.0, "{}", V::NAME);
    assert!(empty.image(&Affine::IDENTITY).bounds().is_empty(), "{}", V::NAME);
    for direction in [[1.0, 2.0, 3.0], [0.0, -0.0, -1.0], [1.0, -1.0, 0.0]] {
        for origin in [[0.0; 3], [1.0, -4.0, 2.0]] {
            let ray = V::ray(origin, direction, &reach);
            assert!(empty.interval(&ray).is_empty(), "{}", V::NAME);
            assert!(V::EMPTY.union(&empty).interval(&ray).is_empty(), "{}", V::NAME);
        }
    }
    // Unions forget it.
    let point = V::of_points(&[[1.0, 2.0, 3.0]]);
    for union in [point.union(&empty), empty.union(&point)] {
        assert_eq!(union.bounds(), point.bounds(), "{}", V::NAME);
    }
    assert!(point.half_area() < 1e-9, "{}", V::NAME);
    // A square has one side's area, for all that can be flat.
    let square = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [1.0, 1.0, 2.0]];
    let area = V::of_points(&square).half_area();
    let expected = if V::NAME == "sphere" { std::f64::consts::PI } else { 1.0 };
    assert!((area / expected - 1.0).abs() < 1e-3, "{}: {area}", V::NAME);
}

#[test]
fn nothing_a_point_and_a_square() {
    for_each_volume!(empty_and_flat);
}

/// Half areas by another way: a line that meets the box of a convex body meets the body as often as
/// their areas say.
fn area_is_a_chance<V: Volume>() {
    let mut random = Random::new(0xA7);
    let points: Vec<_> = (0..60)
        .map(|_| {
            let [x, y, z] = random.direction();
            [x + 0.6 * y, y, 0.4 * z + 0.5 * x]
        })
        .collect();
    let volume = V::of_points(&points);
    let bounds = volume.bounds();
    let radius = 0.6 * bounds.diagonal() as f32;
    let (mut met, mut all) = (0.0, 0.0);
    let reach = Aabb { lo: [-9.0; 3], hi: [9.0; 3] };
    for _ in 0..rounds(40_000) {
        let [from, to] = [(); 2].map(|()| {
            let tip = treelet::math::vec3::normalize(random.direction()).unwrap();
            [0, 1, 2].map(|i: usize| bounds.center()[i] + radius * tip[i])
        });
        let direction = treelet::math::vec3::sub(to, from);
        if !bounds.interval(&<Aabb as Volume>::ray(from, direction, &reach)).is_empty() {
            all += 1.0;
            let ray = V::ray(from, direction, &reach);
            met += f64::from(u8::from(!volume.interval(&ray).is_empty()));
        }
    }
    let expected = volume.half_area() / bounds.half_area();
    let error = (expected * (1.0 - expected) / all).max(0.0).sqrt();
    let chance: f64 = met / all;
    assert!(
        (chance - expected).abs() <= 4.0 * error + 1e-4,
        "{}: {chance}, not {expected}",
        V::NAME
    );
}

#[test]
fn areas_are_chances_of_being_met() {
    for_each_volume!(area_is_a_chance);
}

#[test]
fn oriented_boxes_find_turned_boxes_and_spheres_balls() {
    let mut random = Random::new(0x0B);
    for _ in 0..50 {
        let turn = Affine::translation(random.direction().map(|x| 5.0 * x))
            .then_from(&Affine::rotation(random.direction(), 3.0 * random.unit()));
        let corners: Vec<[f32; 3]> = (0..8)
            .map(|c| [0, 1, 2].map(|i: usize| [9.0, 2.0, 0.5][i] * (c >> i & 1) as f32))
            .map(|corner| turn.point(corner))
            .collect();
        let true_area = 9.0 * 2.0 + 9.0 * 0.5 + 2.0 * 0.5;
        let found = Obb::of_points(&corners);
        assert!(found.half_area() < 1.0001 * true_area, "{found:?}");
        // Turning it further does not make it larger, nor does a union with its own half.
        let image = found.image(&Affine::rotation(random.direction(), 1.0));
        assert!(image.half_area() < 1.001 * true_area, "{image:?}");
        assert!(found.union(&Obb::of_points(&corners[..4])).half_area() < 1.001 * true_area);
        let ball: Vec<[f32; 3]> =
            (0..300).map(|_| treelet::math::vec3::normalize(random.direction()).unwrap()).collect();
        let radius = Sphere::of_points(&ball).radius;
        assert!(radius < 1.02, "{radius}");
    }
    for _ in 0..200 {
        let points = cloud(&mut random);
        if largest(&points) < 1e-30 {
            // Rounding outward is a large part of these.
            continue;
        }
        let (own, aligned) = (Obb::of_points(&points), Aabb::of_points(&points));
        let away = largest(&points).powi(2) * 1e-6;
        assert!(own.half_area() <= 1.001 * aligned.half_area() + away, "{points:?}");
    }
}
