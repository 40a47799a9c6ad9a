//! What every engine looks like to the bench: triangles in, perhaps placed many times, something
//! built, rays through it.

use serde::Serialize;
use treelet::Ray;
use treelet::math::Affine;
use treelet::memory::Array;

/// The triangles that every engine is given.
#[derive(Clone, Debug, Default)]
pub struct Triangles {
    /// Vertex positions.
    pub positions: Array<[f32; 3]>,
    /// Vertex indices of each triangle, all of them in range.
    pub indices: Array<[u32; 3]>,
    /// Where the vertices are at time 1, if they move; [`Triangles::positions`] are those of time 0.
    pub later: Option<Array<[f32; 3]>>,
}

impl Triangles {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The corners of triangle `prim`, which must exist.
    pub fn corners(&self, prim: usize) -> [[f32; 3]; 3] {
        let [a, b, c] = self.indices[prim];
        [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]
    }

    /// Bytes of both arrays.
    pub fn bytes(&self) -> u64 {
        12 * (self.positions.len() as u64 + self.indices.len() as u64)
    }
}

/// A scene with instances.
#[derive(Clone, Debug, Default)]
pub struct Placed {
    /// What is placed, each stored once, in a space of its own.
    pub objects: Vec<Triangles>,
    /// Which object, and the map that takes its points to the world.
    pub instances: Vec<(usize, Affine)>,
}

impl Placed {
    /// Triangles that are stored.
    pub fn stored(&self) -> usize {
        self.objects.iter().map(Triangles::len).sum()
    }

    /// Bytes of the arrays of all objects.
    pub fn bytes(&self) -> u64 {
        self.objects.iter().map(Triangles::bytes).sum()
    }
}

/// What is asked about a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// The first hit.
    Closest,
    /// Whether there is a hit.
    Any,
}

/// How many rays a call takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Api {
    /// One.
    One,
    /// Several: a packet or a slice.
    Many,
}

/// A way to hand rays to an engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Call {
    /// One ray a call, or several.
    pub api: Api,
    /// Rays a call; for slices, [`Call::SLICE`] stands for the length that the bench is told.
    pub width: usize,
    /// Whether the engine is told that the rays are coherent.
    pub coherent: bool,
}

impl Call {
    /// The width of an engine that takes slices of any length.
    pub const SLICE: usize = usize::MAX;

    /// One ray a call.
    pub const ONE: Self = Self { api: Api::One, width: 1, coherent: false };

    /// A slice a call.
    pub const SLICES: Self = Self { api: Api::Many, width: Self::SLICE, coherent: false };

    /// Packets of a fixed width.
    pub const fn packets(width: usize) -> Self {
        Self { api: Api::Many, width, coherent: false }
    }

    /// The same call with the hint that the rays are coherent.
    pub const fn coherent(self) -> Self {
        Self { coherent: true, ..self }
    }
}

/// What an engine says about one ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Where the hit is; infinite for a miss; 0 for a hit of which only its being is known.
    pub t: f32,
    /// Which triangle was hit; `u32::MAX` where there is none, or none was asked for.
    pub prim: u32,
    /// In which instance, counted from 1; 0 where there is none.
    pub inst: u32,
}

impl Answer {
    /// No hit.
    pub const MISS: Self = Self { t: f32::INFINITY, prim: u32::MAX, inst: 0 };

    /// A hit of a scene without instances.
    pub const fn hit(t: f32, prim: u32) -> Self {
        Self { t, prim, inst: 0 }
    }

    /// The answer to whether there is a hit.
    pub const fn any(hit: bool) -> Self {
        if hit { Self::hit(0.0, u32::MAX) } else { Self::MISS }
    }

    /// Whether there is a hit.
    pub fn is_hit(&self) -> bool {
        self.t < f32::INFINITY
    }
}

/// Memory that tracing needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bytes {
    /// What the engine made.
    pub own: u64,
    /// The caller's arrays, where the engine keeps or needs them.
    pub shared: u64,
}

impl Bytes {
    /// Everything.
    pub fn total(&self) -> u64 {
        self.own + self.shared
    }
}

/// How an engine runs its builds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Threading {
    /// On the caller's rayon pool, or on the calling thread alone.
    Callers,
    /// On threads that it makes itself; they take over the calling thread's set of processors.
    Own,
}

/// An engine or a build that cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// It is not there; the sentence says what would bring it.
    #[error("{0}")]
    Missing(String),
    /// It is there and refuses.
    #[error("{0}")]
    Refused(String),
}

/// Something that builds and traces.
pub trait Engine: Send + Sync {
    /// As the report names it.
    fn name(&self) -> &'static str;

    /// Its version, and what else decides its speed, in a few words.
    fn version(&self) -> String;

    /// What it can build, as the report names it.
    fn variants(&self) -> Vec<String>;

    /// Those of [`Engine::variants`] that are measured unless somebody asks for others.
    fn usual_variants(&self) -> Vec<String> {
        self.variants()
    }

    /// The variant that somebody asks for by this name, whatever its letters' case; there may be more than
    /// [`Engine::variants`] lists.
    fn variant(&self, asked: &str) -> Option<String> {
        self.variants().into_iter().find(|variant| variant.eq_ignore_ascii_case(asked))
    }

    /// Whether a variant is given rays in that way unless somebody asks for the variant.
    fn is_usual(&self, variant: &str, call: Call) -> bool {
        let _ = (variant, call);
        true
    }

    /// Whose threads build.
    fn threading(&self) -> Threading {
        Threading::Callers
    }

    /// Gets ready to build and trace with that many threads; not timed.
    ///
    /// # Errors
    ///
    /// The engine refuses; or it is missing with that many threads, and the others go on.
    fn prepare(&mut self, threads: usize) -> Result<(), EngineError> {
        let _ = threads;
        Ok(())
    }

    /// Builds a variant, from the caller's arrays to ready-to-trace; this is timed.
    ///
    /// # Errors
    ///
    /// The engine refuses, or knows no such variant.
    fn build(&self, variant: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError>;

    /// Whether there are instances here: [`Engine::build_placed`].
    fn has_instances(&self) -> bool {
        false
    }

    /// Builds a variant of every object and of the level that places them; this is timed.
    ///
    /// # Errors
    ///
    /// The engine has no instances, refuses, or knows no such variant.
    fn build_placed(&self, variant: &str, placed: &Placed) -> Result<Box<dyn Built>, EngineError> {
        let _ = (variant, placed);
        Err(EngineError::Missing(NO_INSTANCES.into()))
    }
}

/// Why an engine is left out of a scene with instances.
pub const NO_INSTANCES: &str = "it has no instances, or none that the bench calls; --flatten copies \
                                the triangles for everybody";

/// What an engine built.
pub trait Built: Send + Sync {
    /// Memory that tracing needs.
    fn bytes(&self) -> Bytes;

    /// The ways in which it takes rays, the single ray first.
    fn calls(&self) -> Vec<Call>;

    /// Turns rays into the engine's own form, with room for the answers.
    fn pass<'a>(&'a self, call: Call, question: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a>;
}

/// Rays in an engine's own form, ready to be traced again and again.
pub trait Pass: Send {
    /// Traces every ray, after whatever the engine needs to trace it anew; this is timed.
    fn trace(&mut self);

    /// Appends the answers of the last trace, in the order of the rays.
    fn answers(&self, answers: &mut Vec<Answer>);
}
