//! Is the file what was written?
