//! treelet itself, as its users call it.
//!
//! A variant is a builder's or a quality level's name with optimisers after it, and perhaps a layout's
//! or an instruction set's: `binned-sah`, `lbvh+treelets`, `binned-sah wide8`, `best avx2`. What is not
//! named is the library's own choice.
//!
//! The single-ray calls go through a function that is never inlined, so that a loop over rays gains
//! nothing that a renderer's code would not. What that costs is measured against slices of [`LOOP`]
//! rays, too short to be walked together: there the library itself asks ray by ray, in a loop into
//! which all is inlined but the walk, which is compiled for other instructions than what calls it.

use treelet::build;
use treelet::layout;
use treelet::optimize::Optimizer;
use treelet::scene::{LayoutChoice, Recipe, SceneBuilder};
use treelet::simd::Level;
use treelet::{BuildOptions, Context, Hit, Mesh, Quality, Ray, Scene};

use crate::engine::{
    Answer, Api, Built, Bytes, Call, Engine, EngineError, Pass, Placed, Question, Triangles,
};

/// The engine.
#[derive(Debug)]
pub struct Treelet;

/// The name in reports.
pub const NAME: &str = "treelet";

/// The variant that users get without asking.
pub fn default_variant() -> &'static str {
    Quality::default().name()
}

/// Rays of a slice that the library answers one by one.
pub const LOOP: usize = 32;

/// What usual variants are for: building, both, tracing.
const USUAL: [Quality; 3] = [Quality::Fast, Quality::Default, Quality::Best];

/// How the names of layouts begin that are made to be small.
const COMPACT: &str = "compact";

/// Whether a variant is the default build in a small layout.
pub(crate) fn is_compact(variant: &str) -> bool {
    let (build, layout) = variant.split_once(' ').unwrap_or((variant, ""));
    build == default_variant() && layout.starts_with(COMPACT)
}

/// The default build in the small layout.
fn compact_variant() -> Option<String> {
    let variant = |(layout, _): (&str, LayoutChoice)| format!("{} {layout}", default_variant());
    layouts().map(variant).find(|variant| is_compact(variant))
}

impl Engine for Treelet {
    fn name(&self) -> &'static str {
        NAME
    }

    fn version(&self) -> String {
        env!("CARGO_PKG_VERSION").to_owned()
    }

    fn variants(&self) -> Vec<String> {
        let builders = build::ALL.iter().map(|builder| builder.info().name.to_owned());
        let qualities = Quality::ALL.iter().map(|quality| quality.name().to_owned());
        let plain: Vec<_> = qualities.chain(builders).collect();
        let levels =
            Level::ALL.iter().filter(|level| level.is_available()).map(|level| level.name());
        let words: Vec<_> = layouts().map(|(name, _)| name).chain(levels).collect();
        let with = |name: &String| words.iter().map(|word| format!("{name} {word}")).collect();
        let more: Vec<Vec<String>> = plain.iter().map(with).collect();
        plain.into_iter().chain(more.into_iter().flatten()).collect()
    }

    /// Any builder or level with any optimisers after it.
    fn variant(&self, asked: &str) -> Option<String> {
        let asked = asked.to_ascii_lowercase();
        wish(&asked).map(|_| asked)
    }

    fn usual_variants(&self) -> Vec<String> {
        USUAL.iter().map(|quality| quality.name().to_owned()).chain(compact_variant()).collect()
    }

    /// Slices are for the tree that is made to be traced.
    fn is_usual(&self, variant: &str, call: Call) -> bool {
        match call {
            Call::ONE => true,
            Call::SLICES => variant == Quality::Best.name(),
            _ => variant == default_variant(),
        }
    }

    fn build(&self, variant: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError> {
        let scene = scene(variant, triangles)?;
        let is_default = variant == default_variant();
        Ok(Box::new(TreeletScene { scene, is_default, shared: triangles.bytes() }))
    }

    fn has_instances(&self) -> bool {
        true
    }

    fn build_placed(&self, variant: &str, placed: &Placed) -> Result<Box<dyn Built>, EngineError> {
        let scene = placed_scene(variant, placed)?;
        let is_default = variant == default_variant();
        Ok(Box::new(TreeletScene { scene, is_default, shared: placed.bytes() }))
    }
}

