//! Haar wavelet variance of recordings: classical, robust, intervals.
