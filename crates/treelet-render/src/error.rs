//! What can go wrong, each naming the value, its place and the remedy.

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The picture has no pixels, or too many.
    #[error(
        "a picture of {width}x{height} pixels cannot be made; both sides must be at least 1 and \
         their product at most 2^31"
    )]
    ImageSize {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// An allocation whose size follows from the input was refused.
    #[error("out of memory: {bytes} bytes for {what}; choose a smaller picture or scene")]
    OutOfMemory {
        /// How much was asked for.
        bytes: u64,
        /// What it was for.
        what: &'static str,
    },
    /// A camera's field of view is no angle of a pinhole camera.
    #[error(
        "the camera's vertical field of view is {radians} radians; it must lie between 0 and pi"
    )]
    FieldOfView {
        /// The angle.
        radians: f32,
    },
    /// A camera's matrix has a number that is not finite, or a column of length 0.
    #[error("the camera's matrix {rows:?} does not turn directions into directions; place it anew")]
    CameraMatrix {
        /// The rows of the matrix.
        rows: [[f32; 4]; 3],
    },
    /// The axis that points up is not one of the three.
    #[error("axis {axis} cannot point up; there are the axes 0, 1 and 2")]
    Up {
        /// The axis.
        axis: usize,
    },
    /// A placement names an object that is not there.
    #[error("placement {placement} names object {object}, but the model has {objects}")]
    NoSuchObject {
        /// Index of the placement.
        placement: usize,
        /// The object it names.
        object: usize,
        /// How many there are.
        objects: usize,
    },
    /// A part names a material that is not there.
    #[error(
        "part {part} of object {object} names material {material}, but the model has {materials}"
    )]
    NoSuchMaterial {
        /// Index of the object.
        object: usize,
        /// Index of the part in its object.
        part: usize,
        /// The material it names.
        material: usize,
        /// How many there are.
        materials: usize,
    },
    /// A part's normals do not match its vertices.
    #[error(
        "part {part} of object {object} has {normals} normals for {vertices} vertices; \
         give one a vertex, or none"
    )]
    NormalCount {
        /// Index of the object.
        object: usize,
        /// Index of the part in its object.
        part: usize,
        /// How many normals.
        normals: usize,
        /// How many vertices.
        vertices: usize,
    },
    /// A material's factor is NaN, infinite or negative.
    #[error(
        "material {material} ({name:?}) has {factor} = {value}; it must be finite and not negative"
    )]
    MaterialFactor {
        /// Index of the material.
        material: usize,
        /// Its name.
        name: String,
        /// Which factor.
        factor: &'static str,
        /// The value.
        value: f32,
    },
    /// A number of the sky is unfit.
    #[error("the sky's {factor} is {value}; {remedy}")]
    Sky {
        /// Which number.
        factor: &'static str,
        /// Its value.
        value: f32,
        /// What it may be.
        remedy: &'static str,
    },
    /// The film was made for another picture size.
    #[error(
        "the film has {film:?} pixels, the renderer {renderer:?}; make the film with `Renderer::film`"
    )]
    FilmSize {
        /// Width and height of the film.
        film: [u32; 2],
        /// Width and height of the renderer.
        renderer: [u32; 2],
    },
    /// The PNG encoder refused.
    #[error("the PNG encoder failed: {0}")]
    Png(String),
    /// The caller asked to stop; the film is as it was before the call.
    #[error("cancelled")]
    Cancelled,
}
