//! Sensors along a trajectory: ideal IMU, its errors, GNSS, outages.
