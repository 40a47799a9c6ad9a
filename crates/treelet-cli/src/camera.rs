//! The camera of the command line: `from=x,y,z at=x,y,z fov=D`, or the name of one.

use std::str::FromStr;

use treelet_model::{Camera, Lens, View};

/// The words that `--camera` understands.
pub(crate) const KEYS: [&str; 6] = ["from", "at", "fov", "height", "lens", "focus"];

/// Degrees between the top and the bottom edge where `fov` is not given.
const FOV: f32 = 40.0;

/// What the words say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CameraWords {
    pub(crate) from: [f32; 3],
    pub(crate) at: [f32; 3],
    /// Degrees between the top and the bottom edge.
    pub(crate) fov: f32,
    /// What an orthographic camera sees from the top to the bottom edge.
    pub(crate) height: Option<f32>,
    /// The radius of a lens.
    pub(crate) lens: Option<f32>,
    /// How far away things are sharp; what is looked at, if nothing is said.
    pub(crate) focus: Option<f32>,
}

/// Which camera is meant.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CameraChoice {
    /// One of the scene.
    Name(String),
    /// A new one.
    Words(CameraWords),
}

impl FromStr for CameraChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // Names may hold `=`, but do not begin like the words.
        let own = |key: &str| text.strip_prefix(key).is_some_and(|rest| rest.starts_with('='));
        if text.is_empty() || KEYS.iter().any(|key| own(key)) {
            text.parse().map(Self::Words)
        } else {
            Ok(Self::Name(text.to_owned()))
        }
    }
}

impl FromStr for CameraWords {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (mut from, mut at, mut fov) = (None, None, None);
        let (mut height, mut lens, mut focus) = (None, None, None);
        for word in text.split_whitespace() {
            let known = word.split_once('=').filter(|(key, _)| KEYS.contains(key));
            let Some((key, value)) = known else {
                return Err(format!(
                    "`{word}` is none of from=x,y,z at=x,y,z fov=DEGREES height=H lens=RADIUS focus=DISTANCE"
                ));
            };
            let twice = match key {
                "from" => from.replace(point(word, value)?).is_some(),
                "at" => at.replace(point(word, value)?).is_some(),
                "height" => height.replace(length(word, value)?).is_some(),
                "lens" => lens.replace(length(word, value)?).is_some(),
                "focus" => focus.replace(length(word, value)?).is_some(),
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
        if height.is_some() && fov.is_some() {
            return Err("fov is for perspective, height for orthographic cameras: give one".into());
        }
        if focus.is_some() && lens.is_none() {
            return Err("focus needs a lens, as in lens=0.05 focus=3".into());
        }
        Ok(Self { from, at, fov: fov.unwrap_or(FOV), height, lens, focus })
    }
}

impl CameraWords {
    /// The camera, upright along the axis `up`; `None` where numbers overflow.
    pub(crate) fn camera(&self, up: usize) -> Option<Camera> {
        let mut upward = [0.0; 3];
        upward[up] = 1.0;
        let mut camera = Camera::look_at(self.from, self.at, upward, self.fov.to_radians())?;
        if let Some(height) = self.height {
            camera.view = View::Orthographic { height };
        }
        camera.lens = self.lens.map(|radius| {
            let focus_distance = self.focus.unwrap_or_else(|| {
                let apart = (0..3).map(|k| f64::from(self.at[k]) - f64::from(self.from[k]));
                apart.map(|x| x * x).sum::<f64>().sqrt() as f32
            });
            Lens { radius, focus_distance }
        });
        Some(camera)
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
    let view = match camera.view {
        View::Perspective { vertical_fov } => format!("fov={:?}", vertical_fov.to_degrees()),
        View::Orthographic { height } => format!("height={height:?}"),
    };
    let lens = camera.lens.filter(|lens| lens.radius > 0.0).map_or(String::new(), |lens| {
        format!(" lens={:?} focus={:?}", lens.radius, lens.focus_distance)
    });
    format!("from={} at={} {view}{lens}", point(from), point(at))
}

fn point(word: &str, value: &str) -> Result<[f32; 3], String> {
    let numbers = crate::ray_text::numbers(value);
    numbers.ok_or_else(|| format!("`{word}`: three finite numbers, as in from=1,2.5,-3"))
}

fn degrees(word: &str, value: &str) -> Result<f32, String> {
    let degrees = value.parse().ok().filter(|fov| *fov > 0.0 && *fov < 180.0);
    degrees.ok_or_else(|| format!("`{word}`: degrees above 0 and below 180, as in fov=40"))
}

fn length(word: &str, value: &str) -> Result<f32, String> {
    let length = value.parse().ok().filter(|length: &f32| *length > 0.0 && length.is_finite());
    length.ok_or_else(|| format!("`{word}`: a length above 0, as in lens=0.05"))
}

#[cfg(test)]
mod tests {
    use super::{CameraChoice, CameraWords};
    use treelet_model::View;

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
    fn lenses_and_orthographic_views() {
        let words = "from=0,0,4 at=0,0,0 lens=0.1";
        let camera = words.parse::<CameraWords>().unwrap().camera(1).unwrap();
        assert_eq!(camera.lens.unwrap().focus_distance, 4.0);
        let words = "from=0,0,4.0 at=0,0,0 height=3.5 lens=0.1 focus=2.5";
        let camera = words.parse::<CameraWords>().unwrap().camera(1).unwrap();
        assert_eq!(camera.view, View::Orthographic { height: 3.5 });
        assert!(super::words(&camera).ends_with("height=3.5 lens=0.1 focus=2.5"));
        let name: CameraChoice = "front=left".parse().unwrap();
        assert_eq!(name, CameraChoice::Name("front=left".into()));
        assert!("from=1".parse::<CameraChoice>().is_err());
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
            "from=1,2,3 at=0,0,0 lens=0",
            "from=1,2,3 at=0,0,0 focus=2",
            "from=1,2,3 at=0,0,0 fov=20 height=2",
        ] {
            assert!(text.parse::<CameraWords>().is_err(), "{text:?}");
        }
    }
}
