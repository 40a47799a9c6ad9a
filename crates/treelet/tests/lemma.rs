//! The culling lemma, the slack that keeps it from leaking, and the exactness of the triangle test:
//! attacked with what breaks floating point, held against f64 where that is exact enough.

use treelet::bounds::{Aabb, Interval, SlabRay};
use treelet::geometry::clip::clipped_bounds;
use treelet::geometry::{Meeting, TriangleRay};
use treelet::verify::Random;
use treelet_testkit::rounds;

const SEED: u64 = 0x1E44A;

/// Half a unit in the last place of 1.
const U: f64 = f32::EPSILON as f64 / 2.0;

const UNBOUNDED: Interval = Interval::ALL;

type Corners = [[f32; 3]; 3];

/// Values with which products, sums and quotients do something odd.
fn odd(random: &mut Random) -> f32 {
    const POOL: [f32; 16] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::MIN_POSITIVE,
        -1e-45,
        1e-40,
        -3.4e-39,
        4.611_686e18,
        -4.611_686e18,
        16_777_216.0,
        0.1,
        1.0 + f32::EPSILON,
        1e-18,
        -148_376.0,
        3.0e38,
    ];
    match random.below(3) {
        0 => POOL[random.below(POOL.len() as u64) as usize],
        1 => random.between(-2.0, 2.0),
        _ => random.between(-1.0, 1.0) * 2.0_f32.powi(random.below(250) as i32 - 125),
    }
}

#[test]
fn intervals_of_nested_boxes_are_nested() {
    let mut random = Random::new(SEED);
    for round in 0..rounds(2_000_000) {
        // Planes are chosen among few values, the origin's own included: differences of zero
        // times an infinite reciprocal are what goes wrong first.
        let pool: [f32; 5] = std::array::from_fn(|_| odd(&mut random));
        let mut pick = || pool[random.below(5) as usize];
        let origin = [(); 3].map(|()| pick());
        let mut inner = Aabb { lo: origin, hi: origin };
        for axis in 0..3 {
            let (a, b) = (pick(), pick());
            inner.lo[axis] = a.min(b);
            inner.hi[axis] = a.max(b);
        }
        let mut outer = inner;
        for axis in 0..3 {
            outer.lo[axis] = outer.lo[axis].min(pick());
            outer.hi[axis] = outer.hi[axis].max(pick());
        }
        let direction = [(); 3].map(|()| odd(&mut random));
        let slack = match random.below(6) {
            0 => 0.0,
            1 => f32::INFINITY,
            2 => f32::NAN,
            _ => odd(&mut random).abs(),
        };
        let ray = SlabRay::new(origin, direction, slack);
        let (inside, outside) = (ray.interval(&inner), ray.interval(&outer));
        let case = || {
            format!("round {round}, {origin:?}, {direction:?}, slack {slack}, {inner:?}, {outer:?}")
        };
        assert!(outside.entry <= inside.entry, "{}: {inside:?}, {outside:?}", case());
        assert!(inside.exit <= outside.exit, "{}: {inside:?}, {outside:?}", case());
    }
}

/// A triangle and a ray that is likely to come close to it.
#[derive(Debug)]
struct Case {
    corners: Corners,
    origin: [f32; 3],
    direction: [f32; 3],
}

