//! A whole scene through the bench, with an engine that is wrong in a known way.

use treelet::Ray;
use treelet::math::Affine;
use treelet_bench::crew::Clock;
use treelet_bench::engine::{
    Answer, Api, Built, Bytes, Call, Engine, EngineError, Pass, Placed, Question, Triangles,
};
use treelet_bench::marks::{self, Standing};
use treelet_bench::rays::Kind;
use treelet_bench::report::Order;
use treelet_bench::rivals::treelet::Treelet;
use treelet_bench::rounds::Rounds;
use treelet_bench::run::{self, BenchError, Plan, SceneResult, Subject, Watcher};
use treelet_bench::scenes::Generated;

/// treelet under another name, whose first ray of every block gets a wrong answer.
struct Wrong(&'static str);

struct WrongBuilt(Box<dyn Built>);

struct WrongPass<'a>(Box<dyn Pass + 'a>);

impl Engine for Wrong {
    fn name(&self) -> &'static str {
        self.0
    }
    fn version(&self) -> String {
        "0".into()
    }
    fn variants(&self) -> Vec<String> {
        vec!["default".into(), "sweep-sah".into()]
    }
    fn build(&self, variant: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError> {
        Ok(Box::new(WrongBuilt(Treelet.build(variant, triangles)?)))
    }
}

impl Built for WrongBuilt {
    fn bytes(&self) -> Bytes {
        self.0.bytes()
    }
    fn calls(&self) -> Vec<Call> {
        vec![Call::ONE]
    }
    fn pass<'a>(&'a self, call: Call, question: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a> {
        Box::new(WrongPass(self.0.pass(call, question, rays)))
    }
}

impl Pass for WrongPass<'_> {
    fn trace(&mut self) {
        self.0.trace();
    }
    fn answers(&self, answers: &mut Vec<Answer>) {
        let first = answers.len();
        self.0.answers(answers);
        let answer = &mut answers[first];
        *answer = if answer.is_hit() { Answer::MISS } else { Answer::hit(1.0, 0) };
    }
}

struct Nobody;

impl Watcher for Nobody {
    fn step(&self, _: &str) {}
    fn stopped(&self) -> bool {
        false
    }
}

/// Rays of each kind: two blocks of those that threads take.
const RAYS: usize = 8192;

fn plan() -> Plan {
    Plan {
        kinds: Kind::ALL.to_vec(),
        orders: vec![Order::Given, Order::Shuffled],
        slices: vec![RAYS, 1024],
        threads: vec![1],
        rays: RAYS,
        rounds: Rounds { count: 2, seconds: 0.0 },
        clock: Clock::Wall,
        builders: vec!["default".into()],
        variants: Vec::new(),
    }
}

/// A generated scene.
fn hill() -> Subject {
    let triangles = Generated::Terrain(2_000).triangles();
    Subject { name: "hill".into(), generated: true, triangles, placed: None, up: Some(1) }
}

fn measure(rival: &'static str) -> Result<SceneResult, BenchError> {
    let subject = hill();
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(Treelet), Box::new(Wrong(rival))];
    run::scene(&subject, &mut engines, &plan(), &Nobody)
}

#[test]
fn a_rivals_mistakes_are_counted_and_treelets_cells_have_none() {
    let result = measure("wrong").unwrap();
    assert!(result.scene.hit_rate > 0.5, "the camera looks away: {}", result.scene.hit_rate);
    assert!(result.scene.rays_by_brute_force > 100);
    assert_eq!(result.builds.len(), 3);
    // Five kinds. As they are: treelet by one ray, its own loop, two lengths of slices; the rival's two
    // trees. Shuffled: treelet without the shorter slices and its loop; nothing of the rival, which takes no many.
    assert_eq!(result.traces.len(), 5 * (4 + 2) + 5 * 2);
    for trace in &result.traces {
        assert_eq!((trace.rays, trace.seconds.len()), (RAYS as u64, 2), "{}", trace.label());
        assert!(trace.mrays_per_s > 0.0, "{}", trace.label());
        let wrong = if trace.engine == "wrong" { 2.0 / RAYS as f64 * 1e6 } else { 0.0 };
        assert_eq!(trace.mismatch_ppm, wrong, "{}", trace.label());
        assert_eq!(trace.ids_ppm.is_none(), trace.kind.question() == Question::Any);
        let slices = [RAYS, 1024, 32].contains(&trace.width);
        assert_eq!(trace.api == Api::Many, slices, "{}", trace.label());
    }
}

