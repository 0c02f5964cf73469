//! Sound flights and their logs with a planted fault.

use std::collections::{BTreeMap, VecDeque};
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result};
use dcvins::export::check_log;
use dcvins::faults::{Fault, FaultKind, Sensor};
use dcvins::files::RigFile as _;
use dcvins::flight_log::FlightLog;
use dcvins::geometry::RigidTransform;
use dcvins::log_check::CheckReport;
use dcvins::sensors::{CameraMount, CameraRig, Rig};
use dcvins::simulated_log::{Disturbances, SimulationOptions, simulate};
use dcvins::simulation::Experiment;
use mcap::{MessageStream, Writer};

use crate::cases::{Case, is_of_images, is_of_rig};

/// A flight and the sensors that its rig has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Flight {
    /// T2 with the gimbal, its camera and encoders, and the static camera.
    Gimbal,
    /// T3 with the static camera alone.
    Static,
}

/// Smallest images of the simulator, for logs whose images are replaced.
const PLACEHOLDER_PX: [usize; 2] = [32, 24];

impl Flight {
    pub(crate) const ALL: [Self; 2] = [Self::Gimbal, Self::Static];

    pub(crate) fn name(self) -> &'static str {
        if self == Self::Gimbal { "gimbal" } else { "static" }
    }

    pub(crate) fn has(self, sensor: Sensor) -> bool {
        self == Self::Gimbal || sensor != Sensor::Joints
    }

    fn duration_s(self) -> f64 {
        if self == Self::Gimbal { 14.0 } else { 12.0 }
    }

    /// Time from which on later faults act.
    pub(crate) fn middle_s(self) -> f64 {
        0.5 * self.duration_s()
    }

    /// Key of the camera with the faults.
    fn camera_key(self) -> &'static str {
        if self == Self::Gimbal { "cam0" } else { "cam1" }
    }

    fn options(self) -> SimulationOptions {
        let experiment = if self == Self::Gimbal { Experiment::T2 } else { Experiment::T3 };
        SimulationOptions {
            duration_s: Some(self.duration_s()),
            resolution_px: [320, 240],
            camera_rate_hz: 10.0,
            ..SimulationOptions::new(experiment)
        }
    }
}

/// Logs of the flights in a folder; each one's sound log is rendered once.
pub(crate) struct FlightLogs {
    folder: PathBuf,
    sound: BTreeMap<Flight, (PathBuf, Rig)>,
}

/// Log with a fault.
pub(crate) struct PlantedLog {
    log: PathBuf,
    rig: Rig,
}

impl PlantedLog {
    pub(crate) fn check(&self) -> Result<CheckReport> {
        Ok(check_log(None, &Arc::new(FlightLog::open(&self.log)?), &self.rig))
    }

    /// Copies log and rig into a folder.
    pub(crate) fn keep(&self, folder: &Path, name: &str) -> Result<()> {
        fs::create_dir_all(folder)?;
        fs::copy(&self.log, folder.join(format!("{name}.mcap")))?;
        fs::write(folder.join(format!("{name}.rig.yaml")), self.rig.to_yaml())?;
        Ok(())
    }
}

