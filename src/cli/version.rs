//! Version of the program, with the commit from which it was built if that is known.

use std::sync::LazyLock;

/// Commit of the build, by the environment variable `DCVINS_COMMIT`; the scripts of the packages set it.
const COMMIT: Option<&str> = option_env!("DCVINS_COMMIT");

static VERSION: LazyLock<String> = LazyLock::new(|| described(COMMIT));

/// Text of `--version` behind the name of the program, such as `0.2.0 (618ee816)`.
pub(crate) fn version() -> &'static str {
    &VERSION
}

fn described(commit: Option<&str>) -> String {
    let number = env!("CARGO_PKG_VERSION");
    match commit.filter(|commit| !commit.is_empty()) {
        Some(commit) => format!("{number} ({commit})"),
        None => number.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::described;

    #[test]
    fn a_build_without_a_commit_has_the_number_alone() {
        assert_eq!(described(None), env!("CARGO_PKG_VERSION"));
        assert_eq!(described(Some("")), env!("CARGO_PKG_VERSION"));
        assert!(described(Some("618ee816")).ends_with(" (618ee816)"));
    }
}
