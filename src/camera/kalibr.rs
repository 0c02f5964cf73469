//! Kalibr's notation of cameras: names and flat lists of numbers.

use super::{CameraError, CameraModel, Distortion, Projection, RationalLens};

impl CameraModel {
    /// Creates a camera from Kalibr's `camera_model`, `intrinsics`, `distortion_model`, `distortion_coeffs` and
    /// `resolution`.
    ///
    /// `intrinsics` holds `fx fy cx cy`, preceded by `xi` for omni, `alpha beta` for eucm and `xi alpha` for ds.
    /// `plumb_bob` and `rational_polynomial` are the models of ROS and `OpenCV`, with 4 or 5 and with 8 coefficients;
    /// `radial-tangential`, `equi`, `fisheye` and an empty distortion name are accepted too.
    ///
    /// # Errors
    /// When a name is unknown, a list has the wrong length, or a number is out of its range.
    pub fn from_kalibr(
        camera_model: &str,
        intrinsics: &[f64],
        distortion_model: &str,
        distortion_coeffs: &[f64],
        resolution_px: [usize; 2],
    ) -> Result<Self, CameraError> {
        let (projection, intrinsics_px) = match camera_model {
            "pinhole" => {
                let intrinsics_px = numbers("intrinsics", "pinhole", intrinsics, "fx, fy, cx, cy")?;
                (Projection::Pinhole, intrinsics_px)
            }
            "omni" => {
                let [xi, fx, fy, cx, cy] = numbers("intrinsics", "omni", intrinsics, "xi, fx, fy, cx, cy")?;
                (Projection::Omni { xi }, [fx, fy, cx, cy])
            }
            "eucm" => {
                let [alpha, beta, fx, fy, cx, cy] =
                    numbers("intrinsics", "eucm", intrinsics, "alpha, beta, fx, fy, cx, cy")?;
                (Projection::Eucm { alpha, beta }, [fx, fy, cx, cy])
            }
            "ds" => {
                let [xi, alpha, fx, fy, cx, cy] = numbers("intrinsics", "ds", intrinsics, "xi, alpha, fx, fy, cx, cy")?;
                (Projection::Ds { xi, alpha }, [fx, fy, cx, cy])
            }
            name => return Err(CameraError::UnknownModel { name: name.to_owned() }),
        };
        let distortion = match distortion_model {
            // Kalibr writes zeros for a camera without distortion.
            "none" | "" => match distortion_coeffs.iter().find(|value| **value != 0.0) {
                None => Distortion::None,
                Some(&value) => {
                    return Err(CameraError::Value {
                        field: "an entry of distortion_coeffs of 'none'",
                        value,
                        expected: "no coefficients, or zeros",
                    });
                }
            },
            "radtan" | "radial-tangential" | "plumb_bob" => {
                let (values, k3) = match distortion_coeffs {
                    [values @ .., k3] if values.len() == 4 => (values, *k3),
                    values => (values, 0.0),
                };
                let values @ [k1, k2, p1, p2] = numbers("distortion_coeffs", "radtan", values, "k1, k2, p1, p2")?;
                if k3 == 0.0 {
                    Distortion::Radtan(values)
                } else {
                    Distortion::Rational(RationalLens::new([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]))
                }
            }
            "rational_polynomial" => Distortion::Rational(RationalLens::new(numbers(
                "distortion_coeffs",
                "rational_polynomial",
                distortion_coeffs,
                "k1, k2, p1, p2, k3, k4, k5, k6",
            )?)),
            "equidistant" | "equi" | "fisheye" => Distortion::Equidistant(numbers(
                "distortion_coeffs",
                "equidistant",
                distortion_coeffs,
                "k1, k2, k3, k4",
            )?),
            "fov" => {
                let [w] = numbers("distortion_coeffs", "fov", distortion_coeffs, "w")?;
                Distortion::Fov(w)
            }
            name => return Err(CameraError::UnknownDistortion { name: name.to_owned() }),
        };
        Self::new(projection, distortion, intrinsics_px, resolution_px)
    }

    /// Kalibr's `intrinsics`, in the order that [`CameraModel::from_kalibr`] reads.
    pub fn kalibr_intrinsics(&self) -> Vec<f64> {
        let mut values = match self.projection {
            Projection::Pinhole => vec![],
            Projection::Omni { xi } => vec![xi],
            Projection::Eucm { alpha, beta } => vec![alpha, beta],
            Projection::Ds { xi, alpha } => vec![xi, alpha],
        };
        values.extend(self.intrinsics_px);
        values
    }

    /// Kalibr's `distortion_coeffs`; empty without distortion.
    pub fn kalibr_distortion_coeffs(&self) -> Vec<f64> {
        match self.distortion {
            Distortion::None => vec![],
            Distortion::Radtan(values) | Distortion::Equidistant(values) => values.to_vec(),
            Distortion::Rational(lens) if lens.is_polynomial() => lens.coefficients()[..5].to_vec(),
            Distortion::Rational(lens) => lens.coefficients().to_vec(),
            Distortion::Fov(w) => vec![w],
        }
    }
}

/// Checks that a list has exactly `N` numbers.
fn numbers<const N: usize>(
    field: &'static str,
    model: &'static str,
    values: &[f64],
    meaning: &'static str,
) -> Result<[f64; N], CameraError> {
    values.try_into().or(Err(CameraError::Count { field, model, found: values.len(), expected: N, meaning }))
}
