//! Simulates an experiment and writes it as a flight log with its rig and ground truth.

use crate::files::RigFile as _;
use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder as _};
use rayon::prelude::*;

use super::disturbances::{EXPOSURE_DRIFT, VIGNETTING};
use super::error::SimulationError;
use super::options::{SimulationOptions, SimulationProgress, SimulationSummary};
use super::planting::Planting;
use super::prescribed::PrescribedFlight;
use super::render::{RenderedView, Sensor, SensorOptions, SurfaceShader, Workspace};
use super::rig_of_file::rig_as_truth;
use super::world;
use crate::files::output::OutputSet;
use crate::flight_log::{LogError, LogWriter, LogWriterOptions, MessageTimes, Odometry};
use crate::geometry::{during, ns_from_seconds, seconds_from_ns, so3};
use crate::sensors::{CameraMount, CameraRig, GimbalRig, ImuRig, ImuSample, JointSample, Rig};
use crate::simulation::aim::Aimed;
use crate::simulation::equipment::{Equipment, JOINT_TOPIC};
use crate::simulation::experiment::{Experiment, WorldKind};
use crate::simulation::gimbal::JointMotion;
use crate::simulation::random::RandomStream;
use crate::simulation::route::Mirrored;
use crate::simulation::scenario::{Scenario, ScenarioOptions, gravity_m_per_s2, stream};
use crate::simulation::trajectory::{AIR_DRAG_PER_S, Trajectory, VehicleLimits};
use crate::simulation::vibration::{ripple, shake};
use crate::text::Named as _;

/// Start of simulated logs: 15 June 2025, 15:06:40 UTC.
const EPOCH_NS: i64 = 1_750_000_000_000_000_000;
/// Stamp of the first image; streams are not aligned on purpose.
const FIRST_IMAGE_S: f64 = 0.003;
/// Number of images that are rendered concurrently.
const BATCH: usize = 24;
/// Rendered images that are averaged into one with motion blur.
const BLUR_STEPS: usize = 7;
/// Number of image rows that are rendered at one pose, the pose at their middle row, if a camera has a readout. A row
/// is then at most half a row from its exposure time: with 30 ms over 480 rows 0.03 ms, in which the image moves by
/// 0.03 px at 2.4 rad/s, the vehicle's limit.
const SHUTTER_ROWS: usize = 2;
/// Lower bound of the mean velocity, for planning the length of a flight.
const PLANNED_M_PER_S: f64 = 2.5;
/// Delay from measurement to recording: IMU, encoders, first camera, and each further camera.
const DELAYS_S: [f64; 4] = [0.0004, 0.0007, 0.018, 0.0015];

/// Simulates an experiment and writes `output` (an MCAP log) with `.rig.yaml` and `.truth.yaml` in the same folder.
///
/// The same options and file name give the same bytes for any number of threads. `progress` is called after each batch
/// of images.
///
/// # Errors
/// If an option is out of its range, or a file cannot be written.
pub fn simulate(
    options: &SimulationOptions,
    output: &Path,
    progress: &mut dyn FnMut(SimulationProgress),
) -> Result<SimulationSummary, SimulationError> {
    simulate_interruptible(options, output, &mut |at| {
        progress(at);
        ControlFlow::Continue(())
    })
}

