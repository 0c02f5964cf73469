//! Motions of joints and vehicle as comma-separated values: `t_s`, one `NAME_rad` per joint, `x_m`, `y_m`, `z_m`,
//! `heading_rad`.

use std::fs;
use std::path::Path;

use nalgebra::Vector3;

use super::error::ExportError;
use crate::files::output;
use crate::simulation::{MotionSample, MotionSplines, PrescribedMotion};
use crate::table::csv_text;

/// Columns before and after the columns of the joints.
const TIME: &str = "t_s";
const VEHICLE: [&str; 4] = ["x_m", "y_m", "z_m", "heading_rad"];
/// End of the name of a joint's column.
const JOINT_UNIT: &str = "_rad";
/// Time between two written samples, in seconds.
const STEP_S: f64 = 0.05;
/// Size limit of a file that is read.
const LARGEST_BYTES: u64 = 64 << 20;

/// Table of a motion, a row every 0.05 s and one at the end.
pub(super) fn motion_csv(motion: &MotionSplines, joint_names: &[String]) -> String {
    let joints = joint_names.iter().map(|name| format!("{name}{JOINT_UNIT}"));
    let header = [TIME.to_owned()].into_iter().chain(joints).chain(VEHICLE.map(str::to_owned));
    let steps = (motion.duration_s() / STEP_S - 1e-9).ceil().max(1.0) as usize;
    let rows = (0..=steps).map(|step| {
        let time_s = motion.duration_s() * step as f64 / steps as f64;
        let MotionSample { joints_rad, position_m, heading_rad, .. } = motion.sample(time_s);
        let numbers = [time_s].into_iter().chain(joints_rad).chain(position_m.iter().copied()).chain([heading_rad]);
        numbers.map(|number| number.to_string()).collect::<Vec<_>>()
    });
    csv_text(header, rows)
}

/// Writes a motion into a new CSV file, and creates its folder if necessary.
///
/// # Errors
/// If the file exists or cannot be written.
pub fn write_motion(motion: &MotionSplines, joint_names: &[String], path: &Path) -> Result<(), ExportError> {
    if path.exists() {
        return Err(ExportError::Existing { problem: "the file exists".to_owned(), path: path.to_owned() });
    }
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    }
    output::write_file(path, motion_csv(motion, joint_names).as_bytes()).map_err(ExportError::write(path))
}

/// Reads a motion from a CSV file.
///
/// # Errors
/// If the file cannot be read, or a column, a number or a time is wrong; the message names the row.
pub fn read_motion(path: &Path) -> Result<PrescribedMotion, ExportError> {
    let unreadable = |source| ExportError::Read { source, path: path.to_owned() };
    let invalid = |problem: String| ExportError::Motion { problem, path: path.to_owned() };
    let bytes = fs::metadata(path).map_err(unreadable)?.len();
    if bytes > LARGEST_BYTES {
        return Err(invalid(format!("it has {bytes} bytes, expected at most {LARGEST_BYTES}")));
    }
    let motion = parse(&fs::read(path).map_err(unreadable)?).map_err(invalid)?;
    motion.check().map_err(invalid)?;
    Ok(motion)
}

fn parse(text: &[u8]) -> Result<PrescribedMotion, String> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text);
    let header = reader.headers().map_err(|error| error.to_string())?.clone();
    let columns: Vec<&str> = header.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
    let expected = || format!("expected the columns {TIME}, one NAME{JOINT_UNIT} per joint, {}", VEHICLE.join(", "));
    let joints = match columns.split_first().zip(columns.len().checked_sub(VEHICLE.len())) {
        Some(((&TIME, _), vehicle)) if vehicle >= 1 && columns[vehicle..] == VEHICLE => &columns[1..vehicle],
        _ => return Err(format!("the columns are {}: {}", columns.join(", "), expected())),
    };
    let name = |column: &&str| {
        let name = column.strip_suffix(JOINT_UNIT).filter(|name| !name.is_empty());
        name.map(str::to_owned).ok_or_else(|| format!("the column '{column}' is no joint: {}", expected()))
    };
    let joint_names: Vec<String> = joints.iter().map(name).collect::<Result<_, _>>()?;
    let mut samples = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|error| error.to_string())?;
        let number = |(column, cell): (usize, &str)| {
            let value = cell.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| format!("row {}, column {}: '{cell}' is no number", row + 2, columns[column]))
        };
        let numbers: Vec<f64> = record.iter().enumerate().map(number).collect::<Result<_, _>>()?;
        let vehicle = 1 + joint_names.len();
        samples.push(MotionSample {
            time_s: numbers[0],
            joints_rad: numbers[1..vehicle].to_vec(),
            position_m: Vector3::new(numbers[vehicle], numbers[vehicle + 1], numbers[vehicle + 2]),
            heading_rad: numbers[vehicle + 3],
        });
    }
    Ok(PrescribedMotion { joint_names, samples })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_motion_is_read_again() {
        let mut motion = MotionSplines::at_rest(&[0.1, -0.2], 8.0, 16);
        for index in motion.free_points() {
            motion.set_point(1, index, 0.01 * index as f64);
            motion.set_point(2, index, -0.02 * index as f64);
            motion.set_point(5, index, 0.03 * index as f64);
        }
        let names = ["pan".to_owned(), "tilt".to_owned()];
        let text = motion_csv(&motion, &names);
        assert!(text.starts_with("t_s,pan_rad,tilt_rad,x_m,y_m,z_m,heading_rad\n0,"), "{text}");
        let read = parse(text.as_bytes()).unwrap();
        read.check().unwrap();
        assert_eq!((read.joint_names.as_slice(), read.samples.len()), (&names[..], 161));
        for sample in &read.samples {
            assert_eq!(*sample, motion.sample(sample.time_s));
        }
    }

    #[test]
    fn wrong_motions_are_rejected_with_their_place() {
        let check = |text: &str, words: &str| {
            let problem = parse(text.as_bytes()).unwrap_err();
            assert!(problem.contains(words), "{problem}");
        };
        check("", "expected the columns t_s");
        check("t_s,x_m,y_m,z_m\n", "expected the columns t_s");
        check("time,x_m,y_m,z_m,heading_rad\n", "the columns are time,");
        check("t_s,pan,x_m,y_m,z_m,heading_rad\n", "'pan' is no joint");
        check("t_s,x_m,y_m,z_m,heading_rad\n0,0,0,0,0\n0.1,0,much,0,0\n", "row 3, column y_m: 'much' is no number");
        check("t_s,x_m,y_m,z_m,heading_rad\n0,0,0\n", "fields");
        assert!(parse(b"\xef\xbb\xbft_s,x_m,y_m,z_m,heading_rad\n0, 0,0,0,0\n").is_ok());
    }
}
