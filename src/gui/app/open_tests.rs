//! Tests: progress of a conversion, several dropped files, and the page of a missing rig.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::rig_question::RigPage;
use super::tests::{Dropped, TestDesktop, opened, opened_log, run_until};
use super::{App, OpenFailure, OpenLog, OpenProgress, OpenRequest, RigQuestion};
use crate::files::RigFile as _;
use crate::flight_log::{FlightLog, RigCandidate};
use crate::gui::desktop::Desktop;
use crate::gui::rendering::headless::{Headless, HeadlessOptions};
use crate::gui::tests::keep_screenshot;
use crate::gui::theme::ThemeName;
use crate::painting::painter::Painter;

fn window(open: OpenLog) -> (Harness<'static, App>, Arc<TestDesktop>) {
    let desktop = Arc::new(TestDesktop::default());
    let app = App::new(open, Arc::clone(&desktop) as Arc<dyn Desktop>, ThemeName::Light);
    let mut harness = Harness::builder().with_size([1400.0, 850.0]).build_ui_state(|ui, app: &mut App| app.ui(ui), app);
    harness.run_steps(2);
    (harness, desktop)
}

fn drop_files(harness: &mut Harness<'static, App>, paths: &[&str]) {
    for path in paths {
        harness.input_mut().dropped_files.push(Arc::new(Dropped(PathBuf::from(path))));
    }
    harness.run_steps(1);
}

/// The sample log of the repository, as one without a rig.
fn question(request: &OpenRequest) -> RigQuestion {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let candidate = |name: &str, description: Result<&str, &str>| RigCandidate {
        path: PathBuf::from("/flights").join(name),
        is_kalibr: name.contains("camchain"),
        description: description.map(str::to_owned).map_err(str::to_owned),
    };
    RigQuestion {
        log: Arc::new(FlightLog::open(&path).unwrap()),
        request: request.clone(),
        reason: "yard.bag (ROS 1 bag) has no rig: none given, none at /flights/yard.rig.yaml, none attached".to_owned(),
        candidates: vec![
            candidate("camchain-imucam.yaml", Ok("2 cameras, rigid")),
            candidate("house.rig.yaml", Err("not in the log: /gimbal/camera")),
        ],
        new_rig: PathBuf::from("/flights/yard.rig.yaml"),
    }
}