fn mix(a: [f32; 3], b: [f32; 3], share: f32) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn case(random: &mut Random) -> Case {
    let size = 2.0_f32.powi([0, 0, 0, -60, 60, -20, 17][random.below(7) as usize]);
    let at = [(); 3].map(|()| random.between(-3.0, 3.0) * [1.0, 1e5][random.below(2) as usize]);
    let a = [(); 3].map(|()| random.between(-1.0, 1.0));
    let b = [(); 3].map(|()| random.between(-1.0, 1.0));
    let c = match random.below(4) {
        // A sliver, thinner and thinner.
        0 => {
            let thin = 0.1_f32.powi(random.below(8) as i32);
            let off = [(); 3].map(|()| random.between(-thin, thin));
            let near = mix(a, b, random.between(-0.5, 1.5));
            std::array::from_fn(|i| near[i] + off[i])
        }
        // In an axis-parallel plane.
        1 => [a[0], b[1], random.unit()],
        _ => [(); 3].map(|()| random.between(-1.0, 1.0)),
    };
    let place = |p: [f32; 3]| -> [f32; 3] { std::array::from_fn(|i| (p[i] + at[i]) * size) };
    let mut corners = [a, b, c].map(place);
    if random.below(4) == 0 {
        let (axis, plane) = (random.below(3) as usize, corners[0]);
        corners.iter_mut().for_each(|corner| corner[axis] = plane[axis]);
    }
    let [a, b, c] = corners;

    // Aim at a corner, at an edge, inside, or past it.
    let target = match random.below(4) {
        0 => a,
        1 => mix(a, b, random.unit()),
        2 => mix(mix(a, b, random.unit()), c, random.unit()),
        _ => mix(mix(a, b, random.between(-0.5, 1.5)), c, random.between(-0.5, 1.5)),
    };
    let away = [(); 3].map(|()| random.between(-1.0, 1.0));
    let distance = size * [0.0, 1e-6, 1.0, 3.0, 1e4][random.below(5) as usize];
    let mut origin: [f32; 3] = std::array::from_fn(|i| target[i] + away[i] * distance);
    let mut direction = match random.below(3) {
        0 => minus(target, origin),
        1 => away.map(|x| -x),
        // Nearly in the plane, along an edge.
        _ => {
            let edge = minus(b, a);
            origin = std::array::from_fn(|i| target[i] - edge[i] + away[i] * size * 1e-6);
            minus(target, origin)
        }
    };
    match random.below(8) {
        0 => {
            let axis = random.below(3) as usize;
            direction = std::array::from_fn(|i| if i == axis { 1.0 } else { -0.0 });
            (0..3).filter(|i| *i != axis).for_each(|i| origin[i] = target[i]);
        }
        1 => {
            direction[random.below(3) as usize] =
                [0.0, -0.0, 1e-40, -1e-45][random.below(4) as usize]
        }
        _ => {}
    }
    Case { corners, origin, direction }
}

fn valid(case: &Case) -> bool {
    treelet::Ray::new(case.origin, case.direction).is_valid()
}

/// `R` of the derivation: how far the triangle reaches from the origin, per axis.
fn reach(case: &Case) -> f32 {
    case.corners
        .iter()
        .flat_map(|&corner| minus(corner, case.origin))
        .fold(0.0, |reach: f32, x| reach.max(x.abs()))
}

fn slab(case: &Case) -> SlabRay {
    // What `trace::slack` takes for a level of this one triangle.
    SlabRay::new(case.origin, case.direction, 16.0 * U as f32 * reach(case))
}

fn meet(case: &Case, corners: &Corners) -> Option<Meeting> {
    let ray = TriangleRay::new(case.origin, case.direction);
    ray.hit(corners, &slab(case), &UNBOUNDED, &UNBOUNDED)
}

#[test]
fn accepted_t_lies_in_every_box_around_the_triangle() {
    let mut random = Random::new(SEED);
    let mut hits = 0;
    for round in 0..rounds(500_000) {
        let case = case(&mut random);
        if !valid(&case) {
            continue;
        }
        let mut around = Aabb::of_points(&case.corners);
        for axis in 0..3 {
            if random.below(2) == 0 {
                around.lo[axis] -= odd(&mut random).abs();
                around.hi[axis] += odd(&mut random).abs();
            }
        }
        // Slack need not be that of the derivation: without it there are fewer hits, no wrong ones.
        let slab = match random.below(3) {
            0 => SlabRay::new(case.origin, case.direction, 0.0),
            1 => SlabRay::new(case.origin, case.direction, odd(&mut random).abs()),
            _ => slab(&case),
        };
        let inside = slab.interval(&around);
        let middle = 0.5 * inside.entry.max(f32::MIN) + 0.5 * inside.exit.min(f32::MAX);
        let clips = [UNBOUNDED, inside, Interval { entry: inside.entry, exit: middle }];
        for clip in clips {
            let ray = TriangleRay::new(case.origin, case.direction);
            let Some(meeting) = ray.hit(&case.corners, &slab, &clip, &UNBOUNDED) else { continue };
            hits += 1;
            let t = meeting.t;
            let within = |i: &Interval| i.entry <= t && t <= i.exit;
            assert!(within(&inside), "round {round}, {case:?}: {t} is not in {inside:?}");
            assert!(within(&clip), "round {round}, {case:?}: {t} is not in {clip:?}");
        }
    }
    assert!(hits > rounds(300_000), "only {hits} hits");
}

/// The triangle in f64 as the ray sees it: sheared, z along the ray. Exact to `2^-50 R`.
fn sheared(case: &Case) -> [[f64; 3]; 3] {
    let d = case.direction.map(f64::from);
    let z = (0..3).fold(0, |z, i| if d[i].abs() > d[z].abs() { i } else { z });
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    case.corners.map(|corner| {
        let p: [f64; 3] = std::array::from_fn(|i| f64::from(corner[i]) - f64::from(case.origin[i]));
        [p[x] - d[x] / d[z] * p[z], p[y] - d[y] / d[z] * p[z], p[z]]
    })
}

