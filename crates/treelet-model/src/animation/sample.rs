//! The value of a channel between its keys (glTF 2.0, appendix C).

use super::{Animation, Channel, Interpolation, Property};

/// Quaternions whose dot product is above this are so close that the straight line between them is the
/// arc: the sine that slerp divides by would lose half its digits.
const NEARLY_SAME: f64 = 0.999_999;

impl Animation {
    /// Seconds from 0 to its last key; 0 for a clip without keys.
    pub fn duration(&self) -> f64 {
        let ends = self.channels.iter().filter_map(|channel| channel.times.last());
        ends.fold(0.0, |end: f64, &time| end.max(f64::from(time)))
    }

    /// The time in a clip that is played over and over: up to its end, `time` itself; past it, what
    /// is left of `time` after whole rounds.
    pub fn wrapped(&self, time: f64) -> f64 {
        let end = self.duration();
        if time <= end || end <= 0.0 { time.min(end) } else { libm::fmod(time, end) }
    }
}

impl Channel {
    /// Puts the value at `time`, in seconds, into `out`; before the first key it is that key's, after
    /// the last the last one's. Rotations come out with length 1.
    ///
    /// `false`, and nothing in `out`, if there are no keys or not as many values as the keys need.
    pub fn sample(&self, time: f64, out: &mut Vec<f64>) -> bool {
        out.clear();
        let width = self.property.components();
        let is_cubic = self.interpolation == Interpolation::CubicSpline;
        let per_key = width * if is_cubic { 3 } else { 1 };
        let keys = self.times.len();
        if keys == 0 || keys.checked_mul(per_key) != Some(self.values.len()) {
            return false;
        }

        // Find the keys around the time; none is looked for outside.
        let after = self.times.partition_point(|&key| f64::from(key) <= time);
        let before = after.saturating_sub(1);
        let value = |key: usize, which: usize| {
            let start = key * per_key + which * width;
            self.values[start..start + width].iter().map(|&x| f64::from(x))
        };
        // The value stands between the two tangents.
        let middle = usize::from(is_cubic);
        let alone = after == 0 || after == keys || self.interpolation == Interpolation::Step;
        if alone {
            out.extend(value(before, middle));
        } else {
            let (start, end) = (f64::from(self.times[before]), f64::from(self.times[after]));
            let span = end - start;
            let s = (time - start) / span;
            if is_cubic {
                let (from, leave) = (value(before, 1), value(before, 2));
                let (to, arrive) = (value(after, 1), value(after, 0));
                let ends = from.zip(leave).zip(to.zip(arrive));
                out.extend(ends.map(|((a, u), (b, v))| hermite([a, span * u, b, span * v], s)));
            } else if self.property == Property::Rotation {
                let quaternion = |key: usize| {
                    let v = &self.values[key * per_key..];
                    unit([v[0], v[1], v[2], v[3]].map(f64::from))
                };
                out.extend(slerp(quaternion(before), quaternion(after), s));
            } else {
                out.extend(value(before, 0).zip(value(after, 0)).map(|(a, b)| a + (b - a) * s));
            }
        }
        if self.property == Property::Rotation {
            let turned = unit([out[0], out[1], out[2], out[3]]);
            out.copy_from_slice(&turned);
        }
        true
    }
}

/// The cubic from `a`, leaving with `u`, to `b`, arriving with `v`.
fn hermite([a, u, b, v]: [f64; 4], s: f64) -> f64 {
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * a
        + (s3 - 2.0 * s2 + s) * u
        + (3.0 * s2 - 2.0 * s3) * b
        + (s3 - s2) * v
}

/// The shorter way from one unit quaternion to another, at even speed (K. Shoemake, "Animating
/// Rotation with Quaternion Curves", 1985).
fn slerp(a: [f64; 4], b: [f64; 4], s: f64) -> [f64; 4] {
    let dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    // A quaternion and its negative turn alike.
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let cos = dot.abs();
    let (from, to) = if cos > NEARLY_SAME {
        (1.0 - s, s)
    } else {
        let angle = libm::acos(cos);
        let sin = libm::sin(angle);
        (libm::sin((1.0 - s) * angle) / sin, libm::sin(s * angle) / sin)
    };
    [0, 1, 2, 3].map(|k| from * a[k] + sign * to * b[k])
}

