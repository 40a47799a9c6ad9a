//! `bench --figure`: a tiny one from end to end, stopped and resumed. Nothing here needs a rival.

use serde_json::Value;

use crate::kit::Folder;

/// A figure of three builders over some 500 triangles.
const TINY: &str = "bench fractal-terrain:500 --figure --quick --rays 2000 --rounds 1 --seconds 0 --json \
                    --builders lbvh,sweep-sah,presplit+trbvh";

/// The fields of an object that the promised form names, in its order.
fn has(object: &Value, numbers: &[&str], words: &[&str]) {
    for field in numbers {
        assert!(object[field].as_f64().is_some_and(|it| it > 0.0), "{field}: {object}");
    }
    for field in words {
        assert!(object[field].is_string(), "{field}: {object}");
    }
}

#[test]
fn a_figure_has_the_promised_form() {
    let folder = Folder::new();
    let run = folder.run(&format!("{TINY} --kinds primary --plot figure.svg")).ends(0);
    let json = run.json("bench");
    let points = json["points"].as_array().unwrap();
    assert_eq!(points.len(), 3);
    for point in points {
        let numbers = ["threads", "build_s", "mrays_per_s", "sah", "lcv"];
        has(point, &numbers, &["scene", "engine", "variant", "kind"]);
        // Boxes of a hill may overlap nowhere.
        assert!(point["epo"].as_f64().is_some_and(|epo| epo >= 0.0), "{point}");
        assert_eq!((&point["threads"], &point["mismatch_ppm"]), (&1.into(), &0.0.into()));
    }
    let choices = json["choices"].as_array().unwrap();
    // A decade apart.
    assert_eq!(choices.len(), 8);
    for choice in choices {
        let numbers = ["rays", "predicted_s", "measured_s", "best_s"];
        has(choice, &numbers, &["scene", "kind", "variant", "best_variant", "reason"]);
        // Each total is at least the rays over the fastest speed.
        let of_kind = points.iter().filter(|point| point["kind"] == choice["kind"]);
        let fastest = of_kind.map(|it| it["mrays_per_s"].as_f64().unwrap()).fold(0.0, f64::max);
        let rays = choice["rays"].as_f64().unwrap();
        assert!(choice["best_s"].as_f64().unwrap() > rays / fastest * 1e-6, "{choice}");
    }
    let auto = json["auto"].as_array().unwrap();
    // A thousand times the rays that are timed are enough.
    assert_eq!(auto.len(), 2);
    auto.iter().for_each(|it| has(it, &["rays", "measured_s", "best_s"], &["best_variant"]));
    assert_eq!(json["windows"].as_array().unwrap().len(), 1, "presplit+trbvh");
    assert!(run.stderr.contains("among the paper's builders"), "{}", run.stderr);
    assert!(run.stderr.contains("no scene of at least 80,000 triangles"), "{}", run.stderr);

    let svg = String::from_utf8(folder.read("figure.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    assert_eq!(svg.matches("<polyline").count(), 3, "{svg}");
}

#[test]
fn a_run_goes_on_where_one_stopped() {
    let folder = Folder::new();
    let line = format!("{TINY} --kinds primary --resume state.jsonl");
    let whole = folder.run(&line).ends(0).json("bench");
    let text = String::from_utf8(folder.read("state.jsonl")).unwrap();
    // Settings, scene, three builds, traces and choices.
    assert_eq!(text.lines().count(), 1 + 1 + 3 + 2, "{text}");

    // Nothing is measured again: the very same numbers. What is not of this run is left alone.
    let again = folder.run(&line).ends(0);
    assert!(again.stderr.contains("going on after 6 pieces"), "{}", again.stderr);
    assert_eq!(again.json("bench")["points"], whole["points"]);
    for (other, code, word) in [
        (line.replace("--rays 2000", "--rays 2001"), 1, "rays 2000, this run has 2001"),
        (line.replace("lbvh,", ""), 1, "builders"),
        (line.replace("--figure --quick", "--quick"), 2, "--figure"),
        (
            line.replace("fractal-terrain:500", "fractal-terrain:500 fractal-terrain:500"),
            2,
            "two scenes are named",
        ),
    ] {
        let run = folder.run(&other).ends(code);
        assert!(run.stderr.contains(word), "{other}: {}", run.stderr);
        assert!(folder.read("state.jsonl") == text.as_bytes(), "{other}");
    }
}
