//! Damaged logs through the whole program: no panic, bounded memory, and a result from the undamaged part.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use dcvins::flight_log::FlightLog;

/// Limit of the address space of a run; the sample log needs a third of it.
const MEMORY_KIB: u64 = 3_000_000;
/// Estimated part of the log, in the undamaged half.
const DURATION_S: &str = "4";

/// Pseudorandom numbers (splitmix64), for the same damage in every run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % bound as u64) as usize
    }
}

/// Damage to the last half of a file.
#[derive(Clone, Copy, Debug)]
enum Damage {
    /// A sector of 512 bytes is 0xff, as erased flash memory.
    ErasedSector,
    /// A page of 4096 bytes is 0, as a file whose end was never written.
    ZeroPage,
    /// Fifty bits are flipped.
    Bits,
    /// The rest of the file is missing.
    Truncated,
    /// A piece of 10 kB is missing.
    Hole,
    /// A piece of 10 kB is repeated.
    Repeated,
    /// Eight bytes at the possible place of a length are the largest number.
    LargestLength,
}

const DAMAGES: [Damage; 7] = [
    Damage::ErasedSector,
    Damage::ZeroPage,
    Damage::Bits,
    Damage::Truncated,
    Damage::Hole,
    Damage::Repeated,
    Damage::LargestLength,
];

fn damaged(bytes: &[u8], damage: Damage, seed: u64) -> Vec<u8> {
    let mut numbers = Numbers(seed);
    let mut damaged = bytes.to_vec();
    let half = bytes.len() / 2;
    let at = half + numbers.below(half - 10_000);
    match damage {
        Damage::ErasedSector => damaged[at..at + 512].fill(0xff),
        Damage::ZeroPage => damaged[at..at + 4096].fill(0),
        Damage::Bits => {
            for _ in 0..50 {
                damaged[half + numbers.below(half)] ^= 1 << numbers.below(8);
            }
        }
        Damage::Truncated => damaged.truncate(at),
        Damage::Hole => drop(damaged.drain(at..at + 10_000)),
        Damage::Repeated => drop(damaged.splice(at..at, bytes[at..at + 10_000].iter().copied())),
        Damage::LargestLength => damaged[at..at + 8].fill(0xff),
    }
    damaged
}

/// Runs the program with bounded memory.
fn dcvins(arguments: &[&str]) -> Output {
    let limited = format!("ulimit -v {MEMORY_KIB}; exec \"$0\" \"$@\"");
    Command::new("sh")
        .args(["-c", &limited, env!("CARGO_BIN_EXE_dcvins")])
        .args(arguments)
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .expect("the program starts")
}

/// The rig of the sample log with its rigid camera alone: the checks of one camera's images read the log as those of both.
fn rigid_rig(rig: &str) -> String {
    let (before, gimbal_camera) = rig.split_once("cam0:").expect("the sample has two cameras");
    let (_, rigid_camera) = gimbal_camera.split_once("cam1:").expect("the sample has two cameras");
    let (rigid_camera, gimbal) = rigid_camera.split_once("gimbal:").expect("the sample has a gimbal");
    let (_, ground_truth) = gimbal.split_once("ground_truth:").expect("the sample has ground truth");
    format!("{before}cam0:{rigid_camera}ground_truth:{ground_truth}")
}

fn messages(log: &Path, topic: &str) -> u64 {
    let log = FlightLog::open(log).expect("the log can be opened");
    log.topic(topic).map_or(0, |topic| topic.count)
}

/// Damages the sample log in its last half, then runs, checks and converts it.
fn check(damage: Damage, seed: u64) {
    let sample = |name: &str| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs").join(name);
    let folder = tempfile::tempdir().expect("a folder can be made");
    let path = |name: &str| folder.path().join(name);
    let text = |path: &Path| path.to_str().expect("paths of tests are UTF-8").to_owned();
    let (log, out, converted) = (path("damaged.mcap"), path("out"), path("converted.mcap"));
    let whole = fs::read(sample("garden.mcap")).expect("the sample log can be read");
    fs::write(&log, damaged(&whole, damage, seed)).expect("the log can be written");
    let given = fs::read_to_string(sample("garden.rig.yaml")).expect("the sample has a rig");
    fs::write(path("rigid.rig.yaml"), rigid_rig(&given)).expect("the rig can be written");
    let (log_text, rig) = (text(&log), text(&path("rigid.rig.yaml")));

    let run = [
        "run",
        &log_text,
        "--rig",
        &rig,
        "--run",
        "static",
        "--duration",
        DURATION_S,
        "--no-check",
        "--out",
        &text(&out),
    ];
    let run = dcvins(&run);
    assert_eq!(run.status.code(), Some(0), "{damage:?} {seed}: run: {}", String::from_utf8_lossy(&run.stderr));
    let trajectory = fs::read_to_string(out.join("static/trajectory.tum")).expect("a trajectory was written");
    assert!(trajectory.lines().count() > 20, "{damage:?} {seed}: {} lines", trajectory.lines().count());

    let checked = dcvins(&["check", &log_text, "--rig", &rig, "--json"]);
    let code = checked.status.code();
    assert!(code.is_some_and(|code| code != 101), "{damage:?} {seed}: check: {code:?}");
    let report: serde_json::Value = serde_json::from_slice(&checked.stdout).expect("check writes JSON");
    assert!(report.is_object(), "{damage:?} {seed}: {report}");

    let convert = dcvins(&["convert", &log_text, "-o", &text(&converted)]);
    let problem = String::from_utf8_lossy(&convert.stderr);
    assert_eq!(convert.status.code(), Some(0), "{damage:?} {seed}: convert: {problem}");
    for topic in ["/imu", "/static_camera/image_raw/compressed"] {
        let (kept, all) = (messages(&converted, topic), messages(&sample("garden.mcap"), topic));
        assert!(kept as f64 >= 0.45 * all as f64, "{damage:?} {seed}: {kept} of {all} messages of {topic} are left");
    }
}

#[test]
fn damage_in_the_last_half_leaves_the_first() {
    for (seed, damage) in DAMAGES.into_iter().enumerate() {
        check(damage, seed as u64);
    }
}
