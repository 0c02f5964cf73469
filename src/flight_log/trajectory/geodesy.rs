use nalgebra::{Matrix3, Vector3};

/// Semi-major axis of the ellipsoid in metres, WGS 84.
const SEMI_MAJOR_AXIS_M: f64 = 6_378_137.0;
/// Flattening of the ellipsoid, WGS 84.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Position on the earth, WGS 84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    pub(super) latitude_rad: f64,
    pub(super) longitude_rad: f64,
    pub(super) altitude_m: f64,
}

impl Geodetic {
    /// Converts degrees and metres; `None` out of range, and at 0° 0°, which receivers output without a fix.
    pub fn from_deg(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Option<Self> {
        let valid = latitude_deg.abs() <= 90.0
            && longitude_deg.abs() <= 180.0
            && altitude_m.abs() < 1e6
            && (latitude_deg != 0.0 || longitude_deg != 0.0);
        valid.then(|| Self {
            latitude_rad: latitude_deg.to_radians(),
            longitude_rad: longitude_deg.to_radians(),
            altitude_m,
        })
    }

    /// Position this far to the east and to the north at the same altitude, at most some kilometres away.
    pub fn moved(self, east_m: f64, north_m: f64) -> Self {
        let mut moved = self;
        // Each round corrects the rest in the tangent plane by the radius of a sphere, which is wrong by less than 1 %.
        for _ in 0..4 {
            let rest = Vector3::new(east_m, north_m, 0.0) - moved.east_north_up_m(self);
            moved.latitude_rad += rest.y / SEMI_MAJOR_AXIS_M;
            moved.longitude_rad += rest.x / (SEMI_MAJOR_AXIS_M * self.latitude_rad.cos().max(1e-6));
        }
        moved
    }

    pub fn latitude_longitude_deg(self) -> [f64; 2] {
        [self.latitude_rad, self.longitude_rad].map(f64::to_degrees)
    }

    /// Earth-centred, earth-fixed position, in metres.
    fn in_earth_m(self) -> Vector3<f64> {
        let (sin_latitude, cos_latitude) = self.latitude_rad.sin_cos();
        let (sin_longitude, cos_longitude) = self.longitude_rad.sin_cos();
        let eccentricity_squared = FLATTENING * (2.0 - FLATTENING);
        let normal_m = SEMI_MAJOR_AXIS_M / (1.0 - eccentricity_squared * sin_latitude * sin_latitude).sqrt();
        let radius_m = (normal_m + self.altitude_m) * cos_latitude;
        let z_m = (normal_m * (1.0 - eccentricity_squared) + self.altitude_m) * sin_latitude;
        Vector3::new(radius_m * cos_longitude, radius_m * sin_longitude, z_m)
    }

    /// Position in the tangent plane at an origin: east, north, up, in metres.
    pub fn east_north_up_m(self, origin: Self) -> Vector3<f64> {
        let (sin_latitude, cos_latitude) = origin.latitude_rad.sin_cos();
        let (sin_longitude, cos_longitude) = origin.longitude_rad.sin_cos();
        let plane_from_earth = Matrix3::new(
            -sin_longitude,
            cos_longitude,
            0.0,
            -sin_latitude * cos_longitude,
            -sin_latitude * sin_longitude,
            cos_latitude,
            cos_latitude * cos_longitude,
            cos_latitude * sin_longitude,
            sin_latitude,
        );
        plane_from_earth * (self.in_earth_m() - origin.in_earth_m())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_position_lies_where_it_was_moved_to() {
        for (latitude_deg, longitude_deg) in [(47.4, 8.5), (-33.9, 151.2), (0.1, -179.9), (69.0, 18.0)] {
            let origin = Geodetic::from_deg(latitude_deg, longitude_deg, 0.0).unwrap();
            let moved = origin.moved(30.0, -12.5).east_north_up_m(origin);
            assert!((moved.xy() - nalgebra::Vector2::new(30.0, -12.5)).norm() < 1e-6, "{moved}");
        }
    }

    #[test]
    fn places_are_mapped_to_the_tangent_plane() {
        let origin = Geodetic::from_deg(47.0, 8.0, 500.0).unwrap();
        // 0.001° at 47° north: radii of curvature 6369655 m along the meridian (plus 500 m) and 6389591 m across.
        let north = Geodetic::from_deg(47.001, 8.0, 500.0).unwrap().east_north_up_m(origin);
        let east = Geodetic::from_deg(47.0, 8.001, 510.0).unwrap().east_north_up_m(origin);
        assert!((north - Vector3::new(0.0, 111.180, 0.0)).norm() < 0.01, "{north}");
        assert!((east - Vector3::new(76.063, 0.0, 10.0)).norm() < 0.01, "{east}");
        assert_eq!(origin.east_north_up_m(origin), Vector3::zeros());
        assert!(Geodetic::from_deg(0.0, 0.0, 0.0).is_none() && Geodetic::from_deg(91.0, 0.0, 0.0).is_none());
        assert!(Geodetic::from_deg(f64::NAN, 0.0, 0.0).is_none());
    }
}
