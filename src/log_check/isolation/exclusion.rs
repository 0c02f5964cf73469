//! Findings that the comparison of sources excludes, explains or renames.

use super::comparison::Parameter;
use super::pair::Pair;
use super::source::Source;
use super::statement::{SAME_TIME_S, Statement};
use crate::faults::{Fault, FaultKind, Sentence, Subject};
use crate::log_check::report::{Area, Basis, Finding, Findings, Measurement, Severity};
use crate::sensors::Rig;

/// Removes causes, found by the rotations of one camera, of sensors that agree with others although the isolated ones do
/// not.
pub(super) fn exclude_causes(statement: &mut Statement, pairs: &[Pair], findings: &mut Findings) {
    exclude_pairs(statement, findings);
    if !statement.is_isolated {
        return;
    }
    let agreeing: Vec<&Source> =
        pairs.iter().filter(|pair| pair.fit.disagrees.is_none()).flat_map(|pair| &pair.sources).collect();
    let is_excluded = |finding: &Finding| {
        finding.faults.iter().all(|fault| {
            let sensor = fault.kind.row().sensor;
            !statement.suspected.iter().any(|source| source.uses(sensor))
                && agreeing.iter().any(|source| source.uses(sensor))
        })
    };
    // A change at a known time that explains the misfit excludes causes that act all the time.
    let is_constant = |finding: &Finding| {
        let changes = |fault: &Fault| fault.since_s.is_some() || fault.kind == FaultKind::FocalPieces;
        statement.is_measured_change && !finding.faults.iter().any(changes)
    };
    let excluded = findings.retract_misfits(|finding| {
        !finding.faults.is_empty() && (statement.is_cause || is_constant(finding) || is_excluded(finding))
    });
    statement.add_excluded(&excluded);
}

/// Removes findings by comparisons of two sources, of which a third one blames the other.
pub(super) fn exclude_pairs(statement: &mut Statement, findings: &mut Findings) {
    let excluded = match statement.suspected.as_slice() {
        [Source::Gyroscope] if statement.is_isolated => {
            let begins = statement.interval.since_s.is_some();
            // Late angular rates are early images.
            let is_late = statement.has_value && statement.parameter == Some(Parameter::Delay);
            findings.retract_by_pair(Measurement::Gyroscope, |finding| {
                if finding.faults.iter().any(|fault| fault.kind == FaultKind::CameraClock) {
                    is_late
                } else {
                    statement.has_value || begins || finding.area != Area::Imu
                }
            })
        }
        [Source::GroundTruth] if statement.is_isolated => {
            findings.retract_by_pair(Measurement::Gyroscope, |finding| finding.area == Area::Imu)
        }
        suspected if suspected.contains(&Source::Accelerometer) && (statement.is_isolated || statement.is_cause) => {
            let is_replaced = |finding: &Finding| statement.is_cause || finding.area == Area::Log;
            findings.retract_by_pair(Measurement::Accelerometer, is_replaced)
        }
        _ => Vec::new(),
    };
    if excluded.iter().flat_map(|finding| &finding.faults).any(|it| it.kind == FaultKind::AccelerometerAxes) {
        findings.include(Measurement::Accelerometer);
    }
    statement.add_excluded(&excluded);
}

/// True if a finding with a cause is about one of the suspected sources, and for a change whose value is measured about its
/// time.
pub(super) fn is_explained(statement: &Statement, findings: &Findings) -> bool {
    let is_cause = |finding: &&Finding| finding.severity >= Severity::Warning && finding.basis != Basis::Assumed;
    let has_time = |finding: &&Finding| {
        let since_s = finding.since_s().or(finding.interval.since_s);
        let (Some(since_s), Some(change_s)) = (since_s, statement.interval.since_s) else { return false };
        (since_s - change_s).abs() < SAME_TIME_S
    };
    findings
        .explained()
        .filter(is_cause)
        .filter(|finding| !statement.is_measured_change || !finding.faults.is_empty() || has_time(finding))
        .any(|finding| statement.suspected.iter().any(|source| source.is_explained_by(finding.area)))
}

/// Turns a finding on other axes of the gyroscope in the whole log into one on the axes of the IMU: the accelerometer agrees with a
/// ground truth that has the axes of this gyroscope.
pub(super) fn name_axes_of_imu(findings: &mut Findings, rig: &Rig) {
    let is_turned = |fault: &Fault| {
        fault.kind == FaultKind::GyroscopeAxes
            && fault.since_s.is_none()
            && fault.axes().is_some_and(|axes| !axes.is_left_handed())
    };
    let of_gyroscope = findings.retract_misfits(|finding| finding.faults.iter().any(is_turned));
    let Some(Finding { evidence, faults, .. }) = of_gyroscope.into_iter().next() else { return };
    let Some(fault) = faults.into_iter().find(is_turned) else { return };
    let fault = Fault { kind: FaultKind::ImuAxes, ..fault };
    let Sentence { severity, statement, remedy } = Subject { rig, camera_key: "" }.sentence(&fault);
    findings.add(severity, Area::Imu, statement, evidence, remedy);
    findings.state_faults([fault]);
}
