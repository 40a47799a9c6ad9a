//! The figure of the field: rays a second against how many rays are traced, construction included.
//!
//! [`scene()`] measures one scene: builds, one kind of rays after the other, what the library chooses.
//! `data` is what comes of it, `envelope` who wins where, `marks` and `table` what follows, `plot` the
//! picture, `state` what an interrupted run leaves behind.
//!
//! Source: T. Karras, T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume Hierarchies",
//! High-Performance Graphics 2013, figures 1 and 8. Differs: rays of this machine's processor, one a call, and
//! every builder at hand instead of six.

mod auto;
mod builds;
mod choices;
pub mod data;
pub mod envelope;
mod marks;
mod plan;
mod plot;
mod scene;
mod state;
mod table;
mod watch;

pub use marks::{PAPER_CONTENDERS, PAPER_WINDOW, marks, windows};
pub use plan::{COMPOSITIONS, FigurePlan, KINDS};
pub(crate) use plot::{COLORS, STYLE, escaped};
pub use plot::{mean_svg, panel_svg};
pub use scene::{SceneFigure, scene};
pub use state::{State, StateError};
pub use table::{mark_lines, panel_lines};
