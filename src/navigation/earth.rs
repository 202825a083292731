//! The Earth: WGS-84 ellipsoid, rotation and normal gravity. The one home of its constants, for the
//! truth generator and the filter alike ([WGS-84](crate::bibliography::Wgs84);
//! [Groves](crate::bibliography::Groves13), sec. 2.4).
//!
//! Formulas are written over [`Real`]: one text for a scalar and for eight runs at a time.
//!
//! ```
//! use nav_sim_navigation::earth::{A, GravityModel, geodetic_to_ecef, gravity_down};
//!
//! // Normal gravity at the equator and at the poles (m/s²), by the definition of WGS-84.
//! assert!((gravity_down(GravityModel::Wgs84, 0.0, 0.0) - 9.780_325_335_9).abs() < 1e-9);
//! assert!((gravity_down(GravityModel::Wgs84, 1.0, 0.0) - 9.832_184_937_9).abs() < 1e-9);
//! assert!((geodetic_to_ecef(0.0, 0.0, 100.0).x - (A + 100.0)).abs() < 1e-6);
//! ```

use crate::frames::q_e_n;
use crate::lanes::Real;
use glam::DVec3;

/// Semi-major axis (m).
pub const A: f64 = 6_378_137.0;
/// Flattening.
pub const F: f64 = 1.0 / 298.257_223_563;
/// First eccentricity squared.
pub(crate) const E2: f64 = F * (2.0 - F);
/// Rotation rate of the Earth (rad/s).
pub(crate) const OMEGA_IE: f64 = 7.292_115e-5;
/// Gravitational constant times the mass of the Earth (m³/s²).
const MU: f64 = 3.986_004_418e14;
/// Normal gravity at the equator (m/s²).
pub(crate) const GRAVITY_EQUATOR: f64 = 9.780_325_335_9;
/// Somigliana's constant.
const SOMIGLIANA_K: f64 = 0.001_931_852_652_41;
/// Navigation in latitude and longitude is refused beyond this latitude (rad): 89.9°.
pub const MAX_LATITUDE: f64 = MAX_LATITUDE_DEG * crate::units::DEG;
/// Largest latitude (degrees).
pub const MAX_LATITUDE_DEG: f64 = 89.9;

/// The functions of latitude that radii and gravity share: one square root and one division for all.
pub(crate) struct Parallel<R> {
    sin_lat: R,
    /// 1/√(1 − e² sin² lat).
    per_w: R,
}

/// Radii of curvature at a latitude.
#[derive(Debug, Clone, Copy)]
pub struct Radii<R> {
    /// Meridian radius R_N (m), [Groves](crate::bibliography::Groves13) eq. 2.105.
    pub meridian: R,
    /// Transverse (prime vertical) radius R_E (m), eq. 2.106.
    pub transverse: R,
}

impl<R: Real> Parallel<R> {
    /// The parallel at the latitude whose sine is given.
    #[inline(always)]
    pub(crate) fn at(sin_lat: R) -> Self {
        let w2 = sin_lat * sin_lat * -E2 + 1.0;
        Self {
            sin_lat,
            per_w: R::from(1.0) / w2.sqrt(),
        }
    }

    /// The parallel at a sine that differs by less than 1e-6: one Newton step of the inverse root, exact to
    /// rounding there (its error is 3/8 of the square of e² · 1e-6).
    #[inline(always)]
    pub(crate) fn nearby(&self, sin_lat: R) -> Self {
        let w2 = sin_lat * sin_lat * -E2 + 1.0;
        Self {
            sin_lat,
            per_w: self.per_w * (w2 * self.per_w * self.per_w * -0.5 + 1.5),
        }
    }

    /// Radii of curvature.
    #[inline(always)]
    pub(crate) fn radii(&self) -> Radii<R> {
        // R_E = a/w and R_N = a (1 − e²)/w³ with w² = 1 − e² sin² lat.
        let transverse = self.per_w * A;
        Radii {
            meridian: transverse * (self.per_w * self.per_w) * (1.0 - E2),
            transverse,
        }
    }