/// A scene that stands already, as the engine's own.
pub(crate) fn built(scene: Scene, triangles: &Triangles) -> Box<dyn Built> {
    Box::new(TreeletScene { scene, is_default: false, shared: triangles.bytes() })
}

/// The layouts by name.
fn layouts() -> impl Iterator<Item = (&'static str, LayoutChoice)> {
    layout::ALL.iter().map(|info| info.name).zip(LayoutChoice::ALL.iter().copied())
}

/// What a variant's name asks for.
struct Wish {
    recipe: Recipe,
    layout: Option<LayoutChoice>,
    level: Level,
}

/// `None` if a word of the variant's name is not known.
fn wish(variant: &str) -> Option<Wish> {
    let mut words = variant.split(' ');
    let recipe = words.next()?.parse().ok()?;
    let mut wish = Wish { recipe, layout: None, level: BuildOptions::default().level };
    for word in words {
        match (layouts().find(|(name, _)| *name == word), Level::by_name(word)) {
            (Some((_, layout)), _) => wish.layout = Some(layout),
            (None, level) => wish.level = level?,
        }
    }
    Some(wish)
}

/// A scene of these triangles, built as the variant's name says.
pub(crate) fn scene(variant: &str, triangles: &Triangles) -> Result<Scene, EngineError> {
    scene_with(variant, triangles, &[], Context::default())
}

/// A scene of instances, each level built as the variant's name says.
pub(crate) fn placed_scene(variant: &str, placed: &Placed) -> Result<Scene, EngineError> {
    let objects = placed.objects.iter().map(|triangles| scene(variant, triangles));
    let objects = objects.collect::<Result<Vec<_>, _>>()?;
    let mut top = Scene::builder();
    for &(object, world_from_object) in &placed.instances {
        let object = objects.get(object).ok_or_else(|| no_object(object, objects.len()))?;
        top = top.instance(object, world_from_object);
    }
    build(variant, top, &[], Context::default())
}

/// An instance of nothing.
pub(super) fn no_object(object: usize, objects: usize) -> EngineError {
    EngineError::Refused(format!("an instance names object {object} of {objects}"))
}

/// The same, stopped and watched by its caller, with more optimisers at the end.
pub(crate) fn scene_with(
    variant: &str,
    triangles: &Triangles,
    more: &[&dyn Optimizer],
    context: Context<'_>,
) -> Result<Scene, EngineError> {
    let (positions, indices) = (triangles.positions.clone(), triangles.indices.clone());
    let mesh = match &triangles.later {
        None => Mesh::new(positions, indices),
        Some(later) => Mesh::moving([positions, later.clone()], indices),
    };
    build(variant, Scene::builder().mesh(mesh), more, context)
}

/// A scene, built as the variant's name says.
fn build(
    variant: &str,
    scene: SceneBuilder,
    more: &[&dyn Optimizer],
    context: Context<'_>,
) -> Result<Scene, EngineError> {
    let Wish { recipe, layout, level } = wish(variant)
        .ok_or_else(|| EngineError::Missing(format!("treelet has no variant `{variant}`")))?;
    let own = recipe.options().plan().optimizers;
    let optimizers: Vec<_> = own.iter().chain(more).copied().collect();
    let optimizers = Some(&*optimizers);
    let options = BuildOptions { layout, level, optimizers, context, ..recipe.options() };
    scene.build(&options).map_err(|error| EngineError::Refused(error.to_string()))
}

/// A scene, and what it shares with its caller.
struct TreeletScene {
    scene: Scene,
    is_default: bool,
    shared: u64,
}

impl Built for TreeletScene {
    fn bytes(&self) -> Bytes {
        Bytes { own: self.scene.trace_bytes(), shared: self.shared }
    }

