//! The same numbers whatever the processor can do.

use super::estimators::{Way, Ways};
use super::{Error, Measured, Outcome, hard};
use crate::occlusion::{Instructions, Span};

/// The tree's Γ̄ with each set of instructions that this processor has against the baseline's: the same bits.
///
/// # Errors
/// Embree's own.
pub fn instructions() -> Result<Vec<Outcome>, Error> {
    let mut different = vec![0_u32; Instructions::available().len()];
    let mut cases = 0;
    for hard in hard::all() {
        let ways = Ways::new(&hard.model)?;
        for receiver in &hard.receivers {
            for span in [Span::Sphere, Span::Hemisphere] {
                let of = |set| ways.faces(Way::Clusters, receiver, span, Some(set));
                let want = of(Instructions::Baseline);
                cases += want.len() as u32;
                for (set, different) in Instructions::available().into_iter().zip(&mut different) {
                    let unlike = |(a, b): (&f32, &f32)| a.to_bits() != b.to_bits();
                    *different += of(set).iter().zip(&want).filter(|&(a, b)| unlike((a, b))).count() as u32;
                }
            }
        }
    }
    let outcome = |(set, different): (Instructions, u32)| {
        let measured = Measured { error: f64::from(different), bound: 0.0 };
        Outcome { cases, ..Outcome::one(format!("machine: {set:?} as Baseline, faces that differ"), measured) }
    };
    Ok(Instructions::available().into_iter().zip(different).map(outcome).collect())
}