    /// Normal gravity at height h (m), down component of g_n (m/s²; centrifugal part included). North and
    /// east are zero: the north component is below 1e-5 m/s² under 1.2 km of height and left out (as all
    /// peers do).
    #[inline(always)]
    pub(crate) fn gravity_down(&self, model: GravityModel, h: R) -> R {
        let s2 = self.sin_lat * self.sin_lat;
        let surface = (s2 * SOMIGLIANA_K + 1.0) * GRAVITY_EQUATOR * self.per_w;
        match model {
            GravityModel::Wgs84 => {
                // m = ω² a² b/μ, the ratio of centrifugal to gravitational acceleration at the equator
                // (3.45e-3).
                const M: f64 = OMEGA_IE * OMEGA_IE * A * A * (A * (1.0 - F)) / MU;
                // g(h)/g(0) = 1 − (2/a)(1 + f + m − 2f sin²φ) h + 3 h²/a²: at 3 km the bracket alone is worth
                // 2e-5 m/s², and an error of 1e-5 m/s² is 4 m of height after 900 s.
                let first = (s2 * (-2.0 * F) + (1.0 + F + M)) * (-2.0 / A);
                surface * (h * (first + h * (3.0 / (A * A))) + 1.0)
            }
            GravityModel::FirstOrder => surface * (h * (-2.0 / A) + 1.0),
        }
    }
}

/// Radii of curvature at the latitude whose sine is given.
#[inline(always)]
pub fn radii<R: Real>(sin_lat: R) -> Radii<R> {
    Parallel::at(sin_lat).radii()
}

/// Model of the decrease of gravity with height.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Default,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum GravityModel {
    /// Second-order series of the normal gravity field of WGS-84 (the default),
    /// [Groves](crate::bibliography::Groves13) eq. 2.139 without its north component.
    #[default]
    Wgs84,
    /// g(h) = g(0)·(1 − 2h/a), to compare with tools that use it.
    FirstOrder,
}

nav_sim_signal::named!(GravityModel { Wgs84 = "wgs84", FirstOrder = "first-order" });

/// `Parallel::gravity_down` at the latitude whose sine is given.
#[inline(always)]
pub fn gravity_down<R: Real>(model: GravityModel, sin_lat: R, h: R) -> R {
    Parallel::at(sin_lat).gravity_down(model, h)
}

/// Position in e (m).
pub fn geodetic_to_ecef(lat: f64, lon: f64, h: f64) -> DVec3 {
    let (sin_lat, cos_lat) = lat.sin_cos();
    let (sin_lon, cos_lon) = lon.sin_cos();
    let n = radii(sin_lat).transverse;
    DVec3::new(
        (n + h) * cos_lat * cos_lon,
        (n + h) * cos_lat * sin_lon,
        (n * (1.0 - E2) + h) * sin_lat,
    )
}

/// Latitude, longitude (rad) and height (m) of a position in e; for |h| up to 1000 km.
pub fn ecef_to_geodetic(r_e: DVec3) -> (f64, f64, f64) {
    let ([sin_lat, cos_lat], _, h) = meridian(r_e);
    (sin_lat.atan2(cos_lat), r_e.y.atan2(r_e.x), h)
}

/// Direction in e of the normal of the ellipsoid through a position in e, outwards, and the height (m); for |h| up
/// to 1000 km.
pub(crate) fn normal(r_e: DVec3) -> (DVec3, f64) {
    let ([sin_lat, cos_lat], p, h) = meridian(r_e);
    // On the axis of the Earth every longitude will do.
    let (cos_lon, sin_lon) = if p > 0.0 {
        (r_e.x / p, r_e.y / p)
    } else {
        (1.0, 0.0)
    };
    (DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat), h)
}

/// Sine and cosine of the latitude, distance from the axis of the Earth and height (m): two passes of
/// [Bowring](crate::bibliography::Bowring76), algebraic throughout.
fn meridian(r_e: DVec3) -> ([f64; 2], f64, f64) {
    let (p, z) = ((r_e.x * r_e.x + r_e.y * r_e.y).sqrt(), r_e.z);
    let unit = |sine: f64, cosine: f64| {
        let length = (sine * sine + cosine * cosine).sqrt();
        [sine / length, cosine / length]
    };
    // The reduced latitude, tan beta = (1 − f) tan lat, exact for h = 0.
    let [mut sine, mut cosine] = [z, p * (1.0 - F)];
    // The first pass leaves 1e-9 rad at 1000 km, the second 4e-21; a fixed number of them keeps the result
    // independent of a tolerance.
    for _ in 0..2 {
        let [sin_beta, cos_beta] = unit(sine, cosine);
        // tan lat = (z + e'² b sin³ beta)/(p − e² a cos³ beta), where e'² b (1 − f) = e² a.
        sine = z * (1.0 - F) + A * E2 * sin_beta.powi(3);
        cosine = p - A * E2 * cos_beta.powi(3);
    }
    let [s, c] = unit(sine / (1.0 - F), cosine);
    // Distance along the normal, free of cancellation at any latitude.
    let h = p * c + z * s - A * (1.0 - E2 * s * s).sqrt();
    ([s, c], p, h)
}

