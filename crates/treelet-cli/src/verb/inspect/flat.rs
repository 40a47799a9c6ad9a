//! A scene as one mesh, and the trees over it: what the measures are measured on.

use treelet::bounds::Aabb;
use treelet::build::Clip;
use treelet::geometry::clip::clipped_bounds;
use treelet::tree::Tree;
use treelet::{BuildOptions, Context, Mesh, Quality};
use treelet_bench::engine::Triangles;
use treelet_bench::scenes;

use crate::ending::Failure;
use crate::input::Input;
use crate::session::Session;

/// All triangles that are fit for a scene, where they are placed.
pub(super) struct Flat {
    pub(super) triangles: Triangles,
    pub(super) mesh: Mesh,
    bounds: Vec<Aabb>,
}

impl Flat {
    /// Copies what instances repeat.
    pub(super) fn new(input: &Input) -> Result<Self, Failure> {
        let triangles = scenes::flatten(&input.model)
            .map_err(|error| Failure::told(format!("{}: {error}", input.name)))?;
        let mesh = Mesh::new(triangles.positions.clone(), triangles.indices.clone());
        let bounds = (0..triangles.len()).map(|prim| Aabb::of_points(&triangles.corners(prim)));
        Ok(Self { mesh, bounds: bounds.collect(), triangles })
    }

    /// The tree that a variant makes: a builder, or a quality level.
    pub(super) fn tree(&self, variant: &str, session: &Session) -> Result<Tree, Failure> {
        let context = Context { cancel: session.cancel.clone(), progress: None };
        let tree = options(variant).plan().build(&self.bounds, self, &context);
        tree.map_err(|error| stopped_or(session, error))
    }
}

impl Clip for Flat {
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb {
        clipped_bounds(&self.triangles.corners(prim as usize), region)
    }
}

/// A failure, or only what cancelling looks like from outside.
pub(super) fn stopped_or(
    session: &Session,
    error: impl std::error::Error + Send + Sync + 'static,
) -> Failure {
    if session.cancel.is_cancelled() { Failure::Cancelled } else { Failure::from(error) }
}

/// What the name of a builder or a quality level asks for.
pub(super) fn options(variant: &str) -> BuildOptions<'static> {
    BuildOptions {
        quality: Quality::by_name(variant).unwrap_or_default(),
        builder: treelet::build::by_name(variant),
        ..BuildOptions::default()
    }
}

/// The names of all builders and quality levels.
pub(super) fn variants() -> Vec<&'static str> {
    let builders = treelet::build::ALL.iter().map(|builder| builder.info().name);
    builders.chain(Quality::ALL.map(Quality::name)).collect()
}
