//! Studies of the estimators themselves: from signals of known distribution to the errors of the estimates.
//!
//! [`target()`] is what an estimator aims at when parameters vary between replicates, [`Design::set`] draws
//! one set of replicates and estimates from it, [`accuracy()`] says how far from the target the estimates
//! of many sets are, [`outlier_curve`] and [`abnormal_curve`] how far one outlier or one abnormal
//! replicate moves an estimate.

mod accuracy;
mod design;
mod quadrature;
mod sensitivity;
mod target;

pub use accuracy::{Accuracy, accuracy};
pub use design::{Design, Estimate, StudyError};
pub use sensitivity::{Movement, abnormal_curve, outlier_curve};
pub use target::{Target, target};
