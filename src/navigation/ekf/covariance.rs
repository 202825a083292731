//! The covariance of eight runs.
//!
//! States by threes: [`R`] position error (m, n), [`V`] velocity error (m/s, n), `PSI` attitude error
//! (rad, n), then three per bias group (`BIAS`, accelerometer groups first), three per constant error coefficient
//! (scale factor, drift slope; same order), and last the wheel scale and the mounting angles.
//!
//! The lower triangle is the matrix. Inside the square of the navigation states and inside that of the
//! biases the upper triangle repeats it, so that a column can be read as a row.

use super::filter::{Ekf, Regressor};
use super::filter_model::{BiasGroup, FilterModel, MAX_BLOCKS};
use crate::earth::{E2, OMEGA_IE, gravity_down, radii};
use crate::imu::Sensor;
use crate::lanes::{LANES, Lanes, Mat3, Real, Vec3, Wide};
use crate::strapdown::{StepTrace, Strapdown};
use glam::DVec3;
use nalgebra::DMatrix;
use std::ops::Range;

/// Position error block (m, n).
pub const R: usize = 0;
/// Velocity error block (m/s, n).
pub const V: usize = 1;
/// Attitude error block (rad, n).
pub(crate) const PSI: usize = 2;
/// First bias block.
pub(crate) const BIAS: usize = 3;
/// Navigation states.
pub(super) const NAV: usize = 3 * BIAS;

/// Symmetric covariance of eight runs.
#[derive(Debug, Clone)]
pub struct Covariance {
    dim: usize,
    /// Row-major.
    p: Vec<Lanes>,
    /// Scratch: columns of A P, navigation rows.
    columns: [[Lanes; NAV]; NAV],
}

/// Steps of biases that stay as they are: phi = 1, no innovation.
const CONSTANT_BIASES: [BiasGroup; 2 * MAX_BLOCKS + 1] =
    [BiasGroup::constant(0.0); 2 * MAX_BLOCKS + 1];

/// States after the navigation block, biases and error coefficients, with the transition of each.
#[derive(Debug, Clone, Copy)]
pub(super) struct BiasBlocks<'a> {
    /// Transition of each block, in state order: accelerometer biases, gyroscope biases, coefficients of both, vehicle
    /// states (constant).
    steps: &'a [BiasGroup],
    /// Bias groups of each sensor.
    pub biases: [usize; 2],
    /// Factors on the unknowns of each sensor.
    pub regressors: [&'a [Regressor]; 2],
}

impl<'a> BiasBlocks<'a> {
    #[inline(always)]
    pub(super) fn new(
        filter_model: &FilterModel,
        steps: &'a [BiasGroup],
        regressors: &'a [Vec<Regressor>; 2],
    ) -> Self {
        let [accel, gyro] = &filter_model.groups;
        Self {
            steps,
            biases: [accel.len(), gyro.len()],
            regressors: [&regressors[0], &regressors[1]],
        }
    }

    /// The first unknown of a sensor among the blocks.
    #[inline(always)]
    pub(super) fn unknowns(&self, sensor: Sensor) -> usize {
        let before = if sensor == Sensor::Accel {
            0
        } else {
            self.regressors[0].len()
        };
        self.biases[0] + self.biases[1] + before
    }

    /// Blocks with transition 1 and no noise: for a map between samples, which moves no bias.
    pub(super) fn with_identity_transition(self) -> Self {
        Self {
            steps: &CONSTANT_BIASES[..self.steps.len()],
            ..self
        }
    }

    /// First states of: accelerometer biases, gyroscope biases, accelerometer unknowns, gyroscope unknowns.
    #[inline(always)]
    pub(super) fn starts(&self) -> [usize; 4] {
        let gyro = NAV + 3 * self.biases[0];
        let unknown = gyro + 3 * self.biases[1];
        [NAV, gyro, unknown, unknown + 3 * self.regressors[0].len()]
    }
}

