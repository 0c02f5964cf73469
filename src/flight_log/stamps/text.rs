//! Stamps in text files, and their unit.

/// Number of nanoseconds of a second.
const SECOND_NS: i64 = 1_000_000_000;
/// Longest usual step between two stamps, which decides between units.
const USUAL_STEP_NS: f64 = 1e10;
/// Longest step in the expected unit.
const LONGEST_STEP_NS: f64 = 1e12;
/// Times of today's clocks, in seconds since the epoch: the years 2001 to 2099.
const UNIX_TIMES_S: std::ops::Range<f64> = 1e9..4.1e9;

/// Stamp as written, in 1e-9 of its unit.
pub(crate) type WrittenStamp = i128;

/// Unit of the stamps of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StampUnit {
    Seconds,
    Milliseconds,
    Microseconds,
    Nanoseconds,
}

impl StampUnit {
    /// From the smallest to the largest.
    const ALL: [Self; 4] = [Self::Nanoseconds, Self::Microseconds, Self::Milliseconds, Self::Seconds];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Seconds => "seconds",
            Self::Milliseconds => "milliseconds",
            Self::Microseconds => "microseconds",
            Self::Nanoseconds => "nanoseconds",
        }
    }

    fn ns(self) -> i64 {
        match self {
            Self::Seconds => SECOND_NS,
            Self::Milliseconds => 1_000_000,
            Self::Microseconds => 1000,
            Self::Nanoseconds => 1,
        }
    }

    /// Nanoseconds of a stamp in this unit; `None` for more than 292 years.
    pub(crate) fn nanoseconds(self, stamp: WrittenStamp) -> Option<i64> {
        let ns = stamp.checked_mul(i128::from(self.ns()))?;
        i64::try_from(ns.div_euclid(i128::from(SECOND_NS))).ok()
    }

    /// Unit of the stamps of one sensor in the order of a file. The expected unit is taken if its times and steps are
    /// possible ones, steps of at least `shortest_step_ns`; else the unit in which the first stamp is a time of today's clocks, else
    /// the one in which the steps are usual.
    pub(crate) fn of(stamps: &[WrittenStamp], expected: Self, shortest_step_ns: i64) -> Self {
        let mut steps: Vec<i128> =
            stamps.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).filter(|step| *step > 0).collect();
        steps.sort_unstable();
        let Some(step) = steps.get(steps.len() / 2).map(|step| *step as f64 * 1e-9) else { return expected };
        let is_step = |unit: Self, longest_ns: f64| {
            let step_ns = step * unit.ns() as f64;
            step_ns >= shortest_step_ns as f64 && step_ns <= longest_ns
        };
        let is_time = stamps.iter().all(|stamp| expected.nanoseconds(*stamp).is_some());
        if is_time && is_step(expected, LONGEST_STEP_NS) {
            return expected;
        }
        let first_s = |unit: &Self| {
            let first = stamps.first().map_or(f64::NAN, |first| *first as f64 * 1e-9);
            first * unit.ns() as f64 / SECOND_NS as f64
        };
        let is_today = |unit: &Self| UNIX_TIMES_S.contains(&first_s(unit));
        let by_step = || Self::ALL.into_iter().find(|unit| is_step(*unit, USUAL_STEP_NS));
        Self::ALL.into_iter().find(is_today).or_else(by_step).unwrap_or(expected)
    }
}

/// Reads a decimal number, exact up to nine decimals, since a double of today's Unix time resolves only 240 ns; one
/// with an exponent is read as a double. `None` for other text and for numbers beyond 1e20.
pub(crate) fn read_stamp(text: &str) -> Option<WrittenStamp> {
    let exact = || {
        let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
        let (whole, decimals) = digits.split_once('.').unwrap_or((digits, ""));
        let is_plain = |digits: &str| digits.bytes().all(|byte| byte.is_ascii_digit());
        if whole.len() > 20 || !is_plain(whole) || !is_plain(decimals) {
            return None;
        }
        let whole: i128 = whole.parse().ok()?;
        let nine: String = decimals.chars().chain("000000000".chars()).take(9).collect();
        Some(sign * (whole * i128::from(SECOND_NS) + nine.parse::<i128>().ok()?))
    };
    let number = || text.parse::<f64>().ok().filter(|number| number.abs() < 1e20);
    let in_parts = |number: f64| {
        let decimals = (number.fract() * SECOND_NS as f64).round();
        number.trunc() as i128 * i128::from(SECOND_NS) + decimals as i128
    };
    exact().or_else(|| number().map(in_parts))
}

