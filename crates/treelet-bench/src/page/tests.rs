//! What must hold of every page: text from files stays text, nothing is fetched, tags are in order,
//! hidden names are hidden.

use super::{
    CurveDrawing, HeatMap, HeatMaps, LevelBox, Page, Picture, ScenePage, TreeLine, render,
};
use crate::figure::data::{Choice, Figure, Point, Window};

const SCENE: &str = "<script>alert('&\"')</script>";

fn point(scene: &str, engine: &str, variant: &str, build_s: f64, mrays_per_s: f64) -> Point {
    let triangles = Some(1000);
    Point { triangles, ..Point::of(scene, engine, variant, build_s, mrays_per_s) }
}

/// A page with something of everything; the names of `engine`'s and our variants are made up.
fn page() -> Page {
    let mut points = Vec::new();
    for scene in [SCENE, "second"] {
        points.extend([
            point(scene, "treelet", "zonk<quick>", 0.01, 1.0),
            point(scene, "treelet", "sweep-sah", 1.0, 3.0),
            point(scene, "treelet", "zonk+slow", 5.0, 4.0),
            point(scene, "rivalix", "grobnik & HIGH", 2.0, 3.5),
        ]);
    }
    let choice = Choice {
        scene: SCENE.into(),
        kind: "diffuse".into(),
        rays: 1_000_000,
        variant: "zonk<quick>".into(),
        predicted_s: Some(1.1),
        measured_s: 1.2,
        best_variant: "zonk+slow".into(),
        best_s: 1.0,
        threads: 1,
        reason: String::new(),
    };
    let picture = || Picture { png: vec![1, 2, 3], width: 4, height: 2 };
    let map = HeatMap { variant: "zonk+slow".into(), mean: 1.0, max: 2, picture: picture() };
    let drawn = ScenePage {
        scene: SCENE.into(),
        triangles: 1000,
        look: Some(picture()),
        heat: Some(HeatMaps { maps: vec![map], end: 2, ramp: vec![[0; 3], [255; 3]] }),
        curve: Some(CurveDrawing {
            axes: ['x', 'z'],
            extent: [2.0, 1.0],
            path: vec![[0.0, 0.0], [1.0, 1.0]],
            of: 1000,
            boxes: vec![LevelBox { level: 1, lo: [0.0; 2], hi: [0.5, 1.0] }],
        }),
        trees: vec![TreeLine { variant: "zonk+slow".into(), nodes: 7, ..TreeLine::default() }],
    };
    let window = Window {
        scene: SCENE.into(),
        kind: "diffuse".into(),
        threads: 1,
        variant: "zonk+slow".into(),
        from: Some(7e6),
        to: None,
    };
    Page {
        figure: Figure {
            points,
            auto: vec![choice.clone()],
            windows: vec![window],
            choices: vec![choice],
            ..Figure::default()
        },
        scenes: vec![drawn],
        facts: vec![("note <b>".into(), "of rivalix & co".into())],
        commands: vec!["treelet bench --against rivalix --builders 'ZONK<quick>' <x>".into()],
        entrants: vec!["rivalix.json".into()],
        anonymous: false,
    }
}

#[test]
fn text_from_files_stays_text() {
    let html = render(&page());
    for (raw, escaped) in [
        (SCENE, "&lt;script&gt;alert('&amp;&quot;')&lt;/script&gt;"),
        ("zonk<quick>", "zonk&lt;quick&gt;"),
        ("grobnik & HIGH", "grobnik &amp; HIGH"),
        ("note <b>", "note &lt;b&gt;"),
        ("<x>", "&lt;x&gt;"),
    ] {
        assert!(!html.contains(raw), "{raw} stands there raw");
        assert!(html.contains(escaped), "{escaped} is not there");
    }
    // One script, ours.
    assert_eq!(html.matches("<script").count(), 1);
}

