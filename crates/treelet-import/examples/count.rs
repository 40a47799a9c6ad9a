//! Reads scene files and prints what is in them and how long that took.
//!
//! `cargo run --release -p treelet-import --example count -- SCENE...`

#![allow(clippy::print_stdout, reason = "an example that talks")]

use std::path::Path;
use std::time::Instant;

use treelet::bounds::Aabb;

fn main() {
    let options = treelet_import::Options::default();
    for name in std::env::args().skip(1) {
        let start = Instant::now();
        let result = treelet_import::load(Path::new(&name), &options);
        let seconds = start.elapsed().as_secs_f64();
        match result {
            Ok(model) => {
                let bounds = model
                    .objects
                    .iter()
                    .flat_map(|object| &object.parts)
                    .fold(Aabb::EMPTY, |bounds, part| bounds.union(&part.mesh.bounds()));
                println!(
                    "{name}: {} triangles ({} stored), {} vertices, {} objects, {} placements, \
                     {} materials, {} cameras, {seconds:.3} s\n  untransformed bounds {bounds:?}",
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
