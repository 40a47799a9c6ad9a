//! Packed buffer views, made by an encoder of our own that uses every kind of group and code.

mod common;

use common::packing::{EXT, KHR, attributes, packed, sequence};
use common::{SQUARE, check_error, le, model, read, soup};

/// Positions that use every kind of group: small steps, large ones, none.
fn positions() -> Vec<[f32; 3]> {
    (0..700_u32)
        .map(|i| {
            let wild = if i % 50 < 3 { (i * i) as f32 * 0.37 } else { 0.0 };
            [i as f32, (i / 200) as f32, wild]
        })
        .collect()
}

#[test]
fn floats_and_indices_come_back() {
    let positions = positions();
    let elements = le(positions.as_flattened());
    let indices: Vec<u32> = (0..1500).map(|i| (i * 7919) % 700).collect();
    let packed_indices = sequence(&indices);
    let want: Vec<_> =
        indices.chunks(3).map(|t| [t[0], t[1], t[2]].map(|i| positions[i as usize])).collect();
    let variants: [(&str, Option<&[u8]>); 4] = [
        (EXT, None),
        (KHR, Some(&[0, 0, 0])),
        (KHR, Some(&[1, 1, 1])),
        (KHR, Some(&[2, 0x52, 0xf2])),
    ];
    for (name, channels) in variants {
        let stream = attributes(&elements, 12, channels);
        assert!(stream.len() < elements.len(), "{channels:?} packs nothing");
        let bytes = packed(
            name,
            [
                ("ATTRIBUTES", "NONE", 12, 700, &stream),
                ("INDICES", "NONE", 4, 1500, &packed_indices),
            ],
            r#""componentType":5126,"count":700"#,
            (5125, 1500),
        );
        assert_eq!(soup(&model("a.glb", bytes)), want, "{name} {channels:?}");
    }
}

#[test]
fn triangles_by_every_code() {
    // Codes: a new triangle by the table, one on its newest edge with a new vertex, one with a
    // vertex of the list, free indices, neighbours of the last free one, and a restart.
    let data = [0x00_u8, 0xff, 20, 2, 3, 100];
    let codes = [
        0xf0_u8, // 0 1 2: all new, by the first entry of the table.
        0x00,    // On the newest edge [0, 2], with the new vertex 3.
        0x13,    // On the second newest edge, with a vertex used before.
        0xfe,    // Restart: 0 1 2 again.
        0xff,    // Three given ones: 10, 11, 9.
        0x0f,    // On the newest edge, with a given one: 59.
        0x0e,    // With the one after the last given: 60.
        0x0d,    // With the one before: 59.
    ];
    let mut stream = vec![0xe1];
    stream.extend(codes);
    stream.extend(data);
    stream.extend([0; 16]);
    let bytes = packed(
        EXT,
        [
            ("ATTRIBUTES", "NONE", 12, 100, &attributes(&le(&[1.0; 300]), 12, None)),
            ("TRIANGLES", "NONE", 2, 24, &stream),
        ],
        r#""componentType":5126,"count":100"#,
        (5123, 24),
    );
    let got = model("a.glb", bytes);
    let triangles = got.objects[0].parts[0].mesh.triangles().to_vec();
    let want = [
        [0, 1, 2],
        [0, 2, 3],
        [3, 2, 0],
        [0, 1, 2],
        [10, 11, 9],
        [10, 9, 59],
        [10, 59, 60],
        [10, 60, 59],
    ];
    assert_eq!(triangles, want);
}