    fn calls(&self) -> Vec<Call> {
        // The library's own loop is the same for every tree.
        let own_loop = self.is_default.then_some(Call::packets(LOOP));
        [Call::ONE, Call::SLICES].into_iter().chain(own_loop).collect()
    }

    fn pass<'a>(&'a self, call: Call, question: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a> {
        let scene = &self.scene;
        match question {
            Question::Closest => {
                let hits = vec![Hit::MISS; rays.len()];
                Box::new(ClosestPass { scene, call, rays, hits })
            }
            Question::Any => {
                let answers = vec![false; rays.len()];
                Box::new(AnyPass { scene, call, rays, answers })
            }
        }
    }
}

struct ClosestPass<'a> {
    scene: &'a Scene,
    call: Call,
    rays: &'a [Ray],
    hits: Vec<Hit>,
}

/// A user's call: never part of the loop around it.
#[inline(never)]
pub(crate) fn closest(scene: &Scene, ray: &Ray) -> Hit {
    scene.closest(ray).unwrap_or(Hit::MISS)
}

/// A user's call: never part of the loop around it.
#[inline(never)]
pub(crate) fn any(scene: &Scene, ray: &Ray) -> bool {
    scene.any(ray)
}

impl Pass for ClosestPass<'_> {
    fn trace(&mut self) {
        match self.call.api {
            Api::One => {
                for (ray, hit) in self.rays.iter().zip(&mut self.hits) {
                    *hit = closest(self.scene, ray);
                }
            }
            // The lengths are the same, so nothing is refused.
            Api::Many => {
                let width = self.call.width.min(self.rays.len()).max(1);
                for (rays, hits) in self.rays.chunks(width).zip(self.hits.chunks_mut(width)) {
                    let _ = self.scene.closest_many(rays, hits);
                }
            }
        }
    }

    fn answers(&self, answers: &mut Vec<Answer>) {
        let answer = |hit: &Hit| Answer { t: hit.t, prim: hit.prim, inst: hit.inst as u32 };
        answers.extend(self.hits.iter().map(answer));
    }
}

struct AnyPass<'a> {
    scene: &'a Scene,
    call: Call,
    rays: &'a [Ray],
    answers: Vec<bool>,
}

impl Pass for AnyPass<'_> {
    fn trace(&mut self) {
        match self.call.api {
            Api::One => {
                for (ray, answer) in self.rays.iter().zip(&mut self.answers) {
                    *answer = any(self.scene, ray);
                }
            }
            // The lengths are the same, so nothing is refused.
            Api::Many => {
                let width = self.call.width.min(self.rays.len()).max(1);
                for (rays, answers) in self.rays.chunks(width).zip(self.answers.chunks_mut(width)) {
                    let _ = self.scene.any_many(rays, answers);
                }
            }
        }
    }

    fn answers(&self, answers: &mut Vec<Answer>) {
        answers.extend(self.answers.iter().map(|&hit| Answer::any(hit)));
    }
}

#[cfg(test)]
mod tests {
    use super::{Treelet, is_compact, wish};
    use crate::engine::Engine;

    #[test]
    fn what_is_usual_is_known_and_has_one_small_layout() {
        let (usual, known) = (Treelet.usual_variants(), Treelet.variants());
        assert_eq!(usual[..3], ["fast", "default", "best"]);
        assert!(usual.iter().all(|variant| known.contains(variant)), "{usual:?}");
        assert_eq!(usual.iter().filter(|variant| is_compact(variant)).count(), 1, "{usual:?}");
        assert!(known.iter().all(|variant| wish(variant).is_some()));
        let asked = ["lbvh+treelets", "Binned-SAH+Reinsertion wide8", "default+treelets AVX2"];
        for (asked, known) in asked.map(|asked| (asked, Treelet.variant(asked))) {
            assert_eq!(known, Some(asked.to_lowercase()));
        }
        for unknown in ["lbvh+", "lbvh+lbvh", "treelets", "lbvh wide9", "lbvh treelets", ""] {
            assert_eq!(Treelet.variant(unknown), None);
        }
        assert!(!is_compact("best compact") && !is_compact("default wide8"));
    }
}
