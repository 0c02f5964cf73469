use crate::study::{Distribution, EncoderNoise, PerturbationStart, RigQuantity, Statistic, StudyPlan};

pub(super) const WHOLE: &str = r#"
name = "encoders"
seeds = [1, 2, 3]
specs = ["auto", "minimal:encoder=off,name=no-encoder"]

[[logs]]
path = "../sample_logs/*.mcap"
rig = "garden.rig.yaml"
truth = "garden.truth.yaml"
start_s = 1
duration_s = 5.5

[[flights]]
name = "town"
experiment = "T3"
mirrored = true
duration_s = 20
encoder_sigma_deg = 0.5
size_px = [320, 240]
rate_hz = 10
static_camera = false
camera_rate_hz = 15
camera_phase_ms = 11
stereo_m = 0.12
gimbal_camera = "thermal"
disturb = ["exposure=0.01"]
start_error_m = 0.03
start_error_deg = 10
imu_noise_scale = 2
gimbal_imu = 0.5
lens = "radtan"

[[flights]]
experiment = "t4"
encoder_sigma_deg = "none"

[[disturbances]]
name = "none"

[[disturbances]]
name = "fog"
disturb = ["blank=11,1"]

[[perturbations]]
name = "none"

[[perturbations]]
name = "5 mm, 1°"
start = "truth"
prior = "changes"
changes = [
  { quantity = "gimbal.translation", distribution = "uniform", magnitude = "5 mm" },
  { quantity = "gimbal.rotation", distribution = "normal", magnitude = "1 deg" },
  { quantity = "imu.noise", distribution = "constant", magnitude = "100 %" },
  { quantity = "camera.timeshift", magnitude = 0.005 },
]

[limits]
timeout_s = 600
memory_gib = 2

[output]
frames = true
files = true

[slurm]
partition = "debug"
time = "01:00:00"
memory = "4G"
tasks = 8
cpus_per_task = 2
options = ["--account=lab"]

[tolerance]
ate_rmse_m = 0.1
pose_nees = 0.5

[[exclude]]
perturbations = ["5 mm, 1°"]
specs = ["no-encoder"]
seeds = [3]

[[tables]]
title = "Position error"
rows = ["log", "label"]
only = { disturbance = ["none"], perturbation = ["none"] }
against = { label = "auto" }
columns = [
  { column = "ate_rmse_m", title = "ATE, mm", factor = 1000, digits = 1 },
  { column = "ate_rmse_m", title = "ratio", statistic = "ratio" },
]
references = [{ title = "paper", row = ["town", "auto"], value = "180" }]
"#;

#[test]
fn every_key_is_read() {
    let plan = StudyPlan::from_toml(WHOLE).unwrap();
    assert_eq!((plan.name.as_str(), plan.seeds.as_slice()), ("encoders", [1, 2, 3].as_slice()));
    assert_eq!(plan.specs.iter().map(|spec| spec.label.as_str()).collect::<Vec<_>>(), ["auto", "no-encoder"]);
    assert_eq!((plan.logs[0].start_s, plan.logs[0].duration_s), (1.0, Some(5.5)));
    let [town, t4] = plan.flights.as_slice() else { panic!("two flights") };
    assert_eq!((town.size_px, town.encoder, town.static_camera), ([320, 240], EncoderNoise::Degrees(0.5), false));
    assert!(town.mirrored && !t4.mirrored);
    assert_eq!((town.static_camera_rate_hz, town.static_camera_phase_s), (Some(15.0), Some(0.011)));
    let options = town.options(1, &[]).unwrap();
    assert_eq!((options.stereo_baseline_m, options.second_gimbal_camera), (Some(0.12), true));
    assert_eq!((t4.stereo_baseline_m, t4.gimbal_camera.as_deref()), (None, None));
    assert_eq!((town.gimbal_imu_noise_scale, t4.gimbal_imu_noise_scale), (Some(0.5), None));
    assert_eq!((t4.name.as_str(), t4.experiment.as_str(), t4.encoder), ("t4", "T4", EncoderNoise::None));
    assert_eq!(plan.disturbances[1].disturb, ["blank=11,1"]);
    let errors = &plan.perturbations[1];
    assert_eq!((errors.start, errors.match_prior), (PerturbationStart::Truth, true));
    assert_eq!(errors.changes[0].magnitude, 0.005);
    assert_eq!(errors.changes[1].magnitude, 1_f64.to_radians());
    assert_eq!((errors.changes[2].distribution, errors.changes[2].magnitude), (Distribution::Constant, 1.0));
    assert_eq!(errors.changes[3].quantity, RigQuantity::CameraTimeshift);
    assert_eq!((plan.limits.timeout_s, plan.limits.memory_bytes), (600.0, 2 << 30));
    assert!(plan.output.frames && plan.output.files);
    assert_eq!((plan.slurm.tasks, plan.slurm.cpus_per_task), (8, 2));
    assert_eq!(plan.tolerances.get("pose_nees"), Some(&0.5));
    assert_eq!((plan.exclusions.len(), plan.exclusions[0].seeds.as_slice()), (1, [3].as_slice()));
    let [table] = plan.tables.as_slice() else { panic!("one table") };
    assert_eq!((table.rows.len(), table.only.len(), table.references[0].value.as_str()), (2, 2, "180"));
    let [ate, ratio] = table.columns.as_slice() else { panic!("two columns") };
    assert_eq!((ate.title.as_str(), ate.factor, ate.digits, ate.statistic), ("ATE, mm", 1e3, 1, Statistic::Median));
    assert_eq!((ratio.factor, ratio.digits, ratio.statistic), (1.0, 3, Statistic::Ratio));
}

