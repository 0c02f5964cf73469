use nalgebra::Vector2;

/// Squared whitened residual of an observation whose landmark the camera cannot observe.
const UNSEEN_SQUARED: f64 = 1e4;

/// Robust loss ρ on the squared whitened norm `s = ‖r‖²/σ²` of a residual; a problem minimizes `½ Σ ρ(s)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RobustLoss {
    /// Squared loss `ρ(s) = s`.
    None,
    /// Quadratic up to `k` standard deviations, linear beyond: `ρ(s) = 2k√s − k²`.
    Huber(f64),
    /// `ρ(s) = c² ln(1 + s/c²)`, half weight at `c` standard deviations.
    Cauchy(f64),
}

impl RobustLoss {
    /// Residual in standard deviations beyond which a measurement loses weight; infinite for [`Self::None`].
    pub(crate) fn scale(self) -> f64 {
        match self {
            Self::None => f64::INFINITY,
            Self::Huber(scale) | Self::Cauchy(scale) => scale,
        }
    }

    /// `ρ(s)` and its derivative `dρ/ds`, the weight in iteratively reweighted least squares.
    pub fn cost_and_weight(self, squared: f64) -> (f64, f64) {
        match self {
            Self::None => (squared, 1.0),
            Self::Huber(limit) => {
                if squared <= limit * limit {
                    (squared, 1.0)
                } else {
                    let norm = squared.sqrt();
                    (2.0 * limit * norm - limit * limit, limit / norm)
                }
            }
            Self::Cauchy(scale) => {
                let ratio = squared / (scale * scale);
                (scale * scale * ratio.ln_1p(), 1.0 / (1.0 + ratio))
            }
        }
    }

    /// `ρ` of an observation's residual with standard deviation `sigma`; a point that the camera cannot observe
    /// (`None`)
    /// costs as much as a residual of 100 standard deviations.
    pub(crate) fn cost_of(self, residual: Option<Vector2<f64>>, sigma: f64) -> f64 {
        self.cost_and_weight(whitened_squared(residual, sigma)).0
    }
}

/// Squared whitened norm of a residual with standard deviation `sigma`; `None` is a point that cannot be observed.
fn whitened_squared(residual: Option<Vector2<f64>>, sigma: f64) -> f64 {
    residual.map_or(UNSEEN_SQUARED, |residual| residual.norm_squared() / (sigma * sigma))
}

/// Sum of [`RobustLoss::cost_of`] over residuals with equal standard deviation.
///
/// The logarithms of Cauchy's loss are taken of products over many residuals.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LossSum {
    loss: RobustLoss,
    sigma: f64,
    sum: f64,
    /// Product of the factors `1 + s/c²` whose logarithm is not in the sum yet.
    product: f64,
}

/// Size above which the logarithm of the product is added to the sum.
const MAX_PRODUCT: f64 = 1e150;

impl LossSum {
    pub(crate) fn new(loss: RobustLoss, sigma: f64) -> Self {
        Self { loss, sigma, sum: 0.0, product: 1.0 }
    }

    pub(crate) fn add(&mut self, residual: Option<Vector2<f64>>) {
        let RobustLoss::Cauchy(scale) = self.loss else {
            self.sum += self.loss.cost_of(residual, self.sigma);
            return;
        };
        self.product *= 1.0 + whitened_squared(residual, self.sigma) / (scale * scale);
        if self.product > MAX_PRODUCT {
            *self = Self { sum: self.get(), product: 1.0, ..*self };
        }
    }

    pub(crate) fn get(&self) -> f64 {
        let of_product = match self.loss {
            RobustLoss::Cauchy(scale) => scale * scale * self.product.ln(),
            RobustLoss::None | RobustLoss::Huber(_) => 0.0,
        };
        self.sum + of_product
    }
}