impl Covariance {
    /// Zero covariance of `dim` states.
    pub(crate) fn zeros(dim: usize) -> Self {
        Self {
            dim,
            p: vec![Lanes::ZERO; dim * dim],
            columns: [[Lanes::ZERO; NAV]; NAV],
        }
    }

    /// States: rows of the matrix.
    pub(crate) const fn dim(&self) -> usize {
        self.dim
    }

    /// Element (i, j) of the matrix.
    #[inline(always)]
    pub(crate) fn get<W: Wide>(&self, i: usize, j: usize) -> W {
        W::load(&self.p[i.max(j) * self.dim + i.min(j)])
    }

    #[inline(always)]
    fn set<W: Wide>(&mut self, i: usize, j: usize, value: W) {
        value.store(&mut self.p[i * self.dim + j]);
        value.store(&mut self.p[j * self.dim + i]);
    }

    /// Adds to an element of the navigation square and its mirror image.
    #[inline(always)]
    pub(super) fn add<W: Wide>(&mut self, i: usize, j: usize, value: W) {
        self.set(i, j, self.get::<W>(i, j) + value);
    }

    /// Adds to a diagonal block of three states.
    #[inline(always)]
    pub(super) fn add_diagonal_block<W: Wide>(&mut self, block: usize, m: &Mat3<W>) {
        for i in 0..3 {
            for j in i..3 {
                self.add(3 * block + i, 3 * block + j, m.0[i][j]);
            }
        }
    }

    /// Sets the matrix of one lane to a symmetric one.
    pub(super) fn set_lane(&mut self, lane: usize, matrix: &nalgebra::DMatrix<f64>) {
        self.p
            .iter_mut()
            .zip(matrix.iter())
            .for_each(|(to, from)| to[lane] = *from);
    }

    /// Sets the navigation square of all lanes.
    pub(crate) fn set_navigation(&mut self, p: &[[f64; NAV]; NAV]) {
        for i in 0..NAV {
            for j in 0..=i {
                self.set(i, j, Lanes::splat(p[i][j]));
            }
        }
    }

    /// P⁺ = A P Aᵀ + Q for a map A of the navigation error and the transition of the biases; the biases
    /// take their step first: `b_k = phi b_{k−1} + w`, and the map uses `b_k`. Q holds the
    /// innovations of the biases only; `Ekf::add_white_noise` adds the sensors' white noise.
    #[inline(always)]
    pub(super) fn step<W: Wide>(&mut self, map: &impl ErrorMap<W>, sources: &BiasBlocks<'_>) {
        self.step_biases::<W>(sources.steps);
        let n = self.dim;
        // A P: navigation columns into scratch, since P is still read.
        for j in 0..NAV {
            let [accel, gyro] = self.column_errors(j, sources);
            let after = map.apply(load_error(&self.p[j * n..]), accel, gyro);
            store_error(&mut self.columns[j], &after);
        }
        // Columns of the biases: P_bb is already stepped; P_nb still lacks its factor phi.
        for j in NAV..n {
            let phi = W::from(sources.steps[j / 3 - BIAS].phi[j % 3]);
            let (nav, rest) = self.p[j * n..(j + 1) * n].split_at_mut(NAV);
            let [accel, gyro] = row_errors(rest, sources);
            let x = load_error::<W>(nav);
            let x = [x[R] * phi, x[V] * phi, x[PSI] * phi];
            store_error(nav, &map.apply(x, accel, gyro));
        }
        // (A P) Aᵀ: the same map on the rows of A P. Cross terms have taken their step by now: no second phi.
        let still = sources.with_identity_transition();
        for i in 0..NAV {
            let mut row = [Lanes::ZERO; NAV];
            for (element, column) in row.iter_mut().zip(&self.columns) {
                // Transposed while copying: row i of A P is column i of P Aᵀ, to which the same map applies.
                *element = column[i];
            }
            // Row i of A P in the columns of the biases, read from below the diagonal.
            let [accel, gyro] = self.column_errors(i, &still);
            let after = map.apply(load_error(&row), accel, gyro);
            store_error(&mut self.p[i * n..], &after);
        }
        self.mirror_navigation();
    }

