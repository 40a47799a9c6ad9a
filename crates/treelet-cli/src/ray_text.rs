//! Rays as text that can be pasted back: `o=x,y,z d=x,y,z t=t_min,t_max`.
//!
//! Numbers are printed with as many digits as tell an f32 from every other, so that the same ray
//! comes back bit for bit (but for NaN, which no check uses).

use std::str::FromStr;

use treelet::Ray;

/// A ray read from text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RayText(pub(crate) Ray);

impl FromStr for RayText {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (mut origin, mut direction, mut interval) = (None, None, None);
        for word in text.split_whitespace() {
            let wrong = || format!("`{word}` is none of o=x,y,z d=x,y,z t=min,max");
            let (key, value) = word.split_once('=').ok_or_else(wrong)?;
            match key {
                "o" => origin = Some(numbers(value).ok_or_else(wrong)?),
                "d" => direction = Some(numbers(value).ok_or_else(wrong)?),
                "t" => interval = Some(pair(value).ok_or_else(wrong)?),
                _ => return Err(wrong()),
            }
        }
        let origin = origin.ok_or("o=x,y,z is missing")?;
        let direction = direction.ok_or("d=x,y,z is missing")?;
        let [t_min, t_max] = interval.unwrap_or([0.0, f32::INFINITY]);
        Ok(Self(Ray::new(origin, direction).from(t_min).up_to(t_max)))
    }
}

/// The ray as text.
pub(crate) fn text(ray: &Ray) -> String {
    let point = |[x, y, z]: [f32; 3]| format!("{x:?},{y:?},{z:?}");
    let Ray { origin, direction, t_min, t_max, .. } = ray;
    format!("o={} d={} t={t_min:?},{t_max:?}", point(*origin), point(*direction))
}

/// Three finite numbers with commas between.
pub(crate) fn numbers(text: &str) -> Option<[f32; 3]> {
    let numbers: Vec<f32> =
        text.split(',').map(|number| number.trim().parse()).collect::<Result<_, _>>().ok()?;
    let numbers: [f32; 3] = numbers.try_into().ok()?;
    numbers.iter().all(|number| number.is_finite()).then_some(numbers)
}

/// Two numbers, infinities allowed.
fn pair(text: &str) -> Option<[f32; 2]> {
    let (a, b) = text.split_once(',')?;
    let pair: [f32; 2] = [a.trim().parse().ok()?, b.trim().parse().ok()?];
    pair.iter().all(|number| !number.is_nan()).then_some(pair)
}

#[cfg(test)]
mod tests {
    use super::{RayText, text};
    use treelet::Ray;

    #[test]
    fn rays_survive_the_way_through_text() {
        let third = 1.0 / 3.0;
        let rays = [
            Ray::new([0.1, -0.0, 1e-40], [third, -1e30, f32::MIN_POSITIVE]),
            Ray::new([16_777_217.0, 1e9, -third], [0.0, -0.0, 1.0]).from(-5.5).up_to(third),
        ];
        for ray in rays {
            let RayText(back) = text(&ray).parse().unwrap();
            let bits = |ray: &Ray| {
                let all = [ray.origin, ray.direction, [ray.t_min, ray.t_max, ray.time]];
                all.map(|numbers| numbers.map(f32::to_bits))
            };
            assert_eq!(bits(&back), bits(&ray), "{}", text(&ray));
        }
    }

    #[test]
    fn wrong_rays_are_refused() {
        for text in ["", "o=1,2,3", "o=1,2 d=0,0,1", "o=1,2,3 d=0,0,1 t=5", "o=1,2,3 d=0,0,x", "x"]
        {
            assert!(text.parse::<RayText>().is_err(), "{text:?}");
        }
    }
}
