//! The tables over all flights, beside the paper's.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::Result;
use dcvins::simulation::Experiment;

use crate::flights::{Flight, Offline, RUNS};

/// Index of a run in [`RUNS`].
const ONLINE: usize = 0;
const FIXED: usize = 1;
const STATIC: usize = 2;

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

/// Median of the values, and their smallest and largest.
fn spread(mut values: Vec<f64>) -> Option<(f64, f64, f64)> {
    values.sort_by(f64::total_cmp);
    let (first, last) = (*values.first()?, *values.last()?);
    let middle = values.len() / 2;
    let median =
        if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + values[middle]) } else { values[middle] };
    Some((median, first, last))
}

fn written(values: Vec<f64>, digits: usize) -> String {
    spread(values).map_or_else(
        || "none".to_owned(),
        |(median, low, high)| format!("{median:.digits$} [{low:.digits$}, {high:.digits$}]"),
    )
}

fn of(flights: &[Flight], experiment: Experiment) -> impl Iterator<Item = &Flight> {
    flights.iter().filter(move |flight| flight.experiment == experiment)
}

fn flown(flights: &[Flight]) -> impl Iterator<Item = Experiment> {
    Experiment::ALL.into_iter().filter(|experiment| of(flights, *experiment).next().is_some())
}