/// True for the first row of a table with the names of its columns: its first cell begins with a letter or a quote.
pub(crate) fn is_heading(first_cell: &str) -> bool {
    let begins = first_cell.starts_with(|letter: char| letter.is_alphabetic() || letter == '"');
    begins && first_cell.parse::<f64>().is_err()
}

#[cfg(test)]
mod tests {
    use super::*;
    use StampUnit::{Microseconds, Milliseconds, Nanoseconds, Seconds};

    fn unit(stamps: [&str; 3], expected: StampUnit) -> StampUnit {
        StampUnit::of(&stamps.map(|stamp| read_stamp(stamp).unwrap()), expected, 100_000)
    }

    #[test]
    fn decimals_are_exact() {
        let ns = |text: &str, unit: StampUnit| unit.nanoseconds(read_stamp(text).unwrap());
        assert_eq!(ns("1403636580.838555574", Seconds), Some(1_403_636_580_838_555_574));
        assert_eq!(ns("1403636580838.555574", Milliseconds), Some(1_403_636_580_838_555_574));
        assert_eq!(ns("1403636580838555574", Nanoseconds), Some(1_403_636_580_838_555_574));
        assert_eq!(ns("-1.5", Seconds), Some(-1_500_000_000));
        assert_eq!(ns("2.5e1", Seconds), Some(25_000_000_000));
        assert_eq!(ns("1.4036365800e+18", Nanoseconds), Some(1_403_636_580_000_000_000));
        assert_eq!(ns("1403636580838555574", Seconds), None, "no saturated times");
        for text in ["", "x", "1:5", "nan", "inf", "1e30", "1.2.3", "--1"] {
            assert_eq!(read_stamp(text), None, "{text:?}");
        }
    }

    #[test]
    fn units_are_those_of_possible_steps() {
        assert_eq!(
            unit(["1403636580838555574", "1403636580843555574", "1403636580848555574"], Nanoseconds),
            Nanoseconds
        );
        assert_eq!(unit(["0", "5000000", "10000000"], Nanoseconds), Nanoseconds);
        assert_eq!(unit(["1403636580838555", "1403636580843555", "1403636580848555"], Nanoseconds), Microseconds);
        assert_eq!(unit(["1403636580838", "1403636580843", "1403636580848"], Nanoseconds), Milliseconds);
        assert_eq!(unit(["1403636580.838", "1403636580.843", "1403636580.848"], Nanoseconds), Seconds);
        assert_eq!(unit(["0", "5000", "10000"], Nanoseconds), Microseconds);
        assert_eq!(unit(["0.0", "0.005", "0.01"], Nanoseconds), Seconds);
        assert_eq!(unit(["0.5", "1.5", "40.0"], Seconds), Seconds);
        assert_eq!(unit(["0", "60", "120"], Seconds), Seconds);
        assert_eq!(unit(["1403636580.8", "1403636580.9", "1403636581.0"], Seconds), Seconds);
        assert_eq!(unit(["1403636580838555574", "1403636580888555574", "1403636580938555574"], Seconds), Nanoseconds);
        assert_eq!(unit(["0.0e+00", "5.0e+06", "1.0e+07"], Seconds), Nanoseconds);
        // One stamp has no step.
        assert_eq!(StampUnit::of(&[read_stamp("1500000000").unwrap()], Nanoseconds, 100_000), Nanoseconds);
        assert_eq!(StampUnit::of(&[], Seconds, 100_000), Seconds);
    }
}
