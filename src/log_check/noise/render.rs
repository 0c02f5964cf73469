//! Noise of an IMU as text, and as lines of a rig.

use std::fmt::{Display, Formatter, Result};

use super::{AllanReport, NoiseTerm, NoiseTerms, SensorNoise};
use crate::table::text::{TextTable, left, right};
use crate::text::printable;

/// Maximum number of listed stretches.
const MAX_LISTED: usize = 6;

/// Term with its name and unit.
type NamedTerm = (&'static str, fn(&SensorNoise) -> String, fn(&NoiseTerms) -> &NoiseTerm);

const TERMS: [NamedTerm; 4] = [
    ("noise density", SensorNoise::density_unit, |terms| &terms.white),
    ("random walk of the bias", |sensor| sensor.walk_unit().to_owned(), |terms| &terms.random_walk),
    ("bias instability", |sensor| sensor.unit.to_owned(), |terms| &terms.bias_instability),
    ("quantization", |sensor| format!("{}·s", sensor.unit), |terms| &terms.quantization),
];

impl Display for AllanReport {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        let count = self.stretches_s.len();
        let listed: Vec<String> =
            self.stretches_s.iter().take(MAX_LISTED).map(|(begin, end)| format!("{begin:.1}–{end:.1} s")).collect();
        let more = if count > MAX_LISTED { format!(" and {} more", count - MAX_LISTED) } else { String::new() };
        let stretches =
            if count == 1 { "1 stationary stretch".to_owned() } else { format!("{count} stationary stretches") };
        writeln!(
            out,
            "{}: {stretches} of {}, {:.1} s together: {}{more}",
            printable(&self.log),
            printable(&self.topic),
            self.stationary_s,
            if listed.is_empty() { "none".to_owned() } else { listed.join(", ") }
        )?;
        for sensor in &self.sensors {
            write_sensor(out, sensor)?;
        }
        Ok(())
    }
}

fn write_sensor(out: &mut Formatter<'_>, sensor: &SensorNoise) -> Result {
    writeln!(
        out,
        "\n{} (overlapping Allan deviation, {:.0} Hz, {:.0} s)",
        sensor.sensor, sensor.rate_hz, sensor.covered_s
    )?;
    let columns =
        [left("", 37), right("x", 10), right("y", 10), right("z", 10), right("all ± σ", 20), right("rig", 10)];
    let given = |name: &str| {
        let given = sensor.given?;
        match name {
            "noise density" => Some(given.white),
            "random walk of the bias" => Some(given.random_walk),
            _ => None,
        }
    };
    let rows = TERMS.map(|(name, unit, term)| {
        let mut row = vec![format!("{name}, {}", unit(sensor))];
        row.extend(sensor.axes.iter().map(|axis| short(term(&axis.terms))));
        let all = term(&sensor.terms);
        row.push(all.value.zip(all.sigma).map_or_else(|| short(all), |(value, sigma)| with_sigma(value, sigma)));
        row.extend(given(name).map(|given| format!("{given:.2e}")));
        row
    });
    write!(out, "{}", TextTable::new(columns, rows))?;
    for (name, _, term) in TERMS {
        let all = term(&sensor.terms);
        if !all.reason.is_empty() {
            writeln!(out, "  {name} not identified: {}", all.reason)?;
        }
    }
    if let Some(filtered_s) = sensor.filtered_below_s {
        writeln!(
            out,
            "  averaging times below {:.0} ms left out: a low-pass filter of the sensor bends the deviation there",
            filtered_s * 1e3
        )?;
    }
    if !sensor.vibration.is_empty() {
        writeln!(out, "  vibration left out: {}", sensor.vibration.join(", "))?;
    }
    Ok(())
}

/// Value without its standard deviation, or the limit.
fn short(term: &NoiseTerm) -> String {
    match (term.value, term.limit) {
        (Some(value), _) => format!("{value:.2e}"),
        (None, Some(limit)) => format!("<{limit:.1e}"),
        (None, None) => "–".to_owned(),
    }
}

/// `3.40e-4 ± 0.02e-4`: both with the same power of ten.
pub(super) fn with_sigma(value: f64, sigma: f64) -> String {
    let power = value.abs().max(f64::MIN_POSITIVE).log10().floor();
    let scale = 10_f64.powf(power);
    format!("({:.2} ± {:.2})e{power:.0}", value / scale, sigma / scale)
}

impl AllanReport {
    /// Lines of a rig's `imu0`, in Kalibr's names; a term that is not identified keeps the rig's value, or is written
    /// as a comment with its limit.
    pub fn rig_lines(&self) -> String {
        let mut lines = String::from("imu0:\n");
        for sensor in self.sensors.iter().rev() {
            let fields = [
                ("noise_density", sensor.density_unit(), &sensor.terms.white, sensor.given.map(|given| given.white)),
                (
                    "random_walk",
                    sensor.walk_unit().to_owned(),
                    &sensor.terms.random_walk,
                    sensor.given.map(|given| given.random_walk),
                ),
            ];
            for (name, unit, term, given) in fields {
                let key = format!("{}_{name}", sensor.sensor);
                let limit = term.limit.map_or_else(String::new, |limit| format!(" (below {limit:.1e})"));
                let line = match (term.value, term.sigma, given) {
                    (Some(value), sigma, _) => {
                        format!("  {key}: {value:.3e}  # {unit}, σ {:.1e}", sigma.unwrap_or(0.0))
                    }
                    (None, _, Some(given)) => {
                        format!("  {key}: {given:.3e}  # {unit}, as before: not identified{limit}")
                    }
                    (None, _, None) => format!("  # {key}: not identified{limit}, {unit}"),
                };
                lines.push_str(&line);
                lines.push('\n');
            }
        }
        lines
    }
}