#[test]
fn a_small_plan_has_defaults() {
    let plan = StudyPlan::from_toml("[[logs]]\npath = \"a.mcap\"\n").unwrap();
    assert_eq!((plan.seeds.as_slice(), plan.specs.len()), ([1].as_slice(), 1));
    assert_eq!((plan.perturbations.len(), plan.disturbances.len()), (1, 1));
    assert!(plan.perturbations[0].is_none());
    assert_eq!(plan.perturbations[0].name, "none");
}

#[test]
fn errors_name_line_key_and_what_is_allowed() {
    let check = |text: &str, expected: &str| {
        let error = StudyPlan::from_toml(text).unwrap_err().to_string();
        assert!(error.contains(expected), "{text}\n→ {error}\nexpected {expected}");
    };
    let flight = |line: &str| format!("[[flights]]\nexperiment = \"T3\"\n{line}\n");
    let changes = |change: &str| format!("{}[[perturbations]]\nname = \"a\"\nchanges = [{{ {change} }}]\n", flight(""));
    check("", "line 1: the plan has no logs: expected [[logs]] with a path, or [[flights]]");
    check("seeds = [1]\nname", "line 2: invalid TOML: key with no value");
    check("name = \"a\"\nspec = [\"auto\"]", "line 2: unknown key 'spec', expected one of name, seeds, specs");
    check("seeds = [1, \"b\"]", "line 1: 'seeds[2]' is the text 'b', expected an integer from 0");
    check("seeds = 3", "'seeds' is 3, expected a list of integers");
    check("seeds = []", "'seeds' is empty");
    check("seeds = [1, 1]", "'seeds' has a seed twice");
    check("seeds = [-1]", "'seeds[1]' is -1, expected an integer from 0");
    check(
        "\nspecs = [\"auto\",\n \"minmal\"]",
        "line 3: 'specs[2]' is 'minmal': unknown run 'minmal': expected one of",
    );
    check("specs = [\"auto:windw=3\"]", "unknown key 'windw'");
    check("specs = [\"auto\", \"auto\"]\n[[logs]]\npath = \"a\"", "'specs' has two entries named 'auto'");
    check("logs = \"a.mcap\"", "'logs' is the text 'a.mcap', expected tables, each under [[logs]]");
    check("[[logs]]\npth = \"a\"", "line 2: unknown key 'logs[1].pth', expected one of path, name");
    check("[[logs]]\nname = \"a\"", "line 1: 'logs[1]' lacks the key 'path'");
    check("[[logs]]\npath = \"a\"\nstart_s = -1", "line 3: 'logs[1].start_s' is -1, expected a number from 0");
    let trajectories = |list: &str| format!("[[logs]]\npath = \"a\"\ntrajectories = [{list}]");
    check(&trajectories("\":vins\""), "line 3: 'logs[1].trajectories[1]' is ':vins': ");
    check(&trajectories("\"{log}.tum\""), "'{log}.tum' has no label: expected one name for all logs");
    check(
        &trajectories("\"a.tum:vins\", \"b.tum:vins\""),
        "line 3: 'logs[1].trajectories' has two entries named 'vins'",
    );
    let twice = format!("specs = [\"auto\"]\n{}", trajectories("\"a.tum:auto\""));
    check(&twice, "line 1: 'specs' a trajectory and a run are named 'auto', expected different names");
    check("[[flights]]\nexperiment = \"T9\"", "line 2: 'flights[1].experiment' is 'T9', expected T1, T2, T3 or T4");
    check(&flight("encoder_sigma_deg = \"no\""), "expected degrees, a number above 0 and up to 90, or \"none\"");
    check(&flight("size_px = [640]"), "'flights[1].size_px' expected width and height");
    check(&flight("size_px = [640, 8]"), "'flights[1].size_px[2]' is 8, expected an integer from 32 to 4096");
    check(
        &flight("disturb = [\"fog=1\"]"),
        "'flights[1].disturb[1]' is 'fog=1': disturbance 'fog=1': unknown key 'fog', expected one of",
    );
    check(&flight("lens = \"fisheye\""), "expected pinhole or radtan");
    check(&flight("world = \"desert\""), "'flights[1].world' is 'desert', expected textured, plain or facades");
    check(&flight("world = \"plain\""), "'flights[1].world' T3 has no world 'plain': expected textured, or facades");
    check(&flight("swing_deg = 91"), "'flights[1].swing_deg' is 91");
    check(&flight("gimbal_camera = \"zoom\""), "'flights[1].gimbal_camera' is 'zoom', expected thermal");
    check(&flight("static_camera = 1"), "'flights[1].static_camera' is 1, expected true or false");
    check(&changes("quantity = \"gimbal.d\", magnitude = 1"), "expected one of gimbal.translation");
    check(
        &changes("quantity = \"gimbal.rotation\", magnitude = \"5 mm\""),
        "expected a number (rad), or a text with a unit",
    );
    check(&changes("quantity = \"gimbal.rotation\", magnitude = 10"), "is 10, expected a number (rad)");
    check(&changes("quantity = \"gimbal.rotation\""), "lacks the key 'magnitude'");
    check(
        &changes("quantity = \"gimbal.rotation\", magnitude = 0.1, distribution = \"gauss\""),
        "is 'gauss', expected uniform, normal or constant",
    );
    check(&format!("{}[slurm]\noptions = [\"-A lab\"]", flight("")), "expected an option of sbatch");
    check(&format!("{}[slurm]\npartition = \"a b\"", flight("")), "expected one word without blanks");
    check(&format!("{}[tolerance]\nate_rmse_m = \"10 %\"", flight("")), "'tolerance.ate_rmse_m' is the text '10 %'");
    let exclude = |lists: &str| flight(&format!("[[exclude]]\n{lists}"));
    check(&exclude(""), "line 3: 'exclude[1]' excludes nothing: expected lists of logs");
    check(&exclude("specs = [\"static\"]"), "'exclude[1].specs' names 'static', expected some of auto");
    check(&exclude("logs = [\"t1\"]"), "'exclude[1].logs' names 't1', expected some of t3");
    let table = |keys: &str| flight(&format!("[[tables]]\ntitle = \"a\"\n{keys}"));
    check(&table(""), "'tables[1]' lacks the key 'rows'");
    check(
        &table("rows = [\"experiment\"]"),
        "'tables[1].rows[1]' is 'experiment': expected a column of the table of runs",
    );
    let column = |keys: &str| table(&format!("rows = [\"log\"]\ncolumns = [{{ {keys} }}]"));
    check(&column("column = \"status\""), "is 'status', expected a column of numbers of the table of runs");
    check(&column("column = \"ate_rmse_m\", statistic = \"mode\""), "expected median, mean, sum or ratio");
    check(&column("column = \"ate_rmse_m\", statistic = \"ratio\""), "has a ratio and no 'against'");
    let references = "rows = [\"log\"]\nreferences = [{ title = \"a\", row = [], value = \"1\" }]";
    check(&table(references), "has 0 names, expected one for each of 'rows'");
    check(
        "[[logs]]\npath = \"a\"\n[[disturbances]]\nname = \"fog\"\ndisturb = [\"blank=1,1\"]",
        "line 3: 'disturbances' disturb simulated flights, and there are none",
    );
}