    /// The errors of the sample of each sensor in column j of the navigation, every bias after its step.
    #[inline(always)]
    fn column_errors<W: Wide>(&self, j: usize, sources: &BiasBlocks<'_>) -> [Vec3<W>; 2] {
        let [accel, gyro, accel_unknown, gyro_unknown] = sources.starts();
        let of_accel = self.bias_sum(accel..gyro, j, sources.steps);
        let of_gyro = self.bias_sum(gyro..accel_unknown, j, sources.steps);
        [
            self.add_unknowns(of_accel, accel_unknown, j, sources.regressors[0]),
            self.add_unknowns(of_gyro, gyro_unknown, j, sources.regressors[1]),
        ]
    }

    /// The sum of triples of biases in column j of the navigation, each after its step.
    #[inline(always)]
    fn bias_sum<W: Wide>(&self, states: Range<usize>, j: usize, biases: &[BiasGroup]) -> Vec3<W> {
        let mut sum = [W::from(0.0); 3];
        for m in states.step_by(3) {
            let phi = biases[m / 3 - BIAS].phi;
            for axis in 0..3 {
                let element = W::load(&self.p[(m + axis) * self.dim + j]);
                sum[axis] = element.mul_add(W::from(phi[axis]), sum[axis]);
            }
        }
        Vec3(sum)
    }

    /// Adds the unknowns from state `first` on in column j of the navigation, each times its regressor.
    #[inline(always)]
    fn add_unknowns<W: Wide>(
        &self,
        mut sum: Vec3<W>,
        first: usize,
        j: usize,
        regressors: &[Regressor],
    ) -> Vec3<W> {
        for (u, regressor) in regressors.iter().enumerate() {
            for axis in 0..3 {
                let element = W::load(&self.p[(first + 3 * u + axis) * self.dim + j]);
                sum[axis] = element.mul_add(W::load(&regressor.value[axis]), sum[axis]);
            }
        }
        sum
    }

