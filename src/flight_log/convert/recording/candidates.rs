//! Records that measure one quantity, and the choice of one of them.

use std::collections::BTreeMap;

use crate::geometry::seconds_from_ns;

/// Measurements with their times in nanoseconds of the recorder's clock.
pub(super) type Samples<T> = Vec<(i64, T)>;

pub(super) type NamedSamples<T> = (String, Samples<T>);

/// Measurements further apart leave a gap.
const MAX_GAP_NS: i64 = 1_000_000_000;
/// A record that covers less than this ratio of the longest one's time is not chosen.
const MIN_COVERAGE: f64 = 0.9;
/// Of several devices, one with less than this ratio of the most measurements is not chosen.
const MIN_COUNT: f64 = 0.5;

/// Preference of a record: rank of its type, then number of the device among those with this type; the smallest first.
pub(super) type Preference = (u8, u16);

/// Measurements of one quantity by record. Devices with the same type of record (instances, components, receivers) have
/// records of their own.
#[derive(Clone, Debug)]
pub(super) struct Candidates<T>(BTreeMap<(Preference, String), Samples<T>>);

/// Chosen record and the others.
pub(super) struct Choice<T> {
    pub(super) record: String,
    pub(super) samples: Samples<T>,
    /// Names of the other records with their numbers of measurements.
    pub(super) others: Vec<(String, u64)>,
    /// All devices with a record of the chosen type, if there are several.
    pub(super) devices: Option<String>,
}

impl<T> Default for Candidates<T> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<T> Candidates<T> {
    pub(super) fn push(&mut self, preference: Preference, record: &str, time_ns: i64, value: T) {
        self.0.entry((preference, record.to_owned())).or_default().push((time_ns, value));
    }

    pub(super) fn append(&mut self, other: Self) {
        for (record, mut samples) in other.0 {
            self.0.entry(record).or_default().append(&mut samples);
        }
    }

    pub(super) fn count(&self) -> usize {
        self.0.values().map(Vec::len).sum()
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(|(_, name)| name.as_str())
    }

    pub(super) fn samples(&self) -> impl Iterator<Item = &Samples<T>> {
        self.0.values()
    }

    pub(super) fn samples_mut(&mut self) -> impl Iterator<Item = &mut Samples<T>> {
        self.0.values_mut()
    }

    /// Chooses a record: one with a given name, else of those that cover the recording the one of the best type, and of
    /// its devices the first with enough measurements. `None` without measurements.
    pub(super) fn choose(self, is_given: impl Fn(&str) -> bool) -> Option<Choice<T>> {
        let all: Vec<((Preference, String), Samples<T>)> = self.0.into_iter().collect();
        let chosen = all.iter().position(|((_, name), _)| is_given(name)).or_else(|| best(&all))?;
        let rank = all[chosen].0.0.0;
        let same: Vec<&NamedRecord<T>> = all.iter().filter(|((preference, _), _)| preference.0 == rank).collect();
        let devices = (same.len() > 1).then(|| described(&same));
        let mut record = None;
        let mut others = Vec::new();
        for (number, ((_, name), samples)) in all.into_iter().enumerate() {
            if number == chosen {
                record = Some((name, samples));
            } else {
                others.push((name, samples.len() as u64));
            }
        }
        let (record, samples): NamedSamples<T> = record?;
        Some(Choice { record, samples, others, devices })
    }
}

type NamedRecord<T> = ((Preference, String), Samples<T>);

fn best<T>(all: &[NamedRecord<T>]) -> Option<usize> {
    let longest_ns = all.iter().map(|(_, samples)| covered_ns(samples)).max()?;
    let covers = |record: &&NamedRecord<T>| covered_ns(&record.1) as f64 >= MIN_COVERAGE * longest_ns as f64;
    let rank = all.iter().filter(covers).map(|((preference, _), _)| preference.0).min()?;
    let is_candidate = |record: &&NamedRecord<T>| record.0.0.0 == rank && covers(record);
    let most = all.iter().filter(is_candidate).map(|(_, samples)| samples.len()).max()?;
    all.iter().position(|record| is_candidate(&record) && record.1.len() as f64 >= MIN_COUNT * most as f64)
}