#[test]
fn nothing_is_fetched() {
    let html = render(&page()).to_lowercase();
    for address in attributes(&html, &["src", "href", "srcset", "action", "data", "poster"]) {
        assert!(
            address.starts_with('#') || address.starts_with("data:image/png;base64,"),
            "{address}"
        );
    }
    for word in
        ["http:", "https:", "@import", "url(", "fetch(", "xmlhttp", "import(", "<link", "<base"]
    {
        assert!(!html.contains(word), "{word}");
    }
    assert!(html.contains("data:image/png;base64,aqid"));
}

/// The values of some attributes.
fn attributes<'a>(html: &'a str, names: &[&str]) -> Vec<&'a str> {
    let mut values = Vec::new();
    for name in names {
        let pattern = format!(" {name}=\"");
        values
            .extend(html.split(pattern.as_str()).skip(1).filter_map(|rest| rest.split('"').next()));
    }
    values
}

/// Tags that are never closed.
const VOID: [&str; 3] = ["meta", "img", "!doctype"];

#[test]
fn tags_are_closed_in_order_and_names_are_unique() {
    let html = render(&page());
    // The insides of style and script are not tags.
    let mut open: Vec<&str> = Vec::new();
    let mut rest = html.as_str();
    while let Some((_, tag)) = rest.split_once('<') {
        let (tag, after) = tag.split_once('>').expect("a tag ends");
        let name = tag.split_whitespace().next().unwrap_or_default();
        rest = after;
        if let Some(name) = name.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "before {:.80}", rest);
        } else if !VOID.contains(&name.to_lowercase().as_str()) {
            open.push(name);
            if name == "style" || name == "script" {
                rest = &rest[rest.find(&format!("</{name}")).expect("it ends")..];
            }
        }
    }
    assert!(open.is_empty(), "{open:?}");
    let mut ids = attributes(&html, &["id"]);
    let all = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), all, "{ids:?}");
    for link in attributes(&html, &["href"]) {
        assert!(ids.contains(&&link[1..]), "{link} leads nowhere");
    }
    for words in attributes(&html, &["aria-labelledby"]) {
        assert!(words.split(' ').all(|id| ids.contains(&id)), "{words} is nobody's");
    }
}

#[test]
fn every_table_says_what_it_is_and_every_picture_what_it_shows() {
    let html = render(&page());
    assert_eq!(html.matches("<table").count(), html.matches("<caption").count());
    for table in html.split("<table").skip(1) {
        let table = table.split("</table>").next().unwrap_or_default();
        assert!(!table.contains("<th>") && table.contains("scope=\"row\""), "{table:.200}");
    }
    assert_eq!(html.matches("<img").count(), html.matches(" alt=\"").count());
    assert_eq!(html.matches("<svg").count(), {
        html.matches("role=\"img\" aria-labelledby").count()
            + html.matches("preserveAspectRatio=\"none\" aria-hidden=\"true\"").count()
    });
}

#[test]
fn hidden_names_are_nowhere() {
    let hidden = render(&Page { anonymous: true, ..page() }).to_lowercase();
    for name in ["treelet", "rivalix", "zonk", "grobnik", "sweep-sah", "embree"] {
        assert!(!hidden.contains(name), "{name}: {:.300}", &hidden[hidden.find(name).unwrap()..]);
    }
    // The same letter everywhere: the engine of the command line is that of the points.
    let names = super::Names::new(&Page { anonymous: true, ..page() });
    let rival = names.engine("rivalix");
    let expected = format!("--against {rival} --builders '{}'", names.ours("zonk<quick>"));
    assert_eq!(
        names.text("--against rivalix --builders 'ZONK<quick>'"),
        expected,
        "letters differ from place to place"
    );
    assert!(names.full("rivalix", "grobnik & HIGH").starts_with(&rival));
    // Without hiding, they are there.
    let shown = render(&page());
    assert!(["treelet", "rivalix", "zonk+slow"].iter().all(|name| shown.contains(name)));
}

#[test]
fn a_page_of_nothing_is_a_page() {
    let html = render(&Page::default());
    assert!(html.ends_with("</html>") && html.contains("no scenes"));
}

#[test]
fn the_same_data_give_the_same_page() {
    assert_eq!(render(&page()), render(&page()));
}
