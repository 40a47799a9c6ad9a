//! A model made ready for rays.

use crate::{Changes, Model, Part, Placement};
use treelet::context::Context;
use treelet::math::Affine;
use treelet::scene::{Action, Commit, Policy};
use treelet::{BuildOptions, BuildReport, Hit, Pilot, Quality, Scene, SceneError};

/// The scenes of a model, and the way from a hit back to what the model says about it.
///
/// A model of one object placed once, unmoved, is one scene of that object's parts. Any other is a
/// scene of instances, one a placement, over one scene an object; objects that nobody placed are
/// not built.
#[derive(Clone, Debug)]
pub struct PlacedModel {
    /// What rays are traced against.
    pub scene: Scene,
    /// By object: its scene, if it is placed anywhere.
    objects: Vec<Option<Scene>>,
    /// Whether `Hit::inst` counts placements from 1, the scene itself being 0.
    instanced: bool,
    /// What the trees that changed last became.
    updated: Updated,
    /// What updates are to come to.
    policy: Policy,
}

/// What became of trees when a model was posed anew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Updated {
    /// Objects whose trees followed their shape.
    pub refitted: u64,
    /// Objects whose trees followed, and were repaired where they had decayed.
    pub repaired: u64,
    /// Objects that have new trees.
    pub rebuilt: u64,
    /// What became of the tree over the placements; `None` where there is none.
    pub placements: Option<Action>,
}

/// Why a model cannot be traced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlaceError {
    /// A placement names an object that is not there.
    #[error("placement {placement} names object {object} of {objects}")]
    NoSuchObject {
        /// Which placement.
        placement: usize,
        /// Which object it names.
        object: usize,
        /// How many there are.
        objects: usize,
    },
    /// A part names a material that is not there.
    #[error("part {part} of object {object} names material {material} of {materials}")]
    NoSuchMaterial {
        /// Which object.
        object: usize,
        /// Which part of it.
        part: usize,
        /// Which material it names.
        material: usize,
        /// How many there are.
        materials: usize,
    },
    /// An object's meshes are wrong.
    #[error("object {object} ({name}): {error}")]
    Object {
        /// Which object.
        object: usize,
        /// Its name.
        name: String,
        /// What is wrong.
        #[source]
        error: SceneError,
    },
    /// The placements are wrong; an instance is a placement.
    #[error("placements: {0}")]
    Placements(#[source] SceneError),
}

impl PlaceError {
    /// Whether the build was stopped by its caller.
    pub fn is_cancelled(&self) -> bool {
        match self {
            Self::Object { error, .. } | Self::Placements(error) => error.is_cancelled(),
            Self::NoSuchObject { .. } | Self::NoSuchMaterial { .. } => false,
        }
    }
}

impl PlacedModel {
    /// Builds the model's scenes.
    ///
    /// # Errors
    ///
    /// An index that leads nowhere, or whatever building a scene refuses, with the object's name.
    pub fn build(model: &Model, options: &BuildOptions<'_>) -> Result<Self, PlaceError> {
        Self::assemble(model, vec![None; model.objects.len()], options, None)
    }

    /// The scenes of a model that was built before and has been posed since: objects that kept their
    /// shape keep their trees.
    ///
    /// `changes` must be what changed since the build. What is answered, by this and by a fresh
    /// build, is the same. Trees of objects in a new shape, and of the placements, follow what moved or are
    /// built anew, as `treelet::scene::Edit` decides; if nothing changed, nothing is done.
    ///
    /// # Errors
    ///
    /// Those of [`PlacedModel::build`].
    pub fn updated(
        &self,
        model: &Model,
        changes: &Changes,
        options: &BuildOptions<'_>,
    ) -> Result<Self, PlaceError> {
        if changes.keeps_geometry() {
            return Ok(Self { updated: Updated::default(), ..self.clone() });
        }
        check_indices(model)?;
        let mut objects = self.objects.clone();
        objects.resize(model.objects.len(), None);
        let mut updated = Updated::default();
        for &object in &changes.objects {
            let Some(Some(scene)) = objects.get(object) else { continue };
            let options = object_options(model, object, options);
            let bent = bend(model, object, scene, self.policy, &options)?;
            match bent.action {
                Action::Kept => {}
                Action::Refitted => updated.refitted += 1,
                Action::Repaired => updated.repaired += 1,
                Action::Rebuilt => updated.rebuilt += 1,
            }
            objects[object] = Some(bent.scene);
        }
        let before = Some(self).filter(|_| self.instanced);
        let mut placed = Self::assemble(model, objects, options, before)?;
        placed.policy = self.policy;
        placed.updated = Updated { placements: placed.updated.placements, ..updated };
        Ok(placed)
    }