/// Earth rate in n (rad/s) at a latitude, [Groves](crate::bibliography::Groves13) eq. 2.123.
pub fn omega_ie_n(lat: f64) -> DVec3 {
    DVec3::new(OMEGA_IE * lat.cos(), 0.0, -OMEGA_IE * lat.sin())
}

/// Transport rate in n (rad/s), [Groves](crate::bibliography::Groves13) eq. 5.44.
pub fn omega_en_n(lat: f64, h: f64, v_n: DVec3) -> DVec3 {
    let r = radii(lat.sin());
    let east = v_n.y / (r.transverse + h);
    // The down component grows as tan(lat): here the mechanisation in n fails at the poles.
    DVec3::new(east, -v_n.x / (r.meridian + h), -east * lat.tan())
}

/// Position difference `b − a` of two places (latitude, longitude (rad), height (m)) in metres north, east, down at a:
/// curvilinear, (R_N + h) δlat, (R_E + h) cos(lat) δlon, −δh.
pub fn ned_difference([lat, lon, h]: [f64; 3], b: [f64; 3]) -> DVec3 {
    let r = radii(lat.sin());
    DVec3::new(
        (b[0] - lat) * (r.meridian + h),
        // Two points either side of ±180° are neighbours, not a turn apart.
        crate::frames::wrap_angle(b[1] - lon) * (r.transverse + h) * lat.cos(),
        h - b[2],
    )
}

/// The place so many metres north, east, down of another: the inverse of [`ned_difference`].
pub(crate) fn moved([lat, lon, h]: [f64; 3], by_n: DVec3) -> [f64; 3] {
    let r = radii(lat.sin());
    [
        lat + by_n.x / (r.meridian + h),
        lon + by_n.y / ((r.transverse + h) * lat.cos()),
        h - by_n.z,
    ]
}

/// A vector of e written in n at the given place.
pub fn e_to_n(lat: f64, lon: f64, v_e: DVec3) -> DVec3 {
    q_e_n(lat, lon) * v_e
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;

    /// WGS-84 report, table 3.4 and 3.5: derived geometric and physical constants.
    #[test]
    fn derived_constants_of_wgs84() {
        let polar = radii(1.0);
        assert_abs_diff_eq!(polar.transverse, 6_399_593.625_8, epsilon = 1e-3);
        assert_abs_diff_eq!(
            gravity_down(GravityModel::Wgs84, 1.0, 0.0),
            9.832_184_937_8,
            epsilon = 1e-9
        );
        assert_abs_diff_eq!(
            gravity_down(GravityModel::Wgs84, 0.0, 0.0),
            9.780_325_335_9,
            epsilon = 1e-12
        );
        assert_abs_diff_eq!(E2, 6.694_379_990_141e-3, epsilon = 1e-15);
    }

    /// The free-air series against the exact normal field, evaluated independently: gravitation of the
    /// level ellipsoid on the rotation axis, closed form (Heiskanen & Moritz, 1967, eq. 2-62 at β = 90°).
    #[test]
    fn free_air_series_on_the_axis() {
        let (a, b) = (A, A * (1.0 - F));
        let e = (a * a - b * b).sqrt();
        let q = |u: f64| 0.5 * ((1.0 + 3.0 * u * u / (e * e)) * (e / u).atan() - 3.0 * u / e);
        let dq = |u: f64| {
            let step = 1e-3 * u;
            (q(u + step) - q(u - step)) / (2.0 * step)
        };
        // V on the axis = GM/E atan(E/u) + ω²a²/3 · q(u)/q(b)
        let gamma = |u: f64| MU / (u * u + e * e) - OMEGA_IE.powi(2) * a * a / 3.0 * dq(u) / q(b);
        for h in [0.0, 1000.0, 10_000.0] {
            let series = gravity_down(GravityModel::Wgs84, 1.0, h);
            assert_abs_diff_eq!(series, gamma(b + h), epsilon = 2e-6);
        }
    }

    #[test]
    fn geodetic_round_trip_everywhere() {
        for lat in [-90.0, -89.95, -45.0, -1e-9, 0.0, 30.0, 60.0, 89.999, 90.0] {
            for h in [-5000.0, 0.0, 12_000.0, 400_000.0, 1e6] {
                let (la, lo, hh) = ecef_to_geodetic(geodetic_to_ecef(lat * DEG, 179.999 * DEG, h));
                assert!(
                    (la - lat * DEG).abs() < 1e-15 * 4.0,
                    "{lat} {h}: {}",
                    la / DEG
                );
                assert!((hh - h).abs() < 4e-9, "{lat} {h}: {hh}");
                assert!(lat.abs() == 90.0 || (lo - 179.999 * DEG).abs() < 1e-14);
            }
        }
    }
}
