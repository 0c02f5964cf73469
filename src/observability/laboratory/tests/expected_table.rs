//! Computed values against the tables of docs/mathematics.md, sections 7 and 9.
//!
//! Column A of these tables, the paper's literal swap, is omitted: that parameterization cannot represent every
//! mechanism and is not implemented.

use super::super::{DegeneracySurvey, SurveyRow, survey};

/// Expected ranks of one experiment.
struct Expected {
    scenario: &'static str,
    /// Structural rank of each parameterization.
    ranks: &'static [usize],
    /// Deficit of the first parameterization: parameterization, joints, absorbed, motion.
    deficit: [usize; 4],
    /// Parameters of the null directions of the minimal parameterization; `None` where the table does not list all.
    null_of_minimal: Option<&'static [&'static str]>,
}

const NOTHING: Option<&[&str]> = Some(&[]);
const OFFSETS: Option<&[&str]> = Some(&["L1.theta", "L2.theta", "L3.theta"]);

const fn expected(
    scenario: &'static str,
    ranks: &'static [usize],
    deficit: [usize; 4],
    null_of_minimal: Option<&'static [&'static str]>,
) -> Expected {
    Expected { scenario, ranks, deficit, null_of_minimal }
}

const SECTIONS: [(&str, &[Expected]); 6] = [
    (
        "Joint angles and poses (exciting motion)",
        &[
            expected("encoder known, poses known", &[18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("encoder known, poses known, generic", &[18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("encoder known, IMU, bias known", &[18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("encoder known, IMU, bias free", &[18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("encoder prior 7 deg, poses known", &[18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("encoder prior 10 deg, IMU, bias free", &[18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("no encoder, poses known", &[15, 15, 15], [6, 0, 3, 0], OFFSETS),
            expected("no encoder, poses known, generic", &[15, 15, 15], [6, 0, 3, 0], OFFSETS),
            expected("no encoder, IMU, bias known", &[15, 15, 15], [6, 0, 3, 0], OFFSETS),
            expected("no encoder, IMU, bias free, 10 frames", &[12, 12, 12], [6, 0, 3, 3], None),
            expected("no encoder, IMU, bias free, 11 frames", &[15, 15, 15], [6, 0, 3, 0], OFFSETS),
            expected("no encoder, ideal gimbal, poses known", &[9, 9, 9], [6, 0, 9, 0], None),
            expected("no encoder, ideal gimbal, IMU, bias known", &[9, 9, 9], [6, 0, 9, 0], None),
            expected("no encoder, ideal gimbal, IMU, bias free", &[9, 9, 9], [6, 0, 9, 0], None),
            expected("no encoder, without offsets (21 and 15)", &[15, 15], [4, 0, 2, 0], None),
        ],
    ),
    (
        "Number of joints (12 + 4N columns, 4N + 6 identifiable)",
        &[
            expected("no joints", &[6, 6, 6], [6, 0, 0, 0], NOTHING),
            expected("one joint", &[10, 10, 10], [6, 0, 0, 0], NOTHING),
            expected("two joints", &[14, 14, 14], [6, 0, 0, 0], NOTHING),
            expected("three joints", &[18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("four joints", &[22, 22, 22], [6, 0, 0, 0], NOTHING),
        ],
    ),
    (
        "Mechanisms (exciting, encoder known, poses known)",
        &[
            expected("generic", &[18, 18, 18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("yaw-roll-pitch, 2-8 cm offsets, optical", &[18, 18, 18, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("yaw-roll-pitch, axes intersect, optical", &[18, 18, 17, 18, 18], [6, 0, 0, 0], NOTHING),
            expected("yaw-roll-pitch, camera frame FLU", &[18, 17, 18, 17, 18], [6, 0, 0, 0], Some(&["L3.d", "L3.y"])),
            expected(
                "same, camera centre on the last axis",
                &[18, 16, 18, 16, 18],
                [6, 0, 0, 0],
                Some(&["L3.theta", "L3.d", "L3.beta", "L3.y"]),
            ),
            expected("pitch-roll-yaw, optical", &[18, 17, 18, 16, 18], [6, 0, 0, 0], Some(&["L3.d", "L3.y"])),
            expected(
                "roll first (first axis || IMU x)",
                &[18, 17, 17, 18, 18],
                [6, 0, 0, 0],
                Some(&["I.rx", "I.tx", "I.ty", "L1.theta"]),
            ),
            expected("axes 1, 2 parallel", &[17, 17, 17, 17, 18], [7, 0, 0, 0], Some(&["L1.d", "L2.d"])),
            expected("axes 2, 3 parallel", &[17, 17, 17, 17, 18], [7, 0, 0, 0], Some(&["L2.d", "L3.d"])),
            expected(
                "axes 1, 2 coaxial",
                &[16, 16, 16, 16, 18],
                [8, 0, 0, 0],
                Some(&["L1.theta", "L1.d", "L2.theta", "L2.d"]),
            ),
            expected("pan only, optical", &[10, 9, 10, 9, 10], [6, 0, 0, 0], Some(&["L1.d", "L1.y"])),
            expected("pan-tilt", &[14, 14, 14, 14, 14], [6, 0, 0, 0], NOTHING),
        ],
    ),
    (
        "Joints that do not move (identifiable = 4 N_moving + 6)",
        &[
            expected("joints 1, 2 move", &[14, 14], [6, 4, 0, 0], None),
            expected("joints 1, 3 move", &[14, 14], [6, 4, 0, 0], None),
            expected("joints 2, 3 move", &[14, 14], [6, 4, 0, 0], None),
            expected("joints 1, 2 move, generic", &[14, 14], [6, 4, 0, 0], None),
            expected("joint 1 moves", &[10, 10], [6, 8, 0, 0], None),
            expected("joint 2 moves", &[10, 10], [6, 8, 0, 0], None),
            expected("joint 3 moves", &[10, 10], [6, 8, 0, 0], None),
            expected("no joint moves", &[6, 6], [6, 12, 0, 0], None),
            expected("joint 2 stationary, axes 1, 3 parallel", &[14, 14], [6, 4, 0, 0], None),
            expected("no encoder, joints 1, 3 move", &[11, 11], [6, 4, 3, 0], None),
            expected("no encoder, joint 1 moves", &[7, 7], [6, 8, 3, 0], None),
            expected("no encoder, no joint moves", &[3, 3], [6, 12, 3, 0], None),
        ],
    ),
    (
        "Motion of vehicle and camera (encoder known)",
        &[
            expected("pure translation", &[15, 15], [6, 0, 0, 3], Some(&["I.tx", "I.ty", "L1.d"])),
            expected("hover", &[11, 11], [6, 0, 0, 7], None),
            expected("constant velocity, IMU", &[11, 11], [6, 0, 0, 7], None),
            expected("yaw only + translation", &[17, 17], [6, 0, 0, 1], None),
            expected("the same in the plane", &[17, 17], [6, 0, 0, 1], None),
            expected("the same, body tilted", &[17, 17], [6, 0, 0, 1], None),
            expected("yaw in place", &[15, 15], [6, 0, 0, 3], None),
            expected("rotation only", &[17, 17], [6, 0, 0, 1], None),
            expected("constant velocity + rotation, IMU", &[17, 17], [6, 0, 0, 1], None),
            expected("straight line, accelerated, rotating", &[18, 18], [6, 0, 0, 0], NOTHING),
            expected("camera never rotates in the world", &[15, 15], [6, 0, 0, 3], Some(&["L3.d", "L3.a", "L3.y"])),
            expected("the same, IMU, bias free", &[15, 15], [6, 0, 0, 3], Some(&["L3.d", "L3.a", "L3.y"])),
            expected("camera follows yaw only", &[17, 17], [6, 0, 0, 1], None),
            expected("stabilised + rotation only", &[14, 14], [6, 0, 0, 4], None),
            expected("stabilised + pure translation", &[3, 3], [6, 12, 0, 3], None),
        ],
    ),
    (
        "Motion without encoders",
        &[
            expected("pure translation", &[12, 12], [6, 0, 3, 3], None),
            expected("hover", &[9, 9], [6, 0, 3, 6], None),
            expected("yaw only + translation", &[14, 14], [6, 0, 3, 1], None),
            expected("camera never rotates in the world", &[12, 12], [6, 0, 3, 3], None),
            expected("stabilised + pure translation", &[0, 0], [6, 12, 3, 3], None),
        ],
    ),
];

/// Columns, full rank, and the range of the smallest number of frames for it.
const MIN_FRAMES: [(&str, usize, [usize; 2]); 6] = [
    ("encoder, poses known", 18, [5, 5]),
    ("encoder, IMU, bias known", 18, [6, 6]),
    ("encoder, IMU, bias free", 18, [7, 7]),
    ("no encoder, poses known", 15, [8, 8]),
    ("no encoder, IMU, bias known", 15, [9, 10]),
    ("no encoder, IMU, bias free", 15, [11, 11]),
];

/// Largest spurious singular value without first-estimate Jacobians, and the range of the number over 1.
const SPURIOUS: [(&str, f64, [usize; 2]); 6] = [
    ("classical", 0.7, [0, 0]),
    ("classical", 5.7, [1, 2]),
    ("classical", 7.3, [2, 3]),
    ("minimal", 0.0, [0, 0]),
    ("minimal", 0.0, [0, 0]),
    ("poe", 0.48, [0, 0]),
];
/// Upper bound of numerically zero singular values.
const ROUNDING: f64 = 1e-9;

fn check(row: &SurveyRow, expected: &Expected) -> usize {
    let name = expected.scenario;
    assert_eq!(row.scenario, name);
    assert_eq!(row.entries.iter().map(|entry| entry.rank).collect::<Vec<_>>(), expected.ranks, "{name}");
    let deficit = row.deficit.map(|lost| [lost.parameterization, lost.joints, lost.absorbed, lost.motion]);
    assert_eq!(deficit, Some(expected.deficit), "{name}");
    if let Some(names) = expected.null_of_minimal {
        let sorted = |mut names: Vec<String>| {
            names.sort_unstable();
            names
        };
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        assert_eq!(sorted(row.null_of_minimal.clone()), sorted(names), "{name}");
    }
    assert_eq!(row.known_agreeing, row.known, "{name}: null directions known in closed form");
    row.entries.len() + 1 + usize::from(expected.null_of_minimal.is_some())
}

#[test]
fn ranks_losses_and_null_directions_match_the_expected_table() {
    let DegeneracySurvey { sections, least_frames, spurious, sensors: _ } = survey();
    let mut compared = 0;
    assert_eq!(sections.len(), SECTIONS.len());
    for (section, (title, rows)) in sections.iter().zip(&SECTIONS) {
        assert_eq!(section.title, *title);
        assert_eq!(section.rows.len(), rows.len(), "{title}");
        compared += section.rows.iter().zip(*rows).map(|(row, expected)| check(row, expected)).sum::<usize>();
    }
    assert_eq!(least_frames.len(), MIN_FRAMES.len());
    for (row, (scenario, rank, [least, most])) in least_frames.iter().zip(&MIN_FRAMES) {
        assert_eq!((row.scenario.as_str(), row.rank), (*scenario, *rank));
        assert!((*least..=*most).contains(&row.frames), "{row:?}");
        compared += 1;
    }
    assert_eq!(spurious.len(), SPURIOUS.len());
    for (row, (form, largest, [least, most])) in spurious.iter().zip(&SPURIOUS) {
        assert_eq!(row.form, *form);
        assert!(row.known.0 <= *most && *least <= row.known.1, "{row:?}");
        assert!(row.with_first_estimates <= ROUNDING, "{row:?}");
        // The draws differ from the table's: the largest agree within a factor of two.
        let measured = row.without.1;
        let alike = measured <= 2.0 * largest && *largest <= 2.0 * measured;
        assert!(alike || measured.max(*largest) <= ROUNDING, "{row:?}");
        compared += 1;
    }
    assert!(compared >= 250, "{compared}");
}