/// [`simulate`] that stops if `progress` returns `Break`.
///
/// # Errors
/// As [`simulate`], and [`SimulationError::Interrupted`], in which case no file is written.
pub fn simulate_interruptible(
    options: &SimulationOptions,
    output: &Path,
    progress: &mut dyn FnMut(SimulationProgress) -> ControlFlow<()>,
) -> Result<SimulationSummary, SimulationError> {
    options.check()?;
    let name = output.file_stem().map_or_else(|| "simulation".to_owned(), |stem| stem.to_string_lossy().into_owned());
    let scenario = fly_scenario(options, &name)?;
    let chain_error = given_chain_error(&scenario);
    let ground_truth_notes = ground_truth_notes(options, &scenario, chain_error);
    let (rig_path, ground_truth_path) = (output.with_extension("rig.yaml"), output.with_extension("truth.yaml"));

    let mut log = LogWriter::create(output, &LogWriterOptions::default())?;
    let mut notes = BTreeMap::from([
        ("experiment".to_owned(), options.experiment.name().to_owned()),
        ("seed".to_owned(), options.seed.to_string()),
    ]);
    if options.motion.is_some() {
        notes.insert("motion".to_owned(), "prescribed".to_owned());
    }
    log.write_metadata("dcvins simulate", notes)?;
    let images = write_messages(options, &scenario, &mut log, progress)?;
    let attachments = [
        ("rig", scenario.given_rig.to_yaml()),
        ("truth", format!("{}{ground_truth_notes}", scenario.true_rig.to_yaml())),
    ];
    for (kind, text) in attachments {
        log.attach(&format!("{name}.{kind}.yaml"), "application/yaml", &text, EPOCH_NS)?;
    }
    let mut outputs = OutputSet::default();
    outputs.add(log.finish_staged()?);
    outputs.add(scenario.given_rig.stage(&rig_path, "")?);
    outputs.add(scenario.true_rig.stage(&ground_truth_path, &ground_truth_notes)?);
    outputs.commit().map_err(|(path, source)| LogError::Io { action: "write the simulation", source, path })?;
    let duration_s = scenario.trajectory.duration_s();
    Ok(SimulationSummary {
        log: output.to_owned(),
        rig: rig_path,
        ground_truth: ground_truth_path,
        duration_s,
        path_length_m: scenario.trajectory.length_m(duration_s),
        images,
        given_chain_error: chain_error,
    })
}

