//! Strapdown mechanisation on WGS-84, eight runs at a time.
