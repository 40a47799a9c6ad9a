//! Numbers as people read them.

/// `1443517` as `1,443,517`.
pub fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Three digits that count, without an exponent: `0.0123`, `1.23`, `123`, `12,345`.
pub(super) fn short(number: f64) -> String {
    if !number.is_finite() {
        return "\u{2013}".to_owned();
    }
    let size = number.abs();
    let decimals = match size {
        size if size >= 99.95 => return sign(number) + &count(size.round() as u64),
        size if size >= 9.995 => 1,
        size if size >= 0.9995 || size == 0.0 => 2,
        size if size >= 0.0995 => 3,
        _ => 4,
    };
    sign(number) + &format!("{size:.decimals$}")
}

/// A true minus sign.
fn sign(number: f64) -> String {
    if number < 0.0 { "\u{2212}".to_owned() } else { String::new() }
}

/// Seconds with a fitting unit; long times in minutes, hours and days.
pub(super) fn time(seconds: f64) -> String {
    let (number, unit) = match seconds {
        s if s >= 2.0 * 86_400.0 => (s / 86_400.0, "days"),
        s if s >= 2.0 * 3_600.0 => (s / 3_600.0, "h"),
        s if s >= 120.0 => (s / 60.0, "min"),
        s if s >= 0.9995 => (s, "s"),
        s if s >= 0.000_999_5 => (1e3 * s, "ms"),
        s => (1e6 * s, "\u{b5}s"),
    };
    format!("{}\u{a0}{unit}", short(number))
}

/// A part of 1 in percent.
pub(super) fn percent(part: f64) -> String {
    let percent = 100.0 * part;
    let decimals = usize::from(percent.abs() < 9.95);
    let number = format!("{:.decimals$}", percent.abs());
    let zero = number.chars().all(|c| c == '0' || c == '.');
    format!("{}{number}\u{a0}%", if zero { String::new() } else { sign(percent) })
}

/// Bytes with a binary unit.
pub(super) fn bytes(bytes: u64) -> String {
    let units = [(1 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")];
    match units.into_iter().find(|(unit, _)| bytes >= *unit) {
        Some((unit, name)) => format!("{}\u{a0}{name}", short(bytes as f64 / unit as f64)),
        None => format!("{bytes}\u{a0}B"),
    }
}

/// `10⁶` for a power of ten, else `7.2 million`.
pub(super) fn rays(rays: f64) -> String {
    let power = rays.log10().round();
    if rays >= 1.0 && (rays / 10f64.powf(power) - 1.0).abs() < 1e-9 {
        return format!("10{}", superscript(power as u32));
    }
    let units = [(1e12, "trillion"), (1e9, "billion"), (1e6, "million")];
    match units.into_iter().find(|(unit, _)| rays >= 0.9995 * unit) {
        Some((unit, name)) => format!("{}\u{a0}{name}", short(rays / unit)),
        // Three digits that count, here too.
        None if rays >= 1e5 => count(1000 * (rays / 1e3).round() as u64),
        None if rays >= 1e4 => count(100 * (rays / 1e2).round() as u64),
        None => count(rays.round() as u64),
    }
}

/// The digits of an exponent.
pub(super) fn superscript(exponent: u32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digits = exponent.to_string();
    digits.bytes().map(|digit| DIGITS[usize::from(digit - b'0')]).collect()
}

/// Places for ticks from 0 to a little over `top`: a step of 1, 2 or 5 times a power of ten, between
/// three and seven of them.
pub(super) fn ticks(top: f64) -> Vec<f64> {
    let rough = top.max(1e-9) / 7.0;
    let power = 10f64.powf(rough.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    let step = steps.into_iter().find(|step| *step >= rough).unwrap_or(rough);
    (0..).map(|i| f64::from(i) * step).take_while(|tick| *tick <= top * (1.0 + 1e-9)).collect()
}

/// A tick's number: no more decimals than its step needs.
pub(super) fn tick(tick: f64, step: f64) -> String {
    let decimals = (-(step.log10() + 1e-9).floor()).max(0.0) as usize;
    format!("{tick:.decimals$}")
}

/// The geometric mean; `None` of nothing.
pub(super) fn geometric_mean(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = numbers.fold((0.0, 0_u32), |(sum, count), x| (sum + x.ln(), count + 1));
    (count > 0).then(|| (sum / f64::from(count)).exp())
}

/// The median; `None` of nothing.
pub(super) fn median(mut numbers: Vec<f64>) -> Option<f64> {
    numbers.sort_by(f64::total_cmp);
    let upper = *numbers.get(numbers.len() / 2)?;
    let lower = numbers[(numbers.len() - 1) / 2];
    Some(0.5 * (lower + upper))
}

#[cfg(test)]
mod tests {
    use super::{bytes, count, median, percent, rays, short, tick, ticks, time};

    #[test]
    fn numbers_are_short_and_honest() {
        let texts = [0.0, 0.01234, 0.123, 1.0, 9.999, 12.34, 99.96, 12_345.6, -2.0].map(short);
        assert_eq!(
            texts,
            ["0.00", "0.0123", "0.123", "1.00", "10.0", "12.3", "100", "12,346", "\u{2212}2.00"]
        );
        assert_eq!(short(f64::NAN), "\u{2013}");
        assert_eq!(count(1_443_517), "1,443,517");
        assert_eq!(
            [0.0012, 3.0, 600.0].map(time),
            ["1.20\u{a0}ms", "3.00\u{a0}s", "10.0\u{a0}min"]
        );
        assert_eq!([0.051, 0.26, -0.0001].map(percent), ["5.1\u{a0}%", "26\u{a0}%", "0.0\u{a0}%"]);
        assert_eq!(bytes(3 << 20), "3.00\u{a0}MiB");
        assert_eq!(
            [1e4, 1e12, 7.23e6, 2.0e5].map(rays),
            ["10⁴", "10¹²", "7.23\u{a0}million", "200,000"]
        );
        assert_eq!(median(vec![3.0, 1.0, 2.0, 10.0]), Some(2.5));
    }

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(ticks(5.3), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(ticks(1.0).len(), 6);
        assert_eq!([tick(0.2, 0.2), tick(4.0, 2.0), tick(0.05, 0.05)], ["0.2", "4", "0.05"]);
        assert!(ticks(1e-3).len() > 3 && ticks(1e9).len() > 3);
    }
}