/// Flight with its measurements.
fn fly_scenario(options: &SimulationOptions, name: &str) -> Result<Scenario, SimulationError> {
    let experiment = options.experiment;
    let variant = 100 * Experiment::all().position(|other| other == experiment).unwrap_or(0) as u64;
    let random = |stream: u64| RandomStream::new(options.seed, stream + variant);
    let planned_s = (experiment.length_m() / PLANNED_M_PER_S).max(options.duration_s.unwrap_or(0.0));
    let mut flight = experiment.flight(4.0 * planned_s, &mut random(stream::ROUTE));
    let mut look = experiment.look_around(&mut random(stream::LOOK));
    if options.mirrored {
        flight = Box::new(Mirrored(flight));
        look = look.mirrored();
    }
    if let Some(swing_rad) = options.swing_rad {
        if options.motion.is_some() {
            let problem = "a swing changes the heading too; omit it".to_owned();
            return Err(SimulationError::Motion { problem });
        }
        let aim = experiment.aim(swing_rad);
        flight = Box::new(Aimed { flight, aim });
        look = look.aimed(aim);
    }
    let prescribed = options.motion.as_ref().map(|motion| PrescribedFlight::new(motion, options)).transpose()?;
    let mut trajectory = match &prescribed {
        Some(prescribed) => prescribed.trajectory(&flight.point(0.0))?,
        None => Trajectory::new(
            flight.as_ref(),
            &mut random(stream::MANOEUVRES),
            &VehicleLimits::default(),
            planned_s,
            gravity_m_per_s2(),
        ),
    };
    if let Some(stretch_s) = options.disturbances.hover_s {
        trajectory.hover(stretch_s);
    }
    let whole_s = || {
        if prescribed.is_some() { trajectory.duration_s() } else { trajectory.time_of_length(experiment.length_m()) }
    };
    let end_s = options.duration_s.unwrap_or_else(whole_s);
    if let Some([start_s, length_s, rate_rad_per_s]) = options.disturbances.spin {
        trajectory.spin([start_s, length_s], rate_rad_per_s);
    }
    look.slew_s = options.disturbances.gimbal_slew_s;
    look.stabilized_s = options.disturbances.stabilized_s;
    look.fixed_joint = options.disturbances.fixed_joint.map(|[joint, start_s, length_s]| {
        // Checked to be 1 to 3.
        (joint.round() as usize - 1, [start_s, length_s])
    });
    let trajectory = trajectory.cut(end_s);
    let true_rig = true_rig(options, name)?;
    let joints = true_rig.gimbal.as_ref().map_or(&[][..], |gimbal| gimbal.joints.as_slice());
    let joints = prescribed.map(|prescribed| prescribed.joints(joints, trajectory.duration_s())).transpose()?;
    let stabilized = |trajectory: &Trajectory, gimbal: &GimbalRig| JointMotion::stabilized(trajectory, gimbal, &look);
    let mut scenario = Scenario::new(
        trajectory,
        |trajectory, gimbal| joints.unwrap_or_else(|| stabilized(trajectory, gimbal)),
        ScenarioOptions {
            seed: options.seed,
            true_rig,
            start_error: options.start_error,
            imu_noise_scale: options.imu_noise_scale,
        },
    );
    if let Some(noise_scale) = options.gimbal_imu_noise_scale {
        scenario.measure_gimbal_imu(noise_scale);
        scenario.spoil_gimbal_imu(options.disturbances.gimbal_imu_error);
    }
    if let (Some(vibration), Some(record)) = (&options.disturbances.gimbal_vibration, &mut scenario.gimbal_imu_record) {
        shake(record, &scenario.trajectory, vibration, &mut random(stream::GIMBAL_VIBRATION));
    }
    if let (Some(vibration), Some(record)) = (&options.disturbances.gimbal_ripple, &mut scenario.gimbal_imu_record) {
        ripple(record, vibration, &mut random(stream::GIMBAL_RIPPLE));
    }
    if let Some(vibration) = &options.disturbances.vibration {
        shake(&mut scenario.imu_record, &scenario.trajectory, vibration, &mut random(stream::VIBRATION));
    }
    if let Some([sigma_m_per_s2, time_constant_s]) = options.disturbances.accelerometer_drift {
        scenario.imu_record.drift(sigma_m_per_s2, time_constant_s, &mut random(stream::ACCELEROMETER_DRIFT));
    }
    if options.disturbances.imu_intrinsics != [0.0; 2] {
        scenario.miscalibrate_imu(options.disturbances.imu_intrinsics, &mut random(stream::IMU_INTRINSICS));
    }
    for sample in &mut scenario.imu_record.samples {
        if let Some(range) = options.disturbances.gyroscope_range_rad_per_s {
            sample.angular_velocity_rad_per_s.apply(|rate| *rate = rate.clamp(-range.abs(), range.abs()));
        }
        if let Some(range) = options.disturbances.accelerometer_range_m_per_s2 {
            sample.specific_force_m_per_s2.apply(|force| *force = force.clamp(-range.abs(), range.abs()));
        }
    }
    Planting::of(&options.disturbances).plant(&mut scenario)?;
    Ok(scenario)
}

/// True rig: the firefly's with random errors, or the rig of a file.
fn true_rig(options: &SimulationOptions, name: &str) -> Result<Rig, SimulationError> {
    if let Some(rig) = &options.rig {
        return rig_as_truth(rig, options, name);
    }
    let equipment = Equipment {
        gimbal_camera: true,
        static_camera: options.static_camera,
        stereo_baseline_m: options.stereo_baseline_m,
        second_gimbal_camera: options.second_gimbal_camera,
        lens: options.lens,
        resolution_px: options.resolution_px,
        camera_rate_hz: options.camera_rate_hz,
        static_camera_rate_hz: options.static_camera_rate_hz.unwrap_or(options.camera_rate_hz),
        camera_time_offset_s: Planting::of(&options.disturbances).camera_offset_s(),
        readout_s: options.disturbances.readout_s,
        encoder_sigma_rad: options.encoder_sigma_rad,
        gimbal_imu: options.gimbal_imu_noise_scale.is_some(),
    };
    Ok(equipment.true_rig(name, &mut RandomStream::new(options.seed, stream::RIG)))
}

