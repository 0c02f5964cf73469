//! Small recordings in the formats of autopilots and cameras, for the tests of `convert` and the seeds of its fuzz
//! targets.

/// Angular velocity of a sample in rad/s, exact in thousandths.
pub(crate) fn rate(index: usize) -> [f64; 3] {
    let index = index as f64;
    [0.125 * index, -0.25, 0.001 * index]
}

/// Specific force of a sample in m/s².
pub(crate) fn force(index: usize) -> [f64; 3] {
    [0.5, -0.125 * index as f64, -9.75]
}

/// Angles of the gimbal in degrees: roll, pitch, yaw.
pub(crate) const GIMBAL_DEG: [f64; 3] = [1.5, -30.0, 20.0];
/// Angles of the vehicle in degrees: roll, pitch, yaw.
pub(crate) const VEHICLE_DEG: [f64; 3] = [2.0, -4.0, 90.0];
/// Position of the vehicle: north, east, down in metres.
pub(crate) const POSITION_M: [f64; 3] = [3.0, -2.0, -10.0];
/// Time of the first sample since the start of the autopilot, in microseconds.
pub(crate) const START_US: u64 = 5_000_000;
/// Time between samples in microseconds.
pub(crate) const PERIOD_US: u64 = 4_000;
/// UTC of the first sample in seconds since the epoch: 10 June 2024, 00:00:00.
pub(crate) const START_UTC_S: u64 = 1_717_977_600;

pub(crate) fn floats(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| (*value as f32).to_le_bytes()).collect()
}

fn padded(text: &str, length: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(length, 0);
    bytes
}

/// Quaternion of roll, pitch and yaw in degrees, its scalar part first.
pub(crate) fn quaternion([roll_deg, pitch_deg, yaw_deg]: [f64; 3]) -> [f64; 4] {
    let half = |angle_deg: f64| (angle_deg.to_radians() / 2.0).sin_cos();
    let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll_deg), half(pitch_deg), half(yaw_deg));
    [cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy]
}

/// Appends a record of a `DataFlash` log.
pub(crate) fn put_record(out: &mut Vec<u8>, kind: u8, content: &[&[u8]]) {
    out.extend([0xA3, 0x95, kind]);
    for part in content {
        out.extend_from_slice(part);
    }
}

/// Appends the descriptions of types of records: number, name, format, columns, and length in bytes.
pub(crate) fn describe_records(out: &mut Vec<u8>, types: &[(u8, &str, &str, &str, u8)]) {
    for (kind, name, format, columns, length) in types {
        put_record(out, 128, &[&[*kind, *length], &padded(name, 4), &padded(format, 16), &padded(columns, 64)]);
    }
}