    /// The square of the biases: Phi P Phiᵀ + Q.
    #[inline(always)]
    fn step_biases<W: Wide>(&mut self, biases: &[BiasGroup]) {
        for i in NAV..self.dim {
            let BiasGroup {
                phi, innovation, ..
            } = biases[i / 3 - BIAS];
            let row = &mut self.p[i * self.dim..(i + 1) * self.dim];
            for (g, triple) in row[NAV..].as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let factor = biases[g].phi * phi[i % 3];
                for axis in 0..3 {
                    (W::load(&triple[axis]) * factor[axis]).store(&mut triple[axis]);
                }
            }
            (W::load(&row[i]) + innovation[i % 3]).store(&mut row[i]);
        }
    }

    /// Copies the upper triangle of the navigation square to the lower.
    #[inline(always)]
    fn mirror_navigation(&mut self) {
        for i in 0..NAV {
            for j in i + 1..NAV {
                self.p[j * self.dim + i] = self.p[i * self.dim + j];
            }
        }
    }

    /// The variances of a block's three states.
    pub(crate) fn variances(&self, block: usize) -> Vec3 {
        Vec3([0, 1, 2].map(|i| self.get(3 * block + i, 3 * block + i)))
    }

    /// One scalar measurement z = h·x + noise of variance r, in Joseph's form
    /// ([Bar-Shalom](crate::bibliography::BarShalom01), eq. 5.2.3-17), so that the result is positive
    /// semi-definite for any r > 0. `h` lists (state, coefficient). The gain is left in `gain` (one entry
    /// a state, also used as scratch); the innovation variance is returned.
    #[inline(always)]
    pub(super) fn update<W: Wide>(
        &mut self,
        h: &[(usize, Lanes)],
        r: f64,
        ph: &mut [Lanes],
        gain: &mut [Lanes],
    ) -> W {
        let n = self.dim;
        for i in 0..n {
            let mut sum = W::from(0.0);
            for (m, c) in h {
                sum = self.get::<W>(i, *m).mul_add(W::load(c), sum);
            }
            sum.store(&mut ph[i]);
        }
        let mut h_ph = W::from(0.0);
        for (m, c) in h {
            h_ph = W::load(&ph[*m]).mul_add(W::load(c), h_ph);
        }
        let s = h_ph + r;
        let inverse = W::from(1.0) / s;
        for i in 0..n {
            (W::load(&ph[i]) * inverse).store(&mut gain[i]);
        }
        // With M = (I − k hᵀ) P:  P⁺ = M (I − k hᵀ)ᵀ + r k kᵀ = M + (r k − M h) kᵀ.
        for i in 0..n {
            let (ph_i, gain_i) = (W::load(&ph[i]), W::load(&gain[i]));
            // r k − M h vanishes for the optimal gain but for rounding. With it the error of P⁺ is of second
            // order in that of k, without it of first, and P may become indefinite.
            let residual = gain_i * r - (ph_i - gain_i * h_ph);
            for j in 0..=i {
                // Each element is read once, before it is written: in place, without a copy of P.
                let m = (-gain_i).mul_add(W::load(&ph[j]), self.get(i, j));
                self.set(i, j, residual.mul_add(W::load(&gain[j]), m));
            }
        }
        s
    }

    /// xᵀ P⁻¹ x over the states listed, by Cholesky; NaN where the covariance is not positive definite.
    #[inline(always)]
    pub(crate) fn normalised_square<const N: usize>(
        &self,
        states: [usize; N],
        x: [Lanes; N],
    ) -> Lanes {
        self.whitened(states, x).0
    }

    /// Logarithm of the normal density of mean zero and this covariance at `x` (nats; the units of the density are
    /// those of the states, inverse).
    pub(crate) fn log_density<const N: usize>(&self, states: [usize; N], x: [Lanes; N]) -> Lanes {
        let (square, root_of_det) = self.whitened(states, x);
        let constant = N as f64 * std::f64::consts::TAU.ln();
        let mut density = Lanes::ZERO;
        for lane in 0..LANES {
            density[lane] = -0.5 * (square[lane] + 2.0 * root_of_det[lane].ln() + constant);
        }
        density
    }

    /// The square of `L⁻¹ x` and the determinant of L, where P = L Lᵀ over these states.
    fn whitened<const N: usize>(&self, states: [usize; N], x: [Lanes; N]) -> (Lanes, Lanes) {
        let mut l = [[Lanes::ZERO; N]; N];
        let mut y = x;
        let (mut sum, mut det) = (Lanes::ZERO, Lanes::splat(1.0));
        for i in 0..N {
            for j in 0..=i {
                // A negative pivot gives a NaN on purpose: such a run has diverged and is to be seen.
                let mut a: Lanes = self.get(states[i], states[j]);
                for k in 0..j {
                    a -= l[i][k] * l[j][k];
                }
                l[i][j] = if i == j { a.sqrt() } else { a / l[j][j] };
            }
            for k in 0..i {
                let product = l[i][k] * y[k];
                y[i] -= product;
            }
            y[i] = y[i] / l[i][i];
            sum += y[i] * y[i];
            det = det * l[i][i];
        }
        (sum, det)
    }

    /// The matrix of one lane.
    pub fn lane(&self, lane: usize) -> nalgebra::DMatrix<f64> {
        nalgebra::DMatrix::from_fn(self.dim(), self.dim(), |i, j| self.get::<Lanes>(i, j)[lane])
    }
}

/// The first nine lanes of a row as a navigation error.
#[inline(always)]
fn load_error<W: Wide>(row: &[Lanes]) -> NavError<W> {
    let row = &row[..NAV];
    [
        load_triple(&row[..3]),
        load_triple(&row[3..6]),
        load_triple(&row[6..]),
    ]
}