#[test]
fn plans_of_the_documents_and_benches_are_read() {
    let document = include_str!("../../../docs/commands.md");
    let (_, rest) = document.split_once("```toml\nname = \"encoders\"").unwrap();
    let (example, _) = rest.split_once("```").unwrap();
    let plan = StudyPlan::from_toml(&format!("name = \"encoders\"{example}")).unwrap();
    assert_eq!((plan.exclusions.len(), plan.tables.len()), (1, 1));
    let check = |name: &str, text: &str| {
        let plan = StudyPlan::from_toml(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        for table in &plan.tables {
            let known = |names: &[String], row: &str| names.iter().any(|name| name == row);
            let flights: Vec<String> = plan.flights.iter().map(|flight| flight.name.clone()).collect();
            let of_logs = table.rows.first().is_some_and(|column| column == "log");
            for reference in table.references.iter().filter(|_| of_logs) {
                assert!(known(&flights, &reference.row[0]), "{name}: {:?}", reference.row);
            }
        }
    };
    check("accuracy", include_str!("../../../benches/paper_tables/accuracy.toml"));
    check("short", include_str!("../../../benches/paper_tables/short.toml"));
    check("speed", include_str!("../../../benches/paper_tables/speed.toml"));
    check("encoders", include_str!("../../../benches/paper_tables/encoders.toml"));
    check("robustness", include_str!("../../../benches/paper_tables/robustness.toml"));
    check("ablation", include_str!("../../../benches/paper_tables/ablation.toml"));
    check("uneven", include_str!("../../../benches/paper_tables/uneven.toml"));
    check("uneven_short", include_str!("../../../benches/paper_tables/uneven_short.toml"));
    check("losing_sight", include_str!("../../../benches/paper_tables/losing_sight.toml"));
    check("cameras", include_str!("../../../benches/paper_tables/cameras.toml"));
    check("bundle", include_str!("../../../benches/paper_tables/bundle.toml"));
    check("gimbal_imu", include_str!("../../../benches/paper_tables/gimbal_imu.toml"));
    check("gimbal_imu_whole", include_str!("../../../benches/paper_tables/gimbal_imu_whole.toml"));
    check("regression", include_str!("../../../benches/regression/plan.toml"));
}
