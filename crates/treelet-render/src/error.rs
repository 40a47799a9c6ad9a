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
    /// An orthographic camera sees nothing.
    #[error("the orthographic camera sees a height of {height}; it must be finite and above 0")]
    ViewHeight {
        /// The height.
        height: f32,
    },
    /// A lens that cannot be.
    #[error(
        "the lens has radius {radius} and focus distance {focus_distance}; both must be finite, \
         the radius at least 0 and the distance above 0"
    )]
    Lens {
        /// Its radius.
        radius: f32,
        /// How far away things are sharp.
        focus_distance: f32,
    },
    /// A texture names an image that is not there.
    #[error("{owner} names image {image}, but the model has {images}")]
    NoSuchImage {
        /// Whose texture it is.
        owner: String,
        /// The image it names.
        image: usize,
        /// How many there are.
        images: usize,
    },
    /// An image's pixels are not as many as its size says.
    #[error(
        "image {image} ({name:?}) should have {expected} pixels, at least one, and has {found}; \
         decode it anew"
    )]
    ImagePixels {
        /// Index of the image.
        image: usize,
        /// Its name.
        name: String,
        /// Width times height.
        expected: u64,
        /// How many there are.
        found: u64,
    },
    /// A texture's transform has a number that is not finite.
    #[error("{owner} has a texture transform that is not finite; give finite numbers")]
    TextureTransform {
        /// Whose texture it is.
        owner: String,
    },
    /// A light's number is unfit.
    #[error(
        "light {light} ({name:?}) has {factor} {value}; strengths must be finite and not negative, \
         places finite, directions not zero, angles from 0 to pi and the outer above 0"
    )]
    Light {
        /// Index of the light.
        light: usize,
        /// Its name.
        name: String,
        /// Which number.
        factor: &'static str,
        /// Its value.
        value: f32,
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
    /// A part's arrays do not match its vertices.
    #[error(
        "part {part} of object {object} has {count} {what} for {vertices} vertices; \
         give one a vertex, or none"
    )]
    AttributeCount {
        /// Index of the object.
        object: usize,
        /// Index of the part in its object.
        part: usize,
        /// Which array: its plural.
        what: &'static str,
        /// How many entries it has.
        count: usize,
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
    /// An encoder refused.
    #[error("the {format} encoder failed: {reason}; choose another format or size")]
    Encoder {
        /// Which.
        format: &'static str,
        /// What it says.
        reason: String,
    },
    /// The caller asked to stop; the film is as it was before the call.
    #[error("cancelled")]
    Cancelled,
}
