//! A GLB that is put together accessor by accessor.

use super::{glb, le};

/// Accessors so far, and their bytes.
#[derive(Default)]
pub(crate) struct Doc {
    accessors: Vec<String>,
    views: Vec<String>,
    binary: Vec<u8>,
}

impl Doc {
    /// Adds an accessor over `bytes`; its number.
    fn add(&mut self, bytes: &[u8], kind: u32, shape: &str, width: usize) -> usize {
        // Floats, or bytes.
        let size = if kind == 5126 { 4 } else { 1 };
        let count = bytes.len() / (size * width);
        let view = self.views.len();
        let (offset, len) = (self.binary.len(), bytes.len());
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{len}}}"#));
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{kind},"count":{count},"type":"{shape}"}}"#
        ));
        self.binary.extend(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.accessors.len() - 1
    }

    /// Numbers of one component.
    pub(crate) fn scalars(&mut self, values: &[f32]) -> usize {
        self.add(&le(values), 5126, "SCALAR", 1)
    }

    pub(crate) fn vec3(&mut self, values: &[[f32; 3]]) -> usize {
        self.add(&le(values.as_flattened()), 5126, "VEC3", 3)
    }

    pub(crate) fn vec4(&mut self, values: &[[f32; 4]]) -> usize {
        self.add(&le(values.as_flattened()), 5126, "VEC4", 4)
    }

    /// Matrices that move by the offsets.
    pub(crate) fn translations(&mut self, offsets: &[[f32; 3]]) -> usize {
        let matrix = |[x, y, z]: [f32; 3]| {
            le(&[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0])
        };
        let bytes: Vec<u8> = offsets.iter().copied().flat_map(matrix).collect();
        self.add(&bytes, 5126, "MAT4", 16)
    }

    /// Sets of four bytes.
    pub(crate) fn joints(&mut self, joints: &[[u8; 4]]) -> usize {
        self.add(joints.as_flattened(), 5121, "VEC4", 4)
    }

    /// `count` vectors of zeros, of which one is another.
    pub(crate) fn sparse_vec3(&mut self, count: usize, at: u8, value: [f32; 3]) -> usize {
        let (indices, values) = (self.views.len(), self.views.len() + 1);
        for bytes in [&[at, 0, 0, 0][..], &le(&value)] {
            let (offset, len) = (self.binary.len(), bytes.len());
            self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{len}}}"#));
            self.binary.extend(bytes);
        }
        self.accessors.push(format!(
            r#"{{"componentType":5126,"count":{count},"type":"VEC3","sparse":{{"count":1,
            "indices":{{"bufferView":{indices},"componentType":5121}},
            "values":{{"bufferView":{values}}}}}}}"#
        ));
        self.accessors.len() - 1
    }

    /// The file, with `rest` in the root.
    pub(crate) fn glb(&self, rest: &str) -> Vec<u8> {
        let Self { accessors, views, binary } = self;
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"accessors":[{}],"bufferViews":[{}],
            "buffers":[{{"byteLength":{}}}],{rest}}}"#,
            accessors.join(","),
            views.join(","),
            binary.len()
        );
        glb(&json, binary)
    }
}
