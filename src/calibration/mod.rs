//! From replicate recordings to one noise model: AWV, SR-AWV, DR-AWV, GMWM.
