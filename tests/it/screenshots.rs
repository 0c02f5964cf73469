//! `screenshot` at several times.

use std::fs;
use std::path::Path;
use std::process::Command;

/// Draws the timeline of the sample log into a folder; returns the exit code and the names of the files.
fn draw(folder: &Path, arguments: &[&str]) -> (Option<i32>, Vec<String>) {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.arg("screenshot").arg(log).args(["--panel", "timeline", "--size", "640x200", "-o"]);
    command.arg(folder.join("line.png")).args(arguments);
    let output = command.output().expect("the program starts");
    let entries = fs::read_dir(folder).expect("the folder is there");
    let name = |entry: std::io::Result<fs::DirEntry>| {
        entry.expect("it can be read").file_name().to_string_lossy().into_owned()
    };
    let mut names: Vec<String> = entries.map(name).collect();
    names.sort();
    (output.status.code(), names)
}

#[test]
fn a_name_that_no_screenshot_has_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    let output =
        command.arg("screenshot").arg(log).args(["--at", "0.5", "-o"]).arg(folder.path().join("line.csv")).output();
    let output = output.expect("the program starts");
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(message.contains("none of .png, .svg and .pdf"), "{message}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
}

#[test]
fn several_instants_are_named_by_their_time() {
    let check = |arguments: &[&str], code: i32, names: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let drawn = draw(folder.path(), arguments);
        assert_eq!(
            (drawn.0, drawn.1.as_slice()),
            (Some(code), names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>().as_slice()),
            "{arguments:?}"
        );
        for name in names {
            let screenshot = image::open(folder.path().join(name)).unwrap();
            assert_eq!((screenshot.width(), screenshot.height()), (640, 200), "{name}");
        }
    };
    check(&["--at", "0.5"], 0, &["line.png"]);
    check(&["--at", "1", "--at", "0.5", "--at", "1.0"], 0, &["line-0000.500.png", "line-0001.000.png"]);
    let every = ["line-0000.200.png", "line-0000.700.png", "line-0001.200.png", "line-0001.300.png"];
    check(&["--every", "0.5", "--start", "0.2", "--duration", "1.1", "--at", "1.3"], 0, &every);
    // Without a time it is the end.
    check(&["--duration", "1"], 0, &["line.png"]);
    check(&["--every", "0"], 2, &[]);
}

#[test]
fn figures_have_their_size_on_paper_and_the_command_that_repeats_them() {
    let folder = tempfile::tempdir().unwrap();
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let draw = |name: &str, arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
        command.env("DCVINS_CACHE_DIR", "").current_dir(folder.path());
        command
            .arg("screenshot")
            .arg(&log)
            .args(["--duration", "4", "--panel", "timeline", "-o", name])
            .args(arguments);
        let output = command.output().expect("the program starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let figure = ["--from", "2", "--to", "3.5", "--width-mm", "85", "--height-mm", "60", "--font-pt", "7"];
    for name in ["line.svg", "line.pdf", "line.png"] {
        assert_eq!(draw(name, &figure), (Some(0), String::new()), "{name}");
    }
    let read = |name: &str| fs::read(folder.path().join(name)).expect("the file was written");
    let svg = String::from_utf8(read("line.svg")).unwrap();
    assert!(svg.contains(r#"width="85mm" height="60mm""#), "{svg}");
    assert!(svg.contains("--panel timeline -o line.svg --from 2 --to 3.5 --width-mm 85"), "{svg}");
    // Labels are 11 points of the drawing, which are 7 points of 1/72 inch: 85 mm are 240.94 of those.
    assert!(svg.contains(r#"viewBox="0 0 378."#) && svg.contains(r#"font-size="11""#), "{svg}");
    // The range is that of the figure, and the cursor at its end is omitted.
    assert!(svg.contains(">2.5 s</text>") && !svg.contains(">0 s</text>"), "{svg}");
    let pdf = read("line.pdf");
    assert!(pdf.starts_with(b"%PDF-1.7"));
    let text = String::from_utf8_lossy(&pdf).into_owned();
    assert!(text.contains("/MediaBox [0 0 240.94") && text.contains("/Subject"), "a page of 85 mm");
    let image = image::load_from_memory(&read("line.png")).unwrap();
    assert_eq!([image.width(), image.height()], [1004, 709], "300 dpi");
    // The same command replaces its own PDF, with the same bytes, but not the PDF of another program.
    assert_eq!(draw("line.pdf", &figure).0, Some(0));
    assert!(read("line.pdf") == pdf, "two figures differ");
    fs::write(folder.path().join("paper.pdf"), "%PDF-1.5 /Creator (TeX)").unwrap();
    assert!(draw("paper.pdf", &figure).1.contains("the file exists"));
    for (arguments, problem) in [
        (&["--from", "3", "--to", "2", "--width-mm", "85"][..], "ends before it begins"),
        (&["--from", "3"], "--to"),
        (&["--width-mm", "5"], "expected millimetres from 20 to 1000"),
        (&["--width-mm", "85", "--size", "640x480"], "cannot be used with"),
        (&["--width-mm", "85", "--shown-run", "other"], "expected one of"),
        (&["--width-mm", "85", "--renderer", "wgpu"], "without a graphics adapter"),
    ] {
        let (code, message) = draw("other.svg", arguments);
        assert!(code != Some(0) && message.contains(problem), "{arguments:?}: {message}");
    }
    assert!(!folder.path().join("other.svg").exists());
}
