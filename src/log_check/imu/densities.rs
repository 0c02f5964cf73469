//! White noise compared with the rig's densities, and vibration.

use super::spectrum::Spectrum;
use crate::log_check::report::{Area, Findings, Measurement, Severity};
use crate::sensors::Rig;

/// Ratio of measured noise to the rig's from which it is reported.
const NOISE_TOO_SMALL: f64 = 3.0;
/// Ratio of the rig's noise to the measured one from which it is reported.
const NOISE_TOO_LARGE: f64 = 30.0;

/// Ratio of vibration to the white noise of a sample from which it is reported.
const VIBRATION_RATIO: f64 = 3.0;

/// Compares white noise with the rig's densities, and reports vibration; the spectra are those of gyroscope and
/// accelerometer.
pub(super) fn check_noise(spectra: &[Option<Spectrum>; 2], rig: Option<&Rig>, findings: &mut Findings) {
    let noise = rig.map(|rig| &rig.imu.noise);
    let sensors = [
        (Measurement::Gyroscope, "gyroscope", noise.map(|noise| noise.gyroscope_noise_density), "rad/s"),
        (Measurement::Accelerometer, "accelerometer", noise.map(|noise| noise.accelerometer_noise_density), "m/s²"),
    ];
    for ((measurement, name, given, unit), spectrum) in sensors.into_iter().zip(spectra) {
        let Some(spectrum) = spectrum else { continue };
        report_vibration(name, spectrum, unit, findings);
        // By a wrong unit, noise is wrong by the same factor.
        if let Some(given) = given.filter(|_| findings.can_compare(measurement)) {
            compare_density(name, spectrum, given, unit, findings);
        }
    }
}

/// Reports frequencies and amplitudes of a vibration that exceeds the white noise.
fn report_vibration(name: &str, spectrum: &Spectrum, unit: &str, findings: &mut Findings) {
    let white_rms = spectrum.density * (3.0 * spectrum.rate_hz).sqrt();
    if spectrum.lines.is_empty() || spectrum.vibration_rms < VIBRATION_RATIO * white_rms {
        return;
    }
    let line = |line: &super::spectrum::VibrationLine| {
        let (low, high) = line.range_hz;
        format!("{:.3} {unit} at {:.0} Hz ({low:.0} to {high:.0})", line.rms, line.frequency_hz)
    };
    let lines: Vec<String> = spectrum.lines.iter().map(line).collect();
    let evidence =
        format!("{:.3} {unit} RMS, white noise {white_rms:.3}: {}", spectrum.vibration_rms, lines.join(", "));
    let remedy = "isolate the IMU from the rotors; the noise densities need not cover a vibration, which averages out \
                  between two images unless it is clipped or aliased to a low frequency";
    findings.add(Severity::Note, Area::Imu, format!("vibration on the {name}"), evidence, remedy);
}

fn compare_density(name: &str, spectrum: &Spectrum, given: f64, unit: &str, findings: &mut Findings) {
    let (measured, rate_hz, (low_hz, high_hz)) = (spectrum.density, spectrum.rate_hz, spectrum.band_hz);
    let ratio = measured / given;
    let evidence = format!(
        "{measured:.2e} {unit}/√Hz measured between {low_hz:.0} and {high_hz:.0} Hz at {rate_hz:.0} Hz, {given:.2e} in the rig"
    );
    // A density confused with the noise of one sample differs by √rate.
    let discrete = |ratio: f64| (ratio.ln() - 0.5 * rate_hz.ln()).abs() < 0.3;
    let field = format!("imu0.{name}_noise_density");
    // A density may include vibration on purpose.
    let excess = given / spectrum.density_with_vibration();
    if ratio > NOISE_TOO_SMALL {
        let hint = if discrete(ratio) { " (it appears to have been divided by √rate twice)" } else { "" };
        let remedy =
            format!("raise {field} to {:.1e}{hint}; estimators need 2 to 10 times the measured value", 2.0 * measured);
        let title = format!("{name} noise in the rig is {ratio:.1} times too small");
        findings.add(Severity::Warning, Area::Imu, title, evidence, remedy);
    } else if excess > NOISE_TOO_LARGE || (measured > 0.0 && discrete(excess)) {
        let hint =
            if discrete(excess) { ": it appears to be the noise of one sample; divide it by √rate" } else { "" };
        let remedy = format!("{field} is a continuous-time density in {unit}/√Hz{hint}");
        let title = format!("{name} noise in the rig is {excess:.0} times too large");
        findings.add(Severity::Note, Area::Imu, title, evidence, remedy);
    } else {
        findings.good(Area::Imu, format!("{name} noise agrees with the rig"), evidence);
    }
}
