//! Timing in rounds: every engine in turn, the order another one from round to round, so that what
//! one leaves in the caches is not always found by the same neighbour.

use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};

use treelet::Ray;

use crate::crew::Crew;
use crate::engine::{Answer, Built, Call, Pass, Question};

/// Rays that a thread takes at a time where the engine takes one ray or one packet.
const BLOCK: usize = 4096;

/// How long, and how often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounds {
    /// Rounds that count; one more comes before them.
    pub count: usize,
    /// Seconds that a cell takes in a round, at least.
    pub seconds: f64,
}

impl Default for Rounds {
    fn default() -> Self {
        Self { count: 7, seconds: 0.3 }
    }
}

/// One engine's way through all the rays: blocks or slices that threads take from a heap.
pub struct Work<'a> {
    passes: Vec<Mutex<Box<dyn Pass + 'a>>>,
}

impl<'a> Work<'a> {
    /// Prepares the rays. Where the call takes slices, they are `slice` long.
    pub fn new(
        built: &'a dyn Built,
        call: Call,
        question: Question,
        rays: &'a [Ray],
        slice: usize,
    ) -> Self {
        let length = if call.width == Call::SLICE { slice.max(1) } else { BLOCK };
        let pass = |rays| Mutex::new(built.pass(call, question, rays));
        Self { passes: rays.chunks(length).map(pass).collect() }
    }

    /// Traces everything `times` over; the seconds for one time.
    pub fn trace(&self, crew: &Crew, times: usize) -> f64 {
        let trace = |index: usize| {
            self.passes[index].lock().unwrap_or_else(PoisonError::into_inner).trace();
        };
        // A single slice is shared out by the engine itself, on the same pool.
        if self.passes.len() == 1 {
            let time = crew.time_shared(|| (0..times).for_each(|_| trace(0)));
            return time.as_secs_f64() / times as f64;
        }
        let next = AtomicUsize::new(0);
        let total = self.passes.len() * times;
        let time = crew.time(|| {
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                if index >= total {
                    break;
                }
                trace(index % self.passes.len());
            }
        });
        time.as_secs_f64() / times as f64
    }

    /// The answers of the last trace.
    pub fn answers(&self) -> Vec<Answer> {
        let mut answers = Vec::new();
        for pass in &self.passes {
            pass.lock().unwrap_or_else(PoisonError::into_inner).answers(&mut answers);
        }
        answers
    }
}

/// In which order `count` engines take their turns in a round.
///
/// In `count` rounds, twice as many if that is odd, each stands at each place and comes right after
/// each other one, all equally often. Turning the order on by one a round and running every other
/// round backwards, which stood here first, never changed the order of two.
///
/// Source: E. J. Williams, "Experimental Designs Balanced for the Estimation of Residual Effects of
/// Treatments", Australian Journal of Scientific Research A 2(2), 1949.
pub(crate) fn turns(round: usize, count: usize) -> impl Iterator<Item = usize> {
    let backwards = count % 2 == 1 && (round / count) % 2 == 1;
    (0..count).map(move |place| {
        let place = if backwards { count - 1 - place } else { place };
        // 0, 1, -1, 2, -2 and so on, turned on by one a round.
        let step = if place % 2 == 1 { place.div_ceil(2) } else { count - place / 2 };
        (step + round) % count
    })
}