/// A `DataFlash` log: an IMU of 250 Hz and one of 125 Hz, and every tenth sample attitude, gimbal, position and fix.
pub(crate) fn dataflash(samples: usize) -> Vec<u8> {
    let mut out = Vec::new();
    let types = [
        (10, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", 36),
        (11, "ATT", "QccC", "TimeUS,Roll,Pitch,Yaw", 17),
        (12, "MNT", "QBfffff", "TimeUS,I,Roll,Pitch,YawB,YawE,Dist", 32),
        (13, "XKF1", "QBfff", "TimeUS,C,PN,PE,PD", 24),
        (14, "GPS", "QBBIHLLe", "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt", 31),
        (15, "MULT", "Qbd", "TimeUS,Id,Mult", 20),
        (16, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds", 44),
        (17, "MODE", "QB", "TimeUS,Mode", 12),
    ];
    describe_records(&mut out, &types);
    let mut record = |kind: u8, content: &[&[u8]]| put_record(&mut out, kind, content);
    let start = START_US.to_le_bytes();
    record(15, &[&start, b"B", &1e-2_f64.to_le_bytes()]);
    record(16, &[&start, &[11], &padded("sddh", 16), &padded("-BBB", 16)]);
    record(17, &[&start, &[3]]);
    let hundredths = |angle_deg: f64| ((angle_deg * 100.0) as i16).to_le_bytes();
    for index in 0..samples {
        let time = (START_US + PERIOD_US * index as u64).to_le_bytes();
        let sample = [floats(&rate(index)), floats(&force(index))].concat();
        record(10, &[&time, &[0], &sample]);
        if index % 2 == 0 {
            record(10, &[&time, &[1], &sample]);
        }
        if index % 10 == 0 {
            let [roll, pitch, yaw] = VEHICLE_DEG.map(hundredths);
            record(11, &[&time, &roll, &pitch, &yaw]);
            let [roll_deg, pitch_deg, yaw_deg] = GIMBAL_DEG;
            record(12, &[&time, &[0], &floats(&[roll_deg, pitch_deg, yaw_deg, yaw_deg + 90.0, f64::NAN])]);
            record(13, &[&time, &[0], &floats(&POSITION_M)]);
            record(13, &[&time, &[1], &floats(&POSITION_M)]);
            // 10 June 2024 is the second day of GPS week 2318, 18 leap seconds later.
            let in_week_ms = (86_400_000 + 18_000 + (index as u64 * PERIOD_US) / 1000) as u32;
            let place = [470_000_000_i32 + index as i32, 80_000_000, 50_000].map(i32::to_le_bytes).concat();
            record(14, &[&time, &[0, 3], &in_week_ms.to_le_bytes(), &2318_u16.to_le_bytes(), &place]);
        }
    }
    out
}

/// A `ULog`: the same sensors, with the gimbal's attitude in the vehicle's frame.
pub(crate) fn ulog(samples: usize) -> Vec<u8> {
    let mut out = vec![0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35, 1];
    out.extend(START_US.to_le_bytes());
    let mut message = |kind: u8, parts: &[&[u8]]| {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        out.extend((length as u16).to_le_bytes());
        out.push(kind);
        for part in parts {
            out.extend_from_slice(part);
        }
    };
    message(b'B', &[&[0; 40]]);
    for format in [
        "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;float[3] accelerometer_m_s2;",
        "vehicle_attitude:uint64_t timestamp;float[4] q;",
        "gimbal_device_attitude_status:uint64_t timestamp;uint16_t device_flags;float[4] q;uint8_t[2] _padding0;",
        "vehicle_local_position:uint64_t timestamp;float x;float y;float z;bool xy_valid;bool z_valid;",
        "vehicle_gps_position:uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;uint8_t fix_type;",
        "cpuload:uint64_t timestamp;float load;",
    ] {
        message(b'F', &[format.as_bytes()]);
    }
    let names = [
        "sensor_combined",
        "vehicle_attitude",
        "gimbal_device_attitude_status",
        "vehicle_local_position",
        "vehicle_gps_position",
        "cpuload",
    ];
    for (number, name) in names.iter().enumerate() {
        message(b'A', &[&[0], &(number as u16).to_le_bytes(), name.as_bytes()]);
    }
    for index in 0..samples {
        let time_us = START_US + PERIOD_US * index as u64;
        let time = time_us.to_le_bytes();
        message(b'D', &[&[0, 0], &time, &floats(&rate(index)), &4000_u32.to_le_bytes(), &floats(&force(index))]);
        if index % 10 == 0 {
            message(b'D', &[&[1, 0], &time, &floats(&quaternion(VEHICLE_DEG))]);
            message(b'D', &[&[2, 0], &time, &[32, 0], &floats(&quaternion(GIMBAL_DEG))]);
            message(b'D', &[&[3, 0], &time, &floats(&POSITION_M), &[1, 1]]);
            let utc = (START_UTC_S * 1_000_000 + PERIOD_US * index as u64).to_le_bytes();
            let place = [470_000_000_i32 + index as i32, 80_000_000, 500_000].map(i32::to_le_bytes).concat();
            message(b'D', &[&[4, 0], &time, &utc, &place, &[3]]);
            message(b'D', &[&[5, 0], &time, &floats(&[0.5])]);
        }
    }
    message(b'O', &[&250_u16.to_le_bytes()]);
    out
}

/// CRC-16/MCRF4XX of bytes.
fn checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |checksum, byte| {
        (0..8).fold(
            checksum ^ u16::from(*byte),
            |checksum, _| {
                if checksum & 1 == 1 { checksum >> 1 ^ 0x8408 } else { checksum >> 1 }
            },
        )
    })
}

