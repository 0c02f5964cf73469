//! Writing of all sensors of a log into an unfinished folder, each table row by row.

use crate::files::RigFile as _;
use std::fs::{self, File};
use std::io::BufWriter;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

use super::report::{EurocCamera, EurocReport};
use super::sensor_yaml::{body_yaml, camera_yaml, ground_truth_yaml, imu_yaml};
use crate::export::error::ExportError;
use crate::export::masks;
use crate::export::trajectory::EUROC_COLUMNS;
use crate::files::output;
use crate::flight_log::convert::{EUROC_GIMBAL, EUROC_GROUND_TRUTH, EUROC_RIG, rig_of_euroc_folder};
use crate::flight_log::{
    FlightLog, LogWarning, SensorSamples, ground_truth_poses, imu_samples, joint_samples, recorded_images,
};
use crate::geometry::RigidTransform;
use crate::sensors::{CameraMount, CameraRig, GrayImage, PoseSample, Rig};
use crate::text::log_name;

/// Description of the body, which names the log from which a folder was made.
pub(super) const BODY: &str = "body.yaml";
/// Table of the moving extrinsics in the folder of a camera on a gimbal.
const EXTRINSICS: &str = "extrinsics.csv";
/// Largest number of notes about problems of one sensor.
const NOTES_PER_SENSOR: usize = 4;
/// Columns of the IMU's table.
const IMU_COLUMNS: [&str; 6] = [
    "w_RS_S_x [rad s^-1]",
    "w_RS_S_y [rad s^-1]",
    "w_RS_S_z [rad s^-1]",
    "a_RS_S_x [m s^-2]",
    "a_RS_S_y [m s^-2]",
    "a_RS_S_z [m s^-2]",
];

/// Conversion of one log, with the report of what is written so far.
pub(super) struct Conversion<'a> {
    pub(super) log: &'a Arc<FlightLog>,
    pub(super) rig: &'a Rig,
    /// `mav0` under a temporary name, until it is complete.
    pub(super) root: PathBuf,
    pub(super) done: u64,
    pub(super) total: u64,
    pub(super) progress: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
    pub(super) report: EurocReport,
}

