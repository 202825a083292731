//! ASEE, RMSE, NEES, coverage, errors at the end of outages.
