//! F: how a point turns the light that arrives into light towards the eye, geometry term included (paper, Eq. 5).
//!
//! Every F is per steradian of the incoming direction, with its cosine or sine inside.

pub mod fibre;
pub mod kajiya_kay;
pub mod lambert;
pub mod marschner;

pub use fibre::{Faces, Fibre, Sampled, StrandPoint};
pub use kajiya_kay::{DiffuseFibre, Highlight, KajiyaKay, KajiyaKayFibre};
pub use lambert::Lambert;
pub use marschner::Marschner;