#[inline(always)]
fn store_error<W: Wide>(row: &mut [Lanes], x: &NavError<W>) {
    let row = &mut row[..NAV];
    for k in 0..NAV {
        x[k / 3][k % 3].store(&mut row[k]);
    }
}

#[inline(always)]
pub(super) fn load_triple<W: Wide>(triple: &[Lanes]) -> Vec3<W> {
    Vec3([
        W::load(&triple[0]),
        W::load(&triple[1]),
        W::load(&triple[2]),
    ])
}

/// The sum of the triples of a row.
#[inline(always)]
fn sum_triples<W: Wide>(row: &[Lanes]) -> Vec3<W> {
    let mut sum = Vec3::splat(DVec3::ZERO);
    for triple in row.as_chunks::<3>().0 {
        sum = sum + load_triple(triple);
    }
    sum
}

/// The errors of the sample of each sensor in the row of a state behind the navigation's.
#[inline(always)]
fn row_errors<W: Wide>(row: &[Lanes], sources: &BiasBlocks<'_>) -> [Vec3<W>; 2] {
    let (accel, rest) = row.split_at(3 * sources.biases[0]);
    let (gyro, rest) = rest.split_at(3 * sources.biases[1]);
    let [of_accel, of_gyro] = sources.regressors;
    let (accel_unknowns, gyro_unknowns) = rest.split_at(3 * of_accel.len());
    [
        add_products(sum_triples(accel), accel_unknowns, of_accel),
        add_products(sum_triples(gyro), gyro_unknowns, of_gyro),
    ]
}

/// Adds the triples of a row, each times its regressor.
#[inline(always)]
fn add_products<W: Wide>(mut sum: Vec3<W>, row: &[Lanes], regressors: &[Regressor]) -> Vec3<W> {
    for (triple, regressor) in row.as_chunks::<3>().0.iter().zip(regressors) {
        for axis in 0..3 {
            sum[axis] = W::load(&triple[axis]).mul_add(W::load(&regressor.value[axis]), sum[axis]);
        }
    }
    sum
}

// First-order dynamics of the error state, in blocks.
//
// Two maps compose one step. [`Sample`] holds what changes with every IMU sample: the rotation of the
// biases into n and the specific force. `EarthTerms` holds what the Earth contributes: transport and
// Earth rate, Coriolis, gravity gradient, the errors of the transport rate. The latter change slowly and
// are below 1e-4 /s, so they are applied in steps of up to `EARTH_STEP_S` (the splitting is of second
// order: 1e-5 relative in a standard deviation over an outage, tested against the matrix exponential).
//
// [Groves](crate::bibliography::Groves13), sec. 14.2.4, with position in metres: delta r_n =
// ((R_N + h) δlat, (R_E + h) cos lat δlon, −δh), whose dynamics are derived in closed form.

/// Longest step of the Earth terms (s).
pub(crate) const EARTH_STEP_S: f64 = 0.2;

/// A navigation error: triples [`R`], [`V`] and [`PSI`].
pub(crate) type NavError<L> = [Vec3<L>; 3];

/// A linear map of the navigation error, given the errors of the accelerometer and gyroscope biases.
pub(crate) trait ErrorMap<L> {
    /// The error after the map.
    fn apply(&self, x: NavError<L>, accel: Vec3<L>, gyro: Vec3<L>) -> NavError<L>;
}

/// The part of the transition that changes with every sample. Errors of the sample's biases are those of
/// the estimates: b_est − b.
#[derive(Debug, Clone, Copy)]
pub struct Sample<L> {
    /// C_b_n · dt (s).
    c_dt: Mat3<L>,
    /// ½ ∫ f_ib_n dt (m/s).
    half_f_dt: Vec3<L>,
    half_dt: L,
}

