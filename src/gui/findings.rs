//! Panel, parameter and time of a finding about a run, and its text.

use super::{PanelContext, PanelName};
use crate::faults::{Area, FaultKind};
use crate::gimbal::{ParameterId, ParameterPart, Quantity};
use crate::gui::units::seconds;
use crate::session::{Command, FindingSource, RunFinding, RunRecord};

/// Moves the cursor to the start of a finding, shows the panel with what it is about, and selects its parameter if the run
/// estimates it.
pub(super) fn show(ctx: &mut PanelContext<'_>, finding: &RunFinding) {
    ctx.commands.push(Command::Seek { stamp_ns: finding.since_ns.unwrap_or(ctx.recording.start_ns) });
    ctx.selection.wanted_panel = Some(panel_of(finding));
    let parameter = ctx.selected_run().and_then(|run| parameter_of(ctx, run, finding));
    ctx.selection.parameter = parameter.or(ctx.selection.parameter);
}

/// Panel that shows what a finding is about.
pub(super) fn panel_of(finding: &RunFinding) -> PanelName {
    match (finding.source, finding.area()) {
        (FindingSource::GroundTruth, _) | (_, Some(Area::Motion)) => PanelName::Scene,
        (_, Some(Area::Images | Area::Intrinsics)) => PanelName::Image,
        (_, Some(Area::Encoders | Area::Extrinsics)) | (FindingSource::Streams, None) => PanelName::Calibration,
        (FindingSource::Initialization, None) | (_, Some(Area::Log)) => PanelName::Inspector,
        (_, Some(Area::Time | Area::Imu) | None) => PanelName::Residuals,
    }
}

/// Parameter with the faulty value among those that a run estimates.
fn parameter_of(ctx: &PanelContext<'_>, run: &RunRecord, finding: &RunFinding) -> Option<ParameterId> {
    let fault = finding.fault()?;
    let estimated = &run.steps.last()?.report.calibration.parameters;
    let of_camera = |quantity| ParameterId { part: ParameterPart::Camera(0), quantity };
    let wanted = match fault.kind {
        FaultKind::Focal | FaultKind::Zoom | FaultKind::Intrinsics => of_camera(Quantity::Fx),
        FaultKind::PrincipalPoint => of_camera(Quantity::Cx),
        FaultKind::CameraClock | FaultKind::CameraDrift => of_camera(Quantity::Timeshift),
        FaultKind::Shutter => of_camera(Quantity::Readout),
        FaultKind::EncoderClock => ParameterId { part: ParameterPart::Encoder, quantity: Quantity::Timeshift },
        _ => {
            let (names, joint) = (ctx.names(), fault.joints.first()?);
            let of_joint =
                |id: &&ParameterId| names.name(**id).strip_prefix(joint).is_some_and(|it| it.starts_with('.'));
            return estimated.iter().find(of_joint).copied();
        }
    };
    estimated.contains(&wanted).then_some(wanted)
}

/// Statement, time, evidence and remedy, a line each.
pub(super) fn text_of(finding: &RunFinding) -> String {
    let mut lines = vec![format!("{} {}", finding.trust.mark(), finding.statement)];
    lines.extend(time_of(finding));
    lines.extend((!finding.evidence.is_empty()).then(|| finding.evidence.clone()));
    lines.extend((!finding.remedy.is_empty()).then(|| format!("→ {}", finding.remedy)));
    lines.join("\n")
}

/// Interval in words; `None` for the whole run.
pub(super) fn time_of(finding: &RunFinding) -> Option<String> {
    match (finding.since_ns, finding.until_ns) {
        (None, None) => None,
        (Some(since_ns), None) => Some(format!("from {} s on", seconds(since_ns))),
        (None, Some(until_ns)) => Some(format!("up to {} s", seconds(until_ns))),
        (Some(since_ns), Some(until_ns)) => Some(format!("from {} to {} s", seconds(since_ns), seconds(until_ns))),
    }
}