    /// Keeps up with what moves under this policy from now on; [`Policy::Auto`] if nobody says.
    #[must_use]
    pub fn under(self, policy: Policy) -> Self {
        Self { policy, ..self }
    }

    /// What the last [`PlacedModel::updated`] did.
    pub fn update(&self) -> Updated {
        self.updated
    }

    /// Builds what is missing of the objects, and places them, as they were `before` if they were.
    fn assemble(
        model: &Model,
        mut objects: Vec<Option<Scene>>,
        options: &BuildOptions<'_>,
        before: Option<&Self>,
    ) -> Result<Self, PlaceError> {
        check_indices(model)?;
        for placement in &model.placements {
            let object = placement.object;
            if objects[object].is_none() {
                let scene = build_object(model, object, &object_options(model, object, options))?;
                objects[object] = Some(scene);
            }
        }
        let single = match model.placements.as_slice() {
            [only] if only.world_from_object == Affine::IDENTITY => objects[only.object].clone(),
            _ => None,
        };
        let instanced = single.is_none();
        let mut updated = Updated::default();
        let before = before.filter(|before| before.scene.instances() == model.placements.len());
        let scene = match (single, before) {
            (Some(scene), _) => scene,
            (None, Some(before)) => {
                let commit = before.moved(model, &objects, options);
                let commit = commit.map_err(PlaceError::Placements)?;
                updated.placements = Some(commit.action);
                commit.scene
            }
            (None, None) => {
                updated.placements = Some(Action::Rebuilt);
                place(model, &objects, options).map_err(PlaceError::Placements)?
            }
        };
        Ok(Self { scene, objects, instanced, updated, policy: Policy::default() })
    }

    /// The scene of placements, where these are as many as before.
    fn moved(
        &self,
        model: &Model,
        objects: &[Option<Scene>],
        options: &BuildOptions<'_>,
    ) -> Result<Commit, SceneError> {
        let mut edit = self.scene.edit();
        edit.policy = self.policy;
        for (at, placement) in model.placements.iter().enumerate() {
            // Every placement is there, so nothing is refused.
            let map = placement.world_from_object;
            if self.scene.world_from_object(at as u64 + 1) != Some(map) {
                let _ = edit.set_transform(at, map);
            }
            if let (Some(Some(old)), Some(Some(new))) =
                (self.objects.get(placement.object), objects.get(placement.object))
                && !old.is_same(new)
            {
                let _ = edit.set_scene(at, new);
            }
        }
        edit.commit(options)
    }

    /// The placement that was hit, as an index into [`Model::placements`]; `None` for a hit of
    /// another scene.
    pub fn placement_index(&self, hit: &Hit) -> Option<usize> {
        let inst = usize::try_from(hit.inst).ok()?;
        if self.instanced { inst.checked_sub(1) } else { Some(inst) }
    }

    /// The placement and the part that were hit; `None` for a hit of another scene.
    pub fn resolve<'a>(&self, model: &'a Model, hit: &Hit) -> Option<(&'a Placement, &'a Part)> {
        let placement = model.placements.get(self.placement_index(hit)?)?;
        let part = model.objects.get(placement.object)?.parts.get(hit.geom as usize)?;
        Some((placement, part))
    }

    /// The build reports of all scenes that were built, each once, the outermost last.
    pub fn reports(&self) -> impl Iterator<Item = &BuildReport> {
        let top = self.instanced.then_some(&self.scene);
        self.objects.iter().flatten().chain(top).map(Scene::report)
    }
}

fn check_indices(model: &Model) -> Result<(), PlaceError> {
    let objects = model.objects.len();
    for (placement, &Placement { object, .. }) in model.placements.iter().enumerate() {
        if object >= objects {
            return Err(PlaceError::NoSuchObject { placement, object, objects });
        }
    }
    let materials = model.materials.len();
    for (object, content) in model.objects.iter().enumerate() {
        for (part, &Part { material, .. }) in content.parts.iter().enumerate() {
            if material >= materials {
                return Err(PlaceError::NoSuchMaterial { object, part, material, materials });
            }
        }
    }
    Ok(())
}

