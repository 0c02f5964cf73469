//! Measured times as rows of a table.

use std::fmt;

use dcvins::session::Stopwatch;

use crate::shared::markdown::write_table;

/// Durations of repeated measurements, in milliseconds.
#[derive(Default)]
pub(crate) struct Times {
    ms: Vec<f64>,
}

impl Times {
    /// Measures one call.
    pub(crate) fn take<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let watch = Stopwatch::start();
        let result = work();
        self.add(&watch);
        result
    }

    /// Adds the time of a stopwatch.
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
        write_table(formatter, &self.title, &self.header, &self.rows)
    }
}

pub(crate) fn mib(bytes: usize) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

pub(crate) fn kib(bytes: usize) -> String {
    format!("{:.1} KiB", bytes as f64 / 1024.0)
}
