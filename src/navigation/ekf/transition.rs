//! The transition of the error state from one instant to a later one, dense: what a smoother goes back by. The
//! filter itself never needs it.

use super::covariance::{NAV, Sources, load_error, row_errors, store_error};
use super::dynamics::ErrorMap;
use super::filter::Ekf;
use crate::lanes::{LANES, Lanes, Wide};
use nalgebra::DMatrix;

/// The product of the maps of all steps since the beginning, as columns. The lanes of the filter are one run, the
/// same in all of them, so that each of them can carry a column of its own.
#[derive(Debug, Clone)]
pub(super) struct Transition {
    dim: usize,
    /// Eight columns after eight columns, each a vector of states.
    columns: Vec<Lanes>,
}

impl Transition {
    fn identity(dim: usize) -> Self {
        let mut columns = vec![Lanes::ZERO; dim.div_ceil(LANES) * dim];
        for j in 0..dim {
            columns[j / LANES * dim + j][j % LANES] = 1.0;
        }
        Self { dim, columns }
    }

    /// The map after those before: of every column as [`Covariance::step`](super::Covariance) has it of its own.
    #[inline(always)]
    pub(super) fn step<W: Wide>(&mut self, map: &impl ErrorMap<W>, sources: &Sources<'_>) {
        for column in self.columns.chunks_exact_mut(self.dim) {
            let (nav, rest) = column.split_at_mut(NAV);
            for (i, state) in rest.iter_mut().enumerate() {
                // In the order of the filter: biases take their step, then the map uses them.
                (W::load(state) * sources.steps[i / 3].phi[i % 3]).store(state);
            }
            let [accel, gyro] = row_errors(rest, sources);
            store_error(nav, &map.apply(load_error(nav), accel, gyro));
        }
    }

    fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.dim, self.dim, |i, j| {
            self.columns[j / LANES * self.dim + i][j % LANES]
        })
    }
}

impl Ekf {
    /// From now on the transition is kept. All lanes must be the same run.
    pub(crate) fn keep_transition(&mut self) {
        super::settle(self);
        self.transition = Some(Transition::identity(self.p.dim()));
    }

    /// The transition since this was last called, or since [`keep_transition`](Self::keep_transition), to be called
    /// when the filter is settled; the identity where none is kept.
    pub(crate) fn take_transition(&mut self) -> DMatrix<f64> {
        let fresh = Transition::identity(self.p.dim());
        self.transition
            .replace(fresh)
            .unwrap_or_else(|| Transition::identity(self.p.dim()))
            .matrix()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{gauss_markov_model, manoeuvre, predict};
    use super::super::{Belief, FilterStates, InitialSettings, UnknownKind, settle};
    use super::*;
    use crate::earth::GravityModel;
    use crate::frames::NavState;
    use crate::imu::Sensor;
    use crate::strapdown::Strapdown;
    use glam::{DQuat, DVec3};

    /// A covariance as large as this one, with correlations all over.
    fn correlated(p: &DMatrix<f64>) -> DMatrix<f64> {
        let n = p.nrows();
        let mixed = DMatrix::from_fn(n, n, |i, j| ((i * 7 + j * 3) % 11) as f64 / 11.0 - 0.4);
        let sigma = DMatrix::from_diagonal(&p.diagonal().map(f64::sqrt));
        &sigma * (&mixed * mixed.transpose() + DMatrix::identity(n, n)) * &sigma
    }

    /// Two covariances that go through the same steps differ by Phi (P₁ − P₂) Phiᵀ, whatever noise is added to both:
    /// in every block, with turn-on biases, drifts and scale factors.
    #[test]
    fn the_transition_is_that_of_the_covariance() {
        let turn_on = InitialSettings {
            gyro_bias_sigma_rad_s: Some(1e-3),
            ..InitialSettings::default()
        };
        let mut belief = Belief::new(&gauss_markov_model(), FilterStates::Reduced21, 1.0, 800.0)
            .unwrap()
            .with_initial(&turn_on);
        belief.set_unknown(
            Sensor::Accel,
            UnknownKind::Drift,
            DVec3::new(1e-6, 2e-6, 3e-6),
        );
        let start = NavState {
            lat: 0.8,
            lon: 0.1,
            h: 400.0,
            v_n: DVec3::new(150.0, -50.0, 0.5),
            q_b_n: DQuat::from_scaled_axis(DVec3::new(0.05, -0.1, 1.0)),
        };
        let nominal = Strapdown::new(&start, GravityModel::Wgs84);
        let mut filters =
            [0, 1].map(|_| Ekf::new(nominal, &belief, &start, &InitialSettings::default()));
        let correlated = correlated(&filters[0].p.lane(0));
        filters[0].p.set_lane(0, &correlated);
        filters.iter_mut().for_each(Ekf::keep_transition);
        let before = filters[0].p.lane(0) - filters[1].p.lane(0);
        for filter in &mut filters {
            for k in 0..137 {
                let (omega, f) = manoeuvre(f64::from(k) * 0.01);
                predict(filter, omega, f);
            }
            settle(filter);
        }
        let phi = filters.each_mut().map(Ekf::take_transition);
        assert_eq!(phi[0], phi[1]);
        let [p, q] = filters.each_ref().map(|filter| filter.p.lane(0));
        let (found, expected) = (&p - &q, &phi[0] * before * phi[0].transpose());
        assert_eq!(found.nrows(), 27);
        for (i, j) in (0..27).flat_map(|i| (0..27).map(move |j| (i, j))) {
            let scale = ((p[(i, i)] + q[(i, i)]) * (p[(j, j)] + q[(j, j)])).sqrt();
            assert!(
                (found[(i, j)] - expected[(i, j)]).abs() <= 1e-12 * scale,
                "({i}, {j})"
            );
        }
        assert_eq!(filters[0].take_transition(), DMatrix::identity(27, 27));
    }
}