impl<L: Real> Sample<L> {
    /// From what the strapdown passed through.
    #[inline(always)]
    pub(crate) fn new(trace: &StepTrace<L>, dt: f64) -> Self {
        Self {
            c_dt: trace.c_b_n.scaled(L::from(dt)),
            half_f_dt: trace.dv_n * L::from(0.5),
            half_dt: L::from(0.5 * dt),
        }
    }

    /// C diag(variances) Cᵀ dt²: the noise of one sample of a sensor, in n.
    #[inline(always)]
    pub(crate) fn rotated_noise(&self, variances: DVec3) -> Mat3<L> {
        let z = L::from(0.0);
        let mut noise = Mat3([[z; 3]; 3]);
        // C Cᵀ = I: equal axes need no rotation, and the mean attitude's missing cos(θ/2) does not enter
        // either.
        if variances.x == variances.y && variances.x == variances.z {
            for i in 0..3 {
                noise.0[i][i] = self.half_dt * self.half_dt * (4.0 * variances.x);
            }
            return noise;
        }
        for i in 0..3 {
            let row = self.c_dt.0[i];
            let scaled = Vec3([
                row[0] * variances.x,
                row[1] * variances.y,
                row[2] * variances.z,
            ]);
            for j in 0..3 {
                noise.0[i][j] = scaled.dot(Vec3(self.c_dt.0[j]));
            }
        }
        noise
    }

    /// The gyroscope noise of a sample tilts the specific force of the same sample: column j of what that adds to
    /// the covariance of V and PSI, −½ \[f_n dt ×\] q_psi.
    #[inline(always)]
    pub(crate) fn tilted_noise(&self, q_psi: &Mat3<L>, j: usize) -> Vec3<L> {
        Vec3([q_psi.0[0][j], q_psi.0[1][j], q_psi.0[2][j]]).cross(self.half_f_dt)
    }
}

impl<L: Real> ErrorMap<L> for Sample<L> {
    /// Attitude first, velocity with its mean, position with the mean velocity: the second-order terms of
    /// the matrix exponential come with it.
    #[inline(always)]
    fn apply(&self, x: NavError<L>, accel: Vec3<L>, gyro: Vec3<L>) -> NavError<L> {
        // psi_n turns C_true into C_est; a bias estimated too large is taken off too much, hence the minus
        // signs.
        let psi = x[PSI] - self.c_dt * gyro;
        // ½ (psi before + psi after) × f dt: a gyroscope bias reaches v with dt²/2, exactly; r below with
        // dt³/4 instead of dt³/6.
        let v = x[V] + (x[PSI] + psi).cross(self.half_f_dt) - self.c_dt * accel;
        let r = (x[V] + v).mul_add(self.half_dt, x[R]);
        [r, v, psi]
    }
}

/// The blocks of F that the rotating, curved, heavy Earth contributes.
#[derive(Clone, Copy)]
pub(crate) struct EarthTerms<L> {
    /// ∂(dr/dt)/∂r (1/s).
    pub rr: Mat3<L>,
    /// ∂(dv/dt)/∂r (1/s²).
    pub vr: Mat3<L>,
    /// ∂(dv/dt)/∂v (1/s).
    pub vv: Mat3<L>,
    /// ∂(dpsi/dt)/∂r (rad/(m s)).
    pub psi_r: Mat3<L>,
    /// ∂(dpsi/dt)/∂v (rad/m).
    pub psi_v: Mat3<L>,
    /// ∂(dpsi/dt)/∂psi (1/s).
    pub psi_psi: Mat3<L>,
}

