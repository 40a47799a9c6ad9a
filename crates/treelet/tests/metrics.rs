//! The measures of trees, each against its definition and against a second way to it.

use treelet::bounds::{Aabb, SlabRay};
use treelet::build::{self, Builder, Clip, Sbvh};
use treelet::geometry::clip::clipped_bounds;
use treelet::tree::{Kind, LineStats, Node, SahConstants, Surface, Tree};
use treelet::verify::Random;
use treelet::{Cancel, Cancelled, Context, Mesh};
use treelet_testkit::{Shape, awkward, closed};

/// Uneven, so that a mix-up shows.
const PRICES: SahConstants = SahConstants { visit: 1.25, prim: 0.75 };

/// Standard errors within which an estimate must be: 1 of 16,000 is outside.
const SIGMAS: f64 = 4.0;

struct Cuttable<'a>(&'a Mesh);

impl Clip for Cuttable<'_> {
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb {
        clipped_bounds(&self.0.corners(prim as usize).unwrap(), region)
    }
}

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn tree(mesh: &Mesh, builder: &dyn Builder) -> Tree {
    let prims = 0..mesh.triangles().len();
    let bounds: Vec<_> = prims.map(|p| Aabb::of_points(&mesh.corners(p).unwrap())).collect();
    builder.build_clipped(&bounds, &Cuttable(mesh), &Context::default()).unwrap()
}

/// A builder that puts most primitives into several leaves.
const EAGER: Sbvh = Sbvh {
    leaf_max: 1,
    bins: 32,
    visit_cost: 0.0,
    block: 1,
    overlap_min: 0.0,
    node_overlap_min: 0.0,
    advantage: 1.0,
    budget: 3.0,
    clips: 1_000_000,
};

fn builders() -> impl Iterator<Item = &'static dyn Builder> {
    build::ALL.iter().copied().chain([&EAGER as &dyn Builder])
}

/// The primitives below a node.
fn below(tree: &Tree, node: usize) -> Vec<u32> {
    match tree.nodes[node].kind() {
        Kind::Inner { left } => [below(tree, left), below(tree, left + 1)].concat(),
        Kind::Leaf { first, count } => tree.prims[first..first + count].to_vec(),
    }
}

fn price(node: &Node, constants: &SahConstants) -> f64 {
    match node.kind() {
        Kind::Inner { .. } => constants.visit,
        Kind::Leaf { count, .. } => constants.prim * count as f64,
    }
}

/// The definition: every node against every primitive.
fn epo_by_definition(tree: &Tree, mesh: &Mesh) -> f64 {
    let prims = 0..mesh.triangles().len() as u32;
    let all: f64 = prims.clone().map(|prim| mesh.area(prim)).sum();
    let foreign = |at: usize| -> f64 {
        let own = below(tree, at);
        let others = prims.clone().filter(|prim| !own.contains(prim));
        others.map(|prim| mesh.area_inside(prim, &tree.nodes[at].bounds)).sum()
    };
    let nodes = tree.nodes.iter().enumerate();
    nodes.map(|(at, node)| price(node, &PRICES) * foreign(at)).sum::<f64>() / all
}

fn exact(tree: &Tree, mesh: &Mesh) -> f64 {
    tree.epo(mesh, &PRICES, &Cancel::new()).unwrap()
}

#[test]
fn end_point_overlap_is_what_its_definition_says() {
    let scenes = [
        ("thin", closed::sphere(14, 10).mapped(|[x, y, z]| [x + 2.0 * y, 8.0 * y, z + x])),
        ("random", awkward::random_triangles(200, 4.0, 1.0)),
        ("star", closed::random_star(14, 10, 5)),
        ("grid", awkward::coplanar_grid(10)),
        ("far", closed::sphere(12, 8).mapped(closed::far_away)),
    ];
    for (name, shape) in &scenes {
        let mesh = mesh(shape);
        for builder in builders() {
            let tree = tree(&mesh, builder);
            let (got, want) = (exact(&tree, &mesh), epo_by_definition(&tree, &mesh));
            let builder = builder.info().name;
            assert!((got - want).abs() <= 1e-9 * want, "{name}, {builder}: {got}, not {want}");
            assert!(want > 0.0 || *name == "grid", "{name}, {builder}: nothing to see");
        }
    }
    let repeats = tree(&mesh(&scenes[0].1), &EAGER);
    assert!(repeats.prims.len() > 350, "nothing is in several leaves: {}", repeats.prims.len());
}

