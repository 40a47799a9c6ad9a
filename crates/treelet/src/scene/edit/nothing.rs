//! Nothing, as a scene that can stand where an instance was.

use crate::bounds::Aabb;
use crate::layout::wide::Wide;
use crate::scene::assemble::Level;
use crate::scene::place::Placements;
use crate::trace::placements::Instances;
use crate::trace::slack::{Near, Slack};
use crate::trace::structure::{Layout, Structure};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// A scene of nothing that can be placed into this one.
pub(super) fn nothing_like(like: &Structure) -> Arc<Structure> {
    let bounds = Aabb::EMPTY;
    let layout = match like.layout {
        Layout::Wide8(_) => Layout::Wide8(Wide::nothing()),
        Layout::Wide16(_) => Layout::Wide16(Wide::nothing()),
        Layout::Compact(_) => Layout::Compact(Wide::nothing()),
    };
    let placements = Placements {
        instances: Instances::default(),
        reach: bounds,
        slack: Slack::new(Near::of(&bounds), 0.0),
        paths: 1,
    };
    let level = Level {
        level: like.level,
        geometries: Vec::new(),
        first_ids: Vec::new(),
        placements,
        layout,
        bounds,
        cover: Vec::new(),
        repeats: false,
        around_meshes: bounds,
    };
    Arc::new(level.structure())
}
