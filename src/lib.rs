//! **nav-sim**: an INS/GNSS navigation simulator with a robust stochastic-calibration front end.
//!
//! Static recordings (replicates) → robust wavelet variance → one noise model → Monte-Carlo INS/GNSS navigation →
//! comparison of estimators by their effect on the navigation solution.
//!
//! # Notation
//! Units are SI and radians inside; in files, flags and reports the unit is in the name (`lat_deg`,
//! `pos_sigma_m`). Frames are in the name: `f_ib_b` is the specific force of b with respect to i, written
//! in b; `q_b_n` and `C_b_n` take b and return n. n = North-East-Down, b = front-right-down,
//! e = Earth-centred Earth-fixed (WGS-84).
//!
//! | name | meaning |
//! |---|---|
//! | `phi` | AR(1) coefficient, nothing else |
//! | `Phi` | transition matrix |
//! | `lat`, `lon`, `h` | geodetic latitude, longitude (rad), ellipsoidal height (m) |
//! | `roll`, `pitch`, `yaw` | attitude (ZYX); `psi_n` is the attitude *error* rotation vector in n |
//! | `tau` | wavelet scale in samples, 2^j; `t_corr_s` a correlation time |
//! | `sigma2` | white or innovation variance per sample; `gamma2` random-walk increment variance; `q2` is Q² |
//! | `omega` | angular rate; a drift is a `slope` |
//! | `psd` | two-sided, units²/Hz |
//!
//! # Architecture
//! Three crates hold the mathematics, this one the files, words and commands. `nav-sim-signal` (noise, wavelet
//! variance) is the lowest. `nav-sim-calibration` (recordings → model) and `nav-sim-navigation` (trajectory → errors)
//! both depend on it and cannot import each other: they meet in [`noise::Model`]. What a user needs of them is listed
//! below by name, so that `nav_sim::ekf`, for example, is the only path a user needs; this crate itself names theirs.
//! Within a crate a module names only modules above it in the list of its `lib.rs`, as `tests/layering.rs` checks.
//! Nothing below the command line reads a clock, the environment, a terminal or a source of randomness: generators
//! and seeds are arguments.
//!
//! What a command does is one call in [`jobs`]: it takes files and returns results, and reports remarks as values.
//!
//! The division into crates also shortens compilation: a changed line in the filter recompiles `nav-sim-navigation`
//! and the crates that depend on it. Its unit tests are `cargo test -p nav-sim-navigation`.

/// Noise processes, models of six axes, virtual IMUs and contaminations.
pub mod noise {
    #[doc(inline)]
    pub use nav_sim_signal::noise::{
        Ar1, Composite, Drift, Flicker, GaussMarkov, Kind, Law, Ma1, Model, Parameter, ParameterError,
        ParameterRef, Process, Quantization, RandomWalk, ReplicateError, Spread, SpreadError, Synthesizer,
        Variation, VirtualImu, White, continuous::RateError, reduction::ReductionError,
    };

    /// Outliers and other defects, put into recordings by rules.
    pub mod contamination {
        #[doc(inline)]
        pub use nav_sim_signal::noise::contamination::{
            Contamination, ContaminationError, Extent, Operation, RefusedRule, Rule,
        };
    }

    /// The few parameters that filters and data sheets ask for: N, B, K and a Gauss-Markov process.
    pub mod practical {
        #[doc(inline)]
        pub use nav_sim_signal::noise::practical::{
            AxisParameters, CorrelatedProcess, Markov, Minimum, Pair,
        };
    }
}

/// Wavelet variance of a signal: classical and robust.
pub mod wavelet {
    #[doc(inline)]
    pub use nav_sim_signal::wavelet::{
        Convention, Curve, QuantizationResponse, RobustVariance, Status, Tuning, WaveletError, both,
        classical,
    };
}

/// Names and samples of the six channels, and recordings of them.
pub mod imu {
    #[doc(inline)]
    pub use nav_sim_signal::imu::{Axis, Channel, ImuIncrement, ImuSample, Recording, Sensor, Signal};
}

/// Streams of random numbers, each with a key of its own.
pub mod rng {
    #[doc(inline)]
    pub use nav_sim_signal::rng::{Generator, StreamKey};
}

/// From replicate recordings to one noise model.
pub mod calibration {
    #[doc(inline)]
    pub use nav_sim_calibration::{
        Advance, AnticipationError, AverageError, AxesDiffer, Bootstrap, CalibrationError, Candidate, Cause,
        Change, Departure, Estimator, Fit, FitError, FitRange, Goodness, Group, Indistinct, Inference,
        LevelSpread, LimitError, MeansOfAxis, Miss, ModelChoice, ModelSpec, Outcome, ParameterInterval,
        ParameterLimit, Pool, Practical, PracticalIntervals, Ranking, Replicate, Scope, Settings,
        SignalError, SpecError, Termination, TooSimple, Trim, TrimError, TurnOnFinding, TurnOnSpread,
        Undetermined, WarmUp, Weighting, average, calibrate, fit, fit_curve, grouped, implied, infer,
        model_of, replicates,
    };
}

/// Monte-Carlo studies of the estimators themselves.
pub mod efficiency {
    #[doc(inline)]
    pub use nav_sim_calibration::efficiency::{Design, Estimate, StudyError, Target, target};
}

/// Positions, velocities and attitudes.
pub mod frames {
    #[doc(inline)]
    pub use nav_sim_navigation::frames::{NavState, RollPitchYaw};
}

/// Gravity on the ellipsoid WGS-84.
pub mod earth {
    #[doc(inline)]
    pub use nav_sim_navigation::earth::GravityModel;
}

