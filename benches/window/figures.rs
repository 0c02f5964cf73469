//! Measured times as rows of a table.

use std::{fmt, fs};

use dcvins::session::Stopwatch;

/// Milliseconds of many goes at the same thing.
#[derive(Default)]
pub(crate) struct Times {
    ms: Vec<f64>,
}

impl Times {
    /// Measures one go.
    pub(crate) fn take<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let watch = Stopwatch::start();
        let result = work();
        self.add(&watch);
        result
    }

    /// Adds what a stopwatch shows.
    pub(crate) fn add(&mut self, watch: &Stopwatch) {
        self.ms.push(watch.elapsed_ms());
    }

    /// Median, 95th percentile and largest, as cells.
    pub(crate) fn cells(&self) -> Vec<String> {
        let mut sorted = self.ms.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        let places = [last / 2, (last * 19).div_ceil(20), last];
        places.iter().map(|place| sorted.get(*place).map_or_else(String::new, |ms| format!("{ms:.1}"))).collect()
    }
}

/// Rows of cells under a header, printed in Markdown.
pub(crate) struct Table {
    title: String,
    header: Vec<&'static str>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new(title: impl Into<String>, header: &[&'static str]) -> Self {
        Self { title: title.into(), header: header.to_vec(), rows: Vec::new() }
    }

    pub(crate) fn row(&mut self, name: impl Into<String>, cells: impl IntoIterator<Item = String>) {
        self.rows.push(std::iter::once(name.into()).chain(cells).collect());
    }
}

impl fmt::Display for Table {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "{}\n", self.title)?;
        writeln!(formatter, "| {} |", self.header.join(" | "))?;
        writeln!(formatter, "| {} |", vec!["---"; self.header.len()].join(" | "))?;
        for row in &self.rows {
            writeln!(formatter, "| {} |", row.join(" | "))?;
        }
        Ok(())
    }
}

/// Processor time of all threads so far, in seconds; only Linux tells.
pub(crate) fn cpu_s() -> Option<f64> {
    /// Clock ticks per second, the same on every Linux that Rust's standard library runs on.
    const TICKS_PER_S: f64 = 100.0;
    let status = fs::read_to_string("/proc/self/stat").ok()?;
    // Behind the name, which may hold spaces, `utime` and `stime` are the twelfth and thirteenth word.
    let words: Vec<&str> = status.rsplit(')').next()?.split_whitespace().collect();
    let ticks = words.get(11)?.parse::<f64>().ok()? + words.get(12)?.parse::<f64>().ok()?;
    Some(ticks / TICKS_PER_S)
}

/// Bytes in MiB.
pub(crate) fn mib(bytes: usize) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Bytes in KiB.
pub(crate) fn kib(bytes: usize) -> String {
    format!("{:.1} KiB", bytes as f64 / 1024.0)
}