/// Seconds for one time through the rays: `[work][round]`. Every work must have traced before.
///
/// `stop` is asked between rounds; what was measured until then is given.
pub fn measure(
    crew: &Crew,
    works: &[Work<'_>],
    rounds: Rounds,
    stop: &dyn Fn() -> bool,
) -> Vec<Vec<f64>> {
    // The first round shows how often each must run to last long enough.
    let times: Vec<usize> = works
        .iter()
        .map(|work| {
            let once = work.trace(crew, 1).max(1e-9);
            ((rounds.seconds / once).ceil() as usize).max(1)
        })
        .collect();
    let mut seconds = vec![Vec::with_capacity(rounds.count); works.len()];
    for round in 0..rounds.count {
        if stop() {
            break;
        }
        for index in turns(round, works.len()) {
            seconds[index].push(works[index].trace(crew, times[index]));
        }
    }
    seconds
}

#[cfg(test)]
mod tests {
    use super::{Rounds, Work, measure};
    use crate::crew::{Clock, Crew};
    use crate::engine::{Answer, Built, Bytes, Call, Pass, Question};
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use treelet::Ray;

    /// Writes down its name, each time that its rays are traced.
    struct Noting<'n>(usize, &'n Mutex<Vec<usize>>);

    impl Built for Noting<'_> {
        fn bytes(&self) -> Bytes {
            Bytes::default()
        }
        fn calls(&self) -> Vec<Call> {
            vec![Call::ONE]
        }
        fn pass<'a>(&'a self, _: Call, _: Question, _: &'a [Ray]) -> Box<dyn Pass + 'a> {
            Box::new(Noting(self.0, self.1))
        }
    }

    impl Pass for Noting<'_> {
        fn trace(&mut self) {
            self.1.lock().unwrap().push(self.0);
        }
        fn answers(&self, _: &mut Vec<Answer>) {}
    }

    /// Who traced, in order: `count` engines, twice as many rounds and one before them.
    fn noted(count: usize) -> Vec<usize> {
        let notes = Mutex::new(Vec::new());
        let engines: Vec<_> = (0..count).map(|name| Noting(name, &notes)).collect();
        let rays = [Ray::new([0.0; 3], [1.0; 3])];
        let work = |engine| Work::new(engine, Call::ONE, Question::Any, &rays, 1);
        let works: Vec<Work<'_>> = engines.iter().map(|engine| work(engine)).collect();
        let crew = Crew::new(1, Clock::Wall).unwrap();
        measure(&crew, &works, Rounds { count: 2 * count, seconds: 0.0 }, &|| false);
        drop(works);
        drop(engines);
        notes.into_inner().unwrap()
    }

    #[test]
    fn engines_take_turns_at_every_place_and_after_every_other() {
        for count in 2..=5 {
            let notes = noted(count);
            let rounds = notes.chunks(count).skip(1);
            assert_eq!(rounds.len(), 2 * count);
            let mut places = vec![vec![0; count]; count];
            let mut neighbours = vec![vec![0; count]; count];
            for round in rounds {
                round.iter().enumerate().for_each(|(place, &name)| places[name][place] += 1);
                round.windows(2).for_each(|pair| neighbours[pair[0]][pair[1]] += 1);
            }
            assert_eq!(places, vec![vec![2; count]; count], "{notes:?}");
            for (name, after) in neighbours.iter().enumerate() {
                let expected: Vec<_> =
                    (0..count).map(|other| 2 * u8::from(other != name)).collect();
                assert_eq!(*after, expected, "{notes:?}");
            }
        }
    }

    /// Counts how often rays were traced.
    struct Counting(AtomicUsize);

    struct CountingPass<'a>(&'a AtomicUsize, usize);

    impl Built for Counting {
        fn bytes(&self) -> Bytes {
            Bytes::default()
        }
        fn calls(&self) -> Vec<Call> {
            vec![Call::ONE]
        }
        fn pass<'a>(&'a self, _: Call, _: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a> {
            Box::new(CountingPass(&self.0, rays.len()))
        }
    }

    impl Pass for CountingPass<'_> {
        fn trace(&mut self) {
            self.0.fetch_add(self.1, Ordering::Relaxed);
        }
        fn answers(&self, answers: &mut Vec<Answer>) {
            answers.extend((0..self.1).map(|_| Answer::MISS));
        }
    }

    #[test]
    fn every_ray_is_traced_as_often_as_said() {
        let built = Counting(AtomicUsize::new(0));
        let rays = vec![Ray::new([0.0; 3], [1.0; 3]); 10_000];
        let crew = Crew::new(1, Clock::Wall).unwrap();
        let works = [
            Work::new(&built, Call::ONE, Question::Any, &rays, 7),
            Work::new(&built, Call::SLICES, Question::Any, &rays, 7),
        ];
        works[1].trace(&crew, 3);
        assert_eq!(built.0.load(Ordering::Relaxed), 30_000);
        assert_eq!(works[0].answers().len(), 10_000);
        let seconds = measure(&crew, &works, Rounds { count: 5, seconds: 0.0 }, &|| false);
        assert_eq!(seconds.iter().map(Vec::len).collect::<Vec<_>>(), [5, 5]);
        // Once each to find out how long it takes, then five rounds.
        assert_eq!(built.0.load(Ordering::Relaxed), 30_000 + 2 * 6 * 10_000);
    }
}