/// Message of the log by its index among the messages of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Message {
    Truth(usize),
    TrueJoints(usize),
    Imu(usize),
    Joints(usize),
    Image(usize),
    GimbalImu(usize),
}

#[derive(Clone, Copy, Debug)]
struct Shot {
    camera: usize,
    frame_index: usize,
    stamp_ns: i64,
}

/// All recorded measurements in the order of measurement.
struct Recordings {
    imu: Vec<ImuSample>,
    gimbal_imu: Vec<ImuSample>,
    joints: Vec<JointSample>,
    true_joints: Vec<JointSample>,
    shots: Vec<Shot>,
}

fn write_messages(
    options: &SimulationOptions,
    scenario: &Scenario,
    log: &mut LogWriter,
    progress: &mut dyn FnMut(SimulationProgress) -> ControlFlow<()>,
) -> Result<usize, SimulationError> {
    let recordings = recordings(options, scenario);
    let schedule = schedule(&recordings, options.seed);
    let world = world::build(options.experiment.environment(), options.world, options.seed);
    let studio = Studio::new(options, scenario, &world);
    let rig = &scenario.true_rig;
    let joint_names = rig.joint_names();
    let total = recordings.shots.len();
    let mut ready: VecDeque<Vec<u8>> = VecDeque::new();
    let mut done = 0;
    for (log_time_ns, message) in schedule {
        let times = |stamp_ns: i64| MessageTimes { stamp_ns: EPOCH_NS + stamp_ns, log_time_ns: EPOCH_NS + log_time_ns };
        match message {
            Message::Imu(index) => {
                write_imu(log, &rig.imu, times(recordings.imu[index].stamp_ns), &recordings.imu[index])?;
            }
            Message::GimbalImu(index) => {
                let sample = &recordings.gimbal_imu[index];
                if let Some(imu) = &rig.gimbal_imu {
                    write_imu(log, &imu.sensor, times(sample.stamp_ns), sample)?;
                }
            }
            Message::Truth(index) => {
                let stamp_ns = recordings.imu[index].stamp_ns;
                let ground_truth = scenario.trajectory.at(seconds_from_ns(stamp_ns));
                let pose = ground_truth.world_from_imu;
                let odometry = Odometry {
                    linear_m_per_s: pose.rotation.inverse() * ground_truth.velocity_m_per_s,
                    angular_rad_per_s: ground_truth.angular_velocity_rad_per_s,
                    ..Odometry::at_rest("world", "imu", pose)
                };
                let topic = rig.ground_truth_topic.as_deref().unwrap_or("/ground_truth/odometry");
                log.write_odometry(topic, times(stamp_ns), &odometry)?;
            }
            Message::Joints(index) => {
                let sample = &recordings.joints[index];
                let stamp_ns = studio.planting.joint_stamp_ns(sample.stamp_ns);
                let topic = rig.gimbal.as_ref().and_then(|gimbal| gimbal.topic.as_deref()).unwrap_or(JOINT_TOPIC);
                log.write_joints(topic, times(stamp_ns), &joint_names, &sample.angles_rad)?;
            }
            Message::TrueJoints(index) => {
                let sample = &recordings.true_joints[index];
                let topic = "/ground_truth/joint_states";
                log.write_joints(topic, times(sample.stamp_ns), &joint_names, &sample.angles_rad)?;
            }
            Message::Image(index) => {
                if ready.is_empty() {
                    let batch = &recordings.shots[index..total.min(index + BATCH)];
                    ready = studio.develop(batch)?;
                }
                let shot = recordings.shots[index];
                let camera = &rig.cameras[shot.camera];
                let info = camera_info_topic(&camera.topic);
                let times = times(shot.stamp_ns);
                // A camera publishes its given intrinsics, including their errors.
                log.write_camera_info(&info, &camera.frame_id, times, &scenario.given_rig.cameras[shot.camera].model)?;
                if let Some(jpeg) = ready.pop_front() {
                    log.write_compressed_image(&camera.topic, &camera.frame_id, times, "jpeg", &jpeg)?;
                }
                done += 1;
                if progress(SimulationProgress { images_done: done, images_total: total }).is_break() {
                    return Err(SimulationError::Interrupted { images_done: done, images_total: total });
                }
            }
        }
    }
    Ok(done)
}

