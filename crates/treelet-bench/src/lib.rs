//! treelet and its rivals on the same triangles and the same rays, in the same run.
//!
//! Behind one trait ([`engine::Engine`]) stand treelet and every rival. [`run::scene`] builds each
//! variant of each in turn, holds treelet bit for bit against brute force and everybody's answers
//! against treelet's, and only then times rays, in rounds in which the engines take turns.
//!
//! What is fair here: everybody gets the same triangles, as two arrays, or the same objects and instances of them, and the rays in its own form,
//! made before the clock starts; resetting rays is timed; builds are timed from the arrays to
//! ready-to-trace; bytes count the caller's arrays where an engine keeps them.

pub mod animate;
pub mod check;
pub mod crew;
pub mod engine;
pub mod figure;
pub mod marks;
pub mod motion;
pub mod page;
pub mod peak;
pub mod rays;
pub mod report;
pub mod rivals;
pub mod rounds;
pub mod run;
pub mod scenes;
pub mod stats;
pub mod table;
