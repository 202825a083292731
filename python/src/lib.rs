//! The native module of the Python package nav-sim: requests in, answers out. What users see is in `nav_sim/*.py`.

mod error;
mod model;
mod request;
mod wavelet;
mod work;

#[pyo3::pymodule(name = "_native", gil_used = false)]
mod native {
    #[pymodule_export]
    use crate::model::{model_allan, model_contents, model_practical, model_recording};
    #[pymodule_export]
    use crate::request::{Answer, answer, columns, main, study_run, toml};
    #[pymodule_export]
    use crate::wavelet::wavelet;
}