/// A telemetry log: the same sensors in `MAVLink` 2, heartbeats in `MAVLink` 1; the gimbal has a separate clock.
pub(crate) fn telemetry_log(samples: usize) -> Vec<u8> {
    let mut out = Vec::new();
    let mut put = |received_us: u64, component: u8, message: u32, checksum_byte: u8, payload: &[u8]| {
        out.extend((START_UTC_S * 1_000_000 + received_us).to_be_bytes());
        let mut frame = if message == 0 {
            vec![0xFE, payload.len() as u8, 0, 1, component, 0]
        } else {
            let [low, middle, high, _] = message.to_le_bytes();
            // Zeros at the end of a payload are omitted.
            let length = payload.iter().rposition(|byte| *byte != 0).map_or(1, |last| last + 1);
            vec![0xFD, length as u8, 0, 0, 0, 1, component, low, middle, high]
        };
        let length = usize::from(frame[1]);
        frame.extend_from_slice(&payload[..length]);
        let sum = checksum(&[&frame[1..], &[checksum_byte]].concat());
        frame.extend(sum.to_le_bytes());
        out.extend(frame);
    };
    // Delay of the radio.
    const DELAY_US: u64 = 30_000;
    for index in 0..samples {
        let since_start_us = PERIOD_US * index as u64;
        let (received_us, boot_us) = (since_start_us + DELAY_US, START_US + since_start_us);
        let boot_ms = ((boot_us / 1000) as u32).to_le_bytes();
        if index % 50 == 0 {
            put(received_us, 1, 0, 50, &[0, 0, 0, 0, 2, 3, 0, 0, 3]);
            let utc = (START_UTC_S * 1_000_000 + since_start_us).to_le_bytes();
            put(received_us, 1, 2, 137, &[&utc[..], &boot_ms].concat());
        }
        let milli = |values: [f64; 3]| values.map(|value| ((value * 1e3).round() as i16).to_le_bytes()).concat();
        let in_g = force(index).map(|value| value / 9.80665);
        let raw = [&boot_us.to_le_bytes()[..], &milli(in_g), &milli(rate(index)), &[0; 9]].concat();
        put(received_us, 1, 27, 144, &raw);
        if index % 10 == 0 {
            let angles = VEHICLE_DEG.map(f64::to_radians);
            put(received_us, 1, 30, 39, &[&boot_ms[..], &floats(&angles), &floats(&[0.0; 3])].concat());
            put(received_us, 1, 32, 185, &[&boot_ms[..], &floats(&POSITION_M), &floats(&[0.0; 3])].concat());
            let gimbal_ms = ((since_start_us / 1000 + 777) as u32).to_le_bytes();
            let attitude = [floats(&quaternion(GIMBAL_DEG)), floats(&[0.0; 3])].concat();
            let status = [&gimbal_ms[..], &attitude, &[0, 0, 0, 0, 32, 0, 0, 0]].concat();
            put(received_us, 154, 285, 137, &status);
            put(received_us, 1, 74, 20, &[1; 20]);
        }
    }
    out
}

/// A track of a movie.
#[derive(Clone, Debug)]
pub(crate) struct Track<'a> {
    /// Handler, `vide` or `meta`.
    pub(crate) handler: &'a [u8; 4],
    /// Sample description box.
    pub(crate) description: Vec<u8>,
    /// Time units per second.
    pub(crate) timescale: u32,
    /// Duration of a sample in these units.
    pub(crate) duration: u32,
    /// Time from decoding to presentation of each sample, empty for 0.
    pub(crate) delays: Vec<u32>,
    pub(crate) samples: Vec<Vec<u8>>,
    /// First presented time of the media.
    pub(crate) media_start: u32,
}