#[test]
fn files_dropped_together_are_opened_together_and_their_conversion_can_be_cancelled() {
    let stopped = Arc::new(AtomicBool::new(false));
    let asked = Arc::new(Mutex::new(Vec::new()));
    let (is_stopped, requests) = (Arc::clone(&stopped), Arc::clone(&asked));
    let (mut harness, _) = window(Arc::new(move |request, progress| {
        requests.lock().unwrap().push(request.clone());
        if request.sources.len() == 1 {
            return Ok(opened_log(&request.sources[0]));
        }
        for step in 0.. {
            let ratio = f64::from(step % 50) / 100.0;
            if progress(OpenProgress { text: "Converting a.mp4 (MP4 video)".to_owned(), ratio: Some(ratio) })
                == ControlFlow::Break(())
            {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        is_stopped.store(true, Ordering::Relaxed);
        Err(OpenFailure::Cancelled)
    }));
    drop_files(&mut harness, &["/x/a.mp4", "/x/a.ulg"]);
    run_until(&mut harness, |harness| harness.query_by_label_contains("Converting a.mp4 (MP4 video): ").is_some());
    assert_eq!(asked.lock().unwrap()[0].sources, ["/x/a.mp4", "/x/a.ulg"].map(PathBuf::from));
    // Another drop asks before it stops the conversion.
    drop_files(&mut harness, &["/x/b.mcap"]);
    harness.run_steps(2);
    assert!(harness.query_by_label("The conversion in progress is stopped").is_some());
    harness.get_by_label("Keep").click();
    harness.run_steps(2);
    assert!(!stopped.load(Ordering::Relaxed));
    harness.get_by_label("Cancel opening").click();
    run_until(&mut harness, |_| stopped.load(Ordering::Relaxed));
    harness.run_steps(2);
    assert!(opened(&harness).is_none() && harness.query_by_label("Recent logs").is_some());
    assert_eq!(asked.lock().unwrap().len(), 1);
}

#[test]
fn a_log_without_a_rig_is_opened_with_a_found_a_dropped_or_a_new_one() {
    let asked: Arc<Mutex<Vec<OpenRequest>>> = Arc::default();
    let requests = Arc::clone(&asked);
    let (mut harness, desktop) = window(Arc::new(move |request, _| {
        requests.lock().unwrap().push(request.clone());
        match request.rig {
            Some(_) => Ok(opened_log(&request.sources[0])),
            None => Err(OpenFailure::NeedsRig(Box::new(question(request)))),
        }
    }));
    let rig_of_last = || asked.lock().unwrap().last().and_then(|request| request.rig.clone());
    let page_is_open = |harness: &Harness<'static, App>| harness.query_by_label("Rigs found").is_some();
    drop_files(&mut harness, &["/flights/yard.bag"]);
    run_until(&mut harness, page_is_open);
    harness.get_by_label("Open with camchain-imucam.yaml").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    assert_eq!(rig_of_last(), Some(PathBuf::from("/flights/camchain-imucam.yaml")));
    // A rig that is dropped onto an open log opens it again, after a question.
    drop_files(&mut harness, &["/flights/other.rig.yaml"]);
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("with the rig /flights/other.rig.yaml").is_some());
    harness.get_by_role_and_label(egui::Role::Button, "Open").click();
    run_until(&mut harness, |_| rig_of_last() == Some(PathBuf::from("/flights/other.rig.yaml")));
    run_until(&mut harness, |harness| harness.state().opening.is_none());

    harness.state_mut().rig_page = Some(RigPage::new(question(&OpenRequest::of("/flights/yard.bag".into()))));
    harness.run_steps(2);
    run_until(&mut harness, |harness| harness.query_by_label_contains("values assumed; measure or confirm").is_some());
    // The dialog grows with the values, and its buttons move.
    harness.run_steps(5);
    harness.get_by_label("Save and open").click();
    run_until(&mut harness, |_| rig_of_last() == Some(PathBuf::from("/flights/yard.rig.yaml")));
    let rigs = desktop.rigs.lock().unwrap();
    let (path, text) = &rigs[0];
    let rig = crate::sensors::Rig::from_yaml(text, path).unwrap();
    assert_eq!(rig.name, "yard");
    let joints: Vec<&str> = rig.gimbal.iter().flat_map(|gimbal| &gimbal.joints).map(|it| it.name.as_str()).collect();
    assert_eq!(joints, ["yaw", "roll", "pitch"], "the mechanism follows the names of the joints in the log");
    assert!(text.contains("assumed:"));
}

#[test]
fn the_page_of_a_missing_rig_is_drawn() {
    let options = HeadlessOptions { size_px: [1366, 768], pixels_per_point: 1.0, theme: ThemeName::Light };
    let open: OpenLog = Arc::new(|_, _| Err(OpenFailure::Cancelled));
    let mut app = App::new(open, Arc::new(TestDesktop::default()), ThemeName::Light);
    app.rig_page = Some(RigPage::new(question(&OpenRequest::of(Path::new("/flights/yard.bag").to_path_buf()))));
    let (mut headless, mut painter) = (Headless::new(options), Painter::new());
    let mut shown = headless.frame(Vec::new(), |ui| app.ui(ui));
    painter.set_textures(&shown.textures);
    shown.textures.clear();
    std::thread::sleep(std::time::Duration::from_millis(500));
    let Ok(screenshot) = headless.screenshot(&mut painter, |ui| app.ui(ui));
    keep_screenshot("rig-page", &screenshot);
    assert!(app.rig_page.is_some() && screenshot.width() == 1366);
}
