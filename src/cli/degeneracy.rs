//! `dcvins degeneracy`: observability of the calibration by mechanism, parameterization and motion, without a log.

use dcvins::files::RigFile as _;
use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use clap::{Args, ValueEnum};
use dcvins::estimator::{JointKnowledge, PoseKnowledge};
use dcvins::gimbal::Parameterization;
use dcvins::observability::laboratory::{
    Advice, Excitation, LABORATORY_IMU, LaboratoryForm, LaboratoryMotion, LaboratoryReport, LaboratorySetup, Mechanism,
    SensorColumns, SensorExcitation, Situation, advise, excitation, sensor_excitation, survey,
};
use dcvins::sensors::Rig;
use dcvins::text::Named as _;

use crate::cli::terminal::{print, print_report};

#[derive(Args, Clone, Debug)]
pub(crate) struct DegeneracyArguments {
    /// Compute ranks, losses and null directions of every scenario of docs/mathematics.md, section 7; the default without
    /// arguments.
    #[arg(long, conflicts_with_all = ["mechanism", "rig", "forms", "motion", "freeze", "encoder_sigma_deg", "poses", "columns"])]
    pub table: bool,
    /// A mechanism by name; `--list` prints all [default: yaw-roll-pitch-offset].
    #[arg(long, value_name = "NAME", conflicts_with = "rig")]
    pub mechanism: Option<String>,
    /// The mechanism of a rig file.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// The rig's camera [default: the first one on the gimbal, or the first].
    #[arg(long, value_name = "KEY", requires = "rig")]
    pub camera: Option<String>,
    /// Parameterizations to compare: classical, minimal, minimal-yx, minimal-swapped, minimal-swapped-yx, poe, each also with
    /// `-without-offsets` [default: classical,minimal,minimal-swapped,poe].
    #[arg(long = "form", value_name = "NAME", value_delimiter = ',')]
    pub forms: Vec<LaboratoryForm>,
    /// Motion of vehicle and camera; `--list` prints all [default: aggressive].
    #[arg(long, value_name = "NAME")]
    pub motion: Option<LaboratoryMotion>,
    /// Numbers of the stationary joints, from 1.
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    pub freeze: Vec<usize>,
    /// Standard deviation of the encoders in degrees, `known` for exact angles, `none` without encoders
    /// [default: known].
    #[arg(long, value_name = "D|known|none", value_parser = joint_knowledge)]
    pub encoder_sigma_deg: Option<JointKnowledge>,
    /// Source of the vehicle's poses [default: known].
    #[arg(long, value_enum)]
    pub poses: Option<PosesArgument>,
    /// Add an IMU that moves with the camera, its biases unknown.
    #[arg(long, conflicts_with_all = ["table", "columns"])]
    pub gimbal_imu: bool,
    /// Sensor columns in addition to the columns of the chain: readout, timeshift, intrinsics, imu-intrinsics, all;
    /// intrinsics of the IMU need `--poses imu` [default: chain].
    #[arg(long, value_name = "NAME,…")]
    pub columns: Option<SensorColumns>,
    /// Number of frames, 0.25 s apart [default: 10].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=64))]
    pub frames: Option<u16>,
    /// Number of landmarks [default: 100].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=2000))]
    pub landmarks: Option<u16>,
    /// Suggest excitation for the first parameterization: candidate motions from the end of the experiment with the
    /// predicted σ of the least observable direction, and the information gain of each motion so far.
    #[arg(long, conflicts_with = "table")]
    pub advise: bool,
    /// Print the names of the mechanisms and motions.
    #[arg(long)]
    pub list: bool,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PosesArgument {
    /// Poses are known exactly.
    Known,
    /// From the IMU, its biases unknown.
    Imu,
    /// From the IMU, its biases known.
    ImuBiasKnown,
}

fn joint_knowledge(text: &str) -> Result<JointKnowledge, String> {
    match text {
        "known" => Ok(JointKnowledge::Known),
        "none" => Ok(JointKnowledge::Unknown),
        _ => text
            .parse::<f64>()
            .ok()
            .filter(|sigma_deg| sigma_deg.is_finite() && *sigma_deg > 0.0)
            .map(|sigma_deg| JointKnowledge::Encoder(sigma_deg.to_radians()))
            .ok_or_else(|| "expected degrees, a number above 0, or known, or none".to_owned()),
    }
}

pub(crate) fn degeneracy(arguments: &DegeneracyArguments) -> Result<()> {
    if arguments.list {
        return print(&list());
    }
    if arguments.asks_nothing() {
        return print_report(&survey(), arguments.json);
    }
    let setup = arguments.setup()?;
    let forms = match (arguments.forms.is_empty(), arguments.advise) {
        (false, _) => arguments.forms.clone(),
        (true, false) => DEFAULT_FORMS.to_vec(),
        (true, true) => vec![LaboratoryForm::whole(Parameterization::Minimal)],
    };
    let results = setup.run_all(&forms);
    if results.len() < forms.len() {
        bail!(
            "the Jacobian of the mechanism '{}' is not finite: its lengths or angles are too large",
            setup.mechanism.name
        );
    }
    let report = LaboratoryReport::new(&setup, &results);
    if !arguments.advise {
        return print_report(&report, arguments.json);
    }
    let form = forms.first().copied().context("--advise requires a parameterization (--form)")?;
    print_report(&Advised::new(report, &setup, form)?, arguments.json)
}

/// Results of an experiment and the excitation suggested for it.
#[derive(Debug, serde::Serialize)]
struct Advised {
    experiment: LaboratoryReport,
    form: String,
    excitation: Option<Excitation>,
    advice: Advice,
    #[serde(skip_serializing_if = "Option::is_none")]
    sensors: Option<SensorExcitation>,
}

impl Advised {
    fn new(experiment: LaboratoryReport, setup: &LaboratorySetup, form: LaboratoryForm) -> Result<Self> {
        let names: Vec<String> = setup.mechanism.joints.iter().map(|joint| joint.name.clone()).collect();
        let advice = Situation::of_experiment(setup, form, LABORATORY_IMU).as_ref().and_then(advise);
        Ok(Self {
            experiment,
            form: form.name(),
            excitation: excitation(&setup.window(), &form.chain(&setup.mechanism), &names, &setup.mechanism.names),
            advice: advice.context("no candidate motion constrains this mechanism")?,
            sensors: setup.columns.any().then(|| sensor_excitation(setup, form)).flatten(),
        })
    }
}

impl std::fmt::Display for Advised {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(out, "{}", self.experiment)?;
        if let Some(excitation) = &self.excitation {
            writeln!(out, "{excitation}")?;
        }
        if let Some(sensors) = &self.sensors {
            writeln!(out, "{sensors}")?;
        }
        write!(out, "{}", self.advice)?;
        self.advice.sentence().map_or(Ok(()), |sentence| writeln!(out, "\n{}: {sentence}", self.form))
    }
}

