//! F: how a point turns the light that arrives into light towards the eye, geometry term included (paper, Eq. 5).
//!
//! Every `evaluate` is per steradian of the incoming direction, with its cosine or sine inside.

pub mod kajiya_kay;
pub mod lambert;

pub use kajiya_kay::{Highlight, KajiyaKay};
pub use lambert::Lambert;
