//! Which camera a picture is taken with.

use serde::Serialize;
use treelet::bounds::Aabb;
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

/// Which camera is meant.
pub(super) enum Choice {
    /// One of the scene's, by its place in the list; it may move.
    OfScene(usize),
    /// One that stands still.
    Still(Camera),
    /// Nobody named one, and the scene has none.
    Framing,
}

/// The camera of the command line or of the file.
pub(super) fn choice(flags: &Flags, input: &Input) -> Result<Choice, Failure> {
    let cameras = &input.model.cameras;
    match &flags.camera {
        Some(CameraChoice::Words(words)) => {
            let camera = words.camera(input.up).map(Choice::Still);
            camera.ok_or_else(|| Failure::Usage("--camera: the numbers are too large".into()))
        }
        Some(CameraChoice::Name(name)) => {
            // By name, or by number as `--cameras` counts.
            let number = name.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            let named = cameras.iter().position(|camera| camera.name == *name);
            let found = named.or_else(|| number.filter(|&number| number < cameras.len()));
            found.map(Choice::OfScene).ok_or_else(|| {
                let known: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
                let known = if known.is_empty() { "none".into() } else { known.join(", ") };
                Failure::Usage(format!(
                    "--camera {name}: the scene has no such camera, but {known}; or say where it \
                     stands: --camera from=x,y,z at=x,y,z"
                ))
            })
        }
        None if cameras.is_empty() => Ok(Choice::Framing),
        None => Ok(Choice::OfScene(0)),
    }
}

/// The camera of the command line, of the file, or one that sees everything.
pub(super) fn choose(
    flags: &Flags,
    input: &Input,
    placed: &PlacedModel,
) -> Result<Camera, Failure> {
    Ok(match choice(flags, input)? {
        Choice::OfScene(camera) => input.model.cameras[camera].clone(),
        Choice::Still(camera) => camera,
        Choice::Framing => framing(flags, input, &placed.scene.bounds()),
    })
}

/// A camera that sees all of a box.
pub(super) fn framing(flags: &Flags, input: &Input, bounds: &Aabb) -> Camera {
    let aspect = flags.size.width as f32 / flags.size.height as f32;
    Camera::framing(bounds, input.up, aspect)
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
