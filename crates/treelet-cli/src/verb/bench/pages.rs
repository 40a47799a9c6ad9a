//! Huge pages for every engine, or for none.

#[cfg(target_os = "linux")]
use std::process::Command;

use crate::ending::Failure;
use crate::session::warn;

/// The environment variable through which glibc is told to ask for huge pages.
const TUNABLES: &str = "GLIBC_TUNABLES";
/// What it is told.
const TUNABLE: &str = "glibc.malloc.hugetlb=1";

/// Starts the command anew with the tunable set, if it is not: glibc reads it only at the start.
#[cfg(target_os = "linux")]
pub(super) fn allow() -> Result<(), Failure> {
    use std::os::unix::process::CommandExt as _;
    let set = std::env::var(TUNABLES).unwrap_or_default();
    if set.contains("glibc.malloc.hugetlb") {
        return Ok(());
    }
    let set = if set.is_empty() { TUNABLE.to_owned() } else { format!("{set}:{TUNABLE}") };
    let program = std::env::current_exe()?;
    let mut words = std::env::args_os();
    words.next();
    // `exec` comes back only where it failed.
    let error = Command::new(program).args(words).env(TUNABLES, set).exec();
    Err(Failure::told(format!(
        "the command cannot start itself with {TUNABLES} set ({error}); set {TUNABLES}={TUNABLE} \
         yourself, or use --hugepages none"
    )))
}

#[cfg(not(target_os = "linux"))]
pub(super) fn allow() -> Result<(), Failure> {
    Ok(())
}

/// Forbids this program huge pages, whoever asks.
pub(super) fn forbid() {
    if !treelet_bench::crew::forbid_huge_pages() {
        warn("huge pages cannot be forbidden here; engines that ask for them may get them");
    }
}