impl Conversion<'_> {
    /// Writes all sensors; breaks if the caller stops.
    pub(super) fn write(&mut self, cameras: &[&CameraRig]) -> Result<ControlFlow<()>, ExportError> {
        self.write_text(BODY, &body_yaml(&log_name(self.log.path())))?;
        for (number, camera) in cameras.iter().enumerate() {
            if self.write_camera(number, camera)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        if self.write_imu()?.is_break() || self.write_ground_truth()?.is_break() || self.write_joints()?.is_break() {
            return Ok(ControlFlow::Break(()));
        }
        let (joints, poses) = (self.report.joint_readings > 0, self.report.ground_truth_poses > 0);
        let mut rig = rig_of_euroc_folder(self.rig, cameras, joints, poses);
        for (name, content) in masks::beside(&mut rig)? {
            self.write_bytes(&name, &content)?;
        }
        self.write_text(EUROC_RIG, &rig.to_yaml())?;
        Ok(ControlFlow::Continue(()))
    }

    fn write_imu(&mut self) -> Result<ControlFlow<()>, ExportError> {
        if !self.rig.imu.intrinsics.is_identity() {
            let note = "the IMU samples are corrected by the rig's scale and misalignment, which EuRoC's format lacks";
            self.report.notes.push(note.to_owned());
        }
        self.write_text("imu0/sensor.yaml", &imu_yaml(&self.rig.imu))?;
        let mut samples = imu_samples(self.log, self.rig)?;
        let mut table = self.table("imu0/data.csv", &stamped(&IMU_COLUMNS, Vec::new()))?;
        for sample in samples.by_ref() {
            let values = sample.angular_velocity_rad_per_s.iter().chain(&sample.specific_force_m_per_s2);
            table.row(self.absolute_ns(sample.stamp_ns), values)?;
            if self.advance().is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        self.report.imu_samples = table.finish()?;
        self.note_problems(&mut samples);
        Ok(ControlFlow::Continue(()))
    }

    fn write_ground_truth(&mut self) -> Result<ControlFlow<()>, ExportError> {
        let Some(topic) = &self.rig.ground_truth_topic else { return Ok(ControlFlow::Continue(())) };
        let Some(mut samples) = ground_truth_poses(self.log, self.rig) else {
            let problem =
                if self.log.is_position_topic(topic) { "has positions without attitudes" } else { "is not in the log" };
            self.report.notes.push(format!("no ground truth is written: {topic} {problem}"));
            return Ok(ControlFlow::Continue(()));
        };
        self.write_text(&format!("{EUROC_GROUND_TRUTH}/sensor.yaml"), &ground_truth_yaml())?;
        let columns = stamped(&EUROC_COLUMNS[1..8], Vec::new());
        let mut table = self.table(&format!("{EUROC_GROUND_TRUTH}/data.csv"), &columns)?;
        for PoseSample { stamp_ns, world_from_imu } in samples.by_ref() {
            table.row(self.absolute_ns(stamp_ns), &pose_numbers(&world_from_imu))?;
            if self.advance().is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        self.report.ground_truth_poses = table.finish()?;
        self.note_problems(&mut samples);
        Ok(ControlFlow::Continue(()))
    }

    fn write_joints(&mut self) -> Result<ControlFlow<()>, ExportError> {
        let topic = self.rig.gimbal.as_ref().and_then(|gimbal| gimbal.topic.as_ref());
        if topic.is_none_or(|topic| self.log.topic(topic).is_none()) {
            return Ok(ControlFlow::Continue(()));
        }
        let Some(mut samples) = joint_samples(self.log, self.rig)? else { return Ok(ControlFlow::Continue(())) };
        let mut table = self.table(&format!("{EUROC_GIMBAL}/data.csv"), &stamped(&[], self.joint_columns()))?;
        for sample in samples.by_ref() {
            table.row(self.absolute_ns(sample.stamp_ns), &sample.angles_rad)?;
            if self.advance().is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        self.report.joint_readings = table.finish()?;
        self.note_problems(&mut samples);
        Ok(ControlFlow::Continue(()))
    }

    fn write_camera(&mut self, number: usize, camera: &CameraRig) -> Result<ControlFlow<()>, ExportError> {
        let folder = format!("cam{number}");
        let mut samples = recorded_images(self.log, self.rig, camera)?;
        let count = self.log.topic(&camera.topic).map_or(0, |info| info.count);
        let mut table = self.table(&format!("{folder}/data.csv"), &stamped(&["filename"], Vec::new()))?;
        let chain = self.rig.chain_of_camera(&camera.key);
        let mut extrinsics = None;
        if camera.mount == CameraMount::Gimbal {
            let columns = stamped(&POSE_COLUMNS, self.joint_columns());
            extrinsics = Some(self.table(&format!("{folder}/{EXTRINSICS}"), &columns)?);
        }
        let images = self.root.join(&folder).join("data");
        fs::create_dir_all(&images).map_err(ExportError::write(&images))?;
        let mut first_pose = None;
        for recorded in samples.by_ref() {
            let stamp_ns = self.absolute_ns(recorded.stamp_ns);
            let name = format!("{stamp_ns}.png");
            write_image(&images.join(&name), &recorded.image)?;
            table.text_row(stamp_ns, &name)?;
            if let (Some(table), Some(chain), Some(joints)) = (&mut extrinsics, &chain, &recorded.joint_angles) {
                let imu_from_camera = chain.imu_from_camera(&joints.angles_rad);
                first_pose.get_or_insert(imu_from_camera);
                table.row(stamp_ns, pose_numbers(&imu_from_camera).iter().chain(&joints.angles_rad))?;
            }
            if self.advance().is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        let written = table.finish()?;
        let poses = extrinsics.map(SampleTable::finish).transpose()?;
        let pose = match &camera.mount {
            CameraMount::Static { imu_from_camera } => Some(*imu_from_camera),
            CameraMount::Gimbal => {
                first_pose.or_else(|| chain.map(|chain| chain.imu_from_camera(&self.rig.neutral_joint_angles_rad())))
            }
        };
        let text = camera_yaml(camera, pose.as_ref(), first_pose.is_some());
        self.write_text(&format!("{folder}/sensor.yaml"), &text)?;
        self.report.cameras.push(EurocCamera {
            folder,
            key: camera.key.clone(),
            topic: camera.topic.clone(),
            images: written,
            left: count.saturating_sub(written),
            moving_extrinsics: poses,
        });
        self.note_problems(&mut samples);
        Ok(ControlFlow::Continue(()))
    }

    /// Columns of the joints' angles.
    fn joint_columns(&self) -> Vec<String> {
        self.rig.joint_names().into_iter().map(|name| format!("{name} [rad]")).collect()
    }

    fn table(&self, name: &str, columns: &[String]) -> Result<SampleTable, ExportError> {
        SampleTable::create(&self.root.join(name), columns)
    }

    fn write_text(&self, name: &str, text: &str) -> Result<(), ExportError> {
        self.write_bytes(name, text.as_bytes())
    }

    fn write_bytes(&self, name: &str, content: &[u8]) -> Result<(), ExportError> {
        let path = self.root.join(name);
        let folder = output::folder_of(&path);
        fs::create_dir_all(&folder).and_then(|()| fs::write(&path, content)).map_err(ExportError::write(&path))
    }

    fn absolute_ns(&self, stamp_ns: i64) -> i64 {
        self.log.epoch_ns().saturating_add(stamp_ns)
    }

    /// Counts one message and reports the completed fraction.
    fn advance(&mut self) -> ControlFlow<()> {
        self.done += 1;
        (self.progress)((self.done as f64 / self.total as f64).min(1.0))
    }

    /// Notes the first problems of a sensor, and the number of the others.
    fn note_problems<T>(&mut self, samples: &mut SensorSamples<T>) {
        let problems: Vec<LogWarning> = samples.take_warnings();
        self.report.notes.extend(problems.iter().take(NOTES_PER_SENSOR).map(|problem| problem.message.clone()));
        if let Some(more) = problems.len().checked_sub(NOTES_PER_SENSOR).filter(|more| *more > 0) {
            self.report.notes.push(format!("{more} further problems of this topic; `dcvins check` lists them"));
        }
    }
}

/// Stamp of a row.
const STAMP: &str = EUROC_COLUMNS[0];

/// Columns of `T_BS` of a camera.
const POSE_COLUMNS: [&str; 7] =
    ["p_BS_B_x [m]", "p_BS_B_y [m]", "p_BS_B_z [m]", "q_BS_w []", "q_BS_x []", "q_BS_y []", "q_BS_z []"];

/// Names of the stamp's column and of further ones.
fn stamped(columns: &[&str], further: Vec<String>) -> Vec<String> {
    std::iter::once(&STAMP).chain(columns).map(|name| (*name).to_owned()).chain(further).collect()
}

/// Position and orientation (w first) of a pose.
fn pose_numbers(pose: &RigidTransform) -> [f64; 7] {
    let (position, rotation) = (&pose.translation_m, pose.rotation.quaternion());
    [position.x, position.y, position.z, rotation.w, rotation.i, rotation.j, rotation.k]
}

/// Writes grey values as an 8-bit PNG.
fn write_image(path: &Path, image: &GrayImage) -> Result<(), ExportError> {
    let file = File::create(path).map_err(ExportError::write(path))?;
    let encoder = PngEncoder::new_with_quality(BufWriter::new(file), CompressionType::Fast, FilterType::Adaptive);
    let size = [image.width, image.height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    let written = encoder.write_image(&image.pixels, size[0], size[1], ExtendedColorType::L8);
    written.map_err(|error| match error {
        image::ImageError::IoError(source) => ExportError::Write { source, path: path.to_owned() },
        other => ExportError::Write { source: std::io::Error::other(other.to_string()), path: path.to_owned() },
    })
}

/// Rows of a stamp in nanoseconds and further cells.
pub(super) struct SampleTable {
    rows: csv::Writer<BufWriter<File>>,
    count: u64,
    path: PathBuf,
}

impl SampleTable {
    /// Creates a file, and its folder if it is missing.
    pub(super) fn create(path: &Path, columns: &[String]) -> Result<Self, ExportError> {
        let folder = output::folder_of(path);
        let file = fs::create_dir_all(&folder).and_then(|()| File::create(path));
        let file = BufWriter::new(file.map_err(ExportError::write(path))?);
        let mut table = Self { rows: csv::Writer::from_writer(file), count: 0, path: path.to_owned() };
        table.write(columns)?;
        Ok(table)
    }

    /// Appends numbers, which read back exactly.
    pub(super) fn row<'a>(
        &mut self,
        stamp_ns: i64,
        numbers: impl IntoIterator<Item = &'a f64>,
    ) -> Result<(), ExportError> {
        let numbers = numbers.into_iter().map(f64::to_string);
        let cells: Vec<String> = std::iter::once(stamp_ns.to_string()).chain(numbers).collect();
        self.count += 1;
        self.write(&cells)
    }

    /// Appends a row with a text.
    pub(super) fn text_row(&mut self, stamp_ns: i64, text: &str) -> Result<(), ExportError> {
        self.count += 1;
        self.write(&[stamp_ns.to_string(), text.to_owned()])
    }

    /// Number of rows of the complete table.
    pub(super) fn finish(mut self) -> Result<u64, ExportError> {
        self.rows.flush().map_err(ExportError::write(&self.path))?;
        Ok(self.count)
    }

    fn write(&mut self, cells: &[String]) -> Result<(), ExportError> {
        let written = self.rows.write_record(cells);
        written.map_err(|error| ExportError::Write { source: error.into(), path: self.path.clone() })
    }
}