/// A quaternion of length 1; one of length zero, or none, turns nothing.
fn unit(q: [f64; 4]) -> [f64; 4] {
    let length = libm::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if length > 0.0 && length.is_finite() { q.map(|x| x / length) } else { [0.0, 0.0, 0.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::super::{Animation, Channel, Interpolation, Property};

    fn channel(
        property: Property,
        interpolation: Interpolation,
        times: &[f32],
        values: &[f32],
    ) -> Channel {
        let (times, values) = (times.to_vec(), values.to_vec());
        Channel { node: 0, path: String::new(), property, interpolation, times, values }
    }

    #[track_caller]
    fn check(channel: &Channel, time: f64, want: &[f64]) {
        let mut got = Vec::new();
        assert!(channel.sample(time, &mut got));
        assert_eq!(got.len(), want.len());
        let close = got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-7);
        assert!(close, "at {time}: {got:?} is not {want:?}");
    }

    #[test]
    fn steps_and_lines() {
        let values = [0.0, 0.0, 0.0, 4.0, 8.0, -2.0, 5.0, 5.0, 5.0];
        let times = [1.0, 3.0, 4.0];
        let line = channel(Property::Translation, Interpolation::Linear, &times, &values);
        let step = channel(Property::Scale, Interpolation::Step, &times, &values);
        for (time, on_line, on_step) in [
            (0.0, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            (1.5, [1.0, 2.0, -0.5], [0.0, 0.0, 0.0]),
            (3.0, [4.0, 8.0, -2.0], [4.0, 8.0, -2.0]),
            (3.25, [4.25, 7.25, -0.25], [4.0, 8.0, -2.0]),
            (9.0, [5.0, 5.0, 5.0], [5.0, 5.0, 5.0]),
        ] {
            check(&line, time, &on_line);
            check(&step, time, &on_step);
        }
    }

    #[test]
    fn rotations_take_the_short_arc_at_even_speed() {
        // From nothing to a quarter turn about z, written as its negative.
        let half = core::f32::consts::FRAC_1_SQRT_2;
        let values = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -half, -half];
        let turn = channel(Property::Rotation, Interpolation::Linear, &[0.0, 3.0], &values);
        let degrees = |degrees: f64| {
            let half = 0.5 * degrees.to_radians();
            [0.0, 0.0, libm::sin(half), libm::cos(half)]
        };
        check(&turn, 1.0, &degrees(30.0));
        check(&turn, 2.0, &degrees(60.0));
        // Keys that are hardly apart.
        let near = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1e-4, 1.0];
        let turn = channel(Property::Rotation, Interpolation::Linear, &[0.0, 1.0], &near);
        check(&turn, 0.5, &[0.0, 0.0, 5e-5, 1.0]);
    }

    #[test]
    fn cubics_follow_their_tangents() {
        // In-tangent, value, out-tangent of each key; two seconds apart.
        let values = [9.0, 1.0, 3.0, -1.0, 5.0, 9.0];
        let weights = Property::MorphWeights { targets: 1 };
        let cubic = channel(weights, Interpolation::CubicSpline, &[1.0, 3.0], &values);
        check(&cubic, 1.0, &[1.0]);
        // By hand at a half: 1/2 a + 1/8 (2 u) + 1/2 b - 1/8 (2 v).
        check(&cubic, 2.0, &[0.5 + 0.75 + 2.5 + 0.25]);
        // At a quarter: 27/32, 9/64, 5/32, -3/64.
        check(&cubic, 1.5, &[27.0 / 32.0 + 6.0 * 9.0 / 64.0 + 25.0 / 32.0 + 2.0 * 3.0 / 64.0]);
        check(&cubic, 4.0, &[5.0]);
        // Rotations come out with length 1.
        let mut keys = [0.0; 24];
        (keys[7], keys[18]) = (1.0, 1.0);
        let turn = channel(Property::Rotation, Interpolation::CubicSpline, &[0.0, 1.0], &keys);
        let half = core::f64::consts::FRAC_1_SQRT_2;
        check(&turn, 0.5, &[0.0, 0.0, half, half]);
    }

    #[test]
    fn what_has_no_value_says_so() {
        let mut out = vec![1.0];
        let empty = channel(Property::Scale, Interpolation::Linear, &[], &[]);
        assert!(!empty.sample(0.0, &mut out) && out.is_empty());
        let short = channel(Property::Scale, Interpolation::Linear, &[0.0, 1.0], &[1.0; 5]);
        assert!(!short.sample(0.0, &mut out));
        // Keys at the same time: the later one counts, and nothing is divided by zero.
        let same = channel(
            Property::Scale,
            Interpolation::Linear,
            &[1.0, 1.0],
            &[[2.0; 3], [3.0; 3]].concat(),
        );
        check(&same, 1.0, &[3.0; 3]);
        check(&same, 0.5, &[2.0; 3]);
    }

    #[test]
    fn clips_go_round() {
        let mut clip = Animation::default();
        assert_eq!((clip.duration(), clip.wrapped(7.0)), (0.0, 0.0));
        clip.channels.push(channel(Property::Scale, Interpolation::Step, &[0.5, 2.0], &[1.0; 6]));
        for (time, want) in [(0.0, 0.0), (2.0, 2.0), (2.5, 0.5), (7.0, 1.0)] {
            assert_eq!(clip.wrapped(time), want);
        }
    }
}