/// Topic of the intrinsics of a camera whose images have this topic.
fn camera_info_topic(images: &str) -> String {
    let beside = images.strip_suffix("image_raw/compressed").map(|parent| format!("{parent}camera_info"));
    beside.unwrap_or_else(|| format!("{images}/camera_info"))
}

fn write_imu(log: &mut LogWriter, imu: &ImuRig, times: MessageTimes, sample: &ImuSample) -> Result<(), LogError> {
    let (rate, force) = (&sample.angular_velocity_rad_per_s, &sample.specific_force_m_per_s2);
    log.write_imu(&imu.topic, &imu.frame_id, times, rate, force)
}

fn recordings(options: &SimulationOptions, scenario: &Scenario) -> Recordings {
    let start_ns = ns_from_seconds(options.disturbances.joint_start_s);
    let mut joints = options.encoder_sigma_rad.map(|sigma| scenario.encoder_samples(sigma)).unwrap_or_default();
    joints.retain(|sample| sample.stamp_ns >= start_ns);
    let planting = Planting::of(&options.disturbances);
    let names = scenario.true_rig.joint_names();
    for sample in &mut joints {
        planting.plant_angles(&names, sample);
    }
    let duration_s = scenario.trajectory.duration_s();
    let shift_s = planting.camera_offset_s();
    // Earliest and latest exposure of a row, relative to the stamp.
    let rows_s = [options.disturbances.readout_s.min(0.0), options.disturbances.readout_s.max(0.0)];
    let mut shots = Vec::new();
    for (camera, rig) in scenario.true_rig.cameras.iter().enumerate() {
        let period_s = 1.0 / rig.rate_hz;
        let phase_s = if rig.mount == CameraMount::Gimbal { 0.0 } else { options.static_camera_phase_s };
        let mut frame_index = 0;
        loop {
            let stamp_s = FIRST_IMAGE_S + phase_s + frame_index as f64 * period_s;
            if stamp_s.max(stamp_s + shift_s + rows_s[1]) > duration_s {
                break;
            }
            let lost = during(options.disturbances.image_gap_s, stamp_s);
            if stamp_s + shift_s + rows_s[0] >= 0.0 && !lost {
                shots.push(Shot { camera, frame_index, stamp_ns: ns_from_seconds(stamp_s) });
            }
            frame_index += 1;
        }
    }
    // In the order of writing.
    shots.sort_by_key(|shot| (shot.stamp_ns, shot.camera));
    let gimbal_imu = scenario.gimbal_imu_record.as_ref().map_or_else(Vec::new, |record| record.samples.clone());
    Recordings {
        imu: scenario.imu_record.samples.clone(),
        gimbal_imu,
        joints,
        true_joints: scenario.true_joint_samples(),
        shots,
    }
}

/// All messages in the order of their log times, which follow the stamps by a delay with jitter.
fn schedule(recordings: &Recordings, seed: u64) -> Vec<(i64, Message)> {
    let mut random = RandomStream::new(seed, stream::DELIVERY);
    let mut late = |delay_s: f64| ns_from_seconds(delay_s * (1.0 + 0.06 * random.unit()));
    let mut messages = Vec::new();
    for (index, sample) in recordings.imu.iter().enumerate() {
        messages.push((sample.stamp_ns, Message::Truth(index)));
        messages.push((sample.stamp_ns + late(DELAYS_S[0]), Message::Imu(index)));
    }
    for (index, sample) in recordings.true_joints.iter().enumerate() {
        messages.push((sample.stamp_ns, Message::TrueJoints(index)));
    }
    for (index, sample) in recordings.joints.iter().enumerate() {
        messages.push((sample.stamp_ns + late(DELAYS_S[1]), Message::Joints(index)));
    }
    let mut before_ns = 0;
    for (index, shot) in recordings.shots.iter().enumerate() {
        let delay = late(DELAYS_S[2] + DELAYS_S[3] * shot.camera as f64);
        before_ns = (shot.stamp_ns + delay).max(before_ns);
        messages.push((before_ns, Message::Image(index)));
    }
    for (index, sample) in recordings.gimbal_imu.iter().enumerate() {
        messages.push((sample.stamp_ns + late(DELAYS_S[0]), Message::GimbalImu(index)));
    }
    messages.sort_unstable();
    messages
}