/// GNSS fixes.
pub mod gnss {
    #[doc(inline)]
    pub use nav_sim_navigation::gnss::{GnssFix, GnssVelocity};
}

/// Reference trajectories, of samples or of a motion profile.
pub mod trajectory {
    #[doc(inline)]
    pub use nav_sim_navigation::trajectory::{Error, Kinematics, Trajectory, TrajectorySample};

    /// Motion profiles: segments such as straight, turn, climb.
    pub mod profile {
        #[doc(inline)]
        pub use nav_sim_navigation::trajectory::profile::{
            Acceleration, Bank, Error, Kind, Length, Place, Problem, Profile, Segment, Start, Turning,
            Waypoint,
        };
    }

    /// A reference trajectory at the times of a recording.
    pub mod reference {
        #[doc(inline)]
        pub use nav_sim_navigation::trajectory::reference::Reference;
    }
}

/// What the sensors measure along a trajectory.
pub mod sensors {
    /// Barometric height.
    pub mod baro {
        #[doc(inline)]
        pub use nav_sim_navigation::sensors::baro::BaroSettings;
    }
    /// Turn-on biases, scale factors and misalignments of the IMU.
    pub mod defects {
        #[doc(inline)]
        pub use nav_sim_navigation::sensors::defects::ImuSettings;
    }
    /// Errors and lever arm of the receiver.
    pub mod gnss {
        #[doc(inline)]
        pub use nav_sim_navigation::sensors::gnss::GnssSettings;
    }
    /// An IMU without errors.
    pub mod ideal_imu {
        #[doc(inline)]
        pub use nav_sim_navigation::sensors::ideal_imu::{Error, ideal_imu};
    }
    /// The noise that the true IMU has.
    pub mod imu {
        #[doc(inline)]
        pub use nav_sim_navigation::sensors::imu::{Truth, TruthError};
    }
    /// Windows without fixes.
    pub mod outage {
        #[doc(inline)]
        pub use nav_sim_navigation::sensors::outage::{
            NotAnOutage, Outage, OutageError, OutagePlan, OutageRemark, PeriodicOutages, RandomOutages,
        };
        #[doc(inline)]
        pub use nav_sim_signal::units::SettingError;
    }
}

/// The error-state filter: what it believes and which states it has.
pub mod ekf {
    #[doc(inline)]
    pub use nav_sim_navigation::ekf::{
        Belief, BeliefError, FilterStates, InitialSettings, UnknownKind, belief::BiasGroup,
    };
}

/// One run: true IMU, receiver, filter, and what is kept of it.
pub mod simulation {
    #[doc(inline)]
    pub use nav_sim_navigation::simulation::{
        EpochSums, Experiment, ExperimentError, NEES_DOF, OutageRecord, Plan, REPORTED_NAMES, Recording,
        RunRecord, RunResult, lincov::HeadingDoubt, record,
    };
}

/// Many runs.
pub mod monte_carlo {
    #[doc(inline)]
    pub use nav_sim_navigation::monte_carlo::{run, run_plan};
}

/// Settings of an experiment, as a scenario file states them.
pub mod scenario {
    #[doc(inline)]
    pub use nav_sim_navigation::scenario::{FilterSettings, Method, Reduction, RunSettings, Scenario};
}

/// Errors of many runs in figures: ASEE, RMSE, NEES, drift in outages.
pub mod metrics {
    #[doc(inline)]
    pub use nav_sim_navigation::metrics::{
        AccuracySummary, Agreement, AxisReduction, Budget, ComparisonError, Consistency, Coverage,
        EpochMetrics, Estimate, Expected, FanEpoch, Met, Nis, OutageMetrics, OutageSecondOrder,
        OutageSummary, OutageVerdict, PerState, Quantile, Reconvergence, Recovery, ReductionQuality,
        ReductionSummary, SampleSize, Sensitivities, Spread, StateName, Summary, Verdict, VerdictKind,
        epochs,
    };
}

/// The filter on recorded data.
pub mod fusion {
    #[doc(inline)]
    pub use nav_sim_navigation::fusion::{
        Assessment, Confidence, Displaced, Drift, Farthest, FixRecord, FromReference, FusionError,
        OutageDrift, Outcome, Recorded, Row, RowError, Settings, SmoothedOutage, SmoothedOutcome, Solution,
        Start, Use, Verdict, displaced, fuse, outcome,
    };

    /// Attitude from the data at the start.
    pub mod alignment {
        #[doc(inline)]
        pub use nav_sim_navigation::fusion::alignment::{Alignment, AlignmentError, coarse};
    }

    /// Attitude of the IMU in the vehicle.
    pub mod mounting {
        #[doc(inline)]
        pub use nav_sim_navigation::fusion::mounting::{Mounted, Mounting, MountingError, find};
    }
}

/// The IMU that a limit on the errors needs.
pub mod require {
    #[doc(inline)]
    pub use nav_sim_navigation::require::{
        Answer, Course, Drift, IMU_PARAMETERS, ImuParameters, IsoDrift, Limit, Margins, Need, Part,
        PartMargin, Quantity, RequireError, Worst,
    };
}

// Parameters for other programs.
mod export;
// Which model, on the user's own recordings.
pub mod choose;
// What follows a job.
pub mod observer;
// Words and pages.
pub mod report;
// Files.
pub mod formats;
// The engine of studies.
pub mod study;
// What a command does, as one call.
pub mod jobs;
// All that most programs need.
pub mod prelude;
// Arguments, words and exit codes.
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
pub mod cli;
