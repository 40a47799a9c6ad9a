//! Numbers as people read them.

use std::path::Path;
use std::time::Duration;

pub(crate) use treelet_bench::page::count;

/// A path as one word of a POSIX shell, quoted where it must be.
pub(crate) fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+,:@%".contains(c);
    // A leading dash would be read as a flag.
    let text = if text.starts_with('-') { format!("./{text}") } else { text };
    if !text.is_empty() && text.chars().all(plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// `1 thing`, `2 things`.
pub(crate) fn things(number: u64, thing: &str) -> String {
    let plural = match thing {
        "vertex" => "vertices".to_owned(),
        thing if thing.ends_with('s') || thing.ends_with("sh") => format!("{thing}es"),
        thing => format!("{thing}s"),
    };
    format!("{} {}", count(number), if number == 1 { thing } else { &plural })
}

/// A time with three or so digits.
pub(crate) fn time(time: Duration) -> String {
    match time.as_secs_f64() {
        seconds if seconds >= 99.95 => format!("{seconds:.0} s"),
        seconds if seconds >= 9.995 => format!("{seconds:.1} s"),
        seconds if seconds >= 0.9995 => format!("{seconds:.2} s"),
        seconds if seconds >= 0.000_999_5 => format!("{:.0} ms", 1e3 * seconds),
        seconds => format!("{:.0} us", 1e6 * seconds),
    }
}

/// A rate with three or so digits and its unit: `1.23 M`.
pub(crate) fn rate(amount: u64, time: Duration) -> String {
    let rate = amount as f64 / time.as_secs_f64().max(1e-9);
    let (number, prefix) = match rate {
        rate if rate >= 1e9 => (1e-9 * rate, " G"),
        rate if rate >= 1e6 => (1e-6 * rate, " M"),
        rate if rate >= 1e3 => (1e-3 * rate, " k"),
        rate => (rate, " "),
    };
    format!("{number:.*}{prefix}", if number < 9.995 { 2 } else { 1 })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{count, rate, time};

    #[test]
    fn paths_are_one_word_of_a_shell() {
        for (path, word) in [
            ("a/b-1.ply", "a/b-1.ply"),
            ("-a.ply", "./-a.ply"),
            ("a b.ply", "'a b.ply'"),
            ("it's $HOME.ply", r"'it'\''s $HOME.ply'"),
            ("a;b", "'a;b'"),
        ] {
            assert_eq!(super::shell_word(path.as_ref()), word);
        }
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!([0, 999, 1000, 1_234_567].map(count), ["0", "999", "1,000", "1,234,567"]);
        let texts = [7, 45_000, 1_230_000, 34_560_000].map(|us| time(Duration::from_micros(us)));
        assert_eq!(texts, ["7 us", "45 ms", "1.23 s", "34.6 s"]);
        assert_eq!(rate(2_500_000, Duration::from_secs(2)), "1.25 M");
        assert_eq!(rate(0, Duration::ZERO), "0.00 ");
    }
}
