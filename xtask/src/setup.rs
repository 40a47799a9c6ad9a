//! What the checks need beyond the compiler: the `rustfmt` and `clippy` components. Missing ones
//! are added where `rustup` manages the toolchain; elsewhere the error says how to get them.

use std::path::Path;
use std::process::Command;

use crate::step::cargo_has;

/// Component and the cargo subcommand that shows it is there.
const COMPONENTS: &[(&str, &str)] = &[("rustfmt", "fmt"), ("clippy", "clippy")];

/// Makes every component available, or says how to.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    for &(component, subcommand) in COMPONENTS {
        if cargo_has(root, subcommand) {
            eprintln!("  {component}: present");
            continue;
        }
        eprintln!("  {component}: missing; trying `rustup component add {component}`");
        let added = Command::new("rustup").args(["component", "add", component]).status();
        let added = added.is_ok_and(|status| status.success());
        if !added || !cargo_has(root, subcommand) {
            return Err(format!(
                "the component `{component}` is missing; run `rustup component add {component}`, \
                 or install your distribution's package of that name"
            ));
        }
    }
    Ok(())
}
