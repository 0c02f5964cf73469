//! Commands on a study: screenshots, tables and a report, from Parquet and from CSV.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use dcvins::sweep::write_parquet;
use dcvins::sweep::{OpenedStudy, is_study};

use crate::study_sample;

fn dcvins(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dcvins"))
        .env("DCVINS_CACHE_DIR", "")
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// Writes the tables as Parquet or as CSV.
fn write_study(folder: &Path, parquet: bool) {
    fs::create_dir_all(folder).expect("a folder in a new one");
    for (name, table) in ["results", "parameters"].into_iter().zip(study_sample::tables(study_sample::SEEDS)) {
        if parquet {
            write_parquet(&table, &folder.join(format!("{name}.parquet"))).expect("the table is written");
        } else {
            fs::write(folder.join(format!("{name}.csv")), table.csv(0..table.rows())).expect("the table is written");
        }
    }
}

#[test]
fn parquet_and_csv_are_the_same_study() {
    let folder = tempfile::tempdir().unwrap();
    let [parquet, csv] = ["parquet", "csv"].map(|kind| folder.path().join(kind));
    assert!(!is_study(folder.path()));
    write_study(&parquet, true);
    write_study(&csv, false);
    assert!(is_study(&parquet) && is_study(&csv) && is_study(&parquet.join("results.parquet")));
    let read = [&parquet, &csv].map(|path| OpenedStudy::read(path).unwrap_or_else(|error| panic!("{error}")));
    assert_eq!(read[0].study().name, "gimbal-mounts");
    let rows = |study: &OpenedStudy| -> Vec<String> {
        let tables = [&study.study().runs, &study.study().parameters];
        let row = |table: &dcvins::study::StudyTable, row| format!("{:?}", table.row(row).collect::<Vec<_>>());
        tables
            .into_iter()
            .flat_map(|table| (0..table.rows()).map(|number| row(table, number)).collect::<Vec<_>>())
            .collect()
    };
    assert_eq!(rows(&read[0]), rows(&read[1]));
    fs::write(csv.join("results.csv"), "a,b\n1,2\n").unwrap();
    let message = OpenedStudy::read(&csv).unwrap_err().to_string();
    assert!(message.contains("no column 'run'") && message.contains("results.csv"), "{message}");
    fs::write(csv.join("results.csv"), "run,b\n1\n").unwrap();
    let message = OpenedStudy::read(&csv).unwrap_err().to_string();
    assert!(message.starts_with("cannot read the table") && message.contains("line: 2"), "{message}");
}

#[test]
fn panels_of_a_study_are_drawn_with_their_tables() {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("study");
    write_study(&study, true);
    let text = |path: &Path| path.to_str().expect("the path is UTF-8").to_owned();
    let draw = |name: &str, more: &[&str]| {
        let output = text(&folder.path().join(name));
        let study = text(&study);
        let mut arguments = vec!["screenshot", study.as_str(), "-o", output.as_str(), "--size", "900x500"];
        arguments.extend(more);
        let done = dcvins(&arguments);
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    assert_eq!(draw("all.png", &[]), (Some(0), String::new()));
    assert!(image::open(folder.path().join("all.png")).is_ok());
    let filter = ["--panel", "differences", "--csv", "--reference", "classical", "--filter", "log = city"];
    assert_eq!(draw("differences.svg", &filter), (Some(0), String::new()));
    let drawn = fs::read_to_string(folder.path().join("differences.svg")).unwrap();
    assert!(drawn.contains("− classical"), "the axis names the reference");
    let table = fs::read_to_string(folder.path().join("differences.csv")).unwrap();
    assert!(table.starts_with("group,key,run,ate_rmse [m] − classical\nauto,") && table.contains("on city"), "{table}");
    for (more, code, part) in [
        (&["--panel", "scene"][..], 1, "expected one of all, runs, distributions"),
        (&["--at", "5"], 1, "is a study: leave --at"),
        (&["--filter", "ate < 1"], 1, "there is no column 'ate'"),
        (&["--metric", "speed"], 1, "unknown metric 'speed'"),
        (&["--csv"], 1, "name the panel"),
    ] {
        let (found, message) = draw("wrong.png", more);
        assert!(found == Some(code) && message.contains(part), "{more:?}: {message}");
    }
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let of_log = dcvins(&["screenshot", &text(&log), "--at", "1", "--filter", "a = 1", "-o", "x.png"]);
    assert_eq!(of_log.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&of_log.stderr).contains("--filter is for studies"));
}

#[test]
fn the_report_of_a_study_is_one_page_with_its_tables_and_the_same_twice() {
    let folder = tempfile::tempdir().unwrap();
    let [study, report] = ["study", "report"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    write_study(Path::new(&study), true);
    let write = || dcvins(&["report", &study, "-o", &report, "--reference", "auto"]);
    let read = |name: &str| fs::read_to_string(Path::new(&report).join(name)).unwrap_or_else(|_| panic!("{name}"));
    let done = write();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let page = read("report.html");
    for part in
        ["Study report: gimbal-mounts", "192 of 192 runs", "95 %, Wilson", "mean difference to auto", "pitch.alpha"]
    {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("http://") && !page.contains("https://"), "it links to nothing");
    let summary: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!((&summary["study"], &summary["runs"]), (&"gimbal-mounts".into(), &192.into()));
    assert_eq!(summary["groups"].as_array().map(Vec::len), Some(4));
    assert!(read("differences.csv").lines().count() > 50);
    let before = page;
    assert!(write().status.success(), "a report on the same study is replaced");
    assert_eq!(read("report.html"), before, "the same bytes");
    fs::write(Path::new(&report).join("report.json"), "{\"log\": \"flight.mcap\"}").unwrap();
    let refused = write();
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("not of the study"));
}