/// What one object is built with. Rays are shared out by triangles, as they are placed; pilot rays are
/// the world's, and an object only sees them where it is the world.
fn object_options<'a>(
    model: &Model,
    object: usize,
    options: &BuildOptions<'a>,
) -> BuildOptions<'a> {
    let mut options = options.clone();
    if matches!(model.placements.as_slice(), [only] if only.world_from_object == Affine::IDENTITY) {
        return options;
    }
    options.pilot = Pilot::default();
    if let Quality::Rays(rays) = options.quality {
        let placed = model.placements.iter().filter(|each| each.object == object).count();
        let parts = &model.objects[object].parts;
        let triangles: usize = parts.iter().map(|part| part.mesh.triangles().len()).sum();
        let share = placed as f64 * triangles as f64 / model.triangles_placed().max(1) as f64;
        options.quality = Quality::for_rays((rays as f64 * share) as u64);
    }
    options
}

fn build_object(
    model: &Model,
    object: usize,
    options: &BuildOptions<'_>,
) -> Result<Scene, PlaceError> {
    let content = &model.objects[object];
    // Progress is told for the scene as a whole by the caller; hundreds of small bars say nothing.
    let quiet = model.objects.len() > 1;
    let progress = if quiet { None } else { options.context.progress };
    let context = Context { progress, ..options.context.clone() };
    let parts = content.parts.iter().map(|part| part.mesh.clone());
    let scene = parts.fold(Scene::builder(), |scene, mesh| scene.mesh(mesh));
    let built = scene.build(&BuildOptions { context, ..options.clone() });
    built.map_err(|error| PlaceError::Object { object, name: content.name.clone(), error })
}

/// An object in a new shape.
fn bend(
    model: &Model,
    object: usize,
    scene: &Scene,
    policy: Policy,
    options: &BuildOptions<'_>,
) -> Result<Commit, PlaceError> {
    let content = &model.objects[object];
    let mut edit = scene.edit();
    edit.policy = policy;
    for (geom, part) in content.parts.iter().enumerate() {
        if edit.set_shape(geom, part.mesh.clone()).is_err() {
            edit.add_shape(part.mesh.clone());
        }
    }
    for geom in content.parts.len()..scene.shapes().len() {
        let _ = edit.remove_shape(geom);
    }
    let context = Context { progress: None, ..options.context.clone() };
    let commit = edit.commit(&BuildOptions { context, ..options.clone() });
    commit.map_err(|error| PlaceError::Object { object, name: content.name.clone(), error })
}

fn place(
    model: &Model,
    objects: &[Option<Scene>],
    options: &BuildOptions<'_>,
) -> Result<Scene, SceneError> {
    let mut scene = Scene::builder();
    for placement in &model.placements {
        if let Some(object) = &objects[placement.object] {
            scene = scene.instance(object, placement.world_from_object);
        }
    }
    scene.build(options)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, Object};
    use treelet::{Mesh, Ray};

    fn triangle() -> Mesh {
        Mesh::new([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]])
    }

    #[test]
    fn hits_lead_back_to_placement_and_part() {
        let mut model = Model::of_mesh("one", triangle(), Material::default());
        let part = model.objects[0].parts[0].clone();
        model.objects.push(Object { name: "two".into(), parts: vec![part.clone(), part] });
        let at = |z: f32| Affine::translation([0.0, 0.0, z]);
        model.placements = vec![
            Placement { object: 1, world_from_object: at(5.0) },
            Placement { object: 0, world_from_object: at(2.0) },
        ];
        let placed = PlacedModel::build(&model, &BuildOptions::default()).unwrap();
        let hits = placed.scene.all(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]));
        let found: Vec<_> =
            hits.iter().map(|hit| (placed.placement_index(hit).unwrap(), hit.geom)).collect();
        assert_eq!(found, [(1, 0), (0, 0), (0, 1)]);
        assert_eq!(placed.reports().count(), 3);
    }

    #[test]
    fn one_unmoved_object_needs_no_instance() {
        let model = Model::of_mesh("one", triangle(), Material::default());
        let placed = PlacedModel::build(&model, &BuildOptions::default()).unwrap();
        assert_eq!(placed.scene.instances(), 0);
        let hit = placed.scene.closest(&Ray::new([0.2, 0.2, -1.0], [0.0, 0.0, 1.0])).unwrap();
        assert_eq!(placed.placement_index(&hit), Some(0));
    }

    #[test]
    fn indices_that_lead_nowhere_are_errors() {
        let mut model = Model::of_mesh("one", triangle(), Material::default());
        model.objects[0].parts[0].material = 7;
        let error = PlacedModel::build(&model, &BuildOptions::default()).unwrap_err();
        assert_eq!(error.to_string(), "part 0 of object 0 names material 7 of 1");
        model.placements[0].object = 3;
        let error = PlacedModel::build(&model, &BuildOptions::default()).unwrap_err();
        assert_eq!(error.to_string(), "placement 0 names object 3 of 1");
    }
}
