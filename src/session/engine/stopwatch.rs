use std::sync::LazyLock;
use std::time::Instant;

/// Milliseconds of a monotonic clock, for the stage times of reports.
pub(in crate::session) fn clock_ms() -> f64 {
    static BEGIN: LazyLock<Stopwatch> = LazyLock::new(Stopwatch::start);
    BEGIN.elapsed_ms()
}

/// Measures the time of the stages of a step. Stage times are the only values of a report that differ between replays.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    begin: Instant,
}

impl Stopwatch {
    #[expect(clippy::disallowed_methods, reason = "stage timings are measured; nothing is computed from them")]
    pub fn start() -> Self {
        Self { begin: Instant::now() }
    }

    pub fn elapsed_ms(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() * 1e3
    }
}
