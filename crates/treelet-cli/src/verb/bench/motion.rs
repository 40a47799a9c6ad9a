//! `treelet bench --moving`: what motion costs, against the same engine without it.

use serde::Serialize;
use treelet_bench::crew::Crew;
use treelet_bench::motion::{self, Moved, Plan, Propeller};
use treelet_bench::rounds::Rounds;

use super::flags::{Flags, engines, plan};
use super::subject::subject;
use crate::ending::{Ending, Failure};
use crate::session::{Outcome, Session, say, warn};

/// Rays of each kind and rounds, unless somebody asks for others.
const USUAL: (usize, Rounds) = (1 << 17, Rounds { count: 7, seconds: 0.1 });

/// What is printed as JSON.
#[derive(Serialize)]
struct Report {
    speed: f32,
    scenes: Vec<Moved>,
    propeller: Propeller,
}

/// Measures scene after scene, then the propeller.
pub(super) fn run(speed: f32, flags: &Flags, session: &Session) -> Result<Outcome, Failure> {
    let base = plan(flags, session, USUAL.0, USUAL.1);
    let plan =
        Plan { kinds: base.kinds, rays: base.rays, rounds: base.rounds.count, clock: base.clock };
    let (mut engines, missing) = engines(flags);
    missing.iter().for_each(|it| warn(&format!("{} is left out: {}", it.name, it.reason)));
    let crew = Crew::new(1, base.clock).map_err(Failure::from)?;
    let mut scenes = Vec::new();
    for scene in &flags.scenes {
        let subject = subject(scene, flags, session)?;
        let moved = crew
            .install(|| motion::moved(&subject, speed, &mut engines, &plan))
            .map_err(Failure::from)?;
        moved.lines().iter().for_each(|line| say(line));
        scenes.push(moved);
    }
    let propeller = crew.install(|| motion::propeller(&plan)).map_err(Failure::from)?;
    propeller.lines().iter().for_each(|line| say(line));
    Outcome::new("bench", &Report { speed, scenes, propeller }, Ending::Done)
}
