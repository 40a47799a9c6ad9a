//! Layouts with new boxes or new parts: the same steps for each of them.

use super::Reason;
use super::fetch::Places;
use super::sprouts::Sprout;
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::Cancel;
use crate::layout::compact::pack::pack;
use crate::layout::exchange::{Branch, Exchanged, Refused, Stay, Twig, exchange};
use crate::layout::lower::Packed;
use crate::layout::refit::{self, Areas, Content, Part, Refitted, refit};
use crate::layout::repair::{Repaired, repair};
use crate::layout::wide::{Plain, Wide};
use crate::scene::assemble::COVER_MAX;
use crate::scene::upkeep::Standing;
use crate::scene::{Scene, SceneError};
use crate::trace::structure::{Get, Layout, Structure};
use crate::tree::Tree;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;

/// A tree that followed what moved, before it is packed.
pub(super) enum Mended {
    Wide8(Refitted<8>),
    Wide16(Refitted<16>),
    Compact(Refitted<16>),
}

/// What a repair made.
pub(super) struct Repair {
    pub(super) mended: Mended,
    pub(super) prices: Vec<f32>,
    pub(super) kept: usize,
    pub(super) loose: usize,
}

/// Does the same with the tree of any layout.
macro_rules! each {
    ($mended:expr, $it:ident => $what:expr) => {
        match $mended {
            Mended::Wide8($it) => $what,
            Mended::Wide16($it) | Mended::Compact($it) => $what,
        }
    };
}

impl Mended {
    pub(super) fn areas(&self) -> Areas {
        each!(self, it => it.areas)
    }

    pub(super) fn bounds(&self) -> Aabb {
        each!(self, it => it.bounds)
    }

    /// The layout that walks read, a few boxes that together contain everything, and the areas of each node's triangles.
    pub(super) fn finish(
        mut self,
        cancel: &Cancel,
    ) -> Result<(Layout, Vec<Aabb>, Vec<f32>), SceneError> {
        let cover = each!(&self, it => it.cover(COVER_MAX));
        let triangles = each!(&mut self, it => mem::take(&mut it.triangles));
        let layout = match self {
            Self::Wide8(it) => Layout::Wide8(it.wide),
            Self::Wide16(it) => Layout::Wide16(it.wide),
            Self::Compact(it) => Layout::Compact(pack(&it.wide, cancel)?),
        };
        Ok((layout, cover, triangles))
    }

    /// See [`repair`].
    pub(super) fn repair(
        &self,
        prices: &[f32],
        build: impl FnOnce(&[Aabb]) -> Result<Tree, BuildError>,
        cancel: &Cancel,
    ) -> Result<Option<Repair>, BuildError> {
        fn made<const W: usize>(it: Repaired<W>, layout: fn(Refitted<W>) -> Mended) -> Repair {
            let Repaired { refitted, prices, kept, loose } = it;
            Repair { mended: layout(refitted), prices, kept, loose }
        }
        Ok(match self {
            Self::Wide8(it) => repair(it, prices, build, cancel)?.map(|it| made(it, Self::Wide8)),
            Self::Wide16(it) => repair(it, prices, build, cancel)?.map(|it| made(it, Self::Wide16)),
            Self::Compact(it) => {
                repair(it, prices, build, cancel)?.map(|it| made(it, Self::Compact))
            }
        })
    }
}

/// All boxes anew; `None` if a triangle is not fit. See [`refit`].
pub(super) fn sweep(
    layout: &Layout,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
    worn: Option<u32>,
    spare: Option<Structure>,
    cancel: &Cancel,
) -> Result<Option<Mended>, BuildError> {
    // What is left of it is dropped as every scene is.
    let spare =
        spare.map(|mut spare| mem::replace(&mut spare.layout, Layout::Wide8(Wide::nothing())));
    Ok(match (layout, spare) {
        (Layout::Wide8(wide), Some(Layout::Wide8(spare))) => {
            refit(wide, content, worn, Some(spare), cancel)?.map(Mended::Wide8)
        }
        (Layout::Wide16(wide), Some(Layout::Wide16(spare))) => {
            refit(wide, content, worn, Some(spare), cancel)?.map(Mended::Wide16)
        }
        (Layout::Wide8(wide), _) => refit(wide, content, worn, None, cancel)?.map(Mended::Wide8),
        (Layout::Wide16(wide), _) => refit(wide, content, worn, None, cancel)?.map(Mended::Wide16),
        (Layout::Compact(wide), _) => {
            refit(wide, content, worn, None, cancel)?.map(Mended::Compact)
        }
    })
}

