#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| nav_sim_logs::fuzz::ulog(bytes));