impl<L: Real> EarthTerms<L> {
    /// At the nominal state.
    #[inline(always)]
    pub(crate) fn at(ins: &Strapdown<L>) -> Self {
        let (z, one) = (L::from(0.0), L::from(1.0));
        let (s, c) = ins.lat.sin_cos();
        let radii = radii(s);
        let (rn, re) = (radii.meridian + ins.h, radii.transverse + ins.h);
        let [vn, ve, vd] = ins.v_n.0;
        let tan = s / c;
        let (wn, we) = (vn / rn, ve / re); // dlat/dt, cos(lat) dlon/dt
        // dR/dlat of both radii: 3 e² R_N s c/(1 − e² s²) and e² R_E s c/(1 − e² s²)
        let w2 = s * s * -E2 + 1.0;
        let drn = radii.meridian * s * c * (3.0 * E2) / w2;
        let dre = radii.transverse * s * c * E2 / w2;

        // d/dt of (R_N + h) δlat: the slope of R_N cancels between the factor and δlat. East, the slope of
        // (R_E + h) cos lat by latitude is −(R_N + h) sin lat: hence no derivative of a radius in this block.
        let rr = Mat3([
            [-(vd / rn), z, wn],
            [we * tan, -(wn * tan * rn / re) - vd / re, we],
            [z, z, z],
        ]);
        // For r in metres: ∂/∂lat · 1/rn per metre north, −∂/∂h per metre down.
        let omega_ie = Vec3([c * OMEGA_IE, z, s * -OMEGA_IE]);
        let omega_en = Vec3([we, -wn, -(we * tan)]);
        // omega_ie_n is (cos, 0, −sin)·omega_ie; its derivative by latitude, per metre north.
        let d_ie_north = Vec3([s * -OMEGA_IE, z, c * -OMEGA_IE]) * (one / rn);
        let east = -(we * dre / re);
        let d_en_north =
            Vec3([east, wn * drn / rn, -(east * tan) - we * (tan * tan + 1.0)]) * (one / rn);
        let d_en_down = Vec3([we / re, -(wn / rn), -(we * tan / re)]);
        // omega_en_n is linear in the velocity: this is the matrix itself.
        let d_en_v = Mat3([[z, one / re, z], [-(one / rn), z, z], [z, -(tan / re), z]]);

        let coriolis = omega_ie + omega_ie + omega_en;
        let mut v_north = -(d_ie_north + d_ie_north + d_en_north).cross(ins.v_n);
        let mut v_down = -d_en_down.cross(ins.v_n);
        let (g_north, g_down) = gravity_gradient(ins, s, c);
        // Gravity by latitude is 8e-9 m/s² a metre; by height 3.1e-6 /s², what makes the vertical channel
        // unstable (570 s).
        v_north[2] += g_north / rn;
        v_down[2] += g_down;
        // ∂(−(2 w_ie + w_en) × v)/∂v = −[w×] + [v×] ∂w_en/∂v
        let vv = Mat3::skew(ins.v_n) * d_en_v - Mat3::skew(coriolis);
        // dpsi/dt = −w_in × psi − δw_in
        let (psi_north, psi_down) = (-(d_ie_north + d_en_north), -d_en_down);
        Self {
            rr,
            vr: columns(v_north, v_down),
            vv,
            psi_r: columns(psi_north, psi_down),
            psi_v: d_en_v.scaled(L::from(-1.0)),
            psi_psi: Mat3::skew(-(omega_ie + omega_en)),
        }
    }
}

/// The Earth terms over a time step.
pub(crate) struct EarthStep<L> {
    /// The terms.
    pub terms: EarthTerms<L>,
    /// Duration (s).
    pub dt: f64,
}

impl<L: Real> ErrorMap<L> for EarthStep<L> {
    #[inline(always)]
    fn apply(&self, x: NavError<L>, _accel: Vec3<L>, _gyro: Vec3<L>) -> NavError<L> {
        let (t, dt) = (&self.terms, L::from(self.dt));
        [
            // I + F dt: the next term, F² dt²/2, is (1e-4 · 0.2)²/2 = 2e-10.
            (t.rr * x[R]).mul_add(dt, x[R]),
            (t.vr * x[R] + t.vv * x[V]).mul_add(dt, x[V]),
            (t.psi_r * x[R] + t.psi_v * x[V] + t.psi_psi * x[PSI]).mul_add(dt, x[PSI]),
        ]
    }
}

