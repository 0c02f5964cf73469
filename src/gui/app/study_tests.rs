//! Tests of a study in the window: opening it like a log, opening its runs, and returning to it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::tests::{SampleLog, TestDesktop, opened, run_until, sample_opener};
use super::{App, OpenLog, OpenRequest, OpenStudy, PlayingLog, StudySource};
use crate::gui::desktop::Desktop;
use crate::gui::study::tests::synthetic_study;
use crate::gui::theme::ThemeName;
use crate::study::view::Study;

/// A study whose runs are the sample log; a static run cannot be opened.
struct SampleStudy {
    study: Arc<Study>,
    opened: Mutex<Vec<Vec<usize>>>,
}

impl StudySource for SampleStudy {
    fn study(&self) -> Arc<Study> {
        Arc::clone(&self.study)
    }

    fn open_runs(&self, rows: &[usize]) -> Result<Box<dyn PlayingLog>, String> {
        self.opened.lock().unwrap().push(rows.to_vec());
        match self.study.runs.text(rows[0], "run") {
            Some("static") => Err("cannot read the log: no such file: /flights/house.mcap".to_owned()),
            _ => Ok(Box::new(SampleLog::new(Path::new("/flights/house.mcap")))),
        }
    }
}

/// A window in which a study has been opened by its path.
fn with_study() -> (Harness<'static, App>, Arc<SampleStudy>) {
    let source = Arc::new(SampleStudy { study: Arc::new(synthetic_study(1)), opened: Mutex::default() });
    let open: OpenLog = sample_opener();
    let shared = Arc::clone(&source);
    let open_study: OpenStudy = Arc::new(move |path: &Path| {
        let shared = Arc::clone(&shared);
        path.extension().is_none().then(move || Ok(shared as Arc<dyn StudySource>))
    });
    let desktop = Arc::new(TestDesktop::default()) as Arc<dyn Desktop>;
    let mut app = App::new(open, desktop, ThemeName::Dark).with_studies(open_study);
    app.open(OpenRequest::of(PathBuf::from("/studies/gimbal-sweep")));
    let mut harness = Harness::builder().with_size([1600.0, 900.0]).build_ui_state(|ui, app: &mut App| app.ui(ui), app);
    run_until(&mut harness, |harness| harness.state().has_study());
    harness.run_steps(3);
    (harness, source)
}

#[test]
fn a_run_opens_in_front_of_its_study_and_closing_it_goes_back() {
    let (mut harness, source) = with_study();
    assert!(opened(&harness).is_none() && harness.query_by_label("200 runs").is_some());
    harness.get_by_label("Open auto on house, seed 0").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    assert_eq!(*source.opened.lock().unwrap(), [vec![0, 1, 2, 3]], "with the runs beside it");
    assert_eq!(opened(&harness), Some(PathBuf::from("/flights/house.mcap")));
    harness.run_steps(2);
    harness.get_by_label("Back to the study").click();
    run_until(&mut harness, |harness| opened(harness).is_none());
    harness.run_steps(2);
    assert!(harness.query_by_label("200 runs").is_some() && harness.state().has_study());
    harness.get_by_label("Open auto on house, seed 0").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.key_press_modifiers(Modifiers::COMMAND, Key::W);
    run_until(&mut harness, |harness| opened(harness).is_none());
    harness.run_steps(2);
    harness.get_by_label("Close study").click();
    harness.run_steps(3);
    assert!(!harness.state().has_study() && harness.query_by_label("Recent logs").is_some());
}

#[test]
fn a_run_that_cannot_be_opened_is_reported_and_the_study_stays() {
    let (mut harness, _) = with_study();
    harness.get_by_label("Filter condition").focus();
    harness.run_steps(2);
    harness.get_by_label("Filter condition").type_text("run = static and log = house");
    harness.run_steps(3);
    harness.get_by_label("Open static on house, seed 0").click();
    run_until(&mut harness, |harness| harness.query_by_label_contains("cannot read the log: no such file").is_some());
    assert!(harness.state().has_study() && opened(&harness).is_none());
}

#[test]
fn another_log_replaces_the_study() {
    let (mut harness, _) = with_study();
    harness.state_mut().open(OpenRequest::of(PathBuf::from("/logs/city.mcap")));
    run_until(&mut harness, |harness| opened(harness).is_some());
    assert!(!harness.state().has_study());
    harness.run_steps(2);
    assert!(harness.query_by_label("Back to the study").is_none());
}