/// Signed distance of the ray from the sheared triangle: negative inside, `None` if it has no
/// inside. Outside, the distance to the nearest edge line that separates; at most the true one.
fn outside_by([a, b, c]: &[[f64; 3]; 3]) -> Option<f64> {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let line = |p: &[f64; 3], q: &[f64; 3]| {
        let length = (q[0] - p[0]).hypot(q[1] - p[1]);
        (q[0] * p[1] - p[0] * q[1]) / length * area.signum()
    };
    let distance = line(a, b).max(line(b, c)).max(line(c, a));
    (area != 0.0 && distance.is_finite()).then_some(distance)
}

/// Corners move by `6 u R` on each of two axes: in the plane at most by this many `u R`.
const BAND: f64 = 6.0 * core::f64::consts::SQRT_2;

#[test]
fn hits_are_hits_and_misses_are_misses() {
    let mut random = Random::new(SEED);
    let (mut hits, mut misses, mut close) = (0, 0, 0);
    for round in 0..rounds(2_000_000) {
        let case = case(&mut random);
        if !valid(&case) {
            continue;
        }
        // `2^-149` is what the smallest numbers are rounded to.
        let band = BAND * (U * f64::from(reach(&case)) + f64::from(f32::from_bits(1)));
        let Some(outside) = outside_by(&sheared(&case)) else { continue };
        let got = meet(&case, &case.corners);
        if outside < -band {
            hits += 1;
            assert!(got.is_some(), "round {round}, {case:?}: inside by {outside:e}, {band:e}");
        } else if outside > band {
            misses += 1;
            assert!(got.is_none(), "round {round}, {case:?}: outside by {outside:e}: {got:?}");
        } else {
            close += 1;
        }
    }
    assert!(
        hits > rounds(300_000) && misses > rounds(300_000) && close > rounds(50_000),
        "{hits} {misses} {close}"
    );
}

#[test]
fn the_ray_is_at_t_where_the_weights_are() {
    let mut random = Random::new(SEED);
    let (mut hits, mut worst) = (0, 0.0_f64);
    for round in 0..rounds(2_000_000) {
        let case = case(&mut random);
        let got = if valid(&case) { meet(&case, &case.corners) } else { None };
        let Some(Meeting { t, u, v }) = got else { continue };
        hits += 1;
        assert!((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v), "{case:?}: {got:?}");
        assert!(f64::from(u) + f64::from(v) <= 1.0 + 2.0 * U, "{case:?}: {got:?}");
        // Sheared corners are off by 6 u R, the rounded weights move the point by 2 u R, the
        // rounded `t` by u R: so far each component of the difference. The direction's longest
        // component times the last bit of the smallest `t` comes on top.
        let [a, b, c] = case.corners.map(|corner| corner.map(f64::from));
        let (u, v) = (f64::from(u), f64::from(v));
        let off = (0..3).map(|i| {
            let there = (1.0 - u - v) * a[i] + u * b[i] + v * c[i];
            let here = f64::from(case.origin[i]) + f64::from(t) * f64::from(case.direction[i]);
            (there - here).abs()
        });
        let off = off.fold(0.0, f64::max);
        let longest = case.direction.iter().fold(0.0_f32, |l, d| l.max(d.abs()));
        let smallest = f64::from(f32::from_bits(1)) * (1.0 + f64::from(longest));
        let unit = U * f64::from(reach(&case)) + smallest;
        worst = worst.max(off / unit);
        assert!(off <= 10.0 * unit, "round {round}, {case:?}: off by {} u R", off / unit);
    }
    eprintln!("at most {worst:.2} u R between the ray and the weights' point");
    assert!(hits > rounds(500_000), "only {hits} hits");
}

