//! Which rays go together: seen from a few of them, then of each.

use crate::math::Ray;
use crate::trace::packet::GROUP;
use crate::trace::record::Class;

/// Rays whose slopes along the longest axis differ by at most this from a leader's go with it.
const NEAR: f32 = 0.08;

/// Bundles of rays in a run of [`GROUP`] rays, at most: lights, say, or octants that meet.
const LEADERS: usize = 8;

/// Rays looked at of a run.
const SAMPLES: usize = 16;

/// A run is coherent if this many of its samples agree with few leaders.
const LEADERS_FEW: usize = 5;

/// Smaller bundles gain nothing from packets.
const SMALL: u32 = 8;

/// A direction: the class, and the slopes against its longest axis.
#[derive(Clone, Copy)]
struct Bearing {
    class: Class,
    slopes: [f32; 2],
}

impl Bearing {
    /// Of a valid ray.
    #[inline(always)]
    fn of(ray: &Ray) -> Self {
        let class = Class::of(ray);
        let [x, y, z] = class.axes().map(|axis| ray.direction[usize::from(axis.min(2))]);
        let along = 1.0 / z;
        Self { class, slopes: [x * along, y * along] }
    }

    #[inline(always)]
    fn is_near(&self, other: &Self) -> bool {
        let [x, y] = [self.slopes[0] - other.slopes[0], self.slopes[1] - other.slopes[1]];
        self.class == other.class && { let m = super::many::PACK.load(core::sync::atomic::Ordering::Relaxed); let near = if m > 1 { m as f32 * 0.01 } else { NEAR }; x.abs() <= near && y.abs() <= near }
    }
}

/// Whether rays of a run, [`GROUP`] at most, seem to go together: few directions, and starts that are
/// mostly nearer to each other than `near`.
#[inline(always)]
pub(super) fn seem_coherent(rays: &[Ray], near: f32) -> bool {
    let step = (rays.len() / SAMPLES).max(1);
    let mut leaders = [None; LEADERS_FEW];
    let mut last: Option<&Ray> = None;
    let (mut far, mut seen) = (0, 0);
    for ray in rays.iter().step_by(step).filter(|ray| ray.is_valid()) {
        seen += 1;
        let bearing = Bearing::of(ray);
        let place = leaders
            .iter_mut()
            .find(|leader| leader.is_none_or(|leader: Bearing| leader.is_near(&bearing)));
        let Some(place) = place else { crate::trace::packet::add(13, rays.len() as u64); return false };
        place.get_or_insert(bearing);
        if let Some(last) = last {
            let apart = |axis: usize| (ray.origin[axis] - last.origin[axis]).abs() > near;
            far += usize::from(apart(0) || apart(1) || apart(2));
        }
        last = Some(ray);
    }
    if far*4 > seen { crate::trace::packet::add(14, rays.len() as u64); }
    seen > 4 && far * 4 <= seen
}

/// Slots of a run, sorted into bundles.
pub(super) struct Bundles {
    slots: [u32; GROUP],
    ends: [u32; LEADERS + 1],
    leaders: [Option<Bearing>; LEADERS],
}

impl Bundles {
    /// Sorts the valid rays of `first ..`, [`GROUP`] at most.
    pub(super) fn new(rays: &[Ray], first: usize) -> Self {
        let mut names = [0_u8; GROUP];
        let mut counts = [0_u32; LEADERS + 2];
        let mut leaders: [Option<Bearing>; LEADERS] = [None; LEADERS];
        for (ray, name) in rays.iter().zip(&mut names) {
            let mut at = LEADERS + 1;
            if ray.is_valid() {
                let bearing = Bearing::of(ray);
                at = LEADERS;
                for (i, leader) in leaders.iter_mut().enumerate() {
                    if leader.get_or_insert(bearing).is_near(&bearing) {
                        at = i;
                        break;
                    }
                }
            }
            *name = at as u8;
            counts[at] += 1;
        }
        let mut starts = [0_u32; LEADERS + 2];
        let mut ends = [0_u32; LEADERS + 1];
        let mut sum = 0;
        for i in 0..LEADERS + 2 {
            starts[i] = sum;
            sum += counts[i];
            if let Some(end) = ends.get_mut(i) {
                *end = sum;
            }
        }
        let mut slots = [0; GROUP];
        for (at, &name) in names[..rays.len().min(GROUP)].iter().enumerate() {
            let start = &mut starts[usize::from(name)];
            slots[*start as usize % GROUP] = (first + at) as u32;
            *start += 1;
        }
        Self { slots, ends, leaders }
    }

    /// The bundles that are worth walking together, each of one class; the slots of the others.
    pub(super) fn split(&self, mut bundle: impl FnMut(Class, &[u32]), mut rest: impl FnMut(&[u32])) {
        let mut start = 0;
        for i in 0..=LEADERS {
            let end = self.ends[i];
            let slots = &self.slots[start as usize..end as usize];
            match self.leaders.get(i) {
                Some(Some(leader)) if end - start >= SMALL => bundle(leader.class, slots),
                _ => { crate::trace::packet::add(15, slots.len() as u64); rest(slots)},
            }
            start = end;
        }
    }
}
