//! The programs that are known.

use super::layout::Layout;
use super::{autopilots, filters, gazebo, lidar, simulators, vision};
use nav_sim_signal::noise::practical::Bias;

/// A program that parameters are written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// Kalibr, imu.yaml.
    Kalibr,
    /// `OpenVINS`, `kalibr_imu_chain.yaml`.
    OpenVins,
    /// VINS-Mono and VINS-Fusion.
    Vins,
    /// GTSAM, `PreintegrationCombinedParams`.
    Gtsam,
    /// LIO-SAM.
    LioSam,
    /// FAST-LIO2 and FAST-LIVO2.
    FastLio,
    /// Covariances of `sensor_msgs/Imu`.
    RosImuCovariance,
    /// PX4, EKF2.
    Px4,
    /// `ArduPilot`, EKF3.
    ArduPilot,
    /// KF-GINS.
    KfGins,
    /// `NaveGo`.
    NaveGo,
    /// PSINS.
    Psins,
    /// gnss-ins-sim.
    GnssInsSim,
    /// pyins.
    Pyins,
    /// MATLAB, `imuSensor`.
    Matlab,
    /// Gazebo, SDF.
    Gazebo,
}

nav_sim_signal::named!(
    Target {
        Kalibr = "kalibr",
        OpenVins = "openvins",
        Vins = "vins",
        Gtsam = "gtsam",
        LioSam = "lio-sam",
        FastLio = "fast-lio",
        RosImuCovariance = "ros-imu-covariance",
        Px4 = "px4",
        ArduPilot = "ardupilot",
        KfGins = "kf-gins",
        NaveGo = "navego",
        Psins = "psins",
        GnssInsSim = "gnss-ins-sim",
        Pyins = "pyins",
        Matlab = "matlab",
        Gazebo = "gazebo",
    }
);

impl Target {
    /// What it takes a bias for.
    pub(super) const fn bias(self) -> Bias {
        self.layout().bias
    }

    /// Whether it flies a vehicle, whose vibration no static recording holds.
    pub(super) const fn is_autopilot(self) -> bool {
        matches!(self, Self::Px4 | Self::ArduPilot)
    }

    pub(super) const fn layout(self) -> Layout {
        match self {
            Self::Kalibr => vision::KALIBR,
            Self::OpenVins => vision::OPENVINS,
            Self::Vins => vision::VINS,
            Self::Gtsam => vision::GTSAM,
            Self::LioSam => lidar::LIO_SAM,
            Self::FastLio => lidar::FAST_LIO,
            Self::RosImuCovariance => lidar::ROS_IMU_COVARIANCE,
            Self::Px4 => autopilots::PX4,
            Self::ArduPilot => autopilots::ARDUPILOT,
            Self::KfGins => filters::KF_GINS,
            Self::NaveGo => filters::NAVEGO,
            Self::Psins => filters::PSINS,
            Self::Pyins => filters::PYINS,
            Self::GnssInsSim => simulators::GNSS_INS_SIM,
            Self::Matlab => simulators::MATLAB,
            Self::Gazebo => gazebo::GAZEBO,
        }
    }
}
