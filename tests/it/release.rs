//! Version and date of the release: the same in everything that a package carries.

use std::fs;
use std::path::Path;
use std::process::Command;

fn text_of(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Version and date of the first list of the changelog.
fn newest_release() -> (String, String) {
    let changelog = text_of("CHANGELOG.md");
    let heading = changelog.lines().find_map(|line| line.strip_prefix("## ")).expect("the changelog has a list");
    let (version, date) = heading.split_once(" (").unwrap_or_else(|| panic!("'{heading}' has no date"));
    (version.to_owned(), date.trim_end_matches(')').to_owned())
}

#[test]
fn changelog_metadata_and_manual_pages_have_version_and_date_of_the_release() {
    let (version, date) = newest_release();
    assert_eq!(version, env!("CARGO_PKG_VERSION"), "CHANGELOG.md and Cargo.toml");
    let digits = |part: &str, count| part.len() == count && part.bytes().all(|byte| byte.is_ascii_digit());
    let parts: Vec<&str> = date.split('-').collect();
    assert!(matches!(*parts, [y, m, d] if digits(y, 4) && digits(m, 2) && digits(d, 2)), "{date} is no date");

    let header = format!("\"{date}\" \"dcvins {version}\"");
    for (path, expected) in [
        ("assets/linux/dcvins.metainfo.xml", vec![format!("<release version=\"{version}\" date=\"{date}\"/>")]),
        ("assets/linux/dcvins.1", vec![format!(".TH DCVINS 1 {header}")]),
        (".github/CITATION.cff", vec![format!("\nversion: {version}\n"), format!("\ndate-released: \"{date}\"\n")]),
    ] {
        let text = text_of(path);
        for words in expected {
            assert!(text.contains(&words), "{path} lacks '{}'", words.trim());
        }
    }

    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("man");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    let status = command.args(["generate", "man", "-o"]).arg(&pages).output().unwrap();
    assert!(status.status.success(), "{}", String::from_utf8_lossy(&status.stderr));
    let page = fs::read_to_string(pages.join("dcvins-run.1")).unwrap();
    let line = page.lines().find(|line| line.starts_with(".TH ")).expect("a manual page has a header");
    let words = ["1", date.as_str(), "dcvins", version.as_str()];
    assert!(words.iter().all(|word| line.contains(word)), "{line}");
}
