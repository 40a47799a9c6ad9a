//! One announced, timed step of a chore.

use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Numbers the steps of a chore and stops at the first that fails.
pub(crate) struct Steps {
    /// What each step that passed is called, and its seconds.
    done: Vec<(String, f64)>,
    total: usize,
    started: Instant,
}

impl Steps {
    /// A chore of `total` steps.
    pub(crate) fn new(total: usize) -> Self {
        Self { done: Vec::new(), total, started: Instant::now() }
    }

    /// Announces `title`, does `work`, says how long it took.
    pub(crate) fn run(
        &mut self,
        title: &str,
        work: impl FnOnce() -> Result<(), String>,
    ) -> Result<(), String> {
        let place = format!("[{}/{}] {title}", self.done.len() + 1, self.total);
        eprintln!("\n{place}");
        let started = Instant::now();
        let outcome = work();
        let seconds = started.elapsed().as_secs_f64();
        if let Err(reason) = outcome {
            return Err(format!("{place}: FAILED after {seconds:.1} s: {reason}"));
        }
        eprintln!("{place}: passed in {seconds:.1} s");
        self.done.push((title.to_owned(), seconds));
        Ok(())
    }

    /// How long each took, also as lines at the end of `record`; and the closing line.
    pub(crate) fn finish(self, record: &Path) {
        eprintln!();
        for (title, seconds) in &self.done {
            eprintln!("  {title:44} {seconds:>7.1} s");
        }
        if let Err(error) = append(record, &self.done) {
            eprintln!("  {}: {error}", record.display());
        }
        let seconds = self.started.elapsed().as_secs_f64();
        eprintln!("\nall {} steps passed in {seconds:.1} s", self.total);
    }
}

/// Adds a line a step: seconds since 1970 at the end of all of them, its title, its seconds.
fn append(record: &Path, steps: &[(String, f64)]) -> std::io::Result<()> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    let lines = steps.iter().fold(String::new(), |mut lines, (title, seconds)| {
        // Writing to a text does not fail.
        let _ = writeln!(lines, "{now},{title},{seconds:.1}");
        lines
    });
    let mut file = OpenOptions::new().create(true).append(true).open(record)?;
    file.write_all(lines.as_bytes())
}

/// `cargo` with some arguments, run in `root`; its output goes where ours goes.
pub(crate) fn cargo(root: &Path, arguments: &[&str]) -> Result<(), String> {
    cargo_with(root, arguments, &[])
}

/// [`cargo`] with environment variables set.
pub(crate) fn cargo_with(
    root: &Path,
    arguments: &[&str],
    variables: &[(&str, &str)],
) -> Result<(), String> {
    let mut command = cargo_command(root);
    command.args(arguments).envs(variables.iter().copied());
    let shown = format!("cargo {}", arguments.join(" "));
    let shown =
        variables.iter().fold(shown, |shown, (name, value)| format!("{name}='{value}' {shown}"));
    announced(&mut command, &shown)
}

/// Runs a command under the name that it is `shown` by.
pub(crate) fn announced(command: &mut Command, shown: &str) -> Result<(), String> {
    eprintln!("  $ {shown}");
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{shown}` ended with {status}")),
        Err(error) => Err(format!("`{shown}` could not be started: {error}")),
    }
}

/// What a command prints, without the end of the last line.
pub(crate) fn output(command: &mut Command) -> Result<String, String> {
    let name = command.get_program().display().to_string();
    let told = |what: String| format!("`{name}` {what}");
    match command.stderr(Stdio::inherit()).output() {
        Ok(output) if output.status.success() => {
            Ok(String::from_utf8_lossy(&output.stdout).trim_end().to_owned())
        }
        Ok(output) => Err(told(format!("ended with {}", output.status))),
        Err(error) => Err(told(format!("could not be started: {error}"))),
    }
}

/// Whether `cargo <subcommand> --version` works; its output is swallowed.
pub(crate) fn cargo_has(root: &Path, subcommand: &str) -> bool {
    let mut command = cargo_command(root);
    command.args([subcommand, "--version"]).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// The cargo that runs us, without what it set for us alone.
pub(crate) fn cargo_command(root: &Path) -> Command {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.current_dir(root);
    // `cargo run` tells us about xtask's own package; build scripts below must not see that.
    for (name, _) in std::env::vars_os() {
        if name.to_str().is_some_and(|name| name.starts_with("CARGO_PKG_")) {
            command.env_remove(name);
        }
    }
    command.env_remove("CARGO_MANIFEST_DIR").env_remove("CARGO_MANIFEST_PATH");
    command
}

#[cfg(test)]
mod tests {
    use super::{Steps, append};
    use std::fs;

    #[test]
    fn steps_that_passed_are_recorded_one_run_after_the_other() {
        let record = std::env::temp_dir().join(format!("xtask-steps-{}", std::process::id()));
        let mut steps = Steps::new(2);
        steps.run("first", || Ok(())).unwrap();
        let failure = steps.run("second", || Err("no".into())).unwrap_err();
        steps.finish(&record);
        append(&record, &[("later".into(), 12.34)]).unwrap();
        let text = fs::read_to_string(&record).unwrap();
        fs::remove_file(&record).unwrap();
        assert!(failure.starts_with("[2/2] second: FAILED"), "{failure}");
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(lines.len(), 2, "{text}");
        assert_eq!(lines[0][1..], ["first", "0.0"]);
        assert_eq!(lines[1][1..], ["later", "12.3"]);
    }
}
