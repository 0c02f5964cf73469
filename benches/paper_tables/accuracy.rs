//! Tables 1 to 3 beside the paper's and beside what is aimed at.

use dcvins::simulation::Experiment;

use crate::drive::Driven;
use crate::flights::{CLUSTER, FIXED, Flight, ONLINE, Offline, OfflineErrors, RUNS, STATIC};
use crate::table::{Table, median, number, written};

/// RMSE of the paper's Tables 2 and 3: the gimballed camera (T4: with online calibration) and the static one.
fn paper_rmse_m(experiment: Experiment, run: usize) -> Option<f64> {
    match (experiment, run) {
        (Experiment::T1, ONLINE) => Some(0.292),
        (Experiment::T2, ONLINE) => Some(0.310),
        (Experiment::T3, ONLINE) => Some(0.180),
        (Experiment::T4, ONLINE) => Some(0.740),
        (Experiment::T1, STATIC) => Some(0.384),
        (Experiment::T2, STATIC) => Some(0.360),
        (Experiment::T3, STATIC) => Some(0.414),
        _ => None,
    }
}

/// What is aimed at: half of the paper's for the gimballed camera, below the paper's for the static one.
fn aim_rmse_m(experiment: Experiment, run: usize) -> Option<f64> {
    let share = if run == ONLINE { 0.5 } else { 1.0 };
    Some(share * paper_rmse_m(experiment, run)?)
}

fn verdict(ours: Option<f64>, aim: Option<f64>) -> &'static str {
    match (ours, aim) {
        (_, None) => "-",
        (Some(ours), Some(aim)) if ours <= aim => "met",
        _ => "missed",
    }
}

fn or_dash(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
}

/// Table 2: absolute trajectory errors of the gimballed and the static camera.
pub(crate) fn cameras(flights: &[Flight]) -> Table {
    let mut table = Table::new(
        "table2",
        "Table 2: ATE RMSE in m after alignment by yaw and position, median [lowest, highest] over the seeds",
        &["flight", "length m", "run", "paper", "aim", "ours", "", "% of the length", "seeds", "lost", "restarts"],
    );
    for (experiment, run, name) in Flight::experiments_and_runs(flights) {
        let errors: Vec<f64> = Flight::of(flights, experiment).filter_map(|flight| flight.run(run).ate_m()).collect();
        let count = Flight::of(flights, experiment).count();
        let percent = Flight::of(flights, experiment)
            .filter_map(|flight| Some(flight.run(run).accuracy.as_ref()?.ate_percent_of_length));
        let restarts: usize = Flight::of(flights, experiment).map(|flight| flight.run(run).restarts).sum();
        let length = Flight::of(flights, experiment).map(|flight| flight.path_length_m()).fold(0.0, f64::max);
        let aim = aim_rmse_m(experiment, run);
        table.row([
            experiment.name().to_owned(),
            format!("{length:.0}"),
            name.to_owned(),
            or_dash(paper_rmse_m(experiment, run), 3),
            or_dash(aim, 3),
            written(errors.clone(), 3),
            verdict(median(errors.clone()), aim).to_owned(),
            written(percent.collect(), 2),
            count.to_string(),
            (count - errors.len()).to_string(),
            restarts.to_string(),
        ]);
    }
    let average = |run: usize| {
        let medians: Vec<f64> = Flight::experiments(flights)
            .filter(|experiment| *experiment != Experiment::T4)
            .filter_map(|experiment| {
                median(Flight::of(flights, experiment).filter_map(|flight| flight.run(run).ate_m()).collect())
            })
            .collect();
        medians.iter().sum::<f64>() / medians.len() as f64
    };
    let (gimbal, rigid) = (average(ONLINE), average(STATIC));
    if gimbal.is_finite() {
        let less = 100.0 * (1.0 - gimbal / rigid);
        table.notes.push(format!(
            "Average of the medians over {}: gimbal {gimbal:.3} m, static {rigid:.3} m: {less:.0} % less with the gimbal \
             (aim: at least 31 %, {})",
            Flight::experiments(flights)
                .filter(|experiment| *experiment != Experiment::T4)
                .map(Experiment::name)
                .collect::<Vec<_>>()
                .join(", "),
            if less >= 31.0 { "met" } else { "missed" }
        ));
    }
    table
}

