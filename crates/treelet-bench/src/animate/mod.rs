//! Scenes that move: ways to keep up with them, side by side.
//!
//! [`compare`] plays a clip frame by frame. In each frame every way brings its scene up to date, in turn, and
//! traces the same rays; both are timed, and all must answer with the same bits. [`motion`] moves a mesh that
//! stands still in its file: it twists, then flies apart; [`play_clip`] plays what a file says. [`read`] traces a scene
//! while somebody else commits the next ones.

mod clip;
mod compare;
pub mod motion;
mod plot;
mod readers;
mod sum;
mod synthetic;

pub use clip::{Animated, play_clip};
pub use compare::{AnimateError, Clip, Frame, Moment, Play, RaysOf, Way, WayError, compare};
pub use plot::svg;
pub use readers::{Load, Reading, read};
pub use sum::{Sum, frame_line, sum_line, sums};
pub use synthetic::{Motion, Wish, play};