impl FlightLogs {
    pub(crate) fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), sound: BTreeMap::new() }
    }

    /// Log and rig of a case.
    pub(crate) fn planted_log(&mut self, case: &Case) -> Result<PlantedLog> {
        let flight = case.flight;
        let (sound, mut rig) = self.sound(flight)?;
        let log = match &case.fault {
            None => sound,
            Some(fault) if is_of_rig(fault.kind) => {
                plant_in_rig(&mut rig, flight.camera_key(), fault);
                sound
            }
            Some(fault) => self.planted(flight, fault, &sound)?,
        };
        Ok(PlantedLog { log, rig })
    }

    fn sound(&mut self, flight: Flight) -> Result<(PathBuf, Rig)> {
        if let Some(sound) = self.sound.get(&flight) {
            return Ok(sound.clone());
        }
        let (log, simulated) =
            (self.folder.join(format!("{}.mcap", flight.name())), self.folder.join("simulated.mcap"));
        let summary = simulate(&flight.options(), &simulated, &mut |_| ())?;
        copy(&simulated, None, &log)?;
        let mut rig = Rig::from_file(&summary.rig)?;
        if flight == Flight::Static {
            rig.cameras.retain(|camera| camera.mount != CameraMount::Gimbal);
            rig.gimbal = None;
        }
        Ok(self.sound.entry(flight).or_insert((log, rig)).clone())
    }

    /// Log of a flight with a fault of its measurements.
    fn planted(&self, flight: Flight, fault: &Fault, sound: &Path) -> Result<PathBuf> {
        let (log, simulated) = (self.folder.join("planted.mcap"), self.folder.join("simulated.mcap"));
        let mut options = flight.options();
        options.disturbances = Disturbances { faults: vec![fault.clone()], ..Disturbances::default() };
        let is_rendered = is_of_images(fault.kind);
        if !is_rendered {
            options.resolution_px = PLACEHOLDER_PX;
        }
        simulate(&options, &simulated, &mut |_| ())?;
        copy(&simulated, (!is_rendered).then_some(sound), &log)?;
        Ok(log)
    }
}

/// Copies a log without the intrinsics that its cameras publish, which would contradict a rig with a fault, and with the
/// images of another log with as many of them.
fn copy(log: &Path, images: Option<&Path>, output: &Path) -> Result<()> {
    let is_image = |topic: &str| topic.ends_with("/image_raw/compressed");
    let mut ready: BTreeMap<String, VecDeque<Vec<u8>>> = BTreeMap::new();
    if let Some(images) = images {
        for message in MessageStream::new(&fs::read(images)?)? {
            let message = message?;
            if is_image(&message.channel.topic) {
                ready.entry(message.channel.topic.clone()).or_default().push_back(message.data.into_owned());
            }
        }
    }
    let mut writer = Writer::new(BufWriter::new(File::create(output)?))?;
    for message in MessageStream::new(&fs::read(log)?)? {
        let mut message = message?;
        let topic = &message.channel.topic;
        if topic.ends_with("/camera_info") {
            continue;
        }
        if images.is_some() && is_image(topic) {
            let image = ready.get_mut(topic).and_then(VecDeque::pop_front);
            message.data = image.context("the sound log has fewer images")?.into();
        }
        writer.write(&message)?;
    }
    writer.finish()?;
    Ok(())
}

/// Plants a fault of the rig: its values become those that the fault corrects.
fn plant_in_rig(rig: &mut Rig, camera_key: &str, fault: &Fault) {
    let undone = fault.value(0);
    match fault.kind {
        FaultKind::ImuNoise => {
            let noise = &mut rig.imu.noise;
            noise.accelerometer_noise_density /= undone;
            noise.gyroscope_noise_density /= undone;
        }
        FaultKind::EncoderNoise => {
            if let Some(sigma_rad) = rig.gimbal.as_mut().and_then(|gimbal| gimbal.encoder_sigma_rad.as_mut()) {
                *sigma_rad /= undone;
            }
        }
        FaultKind::Mount => {
            let turned = |pose: &mut RigidTransform| pose.rotation *= fault.mount().inverse();
            let chain = rig.gimbal.as_mut().map(|gimbal| &mut gimbal.chain.effector_from_camera);
            let cameras = rig.cameras.iter_mut().filter(|camera| camera.key == camera_key);
            match (cameras.map(|camera| &mut camera.mount).next(), chain) {
                (Some(CameraMount::Static { imu_from_camera }), _) => turned(imu_from_camera),
                (_, Some(effector_from_camera)) => turned(effector_from_camera),
                _ => {}
            }
        }
        _ => {
            let is_faulty = |camera: &&mut CameraRig| camera.key == camera_key;
            for camera in rig.cameras.iter_mut().filter(is_faulty) {
                camera.model = fault.inverse().lens().camera(&camera.model);
                camera.timeshift_cam_imu_s -= fault.camera_shift_s(0.0);
                if fault.kind == FaultKind::Shutter {
                    camera.readout_s = undone;
                }
            }
        }
    }
}