/// The matrix with the given north and down columns; nothing depends on longitude.
#[inline(always)]
fn columns<L: Real>(north: Vec3<L>, down: Vec3<L>) -> Mat3<L> {
    let z = L::from(0.0);
    Mat3([
        [north[0], z, down[0]],
        [north[1], z, down[1]],
        [north[2], z, down[2]],
    ])
}

/// (∂g/∂lat, ∂g/∂(down)) of the down component, by differences of the model itself: the step is exact
/// enough (second order, 1e-9 relative) and follows whatever gravity model is in use.
#[inline(always)]
fn gravity_gradient<L: Real>(ins: &Strapdown<L>, s: L, c: L) -> (L, L) {
    // The rounding of g over this step, 1e-15/1e-5, is 1e-9 of the derivative, its truncation less. In height
    // the series is quadratic, and a central difference exact for any step.
    const STEP_RAD: f64 = 1e-5;
    const STEP_M: f64 = 100.0;
    let (model, h) = (ins.gravity(), ins.h);
    let north = gravity_down(model, s + c * STEP_RAD, h) - gravity_down(model, s - c * STEP_RAD, h);
    let down = gravity_down(model, s, h + -STEP_M) - gravity_down(model, s, h + STEP_M);
    (north * (0.5 / STEP_RAD), down * (0.5 / STEP_M))
}

// The transition of the error state from one instant to a later one, dense: what a smoother goes back by. The
// filter itself never needs it.

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
    pub(super) fn step<W: Wide>(&mut self, map: &impl ErrorMap<W>, sources: &BiasBlocks<'_>) {
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
        super::apply_pending_earth_step(self);
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
#[path = "covariance_tests.rs"]
mod covariance_tests;

#[cfg(test)]
mod transition_tests {
    use super::*;
    use crate::ekf::tests::{gauss_markov_model, manoeuvre, predict};
    use crate::ekf::{CoefficientKind, apply_pending_earth_step};
    use crate::imu::Sensor;
    use crate::tests::*;

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
        let mut filter_model =
            FilterModel::new(&gauss_markov_model(), FilterStates::Reduced21, 1.0, 800.0)
                .unwrap()
                .with_initial(&turn_on);
        filter_model.set_unknown(
            Sensor::Accel,
            CoefficientKind::Drift,
            DVec3::new(1e-6, 2e-6, 3e-6),
        );
        let start = state([150.0, -50.0, 0.5]);
        let nominal = Strapdown::new(&start, GravityModel::Wgs84);
        let mut filters =
            [0, 1].map(|_| Ekf::new(nominal, &filter_model, &start, &InitialSettings::default()));
        let correlated = correlated(&filters[0].p.lane(0));
        filters[0].p.set_lane(0, &correlated);
        filters.iter_mut().for_each(Ekf::keep_transition);
        let before = filters[0].p.lane(0) - filters[1].p.lane(0);
        for filter in &mut filters {
            for k in 0..137 {
                let (omega, f) = manoeuvre(f64::from(k) * 0.01);
                predict(filter, omega, f);
            }
            apply_pending_earth_step(filter);
        }
        let phi = filters.each_mut().map(Ekf::take_transition);
        assert_eq!(phi[0], phi[1]);
        let [p, q] = filters.each_ref().map(|filter| filter.p.lane(0));
        let (found, expected) = (&p - &q, &phi[0] * before * phi[0].transpose());
        assert_eq!(found.nrows(), 27);
        for (i, j) in (0..27).flat_map(|i| (0..27).map(move |j| (i, j))) {
            let scale = ((p[(i, i)] + q[(i, i)]) * (p[(j, j)] + q[(j, j)])).sqrt();
            assert_abs_diff_eq!(found[(i, j)], expected[(i, j)], epsilon = 1e-12 * scale);
        }
        assert_eq!(filters[0].take_transition(), DMatrix::identity(27, 27));
    }
}
