//! What is measured: a scene file, with its instances or without, or triangles that are made.

use std::path::Path;
use std::time::Instant;

use treelet_bench::engine::Triangles;
use treelet_bench::run::Subject;
use treelet_bench::scenes::{self, Generated};

use super::flags::Flags;
use crate::ending::Failure;
use crate::input::Input;
use crate::progress::Line;
use crate::session::{Session, say};
use crate::text;

/// Reads a scene or makes one. Where something is placed more than once, instances are kept, unless they
/// are to be copied.
pub(super) fn subject(scene: &Path, flags: &Flags, session: &Session) -> Result<Subject, Failure> {
    if let Some(generated) = scene.to_str().and_then(Generated::parse) {
        let generated = generated.map_err(Failure::Usage)?;
        let start = Instant::now();
        let triangles = {
            let _line = Line::spinner("making triangles");
            generated.triangles()
        };
        let name = scene.display().to_string();
        let count = text::things(triangles.len() as u64, "triangle");
        say(&format!("{name}: {count}; ready in {}", text::time(start.elapsed())));
        return Ok(Subject { name, generated: true, triangles, placed: None, up: Some(1) });
    }
    let input = Input::load(Some(&scene.to_owned()), &flags.scene_flags, session)?;
    let flatten = flags.flatten || flags.figure.figure || flags.peak_of.is_some();
    let content = if flatten || !scenes::repeats(&input.model) {
        scenes::flatten(&input.model).map(|triangles| (triangles, None))
    } else {
        scenes::placed(&input.model).map(|placed| (Triangles::default(), Some(placed)))
    };
    let (triangles, placed) =
        content.map_err(|error| Failure::told(format!("{}: {error}", input.name)))?;
    let name = scene_name(scene);
    Ok(Subject { name, generated: false, triangles, placed, up: Some(input.up) })
}

/// The file's name without folders, wrapper and format.
pub(super) fn scene_name(scene: &Path) -> String {
    let name = scene.file_name().unwrap_or_default().to_string_lossy();
    let name = name.trim_end_matches(".gz").trim_end_matches(".zst");
    name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned()
}

#[cfg(test)]
mod tests {
    use super::scene_name;

    #[test]
    fn scenes_are_named_after_their_files() {
        assert_eq!(scene_name("a/kitchen.ply.zst".as_ref()), "kitchen");
        assert_eq!(scene_name("kitchen.v2.glb".as_ref()), "kitchen.v2");
        assert_eq!(scene_name("plain".as_ref()), "plain");
    }
}
