//! The trees for parts of the time ([`crate::scene::travel`]) of a level whose instances moved, came or went: each is kept, around the
//! boxes of its part.
//!
//! How many parts there are is not asked again: that is for the next build. Where there was one tree for all times, there is one
//! still, whoever moves now.

use super::Edit;
use super::mend::{Sprig, exchanged};
use crate::context::Cancel;
use crate::layout::exchange::Stay;
use crate::layout::lower::Packed;
use crate::layout::refit::Content;
use crate::scene::SceneError;
use crate::trace::structure::{Layout, Structure};
use alloc::vec::Vec;

impl Edit {
    /// The trees for parts of the time around the instances of `after`, of which some `came`; none if one of them cannot stay, which is what
    /// walks take for one tree over all times.
    pub(super) fn spans(
        &self,
        after: &Structure,
        came: &[usize],
        cancel: &Cancel,
    ) -> Result<Vec<Layout>, SceneError> {
        let before = &self.before.structure;
        let mut spans = Vec::with_capacity(before.spans.len());
        if !after.geometries.is_empty() {
            return Ok(spans);
        }
        let stays = |at: usize| came.binary_search(&at).is_err().then_some(at);
        let stay = Stay { triangle: &|_| None, single: &stays };
        let time = |part: usize| part as f32 / before.spans.len() as f32;
        for (part, span) in before.spans.iter().enumerate() {
            let during = |at: usize| {
                let instance = after.instances.at(at);
                match &instance.motion {
                    Some(motion) if !instance.bounds().is_empty() => {
                        motion.during([time(part), time(part + 1)])
                    }
                    _ => instance.bounds(),
                }
            };
            if !span.root().is_inner() {
                return Ok(Vec::new());
            }
            let nothing = |_: &[u32], _: &mut [Packed]| true;
            let content = Content { triangles: nothing, ahead: &(), instance: &during };
            let sprigs: Vec<Sprig<'_>> =
                came.iter().map(|&at| Sprig::Single(at, during(at))).collect();
            let numbers = after.instances.len();
            match exchanged(span, &stay, &content, (&sprigs, numbers), &[], cancel)? {
                Err(_) => return Ok(Vec::new()),
                Ok((mended, _)) => spans.push(mended.finish(cancel)?.0),
            }
        }
        Ok(spans)
    }
}