/// Tables 2 and 3: absolute trajectory errors.
pub(crate) fn accuracy(flights: &[Flight]) -> String {
    let mut text = String::from(
        "Tables 2 and 3: ATE RMSE in m after alignment by yaw and position, median [lowest, highest] over the seeds\n\
         | flight | length m | run | paper | ours | % of the length | flights lost |\n| --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut sums = [0.0; 3];
    for experiment in flown(flights) {
        for (run, sum) in sums.iter_mut().enumerate() {
            let errors: Vec<f64> = of(flights, experiment).filter_map(|flight| flight.ate_m(run)).collect();
            let percent = of(flights, experiment)
                .filter_map(|flight| Some(flight.runs[run].accuracy.as_ref()?.ate_percent_of_length))
                .collect();
            let lost = of(flights, experiment).count() - errors.len();
            *sum += spread(errors.clone()).map_or(f64::NAN, |(median, ..)| median);
            let paper = paper_rmse_m(experiment, run).map_or_else(|| "-".to_owned(), |rmse_m| format!("{rmse_m:.3}"));
            let length = of(flights, experiment).map(|flight| flight.path_length_m).fold(0.0, f64::max);
            writeln!(
                text,
                "| {} | {length:.0} | {} | {paper} | {} | {} | {lost} |",
                experiment.name(),
                RUNS[run],
                written(errors, 3),
                written(percent, 2)
            )
            .expect("a string takes it");
        }
    }
    writeln!(
        text,
        "\nSum of the medians: gimbal {:.3} m, static {:.3} m: {:.0} % less with the gimbal\n",
        sums[ONLINE],
        sums[STATIC],
        100.0 * (1.0 - sums[ONLINE] / sums[STATIC])
    )
    .expect("a string takes it");
    text
}

/// How well the chain is known after the flight.
pub(crate) fn calibration(flights: &[Flight]) -> String {
    let mut text = String::from(
        "Error of imu_from_camera over the joint angles visited, median [lowest, highest]; the paper after T4: 15.2 ± 7.5 mm, 1.11 ± 0.74°\n\
         | flight | given mm | after mm | given ° | after ° |\n| --- | --- | --- | --- | --- |\n",
    );
    for experiment in flown(flights) {
        let column = |run: usize, of_error: fn((f64, f64)) -> f64| -> Vec<f64> {
            of(flights, experiment).filter_map(|flight| flight.chain_error(run)).map(of_error).collect()
        };
        let millimetres = |(metres, _): (f64, f64)| metres * 1e3;
        let degrees = |(_, degrees): (f64, f64)| degrees;
        writeln!(
            text,
            "| {} | {} | {} | {} | {} |",
            experiment.name(),
            written(column(FIXED, millimetres), 1),
            written(column(ONLINE, millimetres), 1),
            written(column(FIXED, degrees), 2),
            written(column(ONLINE, degrees), 2)
        )
        .expect("a string takes it");
    }
    text.push('\n');
    text
}

/// Tables 1 and 3: the offline calibration and the flight with it.
pub(crate) fn offline(flights: &[Flight]) -> String {
    let tried = || flights.iter().filter_map(|flight| flight.offline.as_ref());
    if tried().next().is_none() {
        return String::new();
    }
    let done: Vec<&Offline> = tried().filter_map(|offline| offline.as_ref().ok()).collect();
    let column = |value: fn(&Offline) -> Option<f64>| done.iter().filter_map(|offline| value(offline)).collect();
    let mut text = format!(
        "Tables 1 and 3: calibrated offline from the same T4 flight ({} of {} worked), then flown with the result held fixed\n\
         | what | paper | ours |\n| --- | --- | --- |\n",
        done.len(),
        tried().count()
    );
    let rows: [(&str, &str, Vec<f64>, usize); 9] = [
        (
            "static camera alone, reprojection px",
            "0.36 (Cam.-IMU)",
            column(|offline| Some(offline.calibration.camera_imu_reprojection.error_px.mean)),
            2,
        ),
        (
            "static camera on the IMU, mm",
            "12.30",
            column(|offline| Some(offline.calibration.truth.as_ref()?.static_camera_imu.translation_mean_m * 1e3)),
            2,
        ),
        (
            "static camera on the IMU, °",
            "0.35",
            column(|offline| {
                Some(offline.calibration.truth.as_ref()?.static_camera_imu.rotation_mean_rad.to_degrees())
            }),
            3,
        ),
        (
            "static camera in the cluster, reprojection px",
            "1.35 (DCC static)",
            column(|offline| Some(offline.calibration.reprojection.first()?.error_px.mean)),
            2,
        ),
        (
            "gimbal camera in the cluster, reprojection px",
            "1.44 (DCC gimbal), 1.54 (DCC calib.)",
            column(|offline| Some(offline.calibration.reprojection.get(1)?.error_px.mean)),
            2,
        ),
        (
            "chain, mm",
            "7.78",
            column(|offline| Some(offline.calibration.truth.as_ref()?.chain_final.translation_mean_m * 1e3)),
            2,
        ),
        (
            "chain, °",
            "4.23 (encoders σ 10°), 0.31 with more excitation",
            column(|offline| Some(offline.calibration.truth.as_ref()?.chain_final.rotation_mean_rad.to_degrees())),
            3,
        ),
        (
            "ATE RMSE of the flight with it, m",
            "1.406 (online 0.740)",
            column(|offline| Some(offline.run.accuracy.as_ref()?.ate_rmse_m)),
            3,
        ),
        ("seconds for the calibration", "-", column(|offline| Some(offline.calibrated_in_s)), 0),
    ];
    for (what, paper, values, digits) in rows {
        writeln!(text, "| {what} | {paper} | {} |", written(values, digits)).expect("a string takes it");
    }
    for (flight, error) in flights.iter().filter_map(|flight| Some((flight, flight.offline.as_ref()?.as_ref().err()?)))
    {
        writeln!(text, "seed {}: {error}", flight.seed).expect("a string takes it");
    }
    text.push('\n');
    text
}

/// Time of the stages and of the whole, and memory.
pub(crate) fn speed(flights: &[Flight]) -> String {
    let mut text = String::from(
        "Times in ms per image of the run `auto` while the other runs share the machine, median over the flights of p50 and p95\n\
         | flight | front end | optimize | marginalize | observability | step | simulated at × real time | three runs at × real time |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for experiment in flown(flights) {
        let stage = |of_timing: fn(&dcvins::export::TimingSummary) -> &dcvins::export::StageSummary| {
            let all: Vec<_> =
                of(flights, experiment).filter_map(|flight| flight.runs[ONLINE].timing_ms.as_ref()).collect();
            let middle = |values: Vec<f64>| spread(values).map_or(f64::NAN, |(median, ..)| median);
            let p50 = middle(all.iter().map(|timing| of_timing(timing).p50).collect());
            let p95 = middle(all.iter().map(|timing| of_timing(timing).p95).collect());
            format!("{p50:.1} / {p95:.1}")
        };
        writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            experiment.name(),
            stage(|timing| &timing.frontend),
            stage(|timing| &timing.optimize),
            stage(|timing| &timing.marginalize),
            stage(|timing| &timing.observability),
            stage(|timing| &timing.step),
            written(of(flights, experiment).map(|flight| flight.duration_s / flight.simulated_in_s).collect(), 2),
            written(of(flights, experiment).map(|flight| flight.duration_s / flight.estimated_in_s).collect(), 2)
        )
        .expect("a string takes it");
    }
    if let Some(peak) = peak_memory_mib() {
        writeln!(text, "\nLargest memory of the process: {peak:.0} MiB").expect("a string takes it");
    }
    text
}

