//! Which instances moved, came or went.

use crate::scene::SceneError;
use crate::trace::placements::{BLOCK, Instances};
use crate::trace::structure::Layout;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// What became of the instances of a level.
#[derive(Default)]
pub(super) struct Changes {
    /// May have another box, or other boxes of parts, in rising order.
    pub(super) moved: Vec<usize>,
    /// Were not there before, and are somewhere.
    pub(super) came: Vec<usize>,
    /// How many of those that moved are nowhere now.
    pub(super) gone: u64,
}

/// What became of the instances.
pub(super) fn changes(
    before: &Instances,
    after: &Instances,
    layout: &Layout,
) -> Result<Changes, SceneError> {
    let mut changes = Changes::default();
    for (index, new) in after.blocks.iter().enumerate() {
        let old = before.blocks.get(index);
        if old.is_some_and(|old| Arc::ptr_eq(old, new)) {
            continue;
        }
        let wider = old.is_some_and(|old| old.near != new.near);
        for (at, new) in new.items.iter().enumerate() {
            let instance = index * BLOCK + at;
            if !new.structure.layout.is_as(layout) {
                return Err(SceneError::MixedLayouts { instance });
            }
            let is = new.bounds();
            let Some(old) = old.and_then(|old| old.items.get(at)) else {
                changes.came.extend((!is.is_empty()).then_some(instance));
                continue;
            };
            let was = old.bounds();
            match (was.is_empty(), is.is_empty()) {
                // It has no leaf, or an empty one.
                (true, false) => {
                    changes.came.push(instance);
                    continue;
                }
                (false, true) => changes.gone += 1,
                _ => {}
            }
            // Boxes of parts may be elsewhere where that of the whole is not.
            if was != is || wider || old.columns != new.columns {
                changes.moved.push(instance);
            }
        }
    }
    Ok(changes)
}