pub(crate) fn mp4_box(kind: &[u8; 4], parts: &[&[u8]]) -> Vec<u8> {
    let content = parts.concat();
    [&((content.len() + 8) as u32).to_be_bytes()[..], kind, &content].concat()
}

fn words(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_be_bytes()).collect()
}

/// Seconds from 1904 to 1970.
const EPOCH_1904_S: u32 = 2_082_844_800;

/// A movie with its tables at the end, as written by cameras, or at the start.
pub(crate) fn movie(tracks: &[Track<'_>], tables_first: bool) -> Vec<u8> {
    let start = mp4_box(b"ftyp", &[b"mp41", &[0; 4], b"mp41"]);
    let build = |data_start: u32| {
        let mut at = data_start;
        let mut traks = Vec::new();
        for track in tracks {
            let sizes: Vec<u32> = track.samples.iter().map(|sample| sample.len() as u32).collect();
            // Three samples per chunk.
            let mut offsets = Vec::new();
            for (index, size) in sizes.iter().enumerate() {
                if index % 3 == 0 {
                    offsets.push(at);
                }
                at += size;
            }
            let count = sizes.len() as u32;
            let (whole, rest) = (count / 3, count % 3);
            let mut chunks = vec![1, 3, 1];
            if rest > 0 {
                chunks.extend([whole + 1, rest, 1]);
            }
            let delays: Vec<u32> = track.delays.iter().flat_map(|delay| [1, *delay]).collect();
            let table = [
                mp4_box(b"stsd", &[&words(&[0, 1]), &track.description]),
                mp4_box(b"stts", &[&words(&[0, 1, count, track.duration])]),
                mp4_box(b"ctts", &[&words(&[0, track.delays.len() as u32]), &words(&delays)]),
                mp4_box(b"stsc", &[&words(&[0, chunks.len() as u32 / 3]), &words(&chunks)]),
                mp4_box(b"stsz", &[&words(&[0, 0, count]), &words(&sizes)]),
                mp4_box(b"stco", &[&words(&[0, offsets.len() as u32]), &words(&offsets)]),
            ];
            let media = [
                mp4_box(b"mdhd", &[&words(&[0, 0, 0, track.timescale, count * track.duration, 0])]),
                mp4_box(b"hdlr", &[&words(&[0, 0]), track.handler, &[0; 13]]),
                mp4_box(b"minf", &[&mp4_box(b"stbl", &[&table.concat()])]),
            ];
            let edits = mp4_box(b"elst", &[&words(&[0, 1, 1000, track.media_start, 0x10000])]);
            traks.extend(mp4_box(b"trak", &[&mp4_box(b"edts", &[&edits]), &mp4_box(b"mdia", &[&media.concat()])]));
        }
        let created = START_UTC_S as u32 + EPOCH_1904_S;
        mp4_box(b"moov", &[&mp4_box(b"mvhd", &[&words(&[0, created, created, 1000, 1000])]), &traks])
    };
    let data: Vec<u8> = tracks.iter().flat_map(|track| track.samples.concat()).collect();
    let data = mp4_box(b"mdat", &[&data]);
    let data_start = start.len() + 8 + if tables_first { build(0).len() } else { 0 };
    let tables = build(data_start as u32);
    if tables_first { [start, tables, data].concat() } else { [start, data, tables].concat() }
}

/// The units of a stream in Annex B.
fn units(stream: &[u8]) -> Vec<&[u8]> {
    let starts: Vec<usize> = (0..stream.len()).filter(|at| stream[*at..].starts_with(&[0, 0, 1])).collect();
    let ends = starts.iter().skip(1).copied().chain([stream.len()]);
    let unit = |(start, end): (&usize, usize)| {
        let unit = &stream[start + 3..end];
        let length = unit.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        &unit[..length]
    };
    starts.iter().zip(ends).map(unit).collect()
}

/// A video track of H.264 messages in Annex B; parameter sets are moved to the sample description.
pub(crate) fn video_track(messages: &[&[u8]], [width, height]: [u16; 2]) -> Track<'static> {
    let all = messages.concat();
    let set = |kind: u8| units(&all).into_iter().find(|unit| unit[0] & 0x1F == kind).unwrap_or_default().to_vec();
    let (sequence, picture) = (set(7), set(8));
    let length = |set: &[u8]| (set.len() as u16).to_be_bytes();
    let configuration = mp4_box(
        b"avcC",
        &[&[1, 100, 0, 31, 0xFF, 0xE1], &length(&sequence), &sequence, &[1], &length(&picture), &picture],
    );
    let size = [width.to_be_bytes(), height.to_be_bytes()].concat();
    let description = mp4_box(b"avc1", &[&[0; 24], &size, &[0; 50], &configuration]);
    let sample = |message: &&[u8]| {
        let units = units(message).into_iter().filter(|unit| ![7, 8].contains(&(unit[0] & 0x1F)));
        units.flat_map(|unit| [&(unit.len() as u32).to_be_bytes()[..], unit].concat()).collect()
    };
    let samples = messages.iter().map(sample).collect();
    Track { handler: b"vide", description, timescale: 1000, duration: 50, delays: Vec::new(), samples, media_start: 0 }
}