/// Renders and compresses images.
struct Studio<'a> {
    options: &'a SimulationOptions,
    scenario: &'a Scenario,
    renderer: SurfaceShader<'a>,
    cameras: Vec<(&'a CameraRig, RenderedView, Sensor)>,
    planting: Planting,
}

impl<'a> Studio<'a> {
    fn new(options: &'a SimulationOptions, scenario: &'a Scenario, world: &'a world::World) -> Self {
        let disturbances = &options.disturbances;
        let sensor = SensorOptions {
            noise: disturbances.image_noise.unwrap_or(options.image_noise),
            exposure_drift: disturbances.exposure_drift.unwrap_or(EXPOSURE_DRIFT),
            vignetting: disturbances.vignetting.unwrap_or(VIGNETTING),
        };
        let cameras = scenario.true_rig.cameras.iter().enumerate().map(|(index, camera)| {
            let view = RenderedView::new(&camera.model);
            let seed = RandomStream::new(options.seed, stream::IMAGES + 1000 * (index as u64 + 1)).next_u64();
            let sensor = Sensor::new(&view, sensor, seed);
            (camera, view, sensor)
        });
        let planting = Planting::of(disturbances);
        Self { options, scenario, renderer: SurfaceShader::new(world), cameras: cameras.collect(), planting }
    }

    /// Renders the images of some shots as JPEG, in their order.
    fn develop(&self, shots: &[Shot]) -> Result<VecDeque<Vec<u8>>, SimulationError> {
        let developed: Result<Vec<_>, _> = shots
            .par_iter()
            .map_init(
                || (Workspace::default(), Vec::new()),
                |(workspace, radiance), shot| self.shoot(*shot, workspace, radiance),
            )
            .collect();
        developed.map(VecDeque::from)
    }

    fn shoot(
        &self,
        shot: Shot,
        workspace: &mut Workspace,
        radiance: &mut Vec<f32>,
    ) -> Result<Vec<u8>, SimulationError> {
        let (camera, view, sensor) = &self.cameras[shot.camera];
        let disturbances = &self.options.disturbances;
        let time_s = seconds_from_ns(shot.stamp_ns) + self.planting.camera_offset_s();
        let zoomed = self.planting.zoomed(&camera.model, time_s).map(|model| RenderedView::new(&model));
        let view = zoomed.as_ref().unwrap_or(view);
        let end_s = self.scenario.trajectory.duration_s();
        radiance.clear();
        radiance.resize(view.pixels(), 0.0);
        let steps = match (disturbances.even_grey_at(&camera.mount, time_s), disturbances.exposure_s) {
            (Some(grey), _) => {
                radiance.fill(grey);
                0
            }
            (None, exposure_s) if exposure_s > 0.0 => BLUR_STEPS,
            _ => 1,
        };
        for step in 0..steps {
            // The stamp is the middle of the first row's exposure.
            let place = (step as f64 + 0.5) / steps as f64 - 0.5;
            for rows in view.bands(if camera.readout_s == 0.0 { usize::MAX } else { SHUTTER_ROWS }) {
                let middle_px = 0.5 * (rows.start + rows.end - 1) as f64;
                let at_s = time_s + place * disturbances.exposure_s + camera.row_time_s(middle_px);
                let pose = self.scenario.world_from_camera(camera, at_s.clamp(0.0, end_s));
                self.renderer.render(view, rows, &pose, 1.0 / steps as f32, workspace, radiance);
            }
        }
        let light = disturbances.light_at(time_s) as f32;
        if light != 1.0 {
            for grey in radiance.iter_mut() {
                *grey *= light;
            }
        }
        let image = sensor.expose(radiance, shot.frame_index, time_s);
        let image = self.planting.flipped(&camera.model, time_s, image);
        let mut jpeg = Vec::with_capacity(image.pixels.len() / 4);
        let quality = disturbances.jpeg_quality.map_or(self.options.jpeg_quality, |quality| quality.round() as u8);
        JpegEncoder::new_with_quality(&mut jpeg, quality)
            .write_image(&image.pixels, image.width as u32, image.height as u32, ExtendedColorType::L8)
            .map_err(|error| SimulationError::Image { problem: error.to_string() })?;
        Ok(jpeg)
    }
}

