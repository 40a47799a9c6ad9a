//! A scene as one mesh, and the trees over it: what the measures are measured on.

use treelet::bounds::Aabb;
use treelet::build::Clip;
use treelet::geometry::clip::clipped_bounds;
use treelet::scene::Recipe;
use treelet::tree::Tree;
use treelet::{Context, Mesh, Quality};
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

    /// The tree that a recipe makes.
    pub(super) fn tree(&self, recipe: &Recipe, session: &Session) -> Result<Tree, Failure> {
        let context = Context { cancel: session.cancel.clone(), progress: None };
        let tree = recipe.options().plan().build(&self.bounds, self, &context);
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

/// All builders and quality levels.
pub(super) fn recipes() -> Vec<Recipe> {
    let builders = treelet::build::ALL.iter().map(|builder| builder.info().name);
    let builders = builders.filter_map(|name| name.parse().ok());
    builders.chain(Quality::ALL.map(Recipe::from)).collect()
}
