//! CAMM, Google's camera motion metadata: a track of packets of eight types, each at the time of its sample
//! (<https://developers.google.com/streetview/publish/camm-spec>).

use nalgebra::Vector3;

use super::dataflash::utc_from_gps_ns;
use super::mp4::Payload;
use super::recorded::{Recorded, finite};
use super::scalar::Scalar;
use crate::flight_log::trajectory::geodesy::Geodetic;
use crate::geometry::median;

/// Name of the format in the report.
const FORMAT: &str = "CAMM";
/// Size of the header of a packet: two reserved bytes and the type.
const HEADER_BYTES: usize = 4;
/// Smallest type of a fix in three dimensions.
const FIX_3D: f64 = 3.0;

/// Reads the packets of a track, in nanoseconds since the start of the video; `None` without a packet.
pub(super) fn read(packets: &[Payload]) -> Option<Recorded> {
    if packets.is_empty() {
        return None;
    }
    let mut recorded = Recorded::new(FORMAT, "/camera");
    let mut readouts_s = Vec::new();
    for packet in packets {
        if let Err((record, reason)) = take(packet, &mut recorded, &mut readouts_s) {
            recorded.leave(record, reason);
        }
    }
    if let Some(readout_s) = median(readouts_s).filter(|readout_s| *readout_s != 0.0) {
        recorded.notes.push(format!(
            "the camera has a rolling shutter, {:.2} ms from the first to the last row in the median: cam0.readout of the rig",
            readout_s * 1e3
        ));
    }
    if !recorded.imus.is_empty() {
        recorded.notes.push(
            "the axes of the camera's IMU are those of its application, which CAMM does not define: check finds them"
                .to_owned(),
        );
    }
    Some(recorded)
}

const NOT_FINITE: &str = "with invalid numbers";

/// Stores a packet, or returns its name and why it is left out. All numbers are little-endian.
fn take(
    packet: &Payload,
    recorded: &mut Recorded,
    readouts_s: &mut Vec<f64>,
) -> Result<(), (&'static str, &'static str)> {
    let bytes = packet.bytes.as_slice();
    let kind = Scalar::U16.little_endian(bytes, 2).ok_or((FORMAT, "shorter than its header"))? as u16;
    let float = |index: usize| Scalar::F32.little_endian(bytes, HEADER_BYTES + 4 * index);
    let vector = |name: &'static str| -> Result<Vector3<f64>, (&'static str, &'static str)> {
        let three = || finite([float(0)?, float(1)?, float(2)?]);
        three().ok_or((name, NOT_FINITE))
    };
    let time_ns = packet.start_ns;
    match kind {
        0 => Err(("CAMM orientation", "its world is defined by the application")),
        1 => {
            // Exposure of a pixel, then time from the first to the last row, in nanoseconds.
            let skew = Scalar::I32.little_endian(bytes, HEADER_BYTES + 4).ok_or(("CAMM exposure", NOT_FINITE))?;
            readouts_s.push(skew * 1e-9);
            Ok(())
        }
        2 => {
            let rate = vector("CAMM gyroscope")?;
            recorded.imu(FORMAT).gyroscope.push((time_ns, rate));
            Ok(())
        }
        3 => {
            let force = vector("CAMM acceleration")?;
            recorded.imu(FORMAT).accelerometer.push((time_ns, force));
            Ok(())
        }
        4 => Err(("CAMM position", "its world is defined by the application")),
        5 => {
            let double = |index: usize| Scalar::F64.little_endian(bytes, HEADER_BYTES + 8 * index);
            let place = || Geodetic::from_deg(double(0)?, double(1)?, double(2)?);
            let place = place().ok_or(("CAMM position on earth", NOT_FINITE))?;
            recorded.fixes.push((1, 0), "CAMM position on earth", time_ns, place);
            Ok(())
        }
        6 => fix(bytes, time_ns, recorded).map_err(|reason| ("CAMM fix", reason)),
        7 => Err(("CAMM magnetic field", "not read")),
        _ => Err((FORMAT, "of an unknown type")),
    }
}

/// Stores a fix: GPS time in seconds (f64), type (i32), latitude and longitude in degrees (f64), altitude in metres (f32).
fn fix(bytes: &[u8], time_ns: i64, recorded: &mut Recorded) -> Result<(), &'static str> {
    let at = |offset: usize, scalar: Scalar| scalar.little_endian(bytes, HEADER_BYTES + offset).ok_or(NOT_FINITE);
    let (gps_s, kind) = (at(0, Scalar::F64)?, at(8, Scalar::I32)?);
    let (latitude_deg, longitude_deg, altitude_m) = (at(12, Scalar::F64)?, at(20, Scalar::F64)?, at(28, Scalar::F32)?);
    if kind < FIX_3D {
        return Err("without a fix in three dimensions");
    }
    let place = Geodetic::from_deg(latitude_deg, longitude_deg, altitude_m).ok_or(NOT_FINITE)?;
    recorded.fixes.push((0, 0), "CAMM fix", time_ns, place);
    recorded.utc.extend(utc_from_gps_ns(0.0, gps_s * 1e3).map(|utc_ns| (time_ns, utc_ns)));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(kind: u16, content: &[u8]) -> Payload {
        Payload { start_ns: 5, end_ns: 6, bytes: [&[0, 0], &kind.to_le_bytes()[..], content].concat() }
    }

    #[test]
    fn packets_of_every_type_are_stored_or_counted() {
        let floats = |values: [f32; 3]| values.map(f32::to_le_bytes).concat();
        let fix = [
            &1_401_494_418.0_f64.to_le_bytes()[..],
            &3_i32.to_le_bytes(),
            &[47.0_f64, 8.0].map(f64::to_le_bytes).concat(),
            &[500.0_f32; 7].map(f32::to_le_bytes).concat(),
        ];
        let packets = [
            packet(0, &floats([0.1; 3])),
            packet(1, &[1_000_000_i32, 20_000_000].map(i32::to_le_bytes).concat()),
            packet(2, &floats([0.25, -0.5, 1.0])),
            packet(3, &floats([0.0, 0.0, 9.75])),
            packet(4, &floats([0.1; 3])),
            packet(5, &[47.0_f64, 8.0, 500.0].map(f64::to_le_bytes).concat()),
            packet(6, &fix.concat()),
            packet(7, &floats([30.0; 3])),
            packet(2, &floats([f32::NAN; 3])),
            packet(9, &[]),
            Payload { start_ns: 0, end_ns: 0, bytes: vec![0, 0, 2] },
        ];
        let recorded = read(&packets).unwrap();
        let imu = &recorded.imus["CAMM"];
        assert_eq!(imu.gyroscope, [(5, Vector3::new(0.25, -0.5, 1.0))]);
        assert_eq!(imu.accelerometer, [(5, Vector3::new(0.0, 0.0, 9.75))]);
        // 4 June 2024: 18 leap seconds.
        assert_eq!((recorded.fixes.count(), recorded.utc.clone()), (2, vec![(5, 1_717_459_200_000_000_000)]));
        let left: Vec<(&str, u64)> = recorded.left.iter().map(|(name, left)| (name.as_str(), left.count)).collect();
        let expected = [
            ("CAMM", 2),
            ("CAMM gyroscope", 1),
            ("CAMM magnetic field", 1),
            ("CAMM orientation", 1),
            ("CAMM position", 1),
        ];
        assert_eq!(left, expected);
        assert!(recorded.notes[0].contains("20.00 ms"), "{:?}", recorded.notes);
        assert!(read(&[]).is_none());
    }
}
