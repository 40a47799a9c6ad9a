//! Why a bench ends without a result.

use crate::crew::CrewError;
use crate::engine::EngineError;

/// Why a bench ends without a result.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// No threads.
    #[error(transparent)]
    Crew(#[from] CrewError),
    /// An engine that was there does not build.
    #[error("{engine} {variant} on {scene}: {error}")]
    Engine {
        /// Its name.
        engine: String,
        /// What it was to build.
        variant: String,
        /// Of what.
        scene: String,
        /// What it says.
        error: EngineError,
    },
    /// treelet is wrong: what it is fast at does not matter then.
    #[error("{scene}, {kind} rays: treelet is not what brute force says: {mismatch}")]
    BruteForce {
        /// The scene.
        scene: String,
        /// The kind of rays.
        kind: &'static str,
        /// The first difference.
        mismatch: Box<treelet::verify::Mismatch>,
    },
    /// treelet is not the same everywhere.
    #[error(
        "{scene}, {kind} rays: treelet {variant} answers ray {ray} with other bits than {reference}"
    )]
    Bits {
        /// The scene.
        scene: String,
        /// The kind of rays.
        kind: &'static str,
        /// What was asked.
        variant: String,
        /// What it was compared with.
        reference: String,
        /// The first ray that differs.
        ray: usize,
    },
    /// A variant that no engine has.
    #[error("no engine here has a variant `{name}`; there are: {known}")]
    NoVariant {
        /// As asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// The file of a figure's pieces.
    #[error(transparent)]
    State(#[from] crate::figure::StateError),
    /// Somebody pressed Ctrl-C.
    #[error("cancelled")]
    Cancelled,
}
