//! The measured numbers by name, and ratios of them, a cell a scene.

use crate::engine::Api;
use crate::rays::Kind;
use crate::report::{Build, Order, SceneLine, Trace};
use crate::rivals::embree::NAME as EMBREE;
use crate::rivals::treelet as ours;
use crate::stats::Ratio;

/// All that was measured.
pub(super) struct Facts<'a> {
    pub(super) scenes: &'a [SceneLine],
    pub(super) builds: &'a [Build],
    pub(super) traces: &'a [Trace],
}

/// A ratio, or what is lacking for it.
pub(super) type Found = Result<Ratio, String>;

/// A cell of a mark: where, and the ratio there.
pub(super) type Cell = (String, Ratio);

/// The cells of a mark, and what the first lacks of those that are not there.
#[derive(Default)]
pub(super) struct Cells {
    pub(super) there: Vec<Cell>,
    pub(super) lacking: Option<String>,
}

/// Traces that were measured in turn with each other.
#[derive(Clone, Copy)]
pub(super) struct Group<'a> {
    pub(super) scene: &'a str,
    pub(super) kind: Kind,
    pub(super) order: Order,
    pub(super) threads: usize,
}

/// Which slices.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Length {
    /// The longest that there are.
    Longest,
    /// Of so many rays.
    Of(usize),
}

impl Group<'_> {
    fn has(&self, trace: &Trace) -> bool {
        trace.scene == self.scene
            && trace.kind == self.kind
            && trace.order == self.order
            && trace.threads == self.threads
    }
}

impl<'a> Facts<'a> {
    /// One, and whatever else was measured.
    pub(super) fn thread_counts(&self) -> Vec<usize> {
        let mut counts: Vec<usize> = self.traces.iter().map(|trace| trace.threads).collect();
        counts.extend(self.builds.iter().map(|build| build.threads));
        counts.push(1);
        counts.sort_unstable();
        counts.dedup();
        counts
    }

    /// The first of treelet's variants that were built which is like that.
    pub(super) fn variant(&self, is_it: impl Fn(&str) -> bool) -> Option<&'a str> {
        let ours = self.builds.iter().filter(|build| build.engine == ours::NAME);
        ours.map(|build| build.variant.as_str()).find(|variant| is_it(variant))
    }

    /// The longest of treelet's slices.
    pub(super) fn longest_slice(&self) -> Option<usize> {
        let slices = self.traces.iter().filter(|t| t.engine == ours::NAME && t.api == Api::Many);
        slices.map(|trace| trace.width).max()
    }

    /// A trace of one ray a call.
    pub(super) fn single(
        &self,
        group: Group<'_>,
        engine: &str,
        variant: &str,
    ) -> Result<&'a Trace, String> {
        let is_it = |t: &&Trace| t.engine == engine && t.variant == variant && t.api == Api::One;
        let mut traces = self.traces.iter().filter(|trace| group.has(trace));
        traces.find(is_it).ok_or_else(|| format!("no single {} of {engine} {variant}", rays(group)))
    }

    /// A trace of treelet's slices.
    pub(super) fn slices(
        &self,
        group: Group<'_>,
        variant: &str,
        length: Length,
    ) -> Result<&'a Trace, String> {
        let slices = self.traces.iter().filter(|t| {
            group.has(t) && t.engine == ours::NAME && t.variant == variant && t.api == Api::Many
        });
        let found = match length {
            Length::Longest => slices.max_by_key(|trace| trace.width),
            Length::Of(width) => slices.into_iter().find(|trace| trace.width == width),
        };
        let of = match length {
            Length::Longest => String::new(),
            Length::Of(width) => format!(" of {width}"),
        };
        found.ok_or_else(|| format!("no slices{of} of {} of treelet {variant}", rays(group)))
    }

    /// The fastest way through a tree of Embree's: the best of one ray and of packets.
    pub(super) fn fastest(&self, group: Group<'_>, variant: &str) -> Result<&'a Trace, String> {
        let theirs = self
            .traces
            .iter()
            .filter(|t| group.has(t) && t.engine == EMBREE && t.variant == variant);
        let many = theirs.clone().any(|trace| trace.api == Api::Many);
        let fastest = theirs.max_by(|a, b| a.mrays_per_s.total_cmp(&b.mrays_per_s));
        fastest
            .filter(|_| many)
            .ok_or_else(|| format!("no packets of {} of embree {variant}", rays(group)))
    }

    /// A build.
    pub(super) fn build(
        &self,
        scene: &str,
        engine: &str,
        variant: &str,
        threads: usize,
    ) -> Result<&'a Build, String> {
        let is_it = |build: &&Build| {
            build.scene == scene
                && build.engine == engine
                && build.variant == variant
                && build.threads == threads
        };
        let found = self.builds.iter().find(is_it);
        found.ok_or_else(|| format!("no build of {engine} {variant} with {threads} threads"))
    }

    /// Scenes of triangles alone, or those with instances.
    fn of_scenes(&self, instanced: bool) -> impl Iterator<Item = &'a SceneLine> {
        self.scenes.iter().filter(move |scene| (scene.instances > 0) == instanced)
    }

    /// Whether there is a scene with instances.
    pub(super) fn has_instances(&self) -> bool {
        self.of_scenes(true).next().is_some()
    }

    /// A cell for each scene with instances.
    pub(super) fn per_instanced_scene(&self, cell: impl Fn(&'a SceneLine) -> Found) -> Cells {
        let mut cells = Cells::default();
        for scene in self.of_scenes(true) {
            cells.add(scene.scene.clone(), cell(scene));
        }
        cells
    }

    /// A cell a scene of triangles alone.
    pub(super) fn per_scene(&self, cell: impl Fn(&'a SceneLine) -> Found) -> Cells {
        let mut cells = Cells::default();
        for scene in self.of_scenes(false) {
            cells.add(scene.scene.clone(), cell(scene));
        }
        cells
    }

    /// A cell for each scene that the bench made.
    pub(super) fn per_generated_scene(&self, cell: impl Fn(&'a SceneLine) -> Found) -> Cells {
        let mut cells = Cells::default();
        for scene in self.scenes.iter().filter(|scene| scene.generated) {
            cells.add(scene.scene.clone(), cell(scene));
        }
        if cells.there.is_empty() {
            cells.lacking.get_or_insert("no generated scene, fractal-terrain or soup".into());
        }
        cells
    }

    /// A cell a scene of triangles alone and kind of rays.
    pub(super) fn per_kind(&self, cell: impl Fn(&'a str, Kind) -> Found) -> Cells {
        let mut cells = Cells::default();
        for scene in self.of_scenes(false) {
            for kind in Kind::ALL {
                let name = format!("{} {}", scene.scene, kind.name());
                cells.add(name, cell(&scene.scene, kind));
            }
        }
        cells
    }
}

impl Cells {
    fn add(&mut self, name: String, cell: Found) {
        match cell {
            Ok(ratio) => self.there.push((name, ratio)),
            Err(lacking) => drop(self.lacking.get_or_insert(lacking)),
        }
    }
}

/// The rays of a group, in words.
fn rays(group: Group<'_>) -> String {
    let order = if group.order == Order::Shuffled { "shuffled " } else { "" };
    format!("{order}{} rays", group.kind.name())
}
