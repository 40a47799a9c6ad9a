//! Reads scene files and prints what is in them and how long that took.
//!
//! `cargo run --release -p treelet-import --example count -- SCENE...`

#![allow(clippy::print_stdout, reason = "an example that talks")]

use std::path::Path;
use std::time::Instant;

use treelet::bounds::Aabb;
use treelet_model::Model;

fn main() {
    let options = treelet_import::Options::default();
    for name in std::env::args().skip(1) {
        let start = Instant::now();
        let result = treelet_import::load(Path::new(&name), &options);
        let seconds = start.elapsed().as_secs_f64();
        match result {
            Ok(model) => {
                let bounds = world_bounds(&model);
                println!(
                    "{name}: {} triangles ({} stored), {} vertices, {} objects, {} placements, \
                     {} materials, {} cameras, {seconds:.3} s\n  bounds {bounds:?}",
                    model.triangles_placed(),
                    model.triangles_stored(),
                    model.vertices_stored(),
                    model.objects.len(),
                    model.placements.len(),
                    model.materials.len(),
                    model.cameras.len(),
                );
                for warning in &model.warnings {
                    println!("  warning: {warning}");
                }
            }
            Err(error) => println!("{error} ({seconds:.3} s)"),
        }
    }
}

/// The box around all triangles whose vertices are there and finite.
fn world_bounds(model: &Model) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    for placement in &model.placements {
        for part in &model.objects[placement.object].parts {
            let sound = (0..part.mesh.triangles().len()).filter(|&i| part.mesh.defect(i).is_none());
            for corners in sound.filter_map(|prim| part.mesh.corners(prim)) {
                let world = corners.map(|p| placement.world_from_object.point(p));
                bounds = bounds.union(&Aabb::of_points(&world));
            }
        }
    }
    bounds
}