/// Table 3: online calibration, the given chain held fixed, and the offline baseline.
pub(crate) fn online_and_offline(flights: &[Flight]) -> Table {
    let mut table = Table::new(
        "table3",
        "Table 3: T4 with the chain given wrong by ±3 cm and ±10°, encoders σ 7°: ATE RMSE in m, median [lowest, highest]",
        &["calibration", "paper", "aim", "ours", "", "seeds"],
    );
    let flown: Vec<&Flight> = Flight::of(flights, Experiment::T4).collect();
    if flown.is_empty() {
        return table;
    }
    let of_run = |run: usize| -> Vec<f64> { flown.iter().filter_map(|flight| flight.run(run).ate_m()).collect() };
    let offline: Vec<f64> = done(flights).filter_map(|offline| offline.run.ate_m()).collect();
    let rows = [
        ("online", Some(0.740), Some(0.37), of_run(ONLINE)),
        ("online, both cameras in one window", None, Some(0.37), of_run(CLUSTER)),
        ("calibrated offline from the same flight, then held fixed", Some(1.406), None, offline),
        ("as given, held fixed", None, None, of_run(FIXED)),
    ];
    for (name, paper, aim, errors) in rows {
        let verdict = verdict(median(errors.clone()), aim);
        let seeds = errors.len().to_string();
        table.row([name.to_owned(), or_dash(paper, 3), or_dash(aim, 2), written(errors, 3), verdict.to_owned(), seeds]);
    }
    table
}

/// How well the chain is known after the flight.
pub(crate) fn chains(flights: &[Flight]) -> Table {
    let mut table = Table::new(
        "calibration",
        "Error of imu_from_camera over the joint angles visited, median [lowest, highest]; the paper after T4: \
         15.2 ± 7.5 mm, 1.11 ± 0.74°; aim after T4: 5 mm, 0.3°",
        &["flight", "run", "given mm", "after mm", "given °", "after °", ""],
    );
    for experiment in Flight::experiments(flights) {
        for run in [ONLINE, CLUSTER, STATIC] {
            let column = |pick: fn(&Driven) -> Option<f64>| -> Vec<f64> {
                Flight::of(flights, experiment).filter_map(|flight| pick(flight.run(run))).collect()
            };
            let given_mm = column(|run| Some(run.chain_error_initial?.metres * 1e3));
            let given_deg = column(|run| Some(run.chain_error_initial?.degrees));
            let (millimetres, degrees) = (column(Driven::chain_mm), column(Driven::chain_deg));
            let aimed = experiment == Experiment::T4 && run == ONLINE;
            let met = median(millimetres.clone()).is_some_and(|value| value <= 5.0)
                && median(degrees.clone()).is_some_and(|value| value <= 0.3);
            table.row([
                experiment.name(),
                RUNS[run].0,
                &written(given_mm, 1),
                &written(millimetres, 1),
                &written(given_deg, 2),
                &written(degrees, 2),
                if !aimed {
                    "-"
                } else if met {
                    "met"
                } else {
                    "missed"
                },
            ]);
        }
    }
    table
}

fn done(flights: &[Flight]) -> impl Iterator<Item = &Offline> {
    flights.iter().filter_map(Flight::offline)
}