#[test]
fn scenes_with_instances_go_to_those_that_have_them() {
    let flat = hill();
    let beside = [0.0, 1.0].map(|x| (0, Affine::translation([x, 0.0, 0.0])));
    let placed = Placed { objects: vec![flat.triangles.clone()], instances: beside.to_vec() };
    let subject = Subject { triangles: Triangles::default(), placed: Some(placed), ..flat };
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(Treelet), Box::new(Wrong("flat"))];
    let result = run::scene(&subject, &mut engines, &plan(), &Nobody).unwrap();
    assert_eq!(result.scene.instances, 2);
    assert!(result.scene.rays_by_brute_force > 100 && result.scene.hit_rate > 0.5);
    assert_eq!(result.left_out.len(), 1);
    assert_eq!(result.left_out[0].name, "flat");
    assert_eq!(result.traces.len(), 5 * 4 + 5 * 2);
    assert!(
        result.traces.iter().all(|trace| trace.engine == "treelet" && trace.mismatch_ppm == 0.0)
    );
}

#[test]
fn treelet_with_other_bits_is_not_timed() {
    let error = measure("treelet").unwrap_err();
    assert!(matches!(error, BenchError::Bits { ray: 0, .. }), "{error}");
}

#[test]
fn marks_without_embree_are_not_measured_but_bytes_are() {
    let result = measure("wrong").unwrap();
    let marks = marks::marks(&[result.scene], &result.builds, &result.traces);
    for mark in &marks {
        let of_our_own = ["bytes a triangle that walks", "  with the caller", "single-ray call"];
        let measured = of_our_own.iter().any(|begin| mark.what.starts_with(begin))
            && !mark.what.contains("compact");
        assert_eq!(mark.standing != Standing::NotMeasured, measured, "{}", mark.what);
        assert_eq!(mark.lacking.is_none(), measured, "{}", mark.what);
    }
    assert!(marks.len() > 30);
}

/// With treelet in Embree's place the marks compare it with itself.
#[test]
fn marks_compare_with_embree() {
    let mut result = measure("wrong").unwrap();
    for trace in &mut result.traces {
        if trace.engine == "wrong" {
            trace.engine = "embree".into();
            trace.variant = "MEDIUM".into();
            // Twice as fast as it was.
            trace.seconds.iter_mut().for_each(|seconds| *seconds *= 0.5);
        }
    }
    let ours = result.traces.iter().find(|t| t.engine == "treelet").unwrap().clone();
    for trace in &mut result.traces {
        if trace.kind == Kind::Primary && trace.order == Order::Given {
            let factor = if trace.engine == "embree" { 0.5 } else { 1.0 };
            trace.seconds = ours.seconds.iter().map(|seconds| seconds * factor).collect();
        }
    }
    let marks = marks::marks(&[result.scene], &result.builds, &result.traces);
    let mark =
        marks.iter().find(|mark| mark.what.starts_with("single primary, default / Embree M"));
    let mark = mark.unwrap();
    assert_eq!((mark.mean, mark.worst, mark.cells), (Some(0.5), Some(0.5), 1));
    assert_eq!(mark.standing, Standing::NotMet);
}

#[test]
fn an_unknown_variant_is_an_error_that_lists_the_known() {
    let triangles = Generated::Soup(10).triangles();
    let subject =
        Subject { name: "soup".into(), generated: true, triangles, placed: None, up: None };
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(Treelet)];
    let plan = Plan { builders: vec!["magic".into()], ..plan() };
    let error = run::scene(&subject, &mut engines, &plan, &Nobody).unwrap_err().to_string();
    assert!(error.contains("magic") && error.contains("binned-sah"), "{error}");
}
