//! The camera of the command line: `from=x,y,z at=x,y,z fov=D`.

use std::str::FromStr;

use treelet_model::Camera;

/// The words that `--camera` understands.
pub(crate) const KEYS: [&str; 3] = ["from", "at", "fov"];

/// Degrees between the top and the bottom edge where `fov` is not given.
const FOV: f32 = 40.0;

/// What the words say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CameraWords {
    pub(crate) from: [f32; 3],
    pub(crate) at: [f32; 3],
    /// Degrees between the top and the bottom edge.
    pub(crate) fov: f32,
}

impl FromStr for CameraWords {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (mut from, mut at, mut fov) = (None, None, None);
        for word in text.split_whitespace() {
            let known = word.split_once('=').filter(|(key, _)| KEYS.contains(key));
            let Some((key, value)) = known else {
                return Err(format!("`{word}` is none of from=x,y,z at=x,y,z fov=DEGREES"));
            };
            let twice = match key {
                "from" => from.replace(point(word, value)?).is_some(),
                "at" => at.replace(point(word, value)?).is_some(),
                _ => fov.replace(degrees(word, value)?).is_some(),
            };
            if twice {
                return Err(format!("`{key}` is given twice"));
            }
        }
        let from = from.ok_or("from=x,y,z is missing")?;
        let at = at.ok_or("at=x,y,z is missing")?;
        if from == at {
            return Err("from and at are the same point, which is no direction".into());
        }
        Ok(Self { from, at, fov: fov.unwrap_or(FOV) })
    }
}

impl CameraWords {
    /// The camera, upright along the axis `up`; `None` where numbers overflow.
    pub(crate) fn camera(&self, up: usize) -> Option<Camera> {
        let mut upward = [0.0; 3];
        upward[up] = 1.0;
        Camera::look_at(self.from, self.at, upward, self.fov.to_radians())
    }
}

/// Words that would give this camera.
pub(crate) fn words(camera: &Camera) -> String {
    let from = camera.position();
    let forward = camera.world_from_camera.vector([0.0, 0.0, -1.0]);
    // Far from the origin, where a step of 1 would be lost, look at something as far away.
    let length = |v: [f32; 3]| v.map(f64::from).iter().map(|x| x * x).sum::<f64>().sqrt();
    let step = length(from).max(1.0) / length(forward);
    let along = |axis: usize| f64::from(from[axis]) + step * f64::from(forward[axis]);
    let at: [f32; 3] = std::array::from_fn(|axis| along(axis) as f32);
    let point = |[x, y, z]: [f32; 3]| format!("{x:?},{y:?},{z:?}");
    format!("from={} at={} fov={:?}", point(from), point(at), camera.vertical_fov(1.0).to_degrees())
}

fn point(word: &str, value: &str) -> Result<[f32; 3], String> {
    let numbers = crate::ray_text::numbers(value);
    numbers.ok_or_else(|| format!("`{word}`: three finite numbers, as in from=1,2.5,-3"))
}

fn degrees(word: &str, value: &str) -> Result<f32, String> {
    let degrees = value.parse().ok().filter(|fov| *fov > 0.0 && *fov < 180.0);
    degrees.ok_or_else(|| format!("`{word}`: degrees above 0 and below 180, as in fov=40"))
}

#[cfg(test)]
mod tests {
    use super::CameraWords;

    #[test]
    fn words_become_a_camera() {
        let camera: CameraWords = "from=1,2,3 fov=60 at=-1e1,0,.5".parse().unwrap();
        assert_eq!(camera.from, [1.0, 2.0, 3.0]);
        assert_eq!(camera.at, [-10.0, 0.0, 0.5]);
        assert_eq!(camera.fov, 60.0);
        assert!(camera.camera(1).is_some());
        let camera: CameraWords = "from=1,2,3 at=0,0,0".parse().unwrap();
        assert_eq!(camera.fov, super::FOV);
    }

    #[test]
    fn wrong_words_are_refused() {
        for text in [
            "",
            "from=1,2,3",
            "at=1,2,3",
            "from=1,2 at=0,0,0",
            "from=1,2,3,4 at=0,0,0",
            "from=1,2,x at=0,0,0",
            "from=1,2,inf at=0,0,0",
            "from=1,2,NaN at=0,0,0",
            "from=1,2,3 at=1,2,3",
            "from=1,2,3 at=0,0,0 fov=180",
            "from=1,2,3 at=0,0,0 fov=0",
            "from=1,2,3 at=0,0,0 fov=nan",
            "from=1,2,3 at=0,0,0 from=1,2,4",
            "from=1,2,3 at=0,0,0 up=0,1,0",
            "elsewhere",
        ] {
            assert!(text.parse::<CameraWords>().is_err(), "{text:?}");
        }
    }
}
