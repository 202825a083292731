//! One run of the filter at an instant, to be returned to.

use super::filter::Ekf;
use crate::frames::NavState;
use crate::lanes::{Kernel, Lanes, Wide, dispatch};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Nominal state and estimates of the first lane, without their covariance.
#[derive(Debug, Clone)]
pub(crate) struct Snapshot {
    nominal: NavState,
    /// Estimates of biases and unknowns, then what the unknowns are multiplied by.
    triples: Vec<DVec3>,
}

impl Ekf {
    /// The first lane as it is.
    pub(crate) fn snapshot(&self) -> Snapshot {
        // The regressors too: the bias of a drift is slope times the age of the sample, and that is of the
        // past here.
        let regressors = self.regressors.iter().flatten().map(|r| &r.value);
        let triples = self
            .estimates
            .iter()
            .chain(regressors)
            .map(|triple| triple.lane(0))
            .collect();
        Snapshot {
            nominal: self.nominal.lane(0),
            triples,
        }
    }

    /// Sets the first lane to a snapshot less an estimated error, whose covariance is `p`. The other lanes, and what the
    /// next sample needs of the ones before, are left as they are: the filter is then to be looked at only.
    pub(crate) fn show(&mut self, snapshot: &Snapshot, error: &DVector<f64>, p: &DMatrix<f64>) {
        self.nominal.set_lane(0, &snapshot.nominal);
        let regressors = self.regressors.iter_mut().flatten().map(|r| &mut r.value);
        let triples = self.estimates.iter_mut().chain(regressors);
        triples
            .zip(&snapshot.triples)
            .for_each(|(to, from)| to.set_lane(0, *from));
        self.p.set_lane(0, p);
        // `p` is that of the snapshot's instant: an age left over would add the Earth terms of another
        // interval.
        self.earth_age = 0.0;
        for (to, from) in self.scratch.error.iter_mut().zip(error.iter()) {
            *to = Lanes::ZERO;
            // The other lanes get no correction: zero moves them nowhere.
            to[0] = *from;
        }
        apply_correction(self);
    }

    /// What the last update took out of the state of the first lane.
    pub(crate) fn correction(&self) -> DVector<f64> {
        DVector::from_iterator(
            self.p.dim(),
            self.scratch.error.iter().map(|error| error[0]),
        )
    }
}

/// Takes the estimated errors out of the state and the estimates of all lanes.
pub(super) fn apply_correction(ekf: &mut Ekf) {
    dispatch(ekf.level, Correct(ekf));
}

struct Correct<'a>(&'a mut Ekf);

impl Kernel for Correct<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Wide>(self) {
        let ins = self.0.nominal.load::<W>();
        self.0.correct(ins);
    }
}
