//! The choices that define an experiment.

use egui::Ui;

use super::worker::LaboratoryJob;
use crate::estimator::{JointKnowledge, PoseKnowledge};
use crate::gimbal::Parameterization;
use crate::gui::PanelContext;
use crate::gui::help::terms::window;
use crate::gui::widgets::{choice_ui, hinted_choice_ui};
use crate::observability::laboratory::{LABORATORY_IMU, LaboratoryForm, LaboratoryMotion, LaboratorySetup, Mechanism};
use crate::text::Named;

/// Knowledge of the joint angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Joints {
    Known,
    Encoder,
    Unknown,
}

impl Named for Joints {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Known, "known"), (Self::Encoder, "encoders"), (Self::Unknown, "no encoders")];
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Poses {
    Known,
    Inertial,
    InertialBiasKnown,
}

impl Named for Poses {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Known, "known"),
        (Self::Inertial, "from the IMU"),
        (Self::InertialBiasKnown, "from the IMU, biases known"),
    ];
}

#[derive(Clone, Debug)]
pub(super) struct Choices {
    /// Name of a mechanism; `None` for the rig's.
    mechanism: Option<&'static str>,
    motion: LaboratoryMotion,
    parameterizations: [bool; Parameterization::NAMES.len()],
    joint_offsets: bool,
    frozen: Vec<bool>,
    joints: Joints,
    encoder_sigma_deg: f64,
    poses: Poses,
}

impl Default for Choices {
    fn default() -> Self {
        Self {
            mechanism: None,
            motion: LaboratoryMotion::Aggressive,
            parameterizations: std::array::from_fn(|index| {
                use Parameterization::{Classical, Minimal, MinimalSwapped};
                matches!(Parameterization::NAMES[index].0, Classical | Minimal | MinimalSwapped)
            }),
            joint_offsets: true,
            frozen: Vec::new(),
            joints: Joints::Known,
            encoder_sigma_deg: 0.5,
            poses: Poses::Known,
        }
    }
}

