use std::collections::BTreeSet;
use std::path::PathBuf;

use super::plan::WHOLE;
use crate::study::{JobLog, JobSubject, RecordedLog, StudyJob, StudyPlan, StudyTrajectory, expand, shard};

fn log(name: &str) -> RecordedLog {
    RecordedLog {
        name: name.to_owned(),
        path: PathBuf::from(format!("/data/{name}.mcap")),
        sha256: format!("hash of {name}"),
        rig: None,
        rig_sha256: "rig".to_owned(),
        truth: None,
        truth_sha256: String::new(),
        start_s: 1.0,
        duration_s: None,
        length_s: 12.0,
        trajectories: Vec::new(),
    }
}

#[test]
fn every_combination_is_one_job() {
    let plan = StudyPlan::from_toml(WHOLE).unwrap();
    let jobs = expand(&plan, &[log("a"), log("b")], "0.2.0");
    // Logs: without errors once, with random ones for 3 seeds; flights: 2 recipes × 2 disturbances × 2 × 3 seeds; 2 runs.
    // With errors and the third seed the second run is excluded on 2 logs, and on 2 recipes with 2 disturbances.
    assert_eq!(jobs.len(), 2 * (1 + 3) * 2 + 2 * 2 * 2 * 3 * 2 - 2 - 2 * 2);
    let keys: BTreeSet<&str> = jobs.iter().map(|job| job.key.as_str()).collect();
    assert_eq!(keys.len(), jobs.len());
    assert!(keys.iter().all(|key| key.len() == 64));
    assert_eq!(jobs[0].job.describe(), "a, auto");
    assert_eq!(jobs[3].job.describe(), "a, 5 mm, 1°, seed 1, minimal:encoder=off,name=no-encoder");
    assert_eq!(jobs.last().unwrap().job.describe(), "t4, fog, 5 mm, 1°, seed 3, auto");
    assert_eq!(jobs[0].job.log.duration_s(), Some(11.0));
    let again = expand(&plan, &[log("a"), log("b")], "0.2.0");
    assert_eq!(jobs, again);
    // The same log twice is the same job.
    assert_eq!(expand(&plan, &[log("a"), log("b"), log("a")], "0.2.0").len(), jobs.len());
}

#[test]
fn a_key_is_that_of_the_inputs_and_not_of_the_place() {
    let plan = StudyPlan::from_toml("[[logs]]\npath = \"a\"\n").unwrap();
    let job = expand(&plan, &[log("a")], "0.2.0").remove(0);
    let key = |change: &dyn Fn(&mut StudyJob)| {
        let mut job = job.job.clone();
        change(&mut job);
        job.key("0.2.0")
    };
    let recorded = |change: fn(&mut RecordedLog)| {
        key(&move |job| match &mut job.log {
            JobLog::Recorded(log) => change(log),
            JobLog::Simulated(_) => unreachable!("the plan has no flights"),
        })
    };
    // A change of the rules by which keys are made repeats every study, so it must be on purpose.
    assert_eq!(job.key, "e412786a9c3f3cc7ffc949e454c89803f28c67e6161af557b65aa9f23df0b026");
    assert_eq!(key(&|_| ()), job.key);
    assert_eq!(recorded(|log| log.path = PathBuf::from("/elsewhere/a.mcap")), job.key);
    assert_eq!(key(&|job| job.study = "other".to_owned()), job.key);
    assert_eq!(
        key(&|job| job.subject = JobSubject::Run("auto:window=10,encoder=on,name=a".parse().unwrap())),
        key(&|job| {
            job.subject = JobSubject::Run("auto:encoder=on,name=a,window=10".parse().unwrap());
        })
    );
    let others = [
        recorded(|log| log.sha256 = "other".to_owned()),
        recorded(|log| log.rig_sha256 = "other".to_owned()),
        recorded(|log| log.truth_sha256 = "other".to_owned()),
        recorded(|log| log.start_s = 2.0),
        recorded(|log| log.duration_s = Some(2.0)),
        key(&|job| job.seed = Some(1)),
        key(&|job| job.subject = JobSubject::Run("auto:window=12".parse().unwrap())),
        key(&|job| job.perturbation.name = "other".to_owned()),
        key(&|job| job.disturbance = "other".to_owned()),
        job.job.key("0.2.1"),
    ];
    let distinct: BTreeSet<&String> = others.iter().chain([&job.key]).collect();
    assert_eq!(distinct.len(), others.len() + 1);
}

/// A log with a trajectory in a file and one in a topic.
fn log_with_trajectories(name: &str) -> RecordedLog {
    let trajectory =
        |text: &str, sha256: &str| StudyTrajectory { spec: text.parse().unwrap(), sha256: sha256.to_owned() };
    let trajectories = vec![trajectory("/data/vins.tum:vins", "hash"), trajectory("topic:/ov/odometry:OpenVINS", "")];
    RecordedLog { trajectories, ..log(name) }
}

