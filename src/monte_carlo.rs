//! All runs: lane batches over threads, reduced in run order.