/// Extrinsics error of the given chain, averaged over the joint angles of the flight: translation in metres, rotation
/// in radians.
fn given_chain_error(scenario: &Scenario) -> (f64, f64) {
    let (Some(given), Some(ground_truth)) = (&scenario.given_rig.gimbal, &scenario.true_rig.gimbal) else {
        return (0.0, 0.0);
    };
    let samples = scenario.true_joint_samples();
    let mut sums = (0.0, 0.0);
    for sample in &samples {
        let (given, ground_truth) =
            (given.chain.imu_from_camera(&sample.angles_rad), ground_truth.chain.imu_from_camera(&sample.angles_rad));
        sums.0 += (given.translation_m - ground_truth.translation_m).norm();
        sums.1 += so3::log(&(ground_truth.rotation.inverse() * given.rotation)).norm();
    }
    let count = samples.len().max(1) as f64;
    (sums.0 / count, sums.1 / count)
}

/// Further entries of the ground truth's YAML.
fn ground_truth_notes(options: &SimulationOptions, scenario: &Scenario, chain_error: (f64, f64)) -> String {
    let environment = match options.experiment.environment() {
        crate::simulation::Environment::House => 1,
        crate::simulation::Environment::Town => 2,
    };
    let duration_s = scenario.trajectory.duration_s();
    let mut notes = String::from("truth:\n");
    let mut entry = |name: &str, value: String| {
        // Writing into a string cannot fail.
        writeln!(notes, "  {name}: {value}").is_ok()
    };
    entry("experiment", options.experiment.name().to_owned());
    entry("environment", environment.to_string());
    entry("seed", options.seed.to_string());
    if options.world != WorldKind::Textured {
        entry("world", options.world.name().to_owned());
    }
    if let Some(swing_rad) = options.swing_rad {
        entry("swing", format!("{swing_rad:?}"));
    }
    entry("epoch_ns", EPOCH_NS.to_string());
    entry("duration", format!("{duration_s:?}"));
    entry("path_length", format!("{:?}", scenario.trajectory.length_m(duration_s)));
    let of_gimbal = scenario.gimbal_imu_record.as_ref().map(|record| ("gimbal_", record));
    for (imu, record) in std::iter::once(("", &scenario.imu_record)).chain(of_gimbal) {
        let [first, last] = [record.biases.first(), record.biases.last()].map(|bias| bias.copied().unwrap_or_default());
        entry(&format!("{imu}gyroscope_bias_start"), list(&first.gyroscope_rad_per_s));
        entry(&format!("{imu}gyroscope_bias_end"), list(&last.gyroscope_rad_per_s));
        entry(&format!("{imu}accelerometer_bias_start"), list(&first.accelerometer_m_per_s2));
        entry(&format!("{imu}accelerometer_bias_end"), list(&last.accelerometer_m_per_s2));
    }
    entry("air_drag_per_s", format!("{AIR_DRAG_PER_S:?}"));
    entry("given_chain_error", format!("{{translation_m: {:?}, rotation_rad: {:?}}}", chain_error.0, chain_error.1));
    notes
}

fn list(vector: &nalgebra::Vector3<f64>) -> String {
    format!("[{:?}, {:?}, {:?}]", vector.x, vector.y, vector.z)
}
