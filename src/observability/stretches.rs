//! Stretches of a flight that keep most of its information about the calibration.

use nalgebra::DMatrix;

use crate::geometry::{ns_from_seconds, seconds_from_ns};

/// Spacing of the tried starts, in seconds.
const SPACING_S: f64 = 0.5;
/// Largest number of tried starts; the spacing grows with longer flights.
const MAX_STARTS: usize = 400;
/// Largest number of stretches.
const MAX_STRETCHES: usize = 4;
/// Shortest stretch behind the time until the estimator is initialized, in seconds.
const MIN_INFORMED_S: f64 = 2.0;
/// Number of rounds in which each stretch is moved to its best place while the others stay.
const ROUNDS: usize = 3;
/// Weight of the mean of the ratios besides the largest one, which alone leaves the others undecided.
const MEAN_WEIGHT: f64 = 0.05;

/// Information about the calibration that a flight has collected up to each of its steps.
#[derive(Clone, Debug, Default)]
pub struct InformationTrack {
    /// Start of the flight and stamps of the steps, in nanoseconds since the log began.
    pub start_ns: i64,
    pub stamps_ns: Vec<i64>,
    /// Posterior information of the calibration after each step (n × n), the prior included.
    pub information: Vec<DMatrix<f64>>,
    /// Information of the prior in the same columns.
    pub prior: DMatrix<f64>,
    /// Time from a start to the first step with information, in nanoseconds.
    pub lead_ns: i64,
}

/// Chosen part of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct UsefulStretch {
    pub start_ns: i64,
    pub end_ns: i64,
    /// Factor by which each column's σ grows without this stretch.
    pub growth_without: Vec<f64>,
}

/// Chosen stretches with the predicted result of a calibration from them alone.
#[derive(Clone, Debug, PartialEq)]
pub struct UsefulStretches {
    /// Chosen stretches in time order.
    pub stretches: Vec<UsefulStretch>,
    /// Predicted σ of each column, divided by the σ of the whole flight.
    pub ratios: Vec<f64>,
}

impl InformationTrack {
    /// Information of a stretch that is processed on its own (n × n).
    fn of_stretch(&self, start_ns: i64, end_ns: i64) -> Option<DMatrix<f64>> {
        let at = |stamp_ns: i64| {
            let after = self.stamps_ns.partition_point(|stamp| *stamp <= stamp_ns);
            after.checked_sub(1).map_or(&self.prior, |last| &self.information[last])
        };
        (end_ns > start_ns + self.lead_ns).then(|| at(end_ns) - at(start_ns + self.lead_ns))
    }

    /// σ of each column from the prior and stretches of equal length that begin at `starts_ns`.
    fn sigmas(&self, starts_ns: &[i64], length_ns: i64) -> Option<Vec<f64>> {
        let mut sum = self.prior.clone();
        for start_ns in starts_ns {
            sum += self.of_stretch(*start_ns, start_ns + length_ns)?;
        }
        sigmas(sum)
    }

    /// Stretches of at most `total_s` seconds in total, one to four of equal length, that minimize the largest ratio of
    /// σ to the σ of the whole flight. `None` without information, or if the flight or `total_s` is too short.
    pub fn useful_stretches(&self, total_s: f64) -> Option<UsefulStretches> {
        let end_ns = *self.stamps_ns.last()?;
        let whole = sigmas(self.information.last()?.clone())?;
        let total_ns = ns_from_seconds(total_s).min(end_ns - self.start_ns);
        let shortest_ns = self.lead_ns + ns_from_seconds(MIN_INFORMED_S);
        let mut best: Option<(f64, Vec<i64>, i64)> = None;
        for count in 1..=MAX_STRETCHES {
            let length_ns = total_ns / count as i64;
            if length_ns < shortest_ns {
                break;
            }
            let Some((score, starts_ns)) = self.placed(count, length_ns, end_ns, &whole) else { continue };
            if best.as_ref().is_none_or(|(least, ..)| score < *least) {
                best = Some((score, starts_ns, length_ns));
            }
        }
        let (_, mut starts_ns, length_ns) = best?;
        starts_ns.sort_unstable();
        let sigmas = self.sigmas(&starts_ns, length_ns)?;
        let stretches = starts_ns.iter().map(|start_ns| {
            let others: Vec<i64> = starts_ns.iter().copied().filter(|other| other != start_ns).collect();
            let without = self.sigmas(&others, length_ns).unwrap_or_else(|| vec![f64::INFINITY; whole.len()]);
            UsefulStretch {
                start_ns: *start_ns,
                end_ns: start_ns + length_ns,
                growth_without: without.iter().zip(&sigmas).map(|(without, with)| without / with).collect(),
            }
        });
        let ratios = sigmas.iter().zip(&whole).map(|(sigma, whole)| sigma / whole);
        Some(UsefulStretches { stretches: stretches.collect(), ratios: ratios.collect() })
    }

