//! Crates of the build: their sources and licences, crates in several versions, and crates without a maintainer.
//!
//! Read from the lock files and from `cargo metadata` without network access; requires that the build has downloaded its
//! dependencies. Known vulnerabilities need a database from the network: `docs/packages.md`.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;
use spdx::{Expression, LicenseId, ParseMode, license_id};

/// Licences that allow the program to be distributed under Apache-2.0, with their notices kept.
const LICENCES: [&str; 14] = [
    "0BSD",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0", // no rights reserved
    "ISC",
    "MIT",
    "MPL-2.0", // per file, and no file of it is changed here
    "OFL-1.1", // the fonts of the window
    "Ubuntu-font-1.0",
    "Unicode-3.0",
    "Zlib",
    "bzip2-1.0.6",
];

/// Crates in more than one version, with the crates that need the older ones.
const SEVERAL_VERSIONS: [(&str, &str); 16] = [
    ("equator", "nano-gemm"),
    ("equator-macro", "equator of nano-gemm"),
    ("foldhash", "hashbrown 0.15"),
    ("getrandom", "ahash"),
    ("glam", "nalgebra, which converts to several"),
    ("hashbrown", "petgraph, gpu-allocator"),
    ("itertools", "criterion"),
    ("linux-raw-sys", "rustix 0.38"),
    ("miniz_oxide", "png"),
    ("num-bigint", "num-rational"),
    ("pollster", "rfd"),
    ("rustc-hash", "naga, wgpu-core"),
    ("rustix", "winit, calloop"),
    ("syn", "interpol, and macros that still use syn 2"),
    ("thiserror", "calloop, smithay-client-toolkit"),
    ("thiserror-impl", "thiserror 1"),
];

/// Crates without a maintainer, with the crates that depend on them; no release of these avoids them.
const UNMAINTAINED: [(&str, &[&str]); 1] =
    [("paste", &["gemm", "gemm-c32", "gemm-c64", "gemm-common", "gemm-f16", "gemm-f32", "gemm-f64", "mcap", "pulp"])];

/// A crate of the build.
struct Package {
    name: String,
    version: String,
    licence: String,
    /// Names of its dependencies in this build.
    dependencies: BTreeSet<String>,
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

fn array<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().map_or(&[], Vec::as_slice)
}

/// Every crate that is built for this platform, including those of tests and benchmarks.
fn packages() -> Vec<Package> {
    let rustc = Command::new("rustc").arg("-vV").output().expect("rustc runs");
    let version = String::from_utf8(rustc.stdout).expect("its version is text");
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).expect("rustc names its host");
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", host])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("cargo writes JSON");
    let described = array(&metadata, "packages");
    let by_id: BTreeMap<String, &Value> = described.iter().map(|package| (text(&package["id"]), package)).collect();
    let nodes = array(&metadata["resolve"], "nodes").iter();
    let package = |node: &Value| {
        let of_id = |id: &Value| by_id[&text(id)];
        let package = of_id(&node["id"]);
        Package {
            name: text(&package["name"]),
            version: text(&package["version"]),
            licence: text(&package["license"]),
            dependencies: array(node, "dependencies").iter().map(|id| text(&of_id(id)["name"])).collect(),
        }
    };
    nodes.map(package).collect()
}

#[test]
fn every_crate_comes_from_crates_io_with_a_checksum() {
    for lock in [include_str!("../../Cargo.lock"), include_str!("../../fuzz/Cargo.lock")] {
        for package in lock.split("[[package]]").skip(1) {
            let own = package.starts_with("\nname = \"dcvins");
            let source = package.contains("\nsource = \"registry+https://github.com/rust-lang/crates.io-index\"\n");
            let checksum = package.contains("\nchecksum = \"");
            assert!(own || source && checksum, "{package}");
        }
    }
}

#[test]
fn every_licence_allows_distribution() {
    let allowed: Vec<LicenseId> =
        LICENCES.iter().map(|name| license_id(name).unwrap_or_else(|| panic!("{name} is a licence"))).collect();
    let packages = packages();
    assert!(packages.len() > 300, "{} crates", packages.len());
    for Package { name, version, licence, .. } in &packages {
        let expression = Expression::parse_mode(licence, ParseMode::LAX)
            .unwrap_or_else(|error| panic!("licence of {name} {version}: {error}"));
        let holds = expression.evaluate(|term| term.license.id().is_some_and(|id| allowed.contains(&id)));
        assert!(holds, "{name} {version} is under {licence}");
    }
}

#[test]
fn crates_in_several_versions_are_known() {
    let mut versions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for package in packages() {
        versions.entry(package.name).or_default().insert(package.version);
    }
    versions.retain(|_, versions| versions.len() > 1);
    let found: BTreeSet<&str> = versions.keys().map(String::as_str).collect();
    let known: BTreeSet<&str> = SEVERAL_VERSIONS.iter().map(|(name, _)| *name).collect();
    assert_eq!(found, known, "crates in several versions: {versions:?}");
}

#[test]
fn crates_without_a_maintainer_come_only_with_those_that_need_them() {
    let packages = packages();
    for (name, known) in UNMAINTAINED {
        let users: BTreeSet<&str> = packages
            .iter()
            .filter(|package| package.dependencies.contains(name))
            .map(|package| package.name.as_str())
            .collect();
        assert_eq!(users, known.iter().copied().collect(), "crates that use {name}");
    }
}
