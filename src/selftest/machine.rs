//! The same numbers whatever the processor can do.

use rayon::prelude::*;

use super::estimators::{Way, Ways};
use super::hard::{self, Hard};
use super::{Error, Measured, Outcome};
use crate::occlusion::{Instructions, Span};

/// The tree's Γ̄ with each set of instructions that this processor has against the baseline's: the same bits.
///
/// # Errors
/// Embree's own.
pub fn instructions() -> Result<Vec<Outcome>, Error> {
    let available = Instructions::available();
    let of_case = |hard: Hard| -> Result<(u32, Vec<u32>), Error> {
        let ways = Ways::new(&hard.model)?;
        let (mut cases, mut different) = (0, vec![0_u32; available.len()]);
        for receiver in &hard.receivers {
            for span in [Span::Sphere, Span::Hemisphere] {
                let of = |set| ways.faces(Way::Clusters, receiver, span, Some(set));
                let want = of(Instructions::Baseline);
                cases += want.len() as u32;
                for (&set, different) in available.iter().zip(&mut different) {
                    let unlike = |(a, b): (&f32, &f32)| a.to_bits() != b.to_bits();
                    *different += of(set).iter().zip(&want).filter(|&(a, b)| unlike((a, b))).count() as u32;
                }
            }
        }
        Ok((cases, different))
    };
    let counts: Vec<(u32, Vec<u32>)> = hard::all().into_par_iter().map(of_case).collect::<Result<_, _>>()?;
    let cases = counts.iter().map(|(cases, _)| cases).sum();
    let outcome = |(i, set): (usize, &Instructions)| {
        let different: u32 = counts.iter().map(|(_, different)| different[i]).sum();
        let measured = Measured { error: f64::from(different), bound: 0.0 };
        Outcome { cases, ..Outcome::one(format!("machine: {set:?} as Baseline, faces that differ"), measured) }
    };
    Ok(available.iter().enumerate().map(outcome).collect())
}