    /// Score and starts of `count` stretches: placed one after the other, then moved in turn.
    fn placed(&self, count: usize, length_ns: i64, end_ns: i64, whole: &[f64]) -> Option<(f64, Vec<i64>)> {
        let range_ns = (end_ns - length_ns - self.start_ns).max(0);
        let spacing_s = SPACING_S.max(seconds_from_ns(range_ns) / MAX_STARTS as f64);
        let steps = (seconds_from_ns(range_ns) / spacing_s).floor() as usize;
        let starts = (0..=steps).map(|step| self.start_ns + ns_from_seconds(step as f64 * spacing_s));
        // The last start may lie between two steps.
        let candidates: Vec<i64> = starts.chain([self.start_ns + range_ns]).collect();
        let score = |starts_ns: &[i64]| {
            let sigmas = self.sigmas(starts_ns, length_ns)?;
            let ratios = || sigmas.iter().zip(whole).map(|(sigma, whole)| sigma / whole);
            let largest = ratios().fold(0.0, f64::max);
            Some(largest + MEAN_WEIGHT * ratios().sum::<f64>() / whole.len().max(1) as f64)
        };
        let best_place = |others: &[i64]| {
            let free = candidates.iter().filter(|start| others.iter().all(|other| (*start - other).abs() >= length_ns));
            let scored = free.filter_map(|start| Some((score(&[others, &[*start]].concat())?, *start)));
            scored.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let (mut starts_ns, mut least) = (Vec::new(), f64::INFINITY);
        for _ in 0..count {
            let (score, start_ns) = best_place(&starts_ns)?;
            starts_ns.push(start_ns);
            least = score;
        }
        for _ in 0..ROUNDS {
            let before = starts_ns.clone();
            for place in 0..count {
                let others: Vec<i64> =
                    (0..count).filter(|other| *other != place).map(|other| starts_ns[other]).collect();
                if let Some((score, start_ns)) = best_place(&others).filter(|(score, _)| *score < least) {
                    (starts_ns[place], least) = (start_ns, score);
                }
            }
            if before == starts_ns {
                break;
            }
        }
        Some((least, starts_ns))
    }
}

/// σ of each column of an information matrix; `None` if it is not positive definite.
fn sigmas(information: DMatrix<f64>) -> Option<Vec<f64>> {
    let covariance = information.cholesky()?.inverse();
    Some(covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flight of 60 s with ten steps per second; column 0 is informed from 10 to 14 s, column 1 from 40 to 44 s.
    fn track() -> InformationTrack {
        let (mut total, mut stamps_ns, mut information) = (DMatrix::identity(2, 2), Vec::new(), Vec::new());
        for step in 0..600 {
            let time_s = f64::from(step) * 0.1;
            total[(0, 0)] += if (10.0..14.0).contains(&time_s) { 5.0 } else { 0.01 };
            total[(1, 1)] += if (40.0..44.0).contains(&time_s) { 5.0 } else { 0.01 };
            stamps_ns.push(ns_from_seconds(time_s));
            information.push(total.clone());
        }
        InformationTrack {
            start_ns: 0,
            stamps_ns,
            information,
            prior: DMatrix::identity(2, 2),
            lead_ns: ns_from_seconds(1.0),
        }
    }

    #[test]
    fn stretches_cover_the_times_that_inform() {
        let found = track().useful_stretches(12.0).expect("the flight informs");
        assert_eq!(found.stretches.len(), 2);
        for (stretch, informed_s) in found.stretches.iter().zip([10.0, 40.0]) {
            // The first second of a stretch is used by the initialization.
            assert!(seconds_from_ns(stretch.start_ns) + 1.0 <= informed_s + 0.11, "{stretch:?}");
            assert!(seconds_from_ns(stretch.end_ns) >= informed_s + 3.9, "{stretch:?}");
        }
        assert!(found.ratios.iter().all(|ratio| (1.0..1.02).contains(ratio)), "{:?}", found.ratios);
        assert!(found.stretches[0].growth_without[0] > 5.0 && found.stretches[0].growth_without[1] < 1.1);
    }

    #[test]
    fn too_few_seconds_show_in_the_ratio() {
        let found = track().useful_stretches(4.0).expect("the flight informs");
        assert_eq!(found.stretches.len(), 1);
        assert!(found.ratios.iter().copied().fold(0.0, f64::max) > 5.0, "{:?}", found.ratios);
        assert_eq!(track().useful_stretches(2.0), None, "shorter than initialization and two seconds");
        assert_eq!(InformationTrack::default().useful_stretches(20.0), None);
    }
}
