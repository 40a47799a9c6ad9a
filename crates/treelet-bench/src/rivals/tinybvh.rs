//! tinybvh through the crate tinybvh-rs 0.1.0-beta.3: trees in C++, built and walked on one thread.
//!
//! What the crate can trace in a program that is compiled for any processor is the two-wide tree,
//! built by binned SAH (`Build`) or with spatial splits (`BuildHQ`): the eight-wide one, tinybvh's best
//! on processors, is offered only to programs that are compiled for AVX2 throughout, which ours are
//! not. There is no any-hit query; whether there is a hit is asked as for the closest.
//!
//! In this version the crate's ray has 64 bytes and tinybvh's own, since its hits carry user data,
//! 128: `Ray::new` writes past its end, which was seen to crash. So rays are made here, with room for
//! what tinybvh might write ([`Room`]).
//!
//! Its trees may not leave the thread that made them. So they stay with that thread, which is the one
//! that traces, and what the bench holds is a ticket: a tree whose ticket is gone is dropped when the
//! thread builds its next one.

use std::cell::RefCell;
use std::sync::{Arc, Weak};

use tinybvh_rs::bvh::{BVH, BVHData};
use tinybvh_rs::{Intersector, Ray as TheirRay};
use treelet::Ray;

use crate::engine::{Answer, Built, Bytes, Call, Engine, EngineError, Pass, Question, Triangles};

/// The engine.
#[derive(Debug)]
pub(super) struct TinyBvh;

/// The name in reports.
pub(super) const NAME: &str = "tinybvh";

/// Binned SAH, and with spatial splits.
const VARIANTS: [&str; 2] = ["BVH", "BVH HQ"];

impl Engine for TinyBvh {
    fn name(&self) -> &'static str {
        NAME
    }

    fn version(&self) -> String {
        "1.6.8 through tinybvh-rs 0.1.0-beta.3, two-wide".to_owned()
    }

    fn variants(&self) -> Vec<String> {
        VARIANTS.map(str::to_owned).to_vec()
    }

    fn prepare(&mut self, threads: usize) -> Result<(), EngineError> {
        if threads == 1 {
            return Ok(());
        }
        let reason = "tinybvh-rs keeps its trees to one thread: measure it with --threads 1";
        Err(EngineError::Missing(reason.to_owned()))
    }

    fn build(&self, variant: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError> {
        let corner = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        let corners = (0..triangles.len()).flat_map(|prim| triangles.corners(prim).map(corner));
        let corners: Vec<[f32; 4]> = corners.collect();
        let positions = corners.as_slice().into();
        let tree =
            if variant == VARIANTS[0] { BVH::new(positions) } else { BVH::new_hq(positions) };
        let refused = |error| EngineError::Refused(format!("tinybvh-rs: {error:?}"));
        let data = tree.map_err(refused)?.data();
        let bytes =
            size_of_val(data.nodes()) + size_of_val(data.indices()) + size_of_val(&*corners);
        let ticket = keep(Tree { data, corners });
        Ok(Box::new(Ticket { ticket, bytes: bytes as u64 }))
    }
}

/// A tree, and the corners that it reads.
struct Tree {
    data: BVHData,
    corners: Vec<[f32; 4]>,
}

thread_local! {
    /// The thread's trees, each with its ticket.
    static TREES: RefCell<Vec<(Weak<()>, Tree)>> = const { RefCell::new(Vec::new()) };
}

/// Leaves a tree with the thread, and drops those that nobody has a ticket for.
fn keep(tree: Tree) -> Arc<()> {
    let ticket = Arc::new(());
    TREES.with_borrow_mut(|trees| {
        trees.retain(|(ticket, _)| ticket.strong_count() > 0);
        trees.push((Arc::downgrade(&ticket), tree));
    });
    ticket
}

/// Stands for a tree of the thread that built it.
struct Ticket {
    ticket: Arc<()>,
    bytes: u64,
}

impl Built for Ticket {
    fn bytes(&self) -> Bytes {
        Bytes { own: self.bytes, shared: 0 }
    }

    fn calls(&self) -> Vec<Call> {
        vec![Call::ONE]
    }

    fn pass<'a>(&'a self, _: Call, question: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a> {
        Box::new(Rays {
            ticket: &self.ticket,
            question,
            rays: rays.iter().map(Room::new).collect(),
            t_max: rays.iter().map(|ray| ray.t_max.min(tinybvh_rs::INFINITE)).collect(),
        })
    }
}

/// A ray in the crate's form, with as much again behind it as tinybvh's own has.
#[repr(C, align(64))]
struct Room {
    ray: TheirRay,
    _rest: TheirRay,
}

impl Room {
    fn new(ray: &Ray) -> Self {
        /// Every instance, as tinybvh numbers them.
        const ALL: u32 = 0xFFFF;
        let reciprocal = |x: f32| if x == 0.0 { tinybvh_rs::INFINITE } else { x.recip() };
        let ray = TheirRay {
            origin: ray.origin,
            padding_0: ALL,
            dir: ray.direction,
            r_d: ray.direction.map(reciprocal),
            ..TheirRay::default()
        };
        Self { ray, _rest: TheirRay::default() }
    }
}

/// Rays in the crate's form, which is where it writes what they hit.
struct Rays<'a> {
    ticket: &'a Arc<()>,
    question: Question,
    rays: Vec<Room>,
    t_max: Vec<f32>,
}

/// The primitive of a ray that has hit nothing yet.
const NONE: u32 = u32::MAX;

impl Pass for Rays<'_> {
    fn trace(&mut self) {
        TREES.with_borrow_mut(|trees| {
            let is_it =
                |(ticket, _): &(Weak<()>, Tree)| ticket.as_ptr() == Arc::as_ptr(self.ticket);
            // On another thread there is no such tree, and all rays miss.
            let Some(place) = trees.iter().position(is_it) else { return };
            // Bound to its corners for as long as it is traced: that only sets a pointer.
            let (ticket, Tree { data, corners }) = trees.swap_remove(place);
            let Ok(tree) = data.bvh(corners.as_slice().into()) else { return };
            for (Room { ray, .. }, &t_max) in self.rays.iter_mut().zip(&self.t_max) {
                ray.hit.t = t_max;
                ray.hit.prim = NONE;
                tree.intersect(ray);
            }
            let data = tree.data();
            trees.push((ticket, Tree { data, corners }));
        });
    }

    fn answers(&self, answers: &mut Vec<Answer>) {
        answers.extend(self.rays.iter().map(|Room { ray, .. }| {
            match (ray.hit.prim, self.question) {
                (NONE, _) => Answer::MISS,
                (_, Question::Any) => Answer::any(true),
                (prim, Question::Closest) => Answer::hit(ray.hit.t, prim),
            }
        }));
    }
}