/// Points of the surfaces: a second way, that never cuts a triangle.
#[test]
fn points_agree_with_areas_within_their_error() {
    let (mut off, mut count) = (0.0, 0.0);
    for shape in [awkward::random_triangles(1_000, 8.0, 1.0), closed::random_star(40, 30, 9)] {
        let mesh = mesh(&shape);
        for builder in builders() {
            let tree = tree(&mesh, builder);
            let exact = exact(&tree, &mesh);
            let sampled = tree.epo_sampled(&mesh, &PRICES, 1 << 14, &Cancel::new()).unwrap();
            let sigmas = (sampled.value - exact) / sampled.error;
            let name = builder.info().name;
            assert!(sigmas.abs() < SIGMAS, "{name}: {sampled:?}, not {exact}");
            assert!(sampled.error < 0.03 * exact, "{name}: {sampled:?}");
            off += sigmas * sigmas;
            count += 1.0;
        }
    }
    // Errors that are said to be larger than they are would hide a wrong sum.
    assert!(off / count > 0.15, "said errors are too large: {}", off / count);
}

#[test]
fn end_point_overlap_by_hand() {
    // Two level unit squares, one triangle each; the second starts in the middle of the first.
    let square = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
    let shape = Shape::soup(&[square(0.0), square(0.5)]);
    let mesh = mesh(&shape);
    let bounds = [0, 1].map(|prim| Aabb::of_points(&mesh.corners(prim).unwrap()));
    let nodes = vec![
        Node::inner(bounds[0].union(&bounds[1]), 1),
        Node::leaf(bounds[0], 0, 1),
        Node::leaf(bounds[1], 1, 1),
    ];
    let tree = Tree { nodes, prims: vec![0, 1] };
    // Of the second, what is left of x = 1: a half less a triangle of 1/8. Of the first, 1/8.
    let expected = 0.75 * ((0.5 - 0.125) + 0.125);
    assert!((exact(&tree, &mesh) - expected).abs() < 1e-12);
    // The root's box holds all, and all belongs to it.
    let squares: Vec<_> = (0..100).map(|i| square(3.0 * i as f32)).collect();
    let apart = self::mesh(&Shape::soup(&squares));
    for builder in builders() {
        assert_eq!(exact(&self::tree(&apart, builder), &apart), 0.0, "{}", builder.info().name);
    }
}

fn lines(tree: &Tree, lines: u32) -> LineStats {
    tree.line_stats(&PRICES, lines, &Cancel::new()).unwrap()
}

/// Crofton: the heuristic is the cost of a long random line.
#[test]
fn lines_cost_what_the_heuristic_says() {
    let long = closed::sphere(12, 8).mapped(|[x, y, z]| [9.0 * x, y, 0.1 * z]);
    for shape in [awkward::random_triangles(2_000, 10.0, 1.0), long, awkward::coplanar_grid(12)] {
        let mesh = mesh(&shape);
        for builder in builders() {
            let tree = tree(&mesh, builder);
            let stats = lines(&tree, 1 << 14);
            let sah = tree.sah(&PRICES);
            let sigmas = (stats.cost.value - sah) / stats.cost.error;
            let name = builder.info().name;
            assert!(sigmas.abs() < SIGMAS, "{name}: {stats:?}, SAH {sah}");
            assert!(stats.cost.error < 0.02 * sah, "{name}: {stats:?}");
        }
    }
}