/// Table 1: the offline calibration.
pub(crate) fn offline(flights: &[Flight]) -> Table {
    type Value = fn(&OfflineErrors) -> Option<f64>;
    let tried = flights.iter().filter(|flight| flight.estimated.offline.is_some()).count();
    let mut table = Table::new(
        "table1",
        format!(
            "Table 1: offline calibration from the T4 flights themselves, encoders σ 7° ({} of {tried} worked), median \
             [lowest, highest]; the paper: encoders σ 10°, 39 measurement poses",
            done(flights).count()
        ),
        &["what", "paper", "aim", "ours", ""],
    );
    let rows: [(&str, f64, usize, Value); 7] = [
        ("static camera alone, reprojection px (Cam.-IMU)", 0.36, 2, |left| Some(left.static_alone_px)),
        ("static camera on the IMU, mm (Cam.-IMU)", 12.30, 2, |left| Some(left.static_mount?.metres * 1e3)),
        ("static camera on the IMU, ° (Cam.-IMU)", 0.35, 3, |left| Some(left.static_mount?.degrees)),
        ("static camera in the cluster, reprojection px (DCC static)", 1.35, 2, |left| {
            left.cluster_px.first().copied()
        }),
        ("gimbal camera in the cluster, reprojection px (DCC calib.)", 1.54, 2, |left| left.cluster_px.get(1).copied()),
        ("chain, mm (DCC calib.)", 7.78, 2, |left| Some(left.chain?.metres * 1e3)),
        ("chain, ° (DCC calib.; 0.31 with better excitation)", 4.23, 3, |left| Some(left.chain?.degrees)),
    ];
    for (what, paper, digits, value) in rows {
        let values: Vec<f64> = done(flights).filter_map(|offline| value(&offline.calibration)).collect();
        let aim = 0.5 * paper;
        table.row([
            what.to_owned(),
            format!("{paper}"),
            format!("{aim:.digits$}"),
            written(values.clone(), digits),
            verdict(median(values), Some(aim)).to_owned(),
        ]);
    }
    let seconds = done(flights).map(|offline| offline.calibrated_in_s).collect();
    table.notes.push(format!("Seconds for the calibration: {}", written(seconds, 0)));
    for flight in flights {
        if let Some(Err(error)) = &flight.estimated.offline {
            table.notes.push(format!("Seed {}: {error}", flight.seed));
        }
    }
    table
}

/// One line for each run of each flight.
pub(crate) fn every_flight(flights: &[Flight]) -> Table {
    let mut table = Table::new(
        "flights",
        "Every flight",
        &[
            "experiment",
            "seed",
            "duration_s",
            "path_length_m",
            "run",
            "initialized_at_s",
            "restarts",
            "lost_s",
            "ate_rmse_m",
            "ate_max_m",
            "ate_percent_of_length",
            "chain_initial_m",
            "chain_initial_deg",
            "chain_m",
            "chain_deg",
            "step_p50_ms",
            "step_p95_ms",
            "simulated_in_s",
            "estimated_in_s",
            "failures",
        ],
    );
    for flight in flights {
        let offline = flight.offline().map(|offline| ("offline", &offline.run));
        for (name, run) in RUNS.iter().map(|(name, _)| *name).zip(&flight.estimated.runs).chain(offline) {
            let accuracy = run.accuracy.as_ref();
            table.row([
                flight.experiment.name().to_owned(),
                flight.seed.to_string(),
                format!("{:.2}", flight.duration_s),
                format!("{:.2}", flight.path_length_m()),
                name.to_owned(),
                number(run.initialized_at_s, 2),
                run.restarts.to_string(),
                format!("{:.1}", run.lost_s),
                number(run.ate_m(), 4),
                number(accuracy.map(|accuracy| accuracy.ate_max_m), 4),
                number(accuracy.map(|accuracy| accuracy.ate_percent_of_length), 4),
                number(run.chain_error_initial.map(|distance| distance.metres), 5),
                number(run.chain_error_initial.map(|distance| distance.degrees), 4),
                number(run.chain_error.map(|distance| distance.metres), 5),
                number(run.chain_error.map(|distance| distance.degrees), 4),
                number(run.step_ms.map(|[median, _]| median), 1),
                number(run.step_ms.map(|[_, high]| high), 1),
                number(flight.simulated_in_s, 0),
                format!("{:.0}", flight.estimated.in_s),
                run.failures.join("; "),
            ]);
        }
    }
    table
}
