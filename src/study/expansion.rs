//! Expansion of a plan to its jobs.

use std::collections::{BTreeMap, BTreeSet};

use super::job::{JobLog, JobSubject, KeyedJob, RecordedLog, SimulatedFlight, StudyJob};
use super::perturbation::RigPerturbation;
use super::plan::{Exclusion, StudyPlan};

/// Jobs of a plan in the order of its tables: logs as found, then flights; for each the disturbances, perturbations,
/// seeds, specifications and bundle adjustments, and for a recorded log its trajectories.
///
/// Recorded logs are run without disturbances, their trajectories are evaluated once, and the plan's exclusions are
/// omitted. If neither the log nor the perturbation is random, there is one job without a seed instead of one for each
/// seed.
pub fn expand(plan: &StudyPlan, logs: &[RecordedLog], program: &str) -> Vec<KeyedJob> {
    let mut jobs = Vec::new();
    let recorded = logs.iter().map(|log| JobLog::Recorded(Box::new(log.clone())));
    let undisturbed = plan.disturbances.iter().find(|level| level.disturb.is_empty());
    let undisturbed = undisturbed.map_or("none", |level| level.name.as_str());
    for log in recorded {
        for perturbation in &plan.perturbations {
            let seeds: Vec<Option<u64>> =
                if perturbation.is_random() { plan.seeds.iter().copied().map(Some).collect() } else { vec![None] };
            for seed in seeds {
                add_subjects(&mut jobs, plan, &log, undisturbed, perturbation, seed);
            }
        }
        if let JobLog::Recorded(recorded) = &log {
            jobs.extend(recorded.trajectories.iter().map(|trajectory| StudyJob {
                study: plan.name.clone(),
                log: log.clone(),
                disturbance: undisturbed.to_owned(),
                perturbation: RigPerturbation { name: "none".to_owned(), ..RigPerturbation::default() },
                seed: None,
                subject: JobSubject::Trajectory(trajectory.clone()),
            }));
        }
    }
    for recipe in &plan.flights {
        for level in &plan.disturbances {
            for perturbation in &plan.perturbations {
                for seed in &plan.seeds {
                    let (recipe, disturb) = (recipe.clone(), level.disturb.clone());
                    let flight = JobLog::Simulated(Box::new(SimulatedFlight { recipe, disturb, seed: *seed }));
                    add_subjects(&mut jobs, plan, &flight, &level.name, perturbation, Some(*seed));
                }
            }
        }
    }
    jobs.retain(|job| !plan.exclusions.iter().any(|exclusion| exclusion.has(job)));
    let mut known = BTreeSet::new();
    let keyed = jobs.into_iter().map(|job| KeyedJob { key: job.key(program), job });
    keyed.filter(|job| known.insert(job.key.clone())).collect()
}

impl Exclusion {
    /// True if each non-empty list contains the job's level.
    fn has(&self, job: &StudyJob) -> bool {
        let named = |names: &[String], name: &str| names.is_empty() || names.iter().any(|known| known == name);
        named(&self.logs, job.log.name())
            && named(&self.disturbances, &job.disturbance)
            && named(&self.perturbations, &job.perturbation.name)
            && named(&self.specs, job.subject.label())
            && (self.seeds.is_empty() || job.seed.is_some_and(|seed| self.seeds.contains(&seed)))
    }
}

fn add_subjects(
    jobs: &mut Vec<StudyJob>,
    plan: &StudyPlan,
    log: &JobLog,
    disturbance: &str,
    perturbation: &RigPerturbation,
    seed: Option<u64>,
) {
    let runs = plan.specs.iter().cloned().map(JobSubject::Run);
    jobs.extend(runs.chain(plan.bundles.iter().copied().map(JobSubject::Bundle)).map(|subject| StudyJob {
        study: plan.name.clone(),
        log: log.clone(),
        disturbance: disturbance.to_owned(),
        perturbation: perturbation.clone(),
        seed,
        subject,
    }));
}

/// Jobs of one shard: every `count`-th flight with all its jobs, starting with number `index` (from 1).
///
/// Jobs on one flight stay together, so that only one shard renders it; the sizes of shards differ by at most one
/// flight.
pub fn shard(jobs: Vec<KeyedJob>, index: usize, count: usize) -> Vec<KeyedJob> {
    let mut flights: BTreeMap<String, usize> = BTreeMap::new();
    let mut groups = 0;
    let mut in_shard = move |job: &KeyedJob| {
        let mut next = || {
            groups += 1;
            groups - 1
        };
        let group = match &job.job.log {
            JobLog::Simulated(flight) => *flights.entry(flight.id()).or_insert_with(next),
            JobLog::Recorded(_) => next(),
        };
        group % count == index - 1
    };
    jobs.into_iter().filter(|job| in_shard(job)).collect()
}