/// The lemma for triangles in pieces (`build::sbvh`): of the boxes around the parts on both
/// sides of a plane, one admits the `t` that the whole triangle was met at. Planes go through what
/// the ray is aimed at, or close by.
#[test]
fn accepted_t_lies_in_the_box_of_a_part() {
    let mut random = Random::new(SEED);
    let (mut hits, mut cut, mut worst) = (0, 0, 0.0_f64);
    for round in 0..rounds(1_000_000) {
        let case = case(&mut random);
        let got = if valid(&case) { meet(&case, &case.corners) } else { None };
        let Some(Meeting { t, .. }) = got else { continue };
        hits += 1;
        // Cells around a point where the ray is: up to three planes, each cutting all the others.
        let own = Aabb::of_points(&case.corners);
        let at: [f32; 3] = std::array::from_fn(|i| case.origin[i] + t * case.direction[i]);
        let mut cells = vec![own];
        for axis in 0..3 {
            let plane = match random.below(5) {
                0 => continue,
                1 => case.corners[random.below(3) as usize][axis],
                2 => at[axis].next_up(),
                3 => at[axis].next_down(),
                _ => at[axis],
            };
            let both = cells.iter().flat_map(|cell| {
                let (mut below, mut above) = (*cell, *cell);
                below.hi[axis] = below.hi[axis].min(plane);
                above.lo[axis] = above.lo[axis].max(plane);
                [below, above]
            });
            cells = both.filter(|cell| !cell.is_empty()).collect();
        }
        cut += usize::from(cells.len() > 1);
        let slab = slab(&case);
        let admits = |cell: &Aabb| {
            let part = clipped_bounds(&case.corners, cell);
            let inside = slab.interval(&part);
            !part.is_empty() && inside.entry <= t && t <= inside.exit
        };
        assert!(cells.iter().any(admits), "round {round}, {case:?}: {t} is in none of {cells:?}");
        // How far the ray is from the nearest box, at `t`, against the 8 u R of the derivation.
        let longest = case.direction.iter().fold(0.0_f32, |l, d| l.max(d.abs()));
        let smallest = f64::from(f32::from_bits(1)) * (1.0 + f64::from(longest));
        let off = cells.iter().map(|cell| {
            let part = clipped_bounds(&case.corners, cell);
            (0..3).fold(0.0_f64, |off, i| {
                let here = f64::from(case.origin[i]) + f64::from(t) * f64::from(case.direction[i]);
                off.max(f64::from(part.lo[i]) - here).max(here - f64::from(part.hi[i]))
            })
        });
        let off = off.fold(f64::INFINITY, f64::min);
        worst = worst.max(off / (U * f64::from(reach(&case)) + smallest));
    }
    eprintln!("at most {worst:.2} u R between the ray and the nearest part");
    assert!(worst <= 8.0, "{worst} u R");
    assert!(hits > rounds(250_000) && cut > rounds(200_000), "only {hits} hits, {cut} cut");
}

#[test]
fn the_order_of_corners_does_not_matter() {
    let mut random = Random::new(SEED);
    for round in 0..rounds(500_000) {
        let case = case(&mut random);
        if !valid(&case) {
            continue;
        }
        let [a, b, c] = case.corners;
        let first = meet(&case, &case.corners).is_some();
        for turned in [[b, c, a], [c, a, b], [a, c, b], [c, b, a], [b, a, c]] {
            assert_eq!(
                meet(&case, &turned).is_some(),
                first,
                "round {round}, {case:?}, {turned:?}"
            );
        }
    }
}

#[test]
fn neighbours_never_both_reject_their_edge() {
    // A fan around a corner: the ray goes near its middle, so some triangle of it must be hit.
    let mut random = Random::new(SEED);
    let (mut rays, mut edges) = (0, 0);
    for round in 0..rounds(300_000) {
        let spokes = 3 + random.below(4) as usize;
        let size = 2.0_f32.powi([0, -60, 59, 10][random.below(4) as usize]);
        let offset = [(); 3].map(|()| random.between(-4.0, 4.0) * size);
        let rim: Vec<[f32; 3]> = (0..spokes)
            .map(|i| {
                let turn =
                    core::f32::consts::TAU * (i as f32 + random.unit() * 0.3) / spokes as f32;
                let (x, y, z) = (libm::cosf(turn), libm::sinf(turn), random.between(-0.3, 0.3));
                std::array::from_fn(|k| [x, y, z][k] * size + offset[k])
            })
            .collect();
        let hub: [f32; 3] = offset;
        // At the hub, at a spoke, or as near to either as f32 can tell.
        let mut target = match random.below(2) {
            0 => hub,
            _ => mix(hub, rim[0], random.between(0.0, 0.2)),
        };
        if random.below(2) == 0 {
            target = target.map(|x| [x.next_up(), x.next_down()][random.below(2) as usize]);
        }
        let from: [f32; 3] = std::array::from_fn(|k| {
            let above = [0.3, 0.3, 1.0][k] * random.between(-1.0, 1.0);
            target[k] + (above + if k == 2 { 2.0 } else { 0.0 }) * size
        });
        let direction = minus(target, from);
        let fan: Vec<Corners> = (0..spokes).map(|i| [hub, rim[i], rim[(i + 1) % spokes]]).collect();
        let hits = fan.iter().filter(|&&corners| {
            let case = Case { corners, origin: from, direction };
            meet(&case, &corners).is_some()
        });
        let hits = hits.count();
        rays += 1;
        edges += usize::from(hits > 1);
        assert!(hits > 0, "round {round}: {from:?}, {direction:?} slips through {fan:?}");
    }
    assert!(edges * 20 > rays, "only {edges} of {rays} rays met more than one triangle");
}