/// Time in which measurements follow each other without a gap.
fn covered_ns<T>(samples: &Samples<T>) -> i64 {
    let steps = samples.windows(2).map(|pair| pair[1].0.saturating_sub(pair[0].0));
    steps.filter(|step_ns| (1..=MAX_GAP_NS).contains(step_ns)).fold(0, i64::saturating_add)
}

/// Numbers of measurements and times from the first measurement of all.
fn described<T>(records: &[&NamedRecord<T>]) -> String {
    let times = |record: &&NamedRecord<T>| {
        let times = || record.1.iter().map(|(time_ns, _)| *time_ns);
        (times().min().unwrap_or(0), times().max().unwrap_or(0))
    };
    let start_ns = records.iter().map(|record| times(record).0).min().unwrap_or(0);
    let text = |record: &&NamedRecord<T>| {
        let (first_ns, last_ns) = times(record);
        let since_start = |time_ns: i64| seconds_from_ns(time_ns.saturating_sub(start_ns));
        let (name, count) = (&record.0.1, record.1.len());
        format!("{name} ({count} messages from {:.1} to {:.1} s)", since_start(first_ns), since_start(last_ns))
    };
    records.iter().map(text).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn candidates(records: &[(Preference, &str, std::ops::Range<i64>, usize)]) -> Candidates<i64> {
        let mut candidates = Candidates::default();
        for (preference, name, span_ms, step_ms) in records {
            for ms in span_ms.clone().step_by(*step_ms) {
                candidates.push(*preference, name, ms * MS, ms);
            }
        }
        candidates
    }

    fn chosen(records: &[(Preference, &str, std::ops::Range<i64>, usize)]) -> String {
        candidates(records).choose(|_| false).unwrap().record
    }

    #[test]
    fn the_best_type_that_covers_the_recording_is_chosen() {
        assert_eq!(chosen(&[((0, 0), "good", 0..10_000, 100), ((1, 0), "fair", 0..10_500, 20)]), "good");
        assert_eq!(chosen(&[((0, 0), "good", 0..5000, 100), ((1, 0), "fair", 0..10_000, 20)]), "fair");
        // A gap of two seconds of ten.
        let mut gap = candidates(&[((0, 0), "good", 0..4000, 100), ((1, 0), "fair", 0..10_000, 100)]);
        (6000..10_000).step_by(100).for_each(|ms| gap.push((0, 0), "good", ms * MS, ms));
        assert_eq!(gap.choose(|_| false).unwrap().record, "fair");
        assert!(Candidates::<i64>::default().choose(|_| true).is_none());
        assert_eq!(chosen(&[((1, 0), "one", 0..1, 1)]), "one");
    }

    #[test]
    fn the_first_of_equal_devices_is_chosen_unless_it_measures_less() {
        assert_eq!(chosen(&[((0, 0), "a", 0..10_000, 20), ((0, 1), "b", 0..10_100, 18)]), "a");
        assert_eq!(chosen(&[((0, 0), "a", 0..10_000, 500), ((0, 1), "b", 0..10_000, 20)]), "b");
        assert_eq!(chosen(&[((0, 154), "a", 0..5000, 20), ((0, 171), "b", 0..8500, 20)]), "b");
    }

    #[test]
    fn devices_are_never_mixed_and_all_are_named() {
        let records = [((0, 154), "a", 0..5000, 20), ((0, 171), "b", 500..8500, 20), ((1, 0), "c", 0..100, 20)];
        let choice = candidates(&records).choose(|name| name == "a").unwrap();
        assert_eq!((choice.record.as_str(), choice.samples.len()), ("a", 250));
        assert!(choice.samples.iter().all(|(_, ms)| *ms < 5000));
        assert_eq!(choice.others, [("b".to_owned(), 400), ("c".to_owned(), 5)]);
        let devices = choice.devices.unwrap();
        assert_eq!(devices, "a (250 messages from 0.0 to 5.0 s), b (400 messages from 0.5 to 8.5 s)");
    }
}
