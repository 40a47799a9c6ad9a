//! `bench --report`: the page, of entrants' files and of a tiny figure.

use crate::kit::{Folder, exists};

/// An entrant of one point.
fn entrant(engine: &str, build_s: &str) -> String {
    format!(
        r#"{{"schema":1,"points":[{{"scene":"hall <b>","engine":"{engine}","variant":"v","kind":"diffuse",
        "threads":1,"build_s":{build_s},"mrays_per_s":2.5,"sah":null,"epo":null,"lcv":null}}]}}"#
    )
}

#[test]
fn a_page_of_entrants_needs_no_scene() {
    let folder = Folder::new();
    folder.write("one.json", &entrant("swift", "0.5"));
    folder.write("two.json", &entrant("swift", "0.7"));
    let run = folder.run("bench --report page.html --entrant one.json,two.json --json").ends(0);
    assert!(run.json("bench")["report"].as_str().unwrap().ends_with("page.html"));
    let page = String::from_utf8(folder.read("page.html")).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"));
    assert!(page.contains("hall &lt;b&gt;") && !page.contains("hall <b>"));
    // The same engine from two files is told apart; the command line is there.
    assert!(page.contains("swift@two") && page.contains("--entrant one.json,two.json"));
    assert_eq!(folder.files(), ["one.json", "page.html", "two.json"]);

    folder.run("bench --report page.html --entrant one.json --anonymous").ends(0);
    let page = String::from_utf8(folder.read("page.html")).unwrap();
    assert!(!page.contains("swift") && !page.to_lowercase().contains("treelet"));
}

#[test]
fn a_figure_becomes_a_page_with_its_pictures() {
    let folder = Folder::new();
    let line = "bench soup:2000 --figure --quick --rays 2000 --rounds 1 --seconds 0 --kinds diffuse \
                --builders lbvh,sweep-sah --report page.html";
    folder.run(line).ends(0);
    let page = String::from_utf8(folder.read("page.html")).unwrap();
    // The scene, and three heat maps.
    assert_eq!(page.matches("src=\"data:image/png;base64,iVBORw0KGgo").count(), 4);
    assert_eq!(page.matches("class=\"chart\"").count(), 2, "both forms of one kind");
    // The first levels of a tree over a soup are full.
    assert_eq!(page.matches("class=\"level l").count(), 2 + 4 + 8 + 16);
    for words in ["2,000 triangles", "sweep-sah", "lbvh", "--builders lbvh,sweep-sah", "regret"] {
        assert!(page.contains(words), "{words}");
    }
    let run = folder.run("bench soup:300 --report other.html").ends(2);
    assert!(run.stderr.contains("add --figure"), "{}", run.stderr);
}

#[test]
fn wrong_entrants_are_told_by_file_and_field_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("wrong.json", &entrant("swift", "\"soon\""));
    folder.write("text.json", "hello");
    for (file, expected) in [
        ("wrong.json", "wrong.json: points[0].build_s is \"soon\"; it must be a number"),
        ("text.json", "text.json: is not JSON"),
        ("none.json", "none.json: cannot be read"),
    ] {
        let run = folder.run(&format!("bench --report page.html --entrant {file}")).ends(1);
        assert!(run.stderr.contains(expected), "{}", run.stderr);
        assert!(!exists(&folder.path("page.html")));
    }
    let run = folder.run("bench --report wrong.json --entrant wrong.json").ends(2);
    assert!(run.stderr.contains("would be written over"), "{}", run.stderr);
    let run = folder.run("bench --entrant wrong.json").ends(2);
    assert!(run.stderr.contains("--report"), "{}", run.stderr);
    folder.run("bench --report page.html").ends(2);
}
