//! The error-state extended Kalman filter (loosely coupled INS/GNSS).