impl Choices {
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>) {
        ui.horizontal_wrapped(|ui| {
            self.mechanism_ui(ui, ctx);
            self.motion_ui(ui);
            self.knowledge_ui(ui);
        });
        ui.horizontal_wrapped(|ui| {
            ui.label("Parameterizations");
            for (chosen, parameterization) in self.parameterizations.iter_mut().zip(Parameterization::all()) {
                ui.checkbox(chosen, parameterization.name());
            }
            ui.checkbox(&mut self.joint_offsets, "Joint offsets")
                .on_hover_text("Estimate the joint offsets as calibration columns");
        });
        let names = self.mechanism(ctx).map(|mechanism| mechanism.joints).unwrap_or_default();
        self.frozen.resize(names.len(), false);
        if !names.is_empty() {
            ui.horizontal_wrapped(|ui| {
                ui.label("Fixed joints");
                for (frozen, joint) in self.frozen.iter_mut().zip(&names) {
                    ui.checkbox(frozen, &joint.name);
                }
            });
        }
    }

    /// Writes the choices that the results do not state.
    pub(super) fn summary_ui(&self, ui: &mut Ui, ctx: &PanelContext<'_>) {
        let rig = format!("rig {}", ctx.recording.rig.name);
        let mechanism = self.mechanism.map_or(rig, str::to_owned);
        let offsets = if self.joint_offsets { "estimated" } else { "fixed" };
        ui.label(format!("Mechanism: {mechanism}; joint offsets {offsets}"));
    }

    fn mechanism_ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>) {
        let rig = format!("rig {}", ctx.recording.rig.name);
        let meaning =
            |name: &str| Mechanism::NAMES.iter().find(|(known, _)| *known == name).map_or("", |known| known.1);
        let names = std::iter::once(None).chain(Mechanism::NAMES.iter().map(|(name, _)| Some(*name)));
        let shown = hinted_choice_ui(
            ui,
            "Mechanism",
            150.0,
            &mut self.mechanism,
            names,
            |name| name.map_or_else(|| rig.clone(), str::to_owned),
            |name| name.map_or("", meaning),
        );
        shown.on_hover_text(window::MECHANISM.meaning);
    }

    fn motion_ui(&mut self, ui: &mut Ui) {
        let (motions, text) = (LaboratoryMotion::all(), |motion: &LaboratoryMotion| motion.name().to_owned());
        hinted_choice_ui(ui, "Motion", 150.0, &mut self.motion, motions, text, |motion| motion.meaning())
            .on_hover_text(window::MOTION.meaning);
    }

    fn knowledge_ui(&mut self, ui: &mut Ui) {
        let name_of = |joints: &Joints| joints.name().to_owned();
        let name = "Joint angles";
        choice_ui(ui, name, 80.0, &mut self.joints, Joints::all(), name_of).on_hover_text(window::JOINT_ANGLES.meaning);
        if self.joints == Joints::Encoder {
            let sigma = egui::DragValue::new(&mut self.encoder_sigma_deg).range(1e-3..=45.0).speed(0.01).suffix("°");
            let sigma = ui.add(sigma).on_hover_text(window::JOINT_ANGLES.meaning);
            sigma.ctx.accesskit_node_builder(sigma.id, |node| node.set_label(name));
        }
        choice_ui(ui, "Poses", 110.0, &mut self.poses, Poses::all(), |poses| poses.name().to_owned())
            .on_hover_text(window::POSES.meaning);
    }

    fn mechanism(&self, ctx: &PanelContext<'_>) -> Option<Mechanism> {
        let run = ctx.selected_run();
        let Some(name) = self.mechanism else {
            let rig = &ctx.recording.rig;
            let key = run.map(|run| &run.camera_key).or_else(|| rig.cameras.first().map(|camera| &camera.key))?;
            return Mechanism::of_rig(rig, key);
        };
        Mechanism::named(name).ok()
    }

    /// The chosen experiment, or the reason why it is invalid.
    pub(super) fn experiment(&self, ctx: &PanelContext<'_>) -> Result<LaboratoryJob, String> {
        let parameterizations = Parameterization::all().zip(self.parameterizations).filter(|(_, chosen)| *chosen);
        let parameterizations: Vec<LaboratoryForm> = parameterizations
            .map(|(parameterization, _)| LaboratoryForm { parameterization, joint_offsets: self.joint_offsets })
            .collect();
        if parameterizations.is_empty() {
            return Err("No parameterization selected".to_owned());
        }
        let mechanism = self.mechanism(ctx).ok_or("No extrinsics of this run's camera in the rig")?;
        let mut setup = LaboratorySetup::new(mechanism);
        if self.mechanism.is_none() {
            let run = ctx.selected_run();
            let camera = run.and_then(|run| ctx.recording.rig.camera(&run.camera_key).ok());
            setup.camera = camera.map_or(setup.camera, |camera| camera.model.clone());
        }
        let noise = if self.mechanism.is_none() { ctx.recording.rig.imu.noise } else { LABORATORY_IMU };
        setup.motion = self.motion;
        let joints = setup.mechanism.joints.len();
        setup.frozen = (0..joints).filter(|joint| self.frozen.get(*joint).copied().unwrap_or(false)).collect();
        setup.joints = match self.joints {
            Joints::Known => JointKnowledge::Known,
            Joints::Encoder => JointKnowledge::Encoder(self.encoder_sigma_deg.to_radians()),
            Joints::Unknown => JointKnowledge::Unknown,
        };
        setup.poses = match self.poses {
            Poses::Known => PoseKnowledge::Known,
            Poses::Inertial => PoseKnowledge::Imu { noise, biases_known: false },
            Poses::InertialBiasKnown => PoseKnowledge::Imu { noise, biases_known: true },
        };
        Ok(LaboratoryJob { setup, parameterizations })
    }
}