/// Lines made in another way, walked without a tree: chords between random points of a sphere
/// around the root, of which those count that meet the root.
#[test]
fn leaf_counts_vary_as_other_lines_say() {
    let mesh = mesh(&awkward::random_triangles(200, 3.0, 1.0).mapped(|[x, y, z]| [x, y, 3.0 * z]));
    let tree = tree(&mesh, &build::BinnedSah::DEFAULT);
    let (root, mut random) = (tree.bounds(), Random::new(0x1C5));
    let radius = 0.51 * root.diagonal() as f32;
    let mut on_sphere = || {
        let tip = treelet::math::vec3::normalize(random.direction()).unwrap();
        [0, 1, 2].map(|axis: usize| root.center()[axis] + radius * tip[axis])
    };
    let leaves = tree.nodes.iter().filter(|node| node.count > 0);
    let leaves: Vec<Aabb> = leaves.map(|node| node.bounds).collect();
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    while count < 20_000.0 {
        let (from, to) = (on_sphere(), on_sphere());
        let ray = SlabRay::new(from, treelet::math::vec3::sub(to, from), 0.0);
        if ray.interval(&root).is_empty() {
            continue;
        }
        let met = leaves.iter().filter(|leaf| !ray.interval(leaf).is_empty()).count() as f64;
        count += 1.0;
        sum += met;
        squares += met * met;
    }
    let deviation = (squares / count - (sum / count) * (sum / count)).sqrt();
    let stats = lines(&tree, 1 << 15);
    assert!((stats.lcv / deviation - 1.0).abs() < 0.03, "{stats:?}, others {deviation}");
    assert!((stats.leaves.value / (sum / count) - 1.0).abs() < 0.03, "{stats:?}, {}", sum / count);
}

#[test]
fn awkward_scenes_are_measured_too() {
    let cancel = Cancel::new();
    let small = |shape: &Shape| shape.triangles.len() <= 600;
    let fit = |scene: &&awkward::Awkward| scene.invalid == 0 && small(&scene.shape);
    for scene in awkward::all(100).iter().filter(fit) {
        let mesh = mesh(&scene.shape);
        for builder in [&build::BinnedSah::DEFAULT as &dyn Builder, &EAGER] {
            let tree = tree(&mesh, builder);
            let exact = exact(&tree, &mesh);
            let sampled = tree.epo_sampled(&mesh, &PRICES, 512, &cancel).unwrap();
            let lines = lines(&tree, 256);
            let numbers = [exact, sampled.value, sampled.error, lines.lcv, lines.cost.value];
            let sound = numbers.iter().all(|number| number.is_finite() && *number >= 0.0);
            assert!(sound, "{}: {numbers:?}", scene.name);
        }
    }
    let nothing = Tree::default();
    assert_eq!(exact(&nothing, &Mesh::default()), 0.0);
    assert_eq!(lines(&nothing, 100), LineStats::default());
}

#[test]
fn measures_are_the_same_for_any_number_of_threads_and_can_be_stopped() {
    let mesh = mesh(&awkward::random_triangles(2_000, 10.0, 1.0));
    let tree = tree(&mesh, &EAGER);
    let measure = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let sampled = tree.epo_sampled(&mesh, &PRICES, 10_000, &Cancel::new()).unwrap();
            (exact(&tree, &mesh).to_bits(), sampled, lines(&tree, 5_000))
        })
    };
    assert_eq!(measure(1), measure(3));

    let cancel = Cancel::new();
    cancel.cancel();
    assert_eq!(tree.epo(&mesh, &PRICES, &cancel), Err(Cancelled));
    assert_eq!(tree.epo_sampled(&mesh, &PRICES, 100, &cancel), Err(Cancelled));
    assert_eq!(tree.line_stats(&PRICES, 100, &cancel), Err(Cancelled));
}
