/// True if a time lies in an interval given as start and length, both in seconds; false without an interval.
pub(crate) fn during(interval_s: Option<[f64; 2]>, time_s: f64) -> bool {
    interval_s.is_some_and(|[start_s, length_s]| time_s >= start_s && time_s < start_s + length_s)
}
