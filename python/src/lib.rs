//! The native module of the Python package nav-sim: requests in, answers out. What users see is in `nav_sim/*.py`.

mod answer;
mod error;
mod model;
mod request;
mod study;
mod table;
mod wavelet;
mod work;

#[pyo3::pymodule(name = "_native", gil_used = false)]
mod native {
    #[pymodule_export]
    use crate::answer::Answer;
    #[pymodule_export]
    use crate::model::{model_contents, model_practical, model_recording, model_wavelet};
    #[pymodule_export]
    use crate::request::{answer, main, toml};
    #[pymodule_export]
    use crate::study::study_run;
    #[pymodule_export]
    use crate::table::columns;
    #[pymodule_export]
    use crate::wavelet::wavelet;
}