/// The boxes of a few instances anew, and those that they are in; `None` where a layout cannot.
pub(super) fn touched(
    layout: &Layout,
    tree: (Aabb, Areas, &[f32]),
    moved: &[refit::Moved],
    instance: impl Fn(usize) -> Aabb,
) -> Result<Option<Mended>, BuildError> {
    Ok(match layout {
        Layout::Wide8(wide) => Some(Mended::Wide8(refit::touch(wide, tree, moved, instance)?)),
        Layout::Wide16(wide) => Some(Mended::Wide16(refit::touch(wide, tree, moved, instance)?)),
        Layout::Compact(_) => None,
    })
}

/// What comes into a tree.
pub(super) enum Sprig<'a> {
    /// An instance, by its number.
    Single(usize, Aabb),
    Tree {
        sprout: &'a Sprout,
        /// Of the shape's first primitive.
        first_id: u32,
        /// What it is called where it is no triangle.
        first_number: usize,
    },
}

impl<'a> Sprig<'a> {
    /// As a tree of so many children a node takes it; `None` if it has others.
    fn twig<const W: usize>(&'a self) -> Option<Twig<'a, W>>
    where
        Layout: Get<Plain, W>,
    {
        Some(match *self {
            Self::Single(number, bounds) => Twig::Single(number, bounds),
            Self::Tree { sprout: Sprout { scene, standing, .. }, first_id, first_number } => {
                let Standing { areas, prices, triangles, .. } = standing;
                Twig::Tree(Branch {
                    wide: scene.structure.layout.get()?,
                    bounds: scene.structure.bounds,
                    first_id,
                    first_number,
                    areas: *areas,
                    prices,
                    triangles,
                })
            }
        })
    }
}

/// The tree without what went and with what came, and what its nodes cost when they were built; see [`exchange`].
pub(super) fn exchanged(
    layout: &Layout,
    stay: &Stay<'_>,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
    (sprigs, numbers): (&[Sprig<'_>], usize),
    prices: &[f32],
    cancel: &Cancel,
) -> Result<Result<(Mended, Vec<f32>), Reason>, SceneError> {
    macro_rules! exchanged {
        ($wide:expr, $mended:expr) => {{
            let Some(twigs) = sprigs.iter().map(Sprig::twig).collect::<Option<Vec<_>>>() else {
                return Ok(Err(Reason::Different));
            };
            match exchange($wide, stay, content, (&twigs, numbers), prices, cancel)? {
                Err(Refused::Unfit) => Err(Reason::Unfit),
                Err(Refused::Different) => Err(Reason::Different),
                Ok(Exchanged { refitted, prices }) => Ok(($mended(refitted), prices)),
            }
        }};
    }
    Ok(match layout {
        Layout::Wide8(wide) => exchanged!(wide, Mended::Wide8),
        Layout::Wide16(wide) => exchanged!(wide, Mended::Wide16),
        Layout::Compact(wide) => exchanged!(wide, Mended::Compact),
    })
}

/// What a tree is worth that is as it was built.
pub(super) fn standing(scene: &Scene) -> Standing {
    let places = Places::of(&scene.structure);
    let content = places.content();
    appraise(&scene.structure.layout, &content)
}

/// What a tree is worth that was made of this.
fn appraise(
    layout: &Layout,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
) -> Standing {
    macro_rules! appraised {
        ($wide:expr) => {{
            let (areas, triangles) = refit::areas($wide, content);
            let prices = refit::survey($wide, &triangles).iter().map(Part::price).collect();
            Standing {
                built: areas.price(),
                sweeps: 0,
                areas,
                prices: Arc::new(prices),
                triangles: triangles.into(),
            }
        }};
    }
    match layout {
        Layout::Wide8(wide) => appraised!(wide),
        Layout::Wide16(wide) => appraised!(wide),
        Layout::Compact(wide) => appraised!(wide),
    }
}
