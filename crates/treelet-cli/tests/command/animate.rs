//! `bench --animate`: a small clip from end to end.

use crate::kit::Folder;

/// Two triangles, the second of which a clip carries away.
const GLTF: &str = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0,1]}],
"nodes":[{"mesh":0},{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
"animations":[{"name":"away","samplers":[{"input":1,"output":2}],
"channels":[{"sampler":0,"target":{"node":1,"path":"translation"}}]}],
"accessors":[
{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR","min":[0],"max":[2]},
{"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},
{"buffer":0,"byteOffset":44,"byteLength":24}],
"buffers":[{"byteLength":68,"uri":"clip.bin"}]}"#;

fn clip(folder: &Folder) {
    let numbers =
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 1.0];
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    std::fs::write(folder.path("clip.bin"), bytes).unwrap();
    folder.write("clip.gltf", GLTF);
}

#[test]
fn every_way_keeps_up_with_a_clip() {
    let folder = Folder::new();
    clip(&folder);
    let line =
        "bench clip.gltf --animate 5 --rays 500 --rounds 1 --threads 1 --plot clip.svg --json";
    let json = folder.run(line).ends(0).json("bench");
    let clip = &json["clips"][0];
    assert_eq!((&clip["clip"], &clip["seconds"]), (&"1 away".into(), &2.0.into()));
    assert_eq!((&clip["instances"], &clip["triangles"]), (&2.into(), &1.into()));
    let sums = clip["sums"].as_array().unwrap();
    let ways: Vec<_> = sums.iter().map(|sum| sum["way"].as_str().unwrap()).collect();
    assert_eq!(ways, ["rebuild only", "refit only", "auto", "rays"]);
    let moments = clip["play"]["moments"].as_array().unwrap();
    assert_eq!(moments.len(), 5 * 4);
    for moment in moments {
        let did = match (moment["frame"].as_u64(), moment["way"].as_u64()) {
            (Some(0), _) => "built",
            (_, Some(0)) => "rebuilt",
            (_, Some(1)) => "refitted",
            _ => continue,
        };
        assert_eq!(moment["did"], did, "{moment}");
        assert!(moment["trace"].as_f64().unwrap() > 0.0, "{moment}");
    }
    let svg = std::fs::read_to_string(folder.path("clip.svg")).unwrap();
    assert_eq!(svg.matches("<polyline").count(), 8);
    assert!(svg.contains("refit only") && svg.ends_with("</svg>\n"));
}

#[test]
fn what_cannot_be_played_is_said() {
    let folder = Folder::new();
    clip(&folder);
    folder.write("still.obj", crate::kit::SCENE);
    for (line, word) in [
        ("bench still.obj --animate", "nothing in the scene moves"),
        ("bench clip.gltf --animate 3 --clip back", "1 away"),
        ("bench clip.gltf clip.gltf --animate 3 --plot a.svg", "one scene"),
        ("bench clip.gltf --clip away", "--animate"),
        ("bench soup:9 --plot a.svg", "--animate"),
    ] {
        let run = folder.run(line).ends(2);
        assert!(run.stderr.contains(word), "{line}: {}", run.stderr);
    }
}
