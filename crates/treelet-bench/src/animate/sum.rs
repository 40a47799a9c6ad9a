//! What a clip comes to, for each way.

use serde::Serialize;

use super::Play;

/// One way, over the whole clip.
#[derive(Clone, Debug, Serialize)]
pub struct Sum {
    /// The way.
    pub way: String,
    /// Frames by what was done, in the order of first appearance.
    pub did: Vec<(String, usize)>,
    /// Seconds of updates.
    pub update: f64,
    /// Seconds of tracing.
    pub trace: f64,
    /// Update and trace, over those of the first way.
    pub total_ratio: f64,
    /// Rays a second over those of the first way in the same frame: the least, and the median.
    pub speed: [f64; 2],
    /// The frame of the least.
    pub slowest_frame: usize,
}

/// Sums of all ways; the first is what the others are compared with.
pub fn sums(play: &Play) -> Vec<Sum> {
    let of = |way: usize| play.moments.iter().filter(move |moment| moment.way == way);
    let total = |way: usize| of(way).map(|it| it.update + it.trace).sum::<f64>();
    let sum = |(way, name): (usize, &String)| {
        let mut did: Vec<(String, usize)> = Vec::new();
        for moment in of(way) {
            match did.iter_mut().find(|(what, _)| *what == moment.did) {
                Some((_, count)) => *count += 1,
                None => did.push((moment.did.clone(), 1)),
            }
        }
        let speeds = of(0).zip(of(way)).map(|(first, it)| (first.trace / it.trace, it.frame));
        let mut speeds: Vec<(f64, usize)> = speeds.collect();
        speeds.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |index: usize| speeds.get(index).copied().unwrap_or((f64::NAN, 0));
        Sum {
            way: name.clone(),
            did,
            update: of(way).map(|it| it.update).sum(),
            trace: of(way).map(|it| it.trace).sum(),
            total_ratio: total(way) / total(0),
            speed: [at(0).0, at(speeds.len() / 2).0],
            slowest_frame: at(0).1,
        }
    };
    play.ways.iter().enumerate().map(sum).collect()
}

/// A line for people.
pub fn sum_line(sum: &Sum) -> String {
    let did: Vec<_> = sum.did.iter().map(|(what, count)| format!("{count} {what}")).collect();
    format!(
        "{:<10} update {:7.3} s, trace {:7.3} s, total {:.3} of the first; rays a second {:.2} (median), {:.2} (frame {}) \
         of its: {}",
        sum.way,
        sum.update,
        sum.trace,
        sum.total_ratio,
        sum.speed[1],
        sum.speed[0],
        sum.slowest_frame,
        did.join(", ")
    )
}

/// A line for people: what each way did in a frame.
pub fn frame_line(play: &Play, frame: usize) -> String {
    let moments = play.moments.iter().rev().take(play.ways.len()).rev();
    let first = play.moments.iter().rev().nth(play.ways.len() - 1).map_or(f64::NAN, |it| it.trace);
    let words = moments.map(|it| {
        let [update, trace] = [it.update, it.trace].map(|seconds| 1e3 * seconds);
        let way = &play.ways[it.way];
        format!("{way} {} {update:.1} + {trace:.1} ms ({:.2})", it.did, first / it.trace)
    });
    format!("frame {frame:3}: {}", words.collect::<Vec<_>>().join("; "))
}
