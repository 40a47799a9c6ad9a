//! A model as objects and instances of them, for engines that have instances.

use treelet_model::{Model, Object};

use super::flatten::{FlattenError, add};
use crate::engine::{Placed, Triangles};

/// Whether something in the model is placed more than once: copying it would make more triangles.
pub fn repeats(model: &Model) -> bool {
    model.triangles_placed() > model.triangles_stored()
}

/// The model's objects, the parts of each as one mesh, and its placements; without triangles that
/// have a defect, and without objects in which no triangle is left.
///
/// # Errors
///
/// No triangle is placed, or an object has more vertices than 32 bits can number.
pub fn placed(model: &Model) -> Result<Placed, FlattenError> {
    let mut placed = Placed::default();
    let mut numbers = vec![None; model.objects.len()];
    for placement in &model.placements {
        let Some(object) = model.objects.get(placement.object) else { continue };
        let number = match numbers[placement.object] {
            Some(number) => number,
            None => {
                placed.objects.push(triangles(object)?);
                let number = placed.objects.len() - 1;
                numbers[placement.object] = Some(number);
                number
            }
        };
        if !placed.objects[number].is_empty() {
            placed.instances.push((number, placement.world_from_object));
        }
    }
    if placed.instances.is_empty() { Err(FlattenError::Empty) } else { Ok(placed) }
}

/// An object's triangles, where they are; one spare vertex follows the last.
fn triangles(object: &Object) -> Result<Triangles, FlattenError> {
    let vertices: u64 = object.parts.iter().map(|part| part.mesh.positions().len() as u64).sum();
    if vertices >= u64::from(u32::MAX) {
        let stored = object.triangles();
        return Err(FlattenError::TooMany { placed: stored, stored });
    }
    let (mut positions, mut indices) = (Vec::with_capacity(vertices as usize + 1), Vec::new());
    for part in &object.parts {
        add(&part.mesh, |position| position, &mut positions, &mut indices);
    }
    positions.push([0.0; 3]);
    Ok(Triangles { positions: positions.into(), indices: indices.into(), later: None })
}

#[cfg(test)]
mod tests {
    use super::{placed, repeats};
    use crate::scenes::FlattenError;
    use treelet::Mesh;
    use treelet::math::Affine;
    use treelet_model::{Material, Model, Object, Placement};

    #[test]
    fn objects_are_stored_once_and_placed_often() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN; 3]];
        let mesh = Mesh::new(positions, [[0, 1, 2], [0, 1, 3]]);
        let mut model = Model::of_mesh("one", mesh, Material::default());
        assert!(!repeats(&model));
        let part = model.objects[0].parts[0].clone();
        model.objects.push(Object { name: "two".into(), parts: vec![part.clone(), part] });
        model.objects.push(Object::default());
        let map = Affine::translation([0.0, 0.0, 5.0]);
        model.placements =
            [2, 1, 1, 7, 0].map(|object| Placement { object, world_from_object: map }).to_vec();
        assert!(repeats(&model));
        let placed = placed(&model).unwrap();
        assert_eq!(placed.instances.iter().map(|it| it.0).collect::<Vec<_>>(), [1, 1, 2]);
        assert_eq!((placed.stored(), placed.objects[1].len()), (3, 2));
        assert_eq!(placed.objects[1].indices[1], [4, 5, 6], "parts follow each other");
        assert_eq!(placed.objects[1].positions.len(), 9, "a spare vertex");
        assert_eq!(super::placed(&Model::default()).unwrap_err(), FlattenError::Empty);
    }
}