/// Largest resident memory so far, where the system tells it.
fn peak_memory_mib() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
}

/// One line for each run of each flight.
pub(crate) fn write_csv(flights: &[Flight], folder: &Path) -> Result<()> {
    let mut text = String::from(
        "experiment,seed,duration_s,path_length_m,run,initialized_at_s,restarts,ate_rmse_m,ate_mean_m,ate_std_m,ate_max_m,\
         ate_percent_of_length,chain_initial_m,chain_initial_deg,chain_m,chain_std_m,chain_deg,chain_std_deg,\
         frontend_p50_ms,step_p50_ms,step_p95_ms,simulated_in_s,estimated_in_s\n",
    );
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
    for flight in flights {
        let offline = flight.offline.iter().filter_map(|offline| Some(&offline.as_ref().ok()?.run));
        for run in flight.runs.iter().chain(offline) {
            let accuracy = run.accuracy.as_ref();
            let first = run.calibration.chain_error_initial.as_ref();
            let last = run.calibration.chain_error.as_ref();
            let timing = run.timing_ms.as_ref();
            let columns = [
                flight.experiment.name().to_owned(),
                flight.seed.to_string(),
                format!("{:.3}", flight.duration_s),
                format!("{:.3}", flight.path_length_m),
                run.run.replace(',', ";"),
                number(run.frames.initialized_at_s),
                run.frames.restarts.to_string(),
                number(accuracy.map(|accuracy| accuracy.ate_rmse_m)),
                number(accuracy.map(|accuracy| accuracy.ate_mean_m)),
                number(accuracy.map(|accuracy| accuracy.ate_std_m)),
                number(accuracy.map(|accuracy| accuracy.ate_max_m)),
                number(accuracy.map(|accuracy| accuracy.ate_percent_of_length)),
                number(first.map(|error| error.translation_mean_m)),
                number(first.map(|error| error.rotation_mean_rad.to_degrees())),
                number(last.map(|error| error.translation_mean_m)),
                number(last.map(|error| error.translation_std_m)),
                number(last.map(|error| error.rotation_mean_rad.to_degrees())),
                number(last.map(|error| error.rotation_std_rad.to_degrees())),
                number(timing.map(|timing| timing.frontend.p50)),
                number(timing.map(|timing| timing.step.p50)),
                number(timing.map(|timing| timing.step.p95)),
                number(Some(flight.simulated_in_s)),
                number(Some(flight.estimated_in_s)),
            ];
            text.push_str(&columns.join(","));
            text.push('\n');
        }
    }
    fs::write(folder.join("flights.csv"), text)?;
    Ok(())
}
