use super::machines::{MACHINES, Need};
use super::{is_there, missing};

#[test]
fn what_is_missing_is_named() {
    let there = |file| is_there(&Need { file, package: "" });
    assert!(there("/") && there("sh"));
    assert!(!there("/no/such/file") && !there("no-such-program"));
    for machine in MACHINES {
        let needs = machine.needs.iter();
        let lacking: Vec<&str> =
            needs.filter(|need| !is_there(need)).map(|need| need.package).collect();
        let told = missing(machine).unwrap_or_default();
        assert!(lacking.iter().all(|package| told.contains(package)), "{told}");
    }
}
