//! The sources of the formulas, one documented item each, so that rustdoc checks every citation.

macro_rules! sources {
    ($($(#[$doc:meta])* $name:ident;)*) => { $($(#[$doc])* #[derive(Debug)] pub enum $name {})* };
}

sources! {
    /// C. Minaretzis, D. A. Cucci, N. El-Sheimy, M. G. Sideris, S. Guerrier, M.-P. Victoria-Feser:
    /// *Robust Multi-signal Estimation Framework with Applications to Inertial Sensor Stochastic
    /// Calibration*, 2024 (AWV, SR-AWV, DR-AWV; the navigation study).
    Minaretzis24;
    /// G. Bakalli et al.: *Multi-signal approaches for repeated sampling schemes in inertial sensor
    /// calibration*, IEEE Trans. Signal Processing 71, 2023 (AWV).
    Bakalli23;
    /// S. Guerrier, J. Skaloud, Y. Stebler, M.-P. Victoria-Feser: *Wavelet-variance-based estimation for
    /// composite stochastic processes*, JASA 108, 2013 (GMWM).
    Guerrier13;
    /// S. Guerrier, R. Molinari, M.-P. Victoria-Feser, H. Xu: *Robust two-step wavelet-based inference for
    /// time series models*, JASA, 2021 (RGMWM).
    Guerrier21;
    /// S. Guerrier, R. Molinari, Y. Stebler: *Theoretical limitations of Allan variance-based regression
    /// for time series model estimation*, IEEE Signal Processing Letters 23, 2016 (AVLR).
    Guerrier16;
    /// N. J. Kasdin: *Discrete simulation of colored noise and stochastic processes and 1/f^α power law noise generation*,
    /// Proceedings of the IEEE 83, 1995.
    Kasdin95;
    /// D. Mondal, D. B. Percival: *Wavelet variance analysis for gappy time series*, Annals of the Institute of Statistical
    /// Mathematics 62, 2010.
    MondalPercival10;
    /// D. Mondal, D. B. Percival: *M-estimation of wavelet variance*, Ann. Inst. Stat. Math. 64, 2012.
    MondalPercival12;
    /// D. B. Percival: *On estimation of the wavelet variance*, Biometrika 82, 1995.
    Percival95;
    /// D. A. Cucci, L. Voirol, M. Khaghani, S. Guerrier: *On performance evaluation of inertial navigation
    /// systems: the case of stochastic calibration*, IEEE Trans. Instrum. Meas., 2023.
    Cucci23;
    /// P. D. Groves: *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*,
    /// 2nd ed., Artech House, 2013.
    Groves13;
    /// P. G. Savage: *Strapdown inertial navigation integration algorithm design*, J. Guidance, Control
    /// and Dynamics 21, 1998 (parts 1 and 2).
    Savage98;
    /// H. E. Rauch, F. Tung, C. T. Striebel: *Maximum likelihood estimates of linear dynamic systems*, AIAA Journal 3,
    /// 1965 (the smoother).
    Rauch65;
    /// I. Skog, P. Händel, J.-O. Nilsson, J. Rantakokko: *Zero-velocity detection: an algorithm evaluation*, IEEE Trans.
    /// Biomedical Engineering 57, 2010.
    Skog10;
    /// S. Särkkä: *Bayesian Filtering and Smoothing*, Cambridge University Press, 2013.
    Sarkka13;
    /// L. Ljung: *System Identification: Theory for the User*, 2nd ed., Prentice Hall, 1999 (prediction-error method).
    Ljung99;
    /// R. K. Mehra: *On the identification of variances and adaptive Kalman filtering*, IEEE Trans. Automatic Control 15, 1970.
    Mehra70;
    /// NIMA TR8350.2: *Department of Defense World Geodetic System 1984*, 3rd ed., 2000.
    Wgs84;
    /// P. S. Maybeck: *Stochastic Models, Estimation, and Control*, vol. 1, Academic Press, 1979.
    Maybeck79;
    /// J. P. Imhof: *Computing the distribution of quadratic forms in normal variables*, Biometrika 48, 1961.
    Imhof61;
    /// J. A. C. Weideman, L. N. Trefethen: *Parabolic and hyperbolic contours for computing the Bromwich integral*,
    /// Math. Comp. 76, 2007.
    WeidemanTrefethen07;
    /// B. R. Bowring: *Transformation from spatial to geographical coordinates*, Survey Review 23, 1976.
    Bowring76;
    /// C. F. van Loan: *Computing integrals involving the matrix exponential*, IEEE TAC 23, 1978.
    VanLoan78;
    /// C. L. Lawson, R. J. Hanson: *Solving Least Squares Problems*, 1974 (NNLS).
    LawsonHanson74;
    /// Y. Bar-Shalom, X. R. Li, T. Kirubarajan: *Estimation with Applications to Tracking and
    /// Navigation*, Wiley, 2001 (NEES, NIS).
    BarShalom01;
    /// R. C. Paule, J. Mandel: *Consensus values and weighting factors*, J. Res. National Bureau of Standards 87, 1982.
    PauleMandel82;
    /// W. Viechtbauer: *Confidence intervals for the amount of heterogeneity in meta-analysis*, Statistics in Medicine 26, 2007.
    Viechtbauer07;
    /// J. J. Moré: *The Levenberg-Marquardt algorithm: implementation and theory*, Numerical Analysis, Lecture Notes in
    /// Mathematics 630, 1978.
    More78;
    /// J. Solà, J. Deray, D. Atchuthan: *A micro Lie theory for state estimation in robotics*, arXiv 1812.01537, 2018.
    Sola18;
    /// S. Goffin, S. Bonnabel, O. Brüls, P. Sacré: *Iterated Invariant Extended Kalman Filter (IterIEKF)*, arXiv
    /// 2404.10665, 2024.
    Goffin24;
    /// D. J. Best, D. E. Roberts: *Algorithm AS 91: The percentage points of the χ² distribution*, Applied Statistics 24,
    /// 1975.
    BestRoberts75;
    /// H. E. Daniels: *Tail probability approximations*, International Statistical Review 55, 1987.
    Daniels87;
    /// R. Ibragimov, U. K. Müller: *t-Statistic based correlation and heterogeneity robust inference*, J. Business and Economic
    /// Statistics 28, 2010.
    IbragimovMuller10;
    /// A. C. Davison, D. V. Hinkley: *Bootstrap Methods and their Application*, Cambridge University Press, 1997.
    DavisonHinkley97;
    /// R. B. Davies: *Hypothesis testing when a nuisance parameter is present only under the alternative*, Biometrika 64,
    /// 1977.
    Davies77;
    /// G. E. P. Box, M. E. Muller: *A note on the generation of random normal deviates*, Ann. Math. Stat. 29, 1958.
    BoxMuller58;
    /// D. Blackman, S. Vigna: *Scrambled linear pseudorandom number generators*, ACM Trans. Mathematical Software 47, 2021
    /// (xoshiro256++).
    Blackman21;
    /// IEEE Std 952-1997 (and 647): *Specification Format Guide and Test Procedure for Single-Axis
    /// Interferometric Fiber Optic Gyros* (Allan variance of the noise terms).
    Ieee952;
}
