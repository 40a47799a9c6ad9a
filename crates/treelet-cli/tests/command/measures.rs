//! `inspect --metrics` and `--bounds`: what trees and volumes are worth.

use serde_json::Value;

use crate::kit::{Folder, SCENE};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

#[test]
fn every_tree_is_measured_and_the_catalogues_say_which() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let json = folder.run("inspect scene.obj --metrics --json").ends(0).json("inspect");
    let trees = json["scenes"][0]["trees"].as_array().unwrap();
    let builders = treelet::build::ALL.iter().map(|builder| builder.info().name);
    let levels = treelet::Quality::ALL.map(treelet::Quality::name);
    let expected: Vec<_> = builders.chain(levels).collect();
    let names: Vec<_> = trees.iter().map(|tree| tree["variant"].as_str().unwrap()).collect();
    assert_eq!(names, expected);
    for tree in trees {
        assert!(number(&tree["sah"]) >= 1.0 && number(&tree["leaves"]) > 0.0, "{tree}");
        assert!(number(&tree["epo"]) >= 0.0 && number(&tree["lcv"]) >= 0.0, "{tree}");
        assert_eq!(number(&tree["epo_error"]), 0.0, "a small scene is measured exactly: {tree}");
    }
    assert_eq!(json["fits"], serde_json::json!([]));
    folder.run("inspect scene.obj scene.obj").ends(2);
    folder.run("inspect scene.obj --trace-time").ends(2);
    folder.run("inspect scene.obj --metrics --builders nobody").ends(2);
}

#[test]
fn times_are_fitted_drawn_and_taken_from_earlier_runs() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    // More trees than a model has weights, or what is left out of a fit is not determined.
    let trees = "--builders lbvh,object-median,binned-sah,sweep-sah,hploc,ploc,spatial-median";
    let first = folder.run(&format!(
        "inspect scene.obj --metrics --trace-time {trees} --seconds 0 --threads 1 --json"
    ));
    let json = first.ends(0).json("inspect");
    let times = json["scenes"][0]["trees"][0]["times"].as_array().unwrap();
    assert_eq!(times.len(), 3);
    assert!(times.iter().all(|times| number(&times["nanoseconds"]) > 0.0), "{times:?}");
    // Three models for each kind of ray.
    assert_eq!(json["fits"].as_array().unwrap().len(), 9);

    folder.write("first.json", &json.to_string());
    let line = "inspect --metrics --trace-time --earlier first.json --plot out.svg --json";
    let again = folder.run(line).ends(0).json("inspect");
    // Numbers go through text, and lose a last bit there.
    let (fits, earlier) = (again["fits"].as_array().unwrap(), json["fits"].as_array().unwrap());
    assert_eq!(fits.len(), earlier.len());
    for (fit, earlier) in fits.iter().zip(earlier) {
        assert_eq!((&fit["model"], &fit["kind"]), (&earlier["model"], &earlier["kind"]));
        let (error, expected) = (number(&fit["error"]), number(&earlier["error"]));
        assert!((error - expected).abs() < 1e-6, "{fit} {earlier}");
    }
    let svg = String::from_utf8(folder.read("out.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.matches("<title>").count() == 63, "{svg}");
    folder.write("wrong.json", "{}");
    let wrong = folder.run("inspect --metrics --trace-time --earlier wrong.json").ends(1);
    assert!(wrong.stderr.contains("wrong.json"), "{}", wrong.stderr);
}

#[test]
fn volumes_are_compared() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let json = folder.run("inspect scene.obj --bounds --json").ends(0).json("inspect");
    let volumes = json["bounds"].as_array().unwrap();
    let names: Vec<_> = volumes.iter().map(|v| v["volume"].as_str().unwrap()).collect();
    assert_eq!(names, ["aabb", "sphere", "obb", "14-dop", "18-dop", "26-dop"]);
    for volume in volumes {
        for nodes in ["leaves", "inner"] {
            let area = number(&volume[nodes]["area"]);
            let most = if volume["volume"] == "sphere" { 20.0 } else { 1.001 };
            assert!((0.0..=most).contains(&area), "{volume}");
            assert!((0.0..1.0).contains(&number(&volume[nodes]["false_positives"])), "{volume}");
        }
        assert!(number(&volume["walk"]["volumes"]) >= 1.0, "{volume}");
    }
    assert_eq!(number(&volumes[0]["leaves"]["area"]), 1.0);
    folder.run("inspect scene.obj --bounds --metrics").ends(2);
}