const DEFAULT_FORMS: [LaboratoryForm; 4] = [
    LaboratoryForm::whole(Parameterization::Classical),
    LaboratoryForm::whole(Parameterization::Minimal),
    LaboratoryForm::whole(Parameterization::MinimalSwapped),
    LaboratoryForm::whole(Parameterization::Poe),
];

fn list() -> String {
    let line = |(name, meaning): (&str, &str)| format!("  {name:<28}{meaning}\n");
    let mechanisms: String = Mechanism::NAMES.into_iter().map(line).collect();
    let motions: String = LaboratoryMotion::all().map(|motion| line((motion.name(), motion.meaning()))).collect();
    format!("mechanisms\n{mechanisms}motions\n{motions}")
}

impl DegeneracyArguments {
    fn asks_nothing(&self) -> bool {
        self.table
            || (self.mechanism.is_none()
                && self.rig.is_none()
                && self.forms.is_empty()
                && self.motion.is_none()
                && self.freeze.is_empty()
                && self.encoder_sigma_deg.is_none()
                && self.poses.is_none()
                && self.columns.is_none()
                && !self.advise
                && !self.gimbal_imu
                && self.frames.is_none()
                && self.landmarks.is_none())
    }

    fn setup(&self) -> Result<LaboratorySetup> {
        let mut imu_noise = LABORATORY_IMU;
        let mut setup = if let Some(path) = &self.rig {
            let rig = Rig::from_file(path)?;
            let key = self.camera_key(&rig)?;
            let camera = rig.camera(&key)?;
            let mechanism =
                Mechanism::of_rig(&rig, &key).with_context(|| format!("the rig's camera '{key}' has no extrinsics"))?;
            imu_noise = rig.imu.noise;
            LaboratorySetup { camera: camera.model.clone(), ..LaboratorySetup::new(mechanism) }
        } else {
            LaboratorySetup::new(Mechanism::named(self.mechanism.as_deref().unwrap_or("yaw-roll-pitch-offset"))?)
        };
        let joints = setup.mechanism.chain.joint_count();
        for joint in &self.freeze {
            let index = joint.checked_sub(1).filter(|index| *index < joints);
            let Some(index) = index else {
                bail!("--freeze names joint {joint}, but '{}' has {joints} joints", setup.mechanism.name);
            };
            setup.frozen.push(index);
        }
        setup.motion = self.motion.unwrap_or(setup.motion);
        setup.joints = self.encoder_sigma_deg.unwrap_or(setup.joints);
        setup.poses = match self.poses.unwrap_or(PosesArgument::Known) {
            PosesArgument::Known => PoseKnowledge::Known,
            PosesArgument::Imu => PoseKnowledge::Imu { noise: imu_noise, biases_known: false },
            PosesArgument::ImuBiasKnown => PoseKnowledge::Imu { noise: imu_noise, biases_known: true },
        };
        setup.gimbal_imu = self.gimbal_imu;
        setup.frames = self.frames.map_or(setup.frames, usize::from);
        setup.landmarks = self.landmarks.map_or(setup.landmarks, usize::from);
        let columns = self.columns.unwrap_or_default();
        if self.columns.is_some_and(|columns| columns.imu_intrinsics && columns != SensorColumns::ALL)
            && setup.poses == PoseKnowledge::Known
        {
            bail!("--columns imu-intrinsics needs --poses imu: known poses leave the IMU without a measurement");
        }
        Ok(setup.with_columns(columns))
    }

    fn camera_key(&self, rig: &Rig) -> Result<String> {
        use dcvins::sensors::CameraMount;
        if let Some(key) = &self.camera {
            return Ok(key.clone());
        }
        let on_gimbal = rig.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal);
        let camera = on_gimbal.or_else(|| rig.cameras.first()).context("the rig has no camera")?;
        Ok(camera.key.clone())
    }
}