#[test]
fn trajectories_are_evaluated_once_for_each_log() {
    let plan = StudyPlan::from_toml(WHOLE).unwrap();
    let of = |log: RecordedLog| -> Vec<_> {
        let jobs = expand(&plan, &[log], "0.2.0").into_iter();
        jobs.filter(|job| job.job.subject.run().is_none()).collect()
    };
    let jobs = of(log_with_trajectories("a"));
    let described: Vec<String> = jobs.iter().map(|job| job.job.describe()).collect();
    assert_eq!(described, ["a, trajectory:vins", "a, trajectory:OpenVINS"]);
    assert!(jobs.iter().all(|job| job.job.seed.is_none() && job.job.perturbation.is_none()));
    let changed = |change: &dyn Fn(&mut StudyTrajectory)| {
        let mut log = log_with_trajectories("a");
        change(&mut log.trajectories[0]);
        of(log)[0].key.clone()
    };
    // The path of a file and the other trajectories of the log have no effect on the key; the file's content has.
    assert_eq!(changed(&|it| it.spec = "/elsewhere/vins.csv:vins".parse().unwrap()), jobs[0].key);
    assert_ne!(changed(&|it| it.sha256 = "other".to_owned()), jobs[0].key);
    let runs = |log: RecordedLog| -> Vec<String> {
        let jobs = expand(&plan, &[log], "0.2.0").into_iter();
        jobs.filter(|job| job.job.subject.run().is_some()).map(|job| job.key).collect()
    };
    assert_eq!(runs(log_with_trajectories("a")), runs(log("a")));
}

#[test]
fn bundles_are_jobs_beside_the_runs() {
    let plan = |bundles: &str| StudyPlan::from_toml(&format!("bundles = [{bundles}]\n{WHOLE}"));
    let [runs, all] = ["", "\"bundle\", \"static-bundle\""].map(|bundles| {
        let jobs = expand(&plan(bundles).unwrap(), &[log("a")], "0.2.0");
        jobs.into_iter().map(|job| (job.key, job.job.subject.label().to_owned())).collect::<Vec<_>>()
    });
    let same: Vec<_> = all.iter().filter(|(_, label)| !label.ends_with("bundle")).collect();
    assert_eq!(same, runs.iter().collect::<Vec<_>>());
    let of = |name: &str| all.iter().filter(|(_, label)| label == name).count();
    assert_eq!([of("bundle"), of("static-bundle")], [of("auto"); 2]);
    assert_eq!(all.iter().map(|(key, _)| key).collect::<BTreeSet<_>>().len(), all.len());
    let error = plan("\"gimbal\"").unwrap_err().to_string();
    assert!(error.contains("'gimbal': expected bundle or static-bundle"), "{error}");
    let twice = WHOLE.replace("name=no-encoder", "name=bundle").replace("\"no-encoder\"", "\"bundle\"");
    let error = StudyPlan::from_toml(&format!("bundles = [\"bundle\"]\n{twice}")).unwrap_err().to_string();
    assert!(error.contains("two entries named 'bundle'"), "{error}");
}

#[test]
fn a_job_comes_back_from_its_text() {
    let plan = StudyPlan::from_toml(&format!("bundles = [\"bundle\"]\n{WHOLE}")).unwrap();
    for job in expand(&plan, &[log("a"), log_with_trajectories("b")], "0.2.0") {
        let text = serde_json::to_string(&job.job).unwrap();
        let read: StudyJob = serde_json::from_str(&text).unwrap();
        assert_eq!((read.key("0.2.0"), &read.log), (job.key, &job.job.log));
    }
}

#[test]
fn shards_share_the_jobs_and_keep_flights_together() {
    let plan = StudyPlan::from_toml(WHOLE).unwrap();
    let jobs = expand(&plan, &[log("a"), log("b")], "0.2.0");
    for count in [1, 2, 3, 7, 100] {
        let shards: Vec<_> = (1..=count).map(|index| shard(jobs.clone(), index, count)).collect();
        let keys: BTreeSet<&str> = shards.iter().flatten().map(|job| job.key.as_str()).collect();
        assert_eq!(
            (keys.len(), shards.iter().map(Vec::len).sum::<usize>()),
            (jobs.len(), jobs.len()),
            "{count} shards"
        );
        let flights = |jobs: &[crate::study::KeyedJob]| -> BTreeSet<String> {
            let ids = jobs.iter().filter_map(|job| match &job.job.log {
                JobLog::Simulated(flight) => Some(flight.id()),
                JobLog::Recorded(_) => None,
            });
            ids.collect()
        };
        let rendered: usize = shards.iter().map(|jobs| flights(jobs).len()).sum();
        assert_eq!(rendered, flights(&jobs).len(), "a flight is rendered by one shard");
    }
}
