//! Small study with simulated results, for the screenshots and the commands on studies.

use dcvins::study::{Cell, ColumnType, StudyColumn, StudyTable};

const LOGS: [&str; 4] = ["city", "house", "ridge", "yard"];
const RUNS: [&str; 4] = ["auto", "classical", "auto:encoder=off", "static"];
const PERTURBATIONS: [&str; 2] = ["none", "mount-2deg"];
/// Error of each specification relative to the first one.
const FACTORS: [f64; 4] = [1.0, 1.12, 1.6, 7.0];
/// Name, unit and σ of the parameters; the reported σ of the last one is half of the true one.
const PARAMETERS: [(&str, &str, f64); 5] = [
    ("yaw.alpha", "rad", 2e-3),
    ("yaw.a", "m", 1e-3),
    ("roll.theta", "rad", 1.5e-3),
    ("roll.d", "m", 2e-3),
    ("pitch.alpha", "rad", 3e-3),
];

/// Stateless numbers: fractional parts of multiples of an irrational number, whose sum is nearly normal.
struct Noise(f64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = (self.0 * 997.0 + 0.618_033_988_749_895).fract();
            self.0
        };
        (0..6).map(|_| uniform()).sum::<f64>() * std::f64::consts::SQRT_2 - 3.0 * std::f64::consts::SQRT_2
    }
}

fn table(columns: &[(&str, ColumnType, &str)]) -> StudyTable {
    let column = |(name, kind, unit): &(&str, ColumnType, &str)| StudyColumn::new(name, *kind, unit, "");
    StudyTable::new(columns.iter().map(column).collect()).expect("the names differ")
}

/// Number of seeds of the study in tests and screenshots.
pub(crate) const SEEDS: i64 = 6;

/// Tables of runs and of parameters.
pub(crate) fn tables(seeds: i64) -> [StudyTable; 2] {
    use ColumnType::{Integer, Number, Text};
    let mut runs = table(&[
        ("key", Text, ""),
        ("study", Text, ""),
        ("log", Text, ""),
        ("perturbation", Text, ""),
        ("seed", Integer, ""),
        ("run", Text, ""),
        ("status", Text, ""),
        ("ate_rmse_m", Number, "m"),
        ("pose_nees", Number, ""),
        ("worst_frame_s", Number, "s"),
        ("chain_error_m", Number, "m"),
        ("restarts", Integer, ""),
        ("real_time_factor", Number, ""),
    ]);
    let texts = [("key", Text, ""), ("parameter", Text, ""), ("unit", Text, "")];
    let numbers = [("sigma", Number, ""), ("error", Number, "")];
    let mut parameters = table(&[texts.as_slice(), &numbers].concat());
    let mut noise = Noise(0.137);
    for (flight, log) in LOGS.iter().enumerate() {
        for perturbation in PERTURBATIONS {
            for seed in 0..seeds {
                let hard = 0.05 * (1.0 + flight as f64) * (0.3 * noise.next()).exp();
                for (place, run) in RUNS.iter().enumerate() {
                    let key = format!("{:016x}", runs.rows());
                    let is_static = *run == "static";
                    let status = match noise.next() {
                        draw if is_static && draw > 0.3 => "not-initialized",
                        draw if draw > 2.0 => "crashed",
                        _ => "ok",
                    };
                    let ok = |value: f64| if status == "ok" { Cell::Number(value) } else { Cell::Empty };
                    let factor = FACTORS[place];
                    let row = [
                        ("key", key.as_str().into()),
                        ("study", "gimbal-mounts".into()),
                        ("log", (*log).into()),
                        ("perturbation", perturbation.into()),
                        ("seed", seed.into()),
                        ("run", (*run).into()),
                        ("status", status.into()),
                        ("ate_rmse_m", ok(hard * factor * (0.1 * noise.next()).exp())),
                        ("pose_nees", ok(6.0 * (0.2 * noise.next()).exp())),
                        ("worst_frame_s", ok(12.0 + 4.0 * noise.next())),
                        ("chain_error_m", ok(0.002 * factor * (0.3 * noise.next()).exp())),
                        ("restarts", if status == "ok" { Cell::Integer(i64::from(is_static)) } else { Cell::Empty }),
                        ("real_time_factor", ok(2.4 + 0.1 * noise.next())),
                    ];
                    runs.push(row).expect("the columns are there");
                    for (name, unit, sigma) in PARAMETERS.iter().filter(|_| status == "ok" && !is_static) {
                        let sigma = sigma * (0.3 * noise.next()).exp();
                        let truth = if *name == "pitch.alpha" { 2.0 * sigma } else { sigma };
                        let row = [
                            ("key", key.as_str().into()),
                            ("parameter", (*name).into()),
                            ("unit", (*unit).into()),
                            ("sigma", sigma.into()),
                            ("error", (truth * noise.next()).into()),
                        ];
                        parameters.push(row).expect("the columns are there");
                    }
                }
            }
        }
    }
    [runs, parameters]
}
