//! Formats that treelet knows of but does not read yet, and how to come from them to one it reads.

use crate::error::Fault;

/// A format that is named, not read.
struct Foreign {
    name: &'static str,
    extensions: &'static [&'static str],
    /// What its files start with, after white space; none if content does not tell.
    starts: &'static [&'static [u8]],
    remedy: &'static str,
}

const BLENDER: &str = "open it in Blender and export it as glTF (.glb)";

/// Sorted by what people have most.
static ALL: &[Foreign] = &[
    Foreign {
        name: "FBX",
        extensions: &["fbx"],
        starts: &[b"Kaydara FBX Binary", b"; FBX "],
        remedy: "convert it to .glb with Blender (import FBX, export glTF) or FBX2glTF",
    },
    Foreign {
        name: "USD",
        extensions: &["usd", "usda", "usdc", "usdz"],
        starts: &[b"PXR-USDC", b"#usda"],
        remedy: "convert it to .glb with Blender (import USD, export glTF)",
    },
    Foreign {
        name: "IFC",
        extensions: &["ifc", "ifczip", "ifcxml"],
        starts: &[b"ISO-10303-21"],
        remedy: "convert it with IfcOpenShell: IfcConvert model.ifc model.glb",
    },
    Foreign { name: "COLLADA", extensions: &["dae"], starts: &[b"<COLLADA"], remedy: BLENDER },
    Foreign { name: "Alembic", extensions: &["abc"], starts: &[b"Ogawa"], remedy: BLENDER },
    Foreign { name: "3DS", extensions: &["3ds"], starts: &[], remedy: BLENDER },
    Foreign {
        name: "a Blender file",
        extensions: &["blend"],
        starts: &[b"BLENDER"],
        remedy: BLENDER,
    },
    Foreign {
        name: "VRML or X3D",
        extensions: &["wrl", "x3d"],
        starts: &[b"#VRML", b"#X3D", b"<X3D"],
        remedy: BLENDER,
    },
    Foreign {
        name: "3MF",
        extensions: &["3mf"],
        starts: &[],
        remedy: "save it as .stl in the slicer or CAD program that made it",
    },
    Foreign {
        name: "a ZIP archive",
        extensions: &["zip"],
        starts: &[b"PK\x03\x04"],
        remedy: "unpack it and give the scene file in it (a .usdz or .3mf is a ZIP, too: \
                 convert it to .glb)",
    },
    Foreign {
        name: "STEP or IGES",
        extensions: &["step", "stp", "iges", "igs"],
        starts: &[],
        remedy: "export a mesh (.stl, .obj or .glb) from the CAD program, or from FreeCAD",
    },
];

/// How far into a file a start is looked for: an XML declaration may stand before it.
const SEARCHED: usize = 512;

/// The format that the content names.
pub(crate) fn by_content(bytes: &[u8]) -> Option<Fault> {
    let text = bytes.trim_ascii_start();
    let head = &text[..text.len().min(SEARCHED)];
    let is_xml = head.starts_with(b"<?xml");
    ALL.iter()
        .find(|foreign| {
            foreign.starts.iter().any(|start| {
                head.starts_with(start) || is_xml && memchr::memmem::find(head, start).is_some()
            })
        })
        .map(fault)
}

/// The format that the extension names.
pub(crate) fn by_extension(extension: &str) -> Option<Fault> {
    ALL.iter().find(|foreign| foreign.extensions.contains(&extension)).map(fault)
}

fn fault(foreign: &Foreign) -> Fault {
    Fault::unsupported(format!("is {}", foreign.name), foreign.remedy)
}
