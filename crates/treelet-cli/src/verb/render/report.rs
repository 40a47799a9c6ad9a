//! What `treelet render` tells: one object for programs, a few lines for people.

use serde::Serialize;
use treelet_render::compare::Errors;

use super::passes::{Goal, Made};
use crate::choice::ChoiceReport;
use crate::session::say;
use crate::text;

#[derive(Serialize)]
pub(super) struct Report {
    pub(super) scene: String,
    pub(super) output: String,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Whole passes in the picture: it equals that of `--spp passes`.
    pub(super) passes: u32,
    pub(super) cancelled: bool,
    pub(super) camera: String,
    pub(super) up: &'static str,
    pub(super) seed: u64,
    pub(super) bounces: u32,
    pub(super) exposure: f32,
    /// What indirect light was cut off at; none if it was not.
    pub(super) clamp: Option<f32>,
    pub(super) softened: bool,
    pub(super) denoised: bool,
    /// Root mean square of relative standard errors of pixels; none after a single pass.
    pub(super) noise: Option<f64>,
    pub(super) samples: u64,
    pub(super) threads: usize,
    pub(super) quality: &'static str,
    pub(super) builder: &'static str,
    pub(super) plan: String,
    /// What --rays or `--quality auto` chose; none where the tree was named.
    pub(super) choice: Option<ChoiceReport>,
    pub(super) triangles_stored: u64,
    pub(super) triangles_placed: u64,
    pub(super) placements: u64,
    pub(super) skipped_triangles: u64,
    pub(super) skipped_instances: u64,
    pub(super) rays: u64,
    pub(super) rays_per_second: f64,
    /// The share of the threads' time that went by in the library's queries.
    pub(super) query_share: f64,
    pub(super) seconds: Seconds,
    pub(super) aov: Vec<Layer>,
    /// Layers that were wanted and, after Ctrl-C, not made.
    pub(super) aov_missing: Vec<String>,
    /// Pictures of a turntable.
    pub(super) frames: Vec<String>,
    pub(super) errors: Option<Differences>,
    pub(super) warnings: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct Seconds {
    pub(super) read: f64,
    pub(super) build: f64,
    pub(super) render: f64,
}

/// A picture beside the picture.
#[derive(Serialize)]
pub(super) struct Layer {
    pub(super) name: String,
    pub(super) file: String,
}

/// How far the picture is from a reference.
#[derive(Serialize)]
pub(super) struct Differences {
    reference: String,
    mean_absolute: f64,
    mean_squared: f64,
    relative_squared: f64,
    bias: f64,
    greatest: f64,
}

impl Differences {
    pub(super) fn new(reference: String, errors: &Errors) -> Self {
        Self {
            reference,
            mean_absolute: errors.mean_absolute,
            mean_squared: errors.mean_squared,
            relative_squared: errors.relative_squared,
            bias: errors.bias,
            greatest: errors.greatest,
        }
    }
}

/// What was done, in a few lines, and how to get more.
pub(super) fn tell(report: &Report, made: &Made, goal: &Goal) {
    let Report { output, width, height, passes, .. } = report;
    let pictures = match report.frames.as_slice() {
        [first, .., last] => format!("{first} to {last}"),
        [only] => only.clone(),
        [] => output.clone(),
    };
    say(&format!(
        "{pictures}: {width}x{height}, {}, {} in {} ({}rays/s, {:.0} % of the time in queries)",
        text::things((*passes).into(), "pass"),
        text::things(made.stats.rays, "ray"),
        text::time(made.time),
        text::rate(made.stats.rays, made.time),
        100.0 * made.query_share()
    ));
    for layer in &report.aov {
        say(&format!("{}: {}", layer.file, layer.name));
    }
    if !report.frames.is_empty() {
        say(&format!("{} on a circle", text::things(report.frames.len() as u64, "picture")));
    }
    if let Some(noise) = report.noise {
        let pixels = u64::from(*width) * u64::from(*height);
        let each = report.samples as f64 / pixels as f64;
        say(&format!("noise {:.2} %, with {each:.1} samples a pixel", 100.0 * noise));
    }
    if let Some(clamp) = report.clamp {
        say(&format!("fireflies are cut off at {clamp} times white: a little light is missing"));
    }
    if report.softened {
        say("caustics are softened");
    }
    if report.denoised {
        say("smoothed: detail that looks like noise is gone; the picture as it is lies beside it");
    }
    if let Some(errors) = &report.errors {
        say(&format!(
            "against {}: relative squared error {:.6}, mean squared {:.6}, mean absolute {:.6}, \
             bias {:+.3} %, greatest {:.4}",
            errors.reference,
            errors.relative_squared,
            errors.mean_squared,
            errors.mean_absolute,
            100.0 * errors.bias,
            errors.greatest
        ));
    }
    if report.cancelled {
        say(&format!("cancelled; the picture is that of --spp {passes}"));
        if !report.aov_missing.is_empty() {
            say(&format!("not made: --aov {}", report.aov_missing.join(",")));
        }
    } else if goal.is_plain_time() && report.frames.is_empty() {
        say(&format!(
            "the same picture: --spp {passes}; a cleaner one: --spp {}, or --denoise",
            passes.saturating_mul(4)
        ));
    }
}