/// A telemetry track of payloads that last 200 ms each.
pub(crate) fn telemetry_track(payloads: Vec<Vec<u8>>) -> Track<'static> {
    let description = mp4_box(b"gpmd", &[&[0; 8]]);
    let (timescale, duration) = (1000, 200);
    let (delays, media_start) = (Vec::new(), 0);
    Track { handler: b"meta", description, timescale, duration, delays, samples: payloads, media_start }
}

/// An item of `GoPro`'s telemetry.
pub(crate) fn item(key: &[u8; 4], kind: u8, size: usize, data: &[u8]) -> Vec<u8> {
    let count = data.len().checked_div(size).unwrap_or(0) as u16;
    let mut out = [&key[..], &[kind, size as u8], &count.to_be_bytes(), data].concat();
    out.resize(out.len().next_multiple_of(4), 0);
    out
}

/// An item that contains others.
pub(crate) fn nested(key: &[u8; 4], items: &[Vec<u8>]) -> Vec<u8> {
    item(key, 0, 4, &items.concat())
}

/// Payloads of a gyroscope with 80 samples each and an accelerometer with 40, stored in an order of axes.
pub(crate) fn telemetry(payloads: usize, axes: &str) -> Vec<Vec<u8>> {
    let stored = |[forward, left, up]: [f64; 3], scale: f64| -> Vec<u8> {
        // GoPro's X, Y and Z.
        let components = [left, -forward, up];
        let along = |axis: u8| match axis {
            b'X' | b'Y' | b'Z' => components[usize::from(axis - b'X')],
            _ => -components[usize::from(axis - b'x')],
        };
        axes.bytes().flat_map(|axis| ((along(axis) * scale).round() as i16).to_be_bytes()).collect()
    };
    let stream = |key: &[u8; 4], scale: i16, samples: Vec<u8>| {
        let scale = item(b"SCAL", b's', 2, &scale.to_be_bytes());
        nested(b"STRM", &[scale, item(b"ORIN", b'c', 1, axes.as_bytes()), item(key, b's', 6, &samples)])
    };
    let payload = |number: usize| {
        let gyroscope = (80 * number..80 * (number + 1)).flat_map(|index| stored(rate(index % 100), 1000.0)).collect();
        let accelerometer =
            (40 * number..40 * (number + 1)).flat_map(|index| stored(force(index % 100), 400.0)).collect();
        let exposure = nested(b"STRM", &[item(b"SHUT", b'f', 4, &[0; 24])]);
        let streams = [stream(b"GYRO", 1000, gyroscope), stream(b"ACCL", 400, accelerometer), exposure];
        nested(b"DEVC", &[&[item(b"DVNM", b'c', 1, b"Camera")][..], &streams].concat())
    };
    (0..payloads).map(payload).collect()
}
