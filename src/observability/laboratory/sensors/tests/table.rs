//! Computed ranks against the table of docs/mathematics.md, section 11.

use super::super::experiments::SECTIONS;
use super::super::survey::survey_sensors;

/// Motion, rank of the chain, null directions added by readout, timeshift, both, intrinsics, IMU, all.
type Row = (&'static str, usize, [usize; 6]);

const RIGID: &[Row] = &[
    ("aggressive", 6, [0; 6]),
    ("straight-line", 6, [0; 6]),
    ("rotation-only", 5, [0; 6]),
    ("translation-only", 3, [0, 0, 0, 0, 10, 11]),
    ("roll-only", 5, [0, 0, 0, 0, 6, 6]),
    ("pitch-only", 5, [0, 0, 0, 0, 6, 6]),
    ("yaw-only", 5, [0, 0, 0, 0, 7, 7]),
    ("constant-acceleration", 0, [0, 1, 1, 1, 15, 17]),
    ("constant-velocity", 0, [0, 1, 1, 1, 15, 17]),
    ("steady-turn", 0, [0, 1, 1, 0, 15, 16]),
    ("hover", 0, [1, 1, 2, 6, 15, 23]),
];
const PINHOLE: &[Row] = &[
    ("aggressive", 6, [0; 6]),
    ("rotation-only", 5, [0; 6]),
    ("translation-only", 3, [0, 0, 0, 0, 10, 14]),
    ("yaw-only", 5, [0, 0, 0, 0, 7, 7]),
    ("constant-velocity", 0, [0, 1, 1, 4, 15, 20]),
    ("steady-turn", 0, [0, 1, 1, 0, 15, 16]),
];
const GIMBAL: &[Row] = &[
    ("aggressive", 18, [0; 6]),
    ("rotation-only", 17, [0; 6]),
    ("translation-only", 15, [0, 0, 0, 0, 10, 10]),
    ("roll-only", 17, [0, 0, 0, 0, 6, 6]),
    ("yaw-only", 17, [0, 0, 0, 0, 7, 7]),
    ("constant-acceleration", 11, [0, 1, 1, 0, 15, 16]),
    ("constant-velocity", 11, [0, 1, 1, 0, 15, 16]),
    ("steady-turn", 11, [0, 1, 1, 0, 15, 16]),
    ("hover", 11, [0, 1, 1, 0, 15, 16]),
    ("stabilized", 15, [0; 6]),
    ("stabilized-rotation-only", 14, [0; 6]),
    ("camera-held-still", 12, [1, 1, 2, 6, 0, 8]),
    ("all-joints-frozen", 6, [0, 1, 1, 0, 0, 1]),
];
const WITHOUT_ENCODERS: &[Row] = &[
    ("aggressive", 15, [0; 6]),
    ("translation-only", 12, [0, 0, 0, 0, 10, 10]),
    ("yaw-only", 14, [0, 0, 0, 0, 7, 7]),
    ("constant-velocity", 9, [0, 1, 1, 0, 15, 16]),
    ("hover", 9, [1, 1, 2, 0, 15, 17]),
    ("stabilized", 12, [0; 6]),
];

#[test]
fn sensor_columns_have_the_ranks_of_the_table() {
    let sections = survey_sensors();
    let expected = [RIGID, PINHOLE, GIMBAL, WITHOUT_ENCODERS];
    assert_eq!(sections.len(), expected.len());
    for ((section, rows), experiments) in sections.iter().zip(expected).zip(&SECTIONS) {
        assert_eq!((section.rows.len(), experiments.experiments.len()), (rows.len(), rows.len()), "{}", section.title);
        for (row, (motion, rank_of_chain, added)) in section.rows.iter().zip(rows) {
            let context = format!("{}: {row:?}", section.title);
            assert_eq!(row.motion, *motion, "{context}");
            assert_eq!(row.sets[0].rank, *rank_of_chain, "{context}");
            let found: Vec<usize> = row.sets[1..].iter().map(|set| set.added).collect();
            assert_eq!(found, added, "{context}");
            assert_eq!(row.cause.is_empty(), added[5] == 0, "{context}");
            assert_eq!(row.lost.is_empty(), added[5] == 0, "{context}");
        }
    }
}
