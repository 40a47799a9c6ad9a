//! What things are made of.

use treelet_model::Material;

/// The materials, in the order of `Model::materials`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Palette {
    Meadow,
    Soil,
    PaleStone,
    DarkStone,
    Basalt,
    Rock,
    Copper,
    Gold,
    Steel,
    BluedSteel,
    Iron,
    Glass,
    Glow,
    Bark,
    PaleBark,
    Leaf,
    LeafLight,
    Amber,
    AmberLight,
    Russet,
    RussetLight,
    Needle,
    NeedleLight,
    Grass,
    GrassDry,
    PetalWhite,
    PetalRed,
    PetalViolet,
}

impl Palette {
    /// Every material, in order.
    const ALL: [Self; 28] = [
        Self::Meadow,
        Self::Soil,
        Self::PaleStone,
        Self::DarkStone,
        Self::Basalt,
        Self::Rock,
        Self::Copper,
        Self::Gold,
        Self::Steel,
        Self::BluedSteel,
        Self::Iron,
        Self::Glass,
        Self::Glow,
        Self::Bark,
        Self::PaleBark,
        Self::Leaf,
        Self::LeafLight,
        Self::Amber,
        Self::AmberLight,
        Self::Russet,
        Self::RussetLight,
        Self::Needle,
        Self::NeedleLight,
        Self::Grass,
        Self::GrassDry,
        Self::PetalWhite,
        Self::PetalRed,
        Self::PetalViolet,
    ];

    /// The material's place in the list.
    pub(super) fn index(self) -> usize {
        self as usize
    }

    /// The list.
    pub(super) fn materials() -> Vec<Material> {
        Self::ALL.iter().map(|material| material.material()).collect()
    }

    /// What the material is.
    fn material(self) -> Material {
        let (name, material) = match self {
            Self::Meadow => ("meadow", diffuse([0.17, 0.20, 0.06])),
            Self::Soil => ("soil", diffuse([0.16, 0.11, 0.07])),
            Self::PaleStone => ("pale stone", stone([0.52, 0.46, 0.38], 0.45)),
            Self::DarkStone => ("dark stone", stone([0.13, 0.125, 0.13], 0.22)),
            Self::Basalt => ("polished basalt", metal([0.12, 0.12, 0.135], 0.12)),
            Self::Rock => ("rock", diffuse([0.36, 0.34, 0.31])),
            Self::Copper => ("copper", metal([0.93, 0.42, 0.24], 0.28)),
            Self::Gold => ("gold", metal([1.0, 0.70, 0.24], 0.24)),
            Self::Steel => ("steel", metal([0.80, 0.82, 0.84], 0.05)),
            Self::BluedSteel => ("blued steel", metal([0.20, 0.27, 0.42], 0.22)),
            Self::Iron => ("iron", metal([0.18, 0.17, 0.17], 0.45)),
            Self::Glass => ("glass", glass()),
            Self::Glow => ("lantern light", glow()),
            Self::Bark => ("bark", diffuse([0.18, 0.12, 0.08])),
            Self::PaleBark => ("pale bark", diffuse([0.55, 0.50, 0.44])),
            Self::Leaf => ("leaf", diffuse([0.14, 0.27, 0.05])),
            Self::LeafLight => ("light leaf", diffuse([0.27, 0.40, 0.08])),
            Self::Amber => ("amber leaf", diffuse([0.72, 0.40, 0.05])),
            Self::AmberLight => ("light amber leaf", diffuse([0.82, 0.57, 0.10])),
            Self::Russet => ("russet leaf", diffuse([0.52, 0.12, 0.03])),
            Self::RussetLight => ("light russet leaf", diffuse([0.70, 0.24, 0.05])),
            Self::Needle => ("needle", diffuse([0.05, 0.12, 0.05])),
            Self::NeedleLight => ("light needle", diffuse([0.10, 0.20, 0.08])),
            Self::Grass => ("grass", diffuse([0.18, 0.30, 0.06])),
            Self::GrassDry => ("dry grass", diffuse([0.46, 0.38, 0.13])),
            Self::PetalWhite => ("white petal", diffuse([0.85, 0.83, 0.78])),
            Self::PetalRed => ("red petal", diffuse([0.75, 0.07, 0.04])),
            Self::PetalViolet => ("violet petal", diffuse([0.38, 0.20, 0.66])),
        };
        Material { name: name.into(), ..material }
    }
}

fn diffuse(base_color: [f32; 3]) -> Material {
    Material { base_color, ..Material::default() }
}

fn stone(base_color: [f32; 3], roughness: f32) -> Material {
    Material { base_color, roughness, ..Material::default() }
}

fn metal(base_color: [f32; 3], roughness: f32) -> Material {
    Material { base_color, metallic: 1.0, roughness, ..Material::default() }
}

fn glass() -> Material {
    Material {
        base_color: [1.0; 3],
        roughness: 0.0,
        transmission: 1.0,
        ior: 1.5,
        ..Material::default()
    }
}

fn glow() -> Material {
    Material { base_color: [0.8; 3], emission: [17.0, 8.2, 2.6], ..Material::default() }
}
