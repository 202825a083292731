//! The IMU that a limit needs, what a given one makes of it, and a ranking of several.

mod given;
mod job;
mod needed;
mod question;
mod ranking;

pub(crate) use job::{Ask, CatalogueUnit, Misplaced, Requirements};
pub(crate) use ranking::stated_in_words;
