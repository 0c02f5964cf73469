use std::sync::LazyLock;
use std::time::Instant;

/// Milliseconds of a clock that only runs forward, for the stage times of reports.
pub(in crate::session) fn clock_ms() -> f64 {
    static BEGIN: LazyLock<Stopwatch> = LazyLock::new(Stopwatch::start);
    BEGIN.elapsed_ms()
}

/// Times the stages of a step; the timings of a report are the only part of it that differs between replays.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    begin: Instant,
}

impl Stopwatch {
    /// Starts it.
    #[expect(clippy::disallowed_methods, reason = "stage timings are measured; nothing is computed from them")]
    pub fn start() -> Self {
        Self { begin: Instant::now() }
    }

    /// Milliseconds since the start.
    pub fn elapsed_ms(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() * 1e3
    }
}
