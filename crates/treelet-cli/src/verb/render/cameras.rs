//! Which camera a picture is taken with.

use serde::Serialize;
use treelet::math::{Affine, vec3};
use treelet_model::{Camera, PlacedModel};

use super::flags::Flags;
use crate::camera::{self, CameraChoice};
use crate::ending::{Ending, Failure};
use crate::input::Input;
use crate::session::{Outcome, say};

#[derive(Serialize)]
struct Report {
    scene: String,
    cameras: Vec<Listed>,
}

#[derive(Serialize)]
struct Listed {
    name: String,
    camera: String,
}

/// Tells the scene's cameras.
pub(super) fn list(input: Input) -> Result<Outcome, Failure> {
    let listed =
        |camera: &Camera| Listed { name: camera.name.clone(), camera: camera::words(camera) };
    let cameras: Vec<Listed> = input.model.cameras.iter().map(listed).collect();
    if cameras.is_empty() {
        say("the scene has no cameras; without --camera, all of it is seen");
    }
    for (number, listed) in cameras.iter().enumerate() {
        let name = if listed.name.is_empty() { "(no name)" } else { &listed.name };
        say(&format!("{}: {name}: {}", number + 1, listed.camera));
    }
    Outcome::new("render", &Report { scene: input.name, cameras }, Ending::Done)
}

/// The camera of the command line, of the file, or one that sees everything.
pub(super) fn choose(
    flags: &Flags,
    input: &Input,
    placed: &PlacedModel,
) -> Result<Camera, Failure> {
    let cameras = &input.model.cameras;
    match &flags.camera {
        Some(CameraChoice::Words(words)) => {
            let camera = words.camera(input.up);
            camera.ok_or_else(|| Failure::Usage("--camera: the numbers are too large".into()))
        }
        Some(CameraChoice::Name(name)) => {
            // By name, or by number as `--cameras` counts.
            let number = name.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            let named = cameras.iter().find(|camera| camera.name == *name);
            let found = named.or_else(|| cameras.get(number?));
            found.cloned().ok_or_else(|| {
                let known: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
                let known = if known.is_empty() { "none".into() } else { known.join(", ") };
                Failure::Usage(format!(
                    "--camera {name}: the scene has no such camera, but {known}; or say where it \
                     stands: --camera from=x,y,z at=x,y,z"
                ))
            })
        }
        None => {
            let aspect = flags.size.width as f32 / flags.size.height as f32;
            let framing = || Camera::framing(&placed.scene.bounds(), input.up, aspect);
            Ok(cameras.first().cloned().unwrap_or_else(framing))
        }
    }
}

/// The camera, turned around the middle of the scene by a share of the circle.
pub(super) fn turned(camera: &Camera, placed: &PlacedModel, up: usize, share: f32) -> Camera {
    let center = placed.scene.bounds().center();
    let mut axis = [0.0; 3];
    axis[up] = 1.0;
    let turn = Affine::translation(center)
        .then_from(&Affine::rotation(axis, share * core::f32::consts::TAU))
        .then_from(&Affine::translation(vec3::scale(center, -1.0)));
    Camera { world_from_camera: turn.then_from(&camera.world_from_camera), ..camera.clone() }
}