#[test]
fn filters_are_undone() {
    // Exponential: 3 * 2^-1, -5 * 2^2, 7.
    let word = |mantissa: i32, exponent: i32| (exponent << 24 | mantissa & 0xff_ffff).to_le_bytes();
    let element = [word(3, -1), word(-5, 2), word(7, 0)].concat();
    let elements = [&element[..], &element, &element].concat();
    let index = sequence(&[0, 1, 2]);
    let bytes = packed(
        EXT,
        [
            ("ATTRIBUTES", "EXPONENTIAL", 12, 3, &attributes(&elements, 12, None)),
            ("INDICES", "NONE", 4, 3, &index),
        ],
        r#""componentType":5126,"count":3"#,
        (5125, 3),
    );
    assert_eq!(soup(&model("a.glb", bytes)), [[[1.5, -20.0, 7.0]; 3]]);

    // Octahedral, as 8 and as 16 bits: +z, then -z folded out, then +x.
    let small: [[i8; 4]; 3] = [[0, 0, 127, 1], [127, 127, 127, 1], [127, 0, 127, 1]];
    let elements: Vec<u8> = small.as_flattened().iter().map(|&x| x as u8).collect();
    let bytes = packed(
        EXT,
        [
            ("ATTRIBUTES", "OCTAHEDRAL", 4, 3, &attributes(&elements, 4, None)),
            ("INDICES", "NONE", 4, 3, &index),
        ],
        r#""componentType":5120,"normalized":true,"count":3"#,
        (5125, 3),
    );
    let want = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]];
    assert_eq!(soup(&model("a.glb", bytes)), [want]);

    // A quaternion with three equal components of 0 and the fourth missing: 0 0 0 1, times 32767.
    let elements: Vec<u8> = [[0_i16, 0, 0, 0x7ffc + 3]; 3]
        .as_flattened()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let bytes = packed(
        KHR,
        [
            ("ATTRIBUTES", "QUATERNION", 8, 3, &attributes(&elements, 8, Some(&[0, 1]))),
            ("INDICES", "NONE", 2, 3, &index),
        ],
        r#""componentType":5122,"normalized":true,"count":3"#,
        (5123, 3),
    );
    assert_eq!(soup(&model("a.glb", bytes)), [[[0.0; 3]; 3]]);

    // Colour: luma 64 of 127 with no difference is grey, under an opacity of seven bits.
    let elements = [64, 0, 0, 0x7f].repeat(3);
    let bytes = packed(
        KHR,
        [
            ("ATTRIBUTES", "COLOR", 4, 3, &attributes(&elements, 4, Some(&[0]))),
            ("INDICES", "NONE", 4, 3, &index),
        ],
        r#""componentType":5121,"count":3"#,
        (5125, 3),
    );
    assert_eq!(soup(&model("a.glb", bytes)), [[[129.0; 3]; 3]]);
}

#[test]
fn broken_streams_are_named() {
    let elements = le(SQUARE.as_flattened());
    let sound = attributes(&elements, 12, None);
    let index = sequence(&[0, 1, 2]);
    let file = |stream: &[u8], mode: &str, filter: &str, stride: usize| {
        packed(
            EXT,
            [(mode, filter, stride, 4, stream), ("INDICES", "NONE", 4, 3, &index)],
            r#""componentType":5126,"count":4"#,
            (5125, 3),
        )
    };
    assert!(read("a.glb", file(&sound, "ATTRIBUTES", "NONE", 12)).is_ok());
    let at = "bufferView 0: is packed in a meshopt stream that ";
    let mut longer = sound.clone();
    longer.insert(1, 0);
    let mut wrong = sound.clone();
    wrong[0] = 0xb0;
    let table: [(&[u8], &str, &str, usize, &str); 8] = [
        (&sound[..sound.len() - 40], "ATTRIBUTES", "NONE", 12, "ends too early"),
        (&[], "ATTRIBUTES", "NONE", 12, "ends too early"),
        (&longer, "ATTRIBUTES", "NONE", 12, "has "),
        (&wrong, "ATTRIBUTES", "NONE", 12, "starts with 0xb0"),
        (&sound, "ATTRIBUTES", "OCTAHEDRAL", 12, "has a stride of 12 for filter OCTAHEDRAL"),
        (&sound, "ATTRIBUTES", "BLUR", 12, "has the filter \"BLUR\""),
        (&sound, "POINTS", "NONE", 12, "has the mode \"POINTS\""),
        (&sound, "TRIANGLES", "NONE", 4, "has 4 indices, which are no triangles"),
    ];
    for (stream, mode, filter, stride, want) in table {
        check_error("a.glb", file(stream, mode, filter, stride), &format!("{at}{want}"));
    }
}
