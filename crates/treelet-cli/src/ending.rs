//! How a run ends: exit codes, and what went wrong in words.

use std::error::Error;

/// Something went wrong.
pub(crate) const ERROR: u8 = 1;
/// The command line asks for something impossible.
const USAGE: u8 = 2;
/// A check found a difference.
const CHECK_FAILED: u8 = 3;
/// Somebody pressed Ctrl-C: 128 plus the number of SIGINT.
pub(crate) const CANCELLED: u8 = 130;

/// What the libraries advise, and what does it here.
const REMEDIES: [(&str, &str); 3] = [
    ("build with `Invalid::Skip`", "leave it out with --invalid skip"),
    ("`Limits::max_bytes`", "--max-bytes"),
    ("`Limits::max_ratio`", "--max-ratio"),
];

/// The end of a verb that has something to report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    Done,
    CheckFailed,
    Cancelled,
}

impl Ending {
    /// The exit code.
    pub(crate) const fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::CheckFailed => CHECK_FAILED,
            Self::Cancelled => CANCELLED,
        }
    }
}

/// The end of a verb that has nothing to report.
#[derive(Debug)]
pub(crate) enum Failure {
    /// What was asked for cannot be done; perhaps a flag would let it be done.
    Error { error: Box<dyn Error + Send + Sync>, flag: Option<&'static str> },
    /// The command line is wrong in a way that only shows later.
    Usage(String),
    /// Cancelled before there was anything to keep.
    Cancelled,
}

impl Failure {
    /// A failure told in a sentence.
    pub(crate) fn told(sentence: impl Into<String>) -> Self {
        Self::Error { error: sentence.into().into(), flag: None }
    }

    /// A failure that a flag of the command would prevent.
    pub(crate) fn with_flag(
        error: impl Error + Send + Sync + 'static,
        flag: Option<&'static str>,
    ) -> Self {
        Self::Error { error: Box::new(error), flag }
    }

    /// The exit code.
    pub(crate) const fn code(&self) -> u8 {
        match self {
            Self::Error { .. } => ERROR,
            Self::Usage(_) => USAGE,
            Self::Cancelled => CANCELLED,
        }
    }

    /// What happened, and its causes, outermost first.
    pub(crate) fn lines(&self) -> Vec<String> {
        match self {
            Self::Usage(sentence) => vec![sentence.clone()],
            Self::Cancelled => vec!["cancelled; nothing was written".into()],
            Self::Error { error, flag } => {
                let mut lines = vec![error.to_string()];
                let mut cause = error.source();
                while let Some(error) = cause {
                    let line = error.to_string();
                    // Transparent errors repeat their cause, and some quote it.
                    if lines.iter().all(|other| !other.contains(&line)) {
                        lines.push(line);
                    }
                    cause = error.source();
                }
                // Name the flag where the library names its own function, or none.
                for line in &mut lines {
                    for (library, command) in REMEDIES {
                        *line = line.replace(library, command);
                    }
                }
                if let (Some(flag), Some(last)) = (flag, lines.last_mut())
                    && !last.contains(flag)
                {
                    *last += &format!("; the flag for that is {flag}");
                }
                lines
            }
        }
    }
}

impl<E: Error + Send + Sync + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::with_flag(error, None)
    }
}
