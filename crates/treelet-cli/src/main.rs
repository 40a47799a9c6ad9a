//! x
mod demo;
fn main() {
    let t = std::time::Instant::now();
    let m = demo::demo();
    eprintln!(
        "{:?} stored {} placed {} placements {} {}",
        t.elapsed(),
        m.triangles_stored(),
        m.triangles_placed(),
        m.placements.len(),
        m.objects.len()
    );
    for o in &m.objects {
        eprintln!("{} {}", o.name, o.triangles());
    }
}
