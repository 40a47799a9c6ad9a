//! `bench`: a small one from end to end. Nothing here needs a rival.

use crate::kit::{Folder, SCENE};

const QUICK: &str = "--rays 1000 --rounds 1 --seconds 0 --threads 1";

#[test]
fn a_small_bench_has_the_promised_form() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = format!("bench scene.obj fractal-terrain:500 {QUICK} --json --slice 64,1000");
    let run = folder.run(&line).ends(0);
    assert!(run.stderr.contains("as by brute force"), "{}", run.stderr);
    let json = run.json("bench");
    assert!(json["machine"]["processor"].is_string());

    let builds = json["builds"].as_array().unwrap();
    let mut variants: Vec<_> = builds.iter().map(|build| build["variant"].clone()).collect();
    variants.retain(|variant| !variant.as_str().unwrap().contains("compact"));
    assert_eq!(variants, ["fast", "default", "best"].repeat(2));
    let variants = builds.len() / 2;
    for build in builds {
        assert_eq!(build["engine"], "treelet");
        assert_eq!(build["threads"], 1);
        let triangles = if build["scene"] == "scene" { 6 } else { 512 };
        assert_eq!(build["triangles"], triangles);
        for field in ["mtris_per_s", "bytes_per_tri"] {
            assert!(build[field].as_f64().unwrap() > 0.0, "{field}: {build}");
        }
        let peak = &build["peak_bytes_per_tri"];
        assert!(cfg!(not(target_os = "linux")) || peak.is_number(), "{build}");
    }

    let traces = json["traces"].as_array().unwrap();
    // Five kinds: one ray a call for all, the library's own loop for the default build, two lengths
    // of slices for the best; of that, the longer one and one ray a call shuffled too.
    assert_eq!(traces.len(), 2 * 5 * (variants + 1 + 2 + 2));
    for trace in traces {
        for field in ["scene", "engine", "variant", "kind"] {
            assert!(trace[field].is_string(), "{field}: {trace}");
        }
        assert_eq!((&trace["rays"], &trace["threads"]), (&1000.into(), &1.into()));
        let width = if trace["api"] == "one" { vec![1] } else { vec![32, 64, 1000] };
        assert!(width.contains(&trace["width"].as_u64().unwrap()), "{trace}");
        assert!(trace["mrays_per_s"].as_f64().unwrap() > 0.0, "{trace}");
        assert_eq!(trace["mismatch_ppm"], 0.0);
        let ids = &trace["ids_ppm"];
        let any = trace["kind"] == "occlusion" || trace["kind"] == "shadow";
        assert!(if any { ids.is_null() } else { *ids == 0.0 }, "{trace}");
    }
}

#[test]
fn a_missing_rival_is_a_line_and_no_failure() {
    let folder = Folder::new();
    let line = format!(
        "bench soup:50 {QUICK} --json --kinds random --builders binned-sah \
        --against embree --embree nowhere/libembree4.so"
    );
    let run = folder.run(&line).ends(0);
    assert!(run.stderr.contains("embree is left out"), "{}", run.stderr);
    assert!(run.stderr.contains("cargo xtask rivals"), "{}", run.stderr);
    let json = run.json("bench");
    assert_eq!(json["missing"][0]["name"], "embree");
    assert_eq!(json["engines"].as_array().unwrap().len(), 1);
    let standings: Vec<_> =
        json["marks"].as_array().unwrap().iter().map(|mark| mark["standing"].clone()).collect();
    assert!(standings.contains(&"not_measured".into()));
}

#[test]
fn what_cannot_be_measured_is_said() {
    let folder = Folder::new();
    folder.write("empty.obj", "v 0 0 0\n");
    for (line, code, word) in [
        ("bench soup:x", 2, "soup:4M"),
        ("bench soup:1", 2, "soup:4M"),
        ("bench", 2, "SCENE"),
        ("bench soup:9 --kinds sideways", 2, "occlusion"),
        ("bench soup:9 --against rtx", 2, "embree"),
        ("bench soup:9 --threads 300 --rays 9", 1, "--threads"),
        ("inspect empty.obj --threads 1,2", 2, "only `bench`"),
        ("bench empty.obj", 1, "another scene"),
    ] {
        let run = folder.run(line).ends(code);
        assert!(run.stderr.contains(word), "{line}: {}", run.stderr);
    }
}
