//! Reference trajectories: splines through samples, motion profiles, imports.
