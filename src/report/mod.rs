//! Tables and files from results; computes no statistic.
