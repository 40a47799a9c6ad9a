//! One run of the command: threads, cancelling, the report on stdout, words on stderr.

use std::ffi::OsString;
use std::fmt;
use std::io::{ErrorKind, Write as _};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use anstyle::{AnsiColor, Style};
use serde::Serialize;
use treelet::Cancel;

use crate::arguments::Arguments;
use crate::ending::{CANCELLED, ERROR, Ending, Failure};
use crate::{output, verb};

/// The version of the JSON reports' form; it rises when a field changes its meaning or vanishes.
pub(crate) const SCHEMA: u32 = 1;

/// What every verb is given.
pub(crate) struct Session {
    /// Raised by the first Ctrl-C.
    pub(crate) cancel: Cancel,
    /// Threads at work.
    pub(crate) threads: usize,
    /// The numbers of threads that somebody asked for, one after the other; perhaps none.
    pub(crate) threads_asked: Vec<usize>,
}

/// What a verb has to report, and how it ended.
pub(crate) struct Outcome {
    /// The object for stdout, as text.
    pub(crate) json: String,
    /// What stdout gets without --json.
    pub(crate) text: Option<String>,
    pub(crate) ending: Ending,
}

/// A report with what all of them have.
#[derive(Serialize)]
struct Envelope<'a, T> {
    schema: u32,
    /// Null where the command line names none.
    verb: Option<&'a str>,
    #[serde(flatten)]
    body: &'a T,
}

/// The body of a report of failure.
#[derive(Serialize)]
struct FailureReport {
    exit_code: u8,
    /// What happened, then its causes.
    error: Vec<String>,
}

impl Outcome {
    /// A finished verb.
    pub(crate) fn new(verb: &str, body: &impl Serialize, ending: Ending) -> Result<Self, Failure> {
        let json = serde_json::to_string(&Envelope { schema: SCHEMA, verb: Some(verb), body })?;
        Ok(Self { json, text: None, ending })
    }

    /// With text for stdout, where no --json asks for the object.
    pub(crate) fn with_text(self, text: String) -> Self {
        Self { text: Some(text), ..self }
    }
}

/// Runs the verb; the exit code.
pub(crate) fn run(arguments: Arguments) -> ExitCode {
    let name = arguments.verb.name();
    let json = arguments.json;
    let outcome = start(arguments);
    let (report, text, code) = match outcome {
        Ok(Outcome { json, text, ending }) => (json, text, ending.code()),
        Err(failure) => {
            let error = failure.lines();
            let code = failure.code();
            complain(&failure, &error);
            let body = FailureReport { exit_code: code, error };
            let envelope = Envelope { schema: SCHEMA, verb: Some(name), body: &body };
            // A report of strings and numbers always has a text.
            (serde_json::to_string(&envelope).unwrap_or_default(), None, code)
        }
    };
    let wanted = if json { Some(report) } else { text };
    if wanted.is_some_and(|text| !print(&text)) {
        return ExitCode::from(ERROR);
    }
    ExitCode::from(code)
}

/// Puts a report on stdout; whether that worked, or nobody reads.
fn print(report: &str) -> bool {
    let mut stdout = std::io::stdout().lock();
    match writeln!(stdout, "{report}").and_then(|()| stdout.flush()) {
        // A reader that went away is not our failure.
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            let failure = Failure::told(format!(
                "stdout: the report cannot be written ({error}); choose another place for it"
            ));
            complain(&failure, &failure.lines());
            false
        }
        _ => true,
    }
}

/// Tells a wrong command line, on stderr for people, and on stdout if the words ask for JSON.
pub(crate) fn refuse(words: &[OsString], message: &clap::Error) -> ExitCode {
    // Help and version too come this way; clap knows which stream and which exit code. A closed
    // stream is no reason to fail.
    drop(message.print());
    let code = u8::try_from(message.exit_code()).unwrap_or(ERROR);
    let mut words = words.iter().skip(1).take_while(|word| *word != "--");
    if code != 0 && words.clone().any(|word| word == "--json") {
        let text = message.render().to_string();
        // The usage and the hints follow after an empty line.
        let first = text.split("\n\n").next().unwrap_or_default();
        let first = first.strip_prefix("error: ").unwrap_or(first).trim().to_owned();
        let verb = words.find_map(|word| verb::known(word.to_str()?));
        let body = FailureReport { exit_code: code, error: vec![first] };
        let envelope = Envelope { schema: SCHEMA, verb, body: &body };
        print(&serde_json::to_string(&envelope).unwrap_or_default());
    }
    ExitCode::from(code)
}

/// Prepares threads and cancelling, and runs the verb.
fn start(arguments: Arguments) -> Result<Outcome, Failure> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    let threads_asked: Vec<usize> = arguments.threads.iter().map(|n| n.get()).collect();
    if threads_asked.len() > 1 && !arguments.verb.takes_several_thread_counts() {
        let verb = arguments.verb.name();
        return Err(Failure::Usage(format!(
            "--threads: `{verb}` works with one number of threads; only `bench` tries several"
        )));
    }
    if let Some(&threads) = threads_asked.iter().max() {
        pool = pool.num_threads(threads);
    }
    let pool = pool.build()?;
    let session =
        Session { cancel: Cancel::new(), threads: pool.current_num_threads(), threads_asked };
    watch_for_interrupts(session.cancel.clone())?;
    pool.install(|| arguments.verb.run(&session))
}

/// The first Ctrl-C asks the verb to stop, the second stops the program.
fn watch_for_interrupts(cancel: Cancel) -> Result<(), Failure> {
    static ASKED: AtomicBool = AtomicBool::new(false);
    ctrlc::set_handler(move || {
        if ASKED.swap(true, Ordering::SeqCst) {
            output::remove_unfinished();
            std::process::exit(i32::from(CANCELLED));
        }
        cancel.cancel();
        say("\nstopping; Ctrl-C again stops at once");
    })?;
    Ok(())
}

/// Prints a failure: one line, and one for each cause.
fn complain(failure: &Failure, lines: &[String]) {
    let red = Style::new().bold().fg_color(Some(AnsiColor::Red.into()));
    let mut lines = lines.iter();
    let first = lines.next().map_or("", String::as_str);
    match failure {
        Failure::Cancelled => say(first),
        _ => put(format_args!("{red}error:{red:#} {first}")),
    }
    for cause in lines {
        put(format_args!("  because {cause}"));
    }
}

/// Something the user should know, though work goes on.
pub(crate) fn warn(sentence: &str) {
    let yellow = Style::new().bold().fg_color(Some(AnsiColor::Yellow.into()));
    put(format_args!("{yellow}warning:{yellow:#} {sentence}"));
}

/// A line for people.
pub(crate) fn say(line: &str) {
    put(format_args!("{line}"));
}

/// A line on stderr. Where that is full or closed, work goes on without words.
fn put(line: fmt::Arguments<'_>) {
    drop(writeln!(anstream::stderr().lock(), "{line}"));
}
