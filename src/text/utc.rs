//! Times of a clock as dates.

/// Times of today's clocks, in seconds since 1970: the years 2001 to 2099.
const UNIX_TIMES_S: std::ops::Range<i64> = 1_000_000_000..4_100_000_000;
const DAY_S: i64 = 86_400;

/// Date and time in UTC to the minute, `2026-05-12 10:03`, of nanoseconds since 1970; `None` for another clock.
///
/// The date follows from the number of the day by the rules of the Gregorian calendar, in years that begin in March, so
/// that the leap day is the last one.
pub fn utc(stamp_ns: i64) -> Option<String> {
    let stamp_s = stamp_ns.div_euclid(1_000_000_000);
    if !UNIX_TIMES_S.contains(&stamp_s) {
        return None;
    }
    let (day, second) = (stamp_s / DAY_S, stamp_s % DAY_S);
    // Days since 1 March 2000; 400 years have 146,097 days, 100 years without their first 36,524, four years 1,461.
    let day = day - 11_017;
    let (age, day) = (day.div_euclid(146_097), day.rem_euclid(146_097));
    let century = (day / 36_524).min(3);
    let day = day - century * 36_524;
    let (leap, day) = (day / 1461, day % 1461);
    let year = (day / 365).min(3);
    let day = day - year * 365;
    // Months from March on have 31, 30, 31, 30, 31 days and again, 153 in five.
    let month = (5 * day + 2) / 153;
    let day_of_month = day - (153 * month + 2) / 5 + 1;
    let march_year = 2000 + 400 * age + 100 * century + 4 * leap + year;
    let (year, month) = if month < 10 { (march_year, month + 3) } else { (march_year + 1, month - 9) };
    Some(format!("{year:04}-{month:02}-{day_of_month:02} {:02}:{:02}", second / 3600, second / 60 % 60))
}

#[cfg(test)]
mod tests {
    use super::utc;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (second, expected) in [
            (1_000_000_000, "2001-09-09 01:46"),
            (1_709_164_800, "2024-02-29 00:00"),
            (1_709_251_199, "2024-02-29 23:59"),
            (1_709_251_200, "2024-03-01 00:00"),
            (1_735_689_599, "2024-12-31 23:59"),
            (1_735_689_600, "2025-01-01 00:00"),
            (1_778_580_180, "2026-05-12 10:03"),
            (4_099_999_999, "2099-12-03 16:53"),
        ] {
            assert_eq!(utc(second * 1_000_000_000).as_deref(), Some(expected));
        }
        assert_eq!([utc(0), utc(-1), utc(i64::MAX)], [None, None, None]);
    }
}
