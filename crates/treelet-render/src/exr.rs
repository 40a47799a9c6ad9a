//! Pictures with all their light: OpenEXR with layers, and Radiance HDR.
//!
//! EXR: the picture as `R`, `G`, `B`, and layers by the prefix of their channels (`normal.X`), as
//! compositing programs group them; lossless. HDR: G. Ward, "Real Pixels", Graphics Gems II, 1991;
//! the run-length form of the format, without runs.

use crate::error::RenderError;
use crate::layers::Layers;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, LayerAttributes, WritableImage as _,
};
use std::io::Cursor;

/// A picture of linear Rec. 709 radiances, rows from the top, as OpenEXR, with layers or without.
///
/// # Errors
/// If the encoder refuses: where the planes have not `width * height` pixels.
pub fn encode_exr(
    width: u32,
    height: u32,
    radiance: &[[f32; 3]],
    layers: Option<&Layers>,
) -> Result<Vec<u8>, RenderError> {
    let mut channels = Vec::new();
    let mut colors = |names: [&str; 3], plane: &[[f32; 3]]| {
        for (c, name) in names.into_iter().enumerate() {
            let samples = FlatSamples::F32(plane.iter().map(|pixel| pixel[c]).collect());
            channels.push(AnyChannel::new(name, samples));
        }
    };
    colors(["R", "G", "B"], radiance);
    if let Some(layers) = layers {
        colors(["albedo.R", "albedo.G", "albedo.B"], &layers.albedo);
        colors(["normal.X", "normal.Y", "normal.Z"], &layers.normal);
        channels.push(AnyChannel::new("depth.Z", FlatSamples::F32(layers.depth.clone())));
        for (k, name) in ["id.placement", "id.part", "id.triangle"].into_iter().enumerate() {
            let samples = FlatSamples::U32(layers.ids.iter().map(|ids| ids[k]).collect());
            channels.push(AnyChannel::new(name, samples));
        }
        channels.push(AnyChannel::new("visits.Y", FlatSamples::U32(layers.visits.clone())));
        channels.push(AnyChannel::new("tests.Y", FlatSamples::U32(layers.tests.clone())));
    }
    let pixels = radiance.len();
    let refused = |reason: String| RenderError::Encoder { format: "EXR", reason };
    let fits = u64::from(width) * u64::from(height) == pixels as u64 && pixels > 0;
    if !fits || layers.is_some_and(|layers| layers.depth.len() != pixels) {
        let reason = format!("{pixels} pixels are not {width} by {height}");
        return Err(refused(reason));
    }
    let image = Image::from_layer(exr::prelude::Layer::new(
        (width as usize, height as usize),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.into_iter().collect()),
    ));
    let mut bytes = Vec::new();
    image
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|error| refused(error.to_string()))?;
    Ok(bytes)
}

/// A picture of linear Rec. 709 radiances, rows from the top, as Radiance HDR: 8 bits a channel and
/// a common exponent.
///
/// # Errors
/// If `radiance` has not `width * height` pixels, or a row more than 32,767.
pub fn encode_hdr(width: u32, height: u32, radiance: &[[f32; 3]]) -> Result<Vec<u8>, RenderError> {
    const ROW_MAX: u32 = 32_767;
    let pixels = radiance.len();
    if width > ROW_MAX || u64::from(width) * u64::from(height) != pixels as u64 || pixels == 0 {
        let reason = format!("{pixels} pixels are not {width} by {height}, or a row is too long");
        return Err(RenderError::Encoder { format: "HDR", reason });
    }
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n".to_vec();
    bytes.extend(format!("-Y {height} +X {width}\n").bytes());
    for row in radiance.chunks_exact(width as usize) {
        // Rows of fewer than 8 pixels have no run-length form.
        if width < 8 {
            row.iter().for_each(|&pixel| bytes.extend(rgbe(pixel)));
            continue;
        }
        bytes.extend([2, 2, (width >> 8) as u8, width as u8]);
        let row: Vec<[u8; 4]> = row.iter().map(|&pixel| rgbe(pixel)).collect();
        for channel in 0..4 {
            for literal in row.chunks(128) {
                bytes.push(literal.len() as u8);
                bytes.extend(literal.iter().map(|pixel| pixel[channel]));
            }
        }
    }
    Ok(bytes)
}

/// Three mantissas under the exponent of the largest.
fn rgbe(radiance: [f32; 3]) -> [u8; 4] {
    let [r, g, b] = radiance.map(|c| if c > 0.0 { c.min(f32::MAX) } else { 0.0 });
    let most = r.max(g).max(b);
    // The format ends at about 1e-38.
    if most < 1e-37 {
        return [0; 4];
    }
    let (_, exponent) = libm::frexpf(most);
    let mantissa = |c: f32| libm::ldexpf(c, 8 - exponent) as u8;
    match u8::try_from(exponent + 128) {
        Ok(shared) => [mantissa(r), mantissa(g), mantissa(b), shared],
        Err(_) => [255; 4],
    }
}

#[cfg(test)]
mod tests {
    use super::{encode_exr, encode_hdr};
    use crate::layers::Layers;
    use treelet_model::{Image, Pixels};

    fn picture(width: u32, height: u32) -> Vec<[f32; 3]> {
        (0..width * height).map(|i| [i as f32 * 0.37, 1e4 / (i + 1) as f32, 0.0]).collect()
    }

    fn decoded(bytes: &[u8], name: &str) -> Vec<[f32; 4]> {
        let image = Image::decode(bytes, name, 1 << 20).unwrap();
        let Pixels::Rgba32F(pixels) = image.pixels else { panic!("floats") };
        pixels.to_vec()
    }

    #[test]
    fn exr_comes_back_bit_for_bit() {
        let radiance = picture(13, 7);
        let bytes = encode_exr(13, 7, &radiance, None).unwrap();
        let back = decoded(&bytes, "a.exr");
        assert!(back.iter().zip(&radiance).all(|(a, b)| a[..3] == b[..]));
        assert!(encode_exr(13, 8, &radiance, None).is_err());
    }

    #[test]
    fn exr_has_layers() {
        let radiance = picture(3, 2);
        let layers = Layers {
            albedo: vec![[0.5; 3]; 6],
            normal: vec![[0.0, 0.0, 1.0]; 6],
            depth: vec![2.5; 6],
            ids: vec![[1, 2, 70_000]; 6],
            visits: vec![9; 6],
            tests: vec![4; 6],
        };
        let bytes = encode_exr(3, 2, &radiance, Some(&layers)).unwrap();
        use exr::prelude::{ReadChannels as _, ReadLayers as _, read};
        let image = read().no_deep_data().largest_resolution_level().all_channels();
        let image = image.first_valid_layer().all_attributes();
        let image = image.non_parallel().from_buffered(std::io::Cursor::new(&bytes)).unwrap();
        let names: Vec<String> =
            image.layer_data.channel_data.list.iter().map(|c| c.name.to_string()).collect();
        let expected = [
            "B",
            "G",
            "R",
            "albedo.B",
            "albedo.G",
            "albedo.R",
            "depth.Z",
            "id.part",
            "id.placement",
            "id.triangle",
            "normal.X",
            "normal.Y",
            "normal.Z",
            "tests.Y",
            "visits.Y",
        ];
        assert_eq!(names, expected);
        let id = &image.layer_data.channel_data.list[9].sample_data;
        assert_eq!(id.values_as_f32().next(), Some(70_000.0));
    }

    #[test]
    fn hdr_comes_back_to_a_percent() {
        for width in [3, 8, 300] {
            let radiance = picture(width, 5);
            let bytes = encode_hdr(width, 5, &radiance).unwrap();
            let back = decoded(&bytes, "a.hdr");
            for (back, sent) in back.iter().zip(&radiance) {
                let most = sent[0].max(sent[1]);
                assert!((0..3).all(|c| (back[c] - sent[c]).abs() <= most / 100.0));
            }
        }
    }
}
