//! How long each case of a study takes: tried on a small picture as far as there is time, guessed from its neighbours where there is none.

use std::time::Instant;

use super::measure::{Bench, Pace};
use super::run::StudyError;
use super::settings::{Case, REFERENCES, reference};

/// Share of a budget that may go into finding out how long settings take.
const FOR_PROBES: f64 = 0.15;

/// What a value is taken to need more than the one before it, where it is not tried.
const STEP: f64 = 1.6;

/// Times of cases and references.
pub(super) struct Paces {
    /// Of a render, in the order of the cases.
    pub cases: Vec<Pace>,
    /// Of a pass, from the coarsest reference to the finest.
    pub references: Vec<Pace>,
}

impl Paces {
    /// Where no time is asked for: each render counts the same.
    pub fn alike(cases: &[Case]) -> Self {
        let same = Pace { before: 1.0, pixel: 0.0 };
        Self { cases: vec![same; cases.len()], references: vec![same; REFERENCES.len()] }
    }
}

/// Tries the scene as it is, references and then cases, the cheap ends of all settings first.
pub(super) fn probe(bench: &mut Bench<'_>, cases: &[Case], budget: f64) -> Result<Paces, StudyError> {
    let begin = Instant::now();
    let left = || FOR_PROBES * budget - begin.elapsed().as_secs_f64();
    let facts = bench.facts().clone();
    let default = bench.probe(&[])?;
    let mut references: Vec<Pace> = Vec::new();
    for values in REFERENCES {
        let guess = references.last().copied().unwrap_or(default).times(STEP);
        let tried = references.is_empty() || guess.of(bench.probed()) < 0.5 * left();
        references.push(if tried { bench.probe(&reference(&facts, values))? } else { guess });
    }
    let ladders = ladders(cases);
    let mut paces = vec![default; cases.len()];
    let most = ladders.iter().map(Vec::len).max().unwrap_or(0);
    for (step, ladder) in (0..most).flat_map(|step| ladders.iter().map(move |ladder| (step, ladder))) {
        let Some(&index) = ladder.get(step).filter(|&&index| index > 0) else { continue };
        let guess = step.checked_sub(1).map_or(default, |before| paces[ladder[before]].times(STEP));
        paces[index] = if guess.of(bench.probed()) < left() { bench.probe(&cases[index].set)? } else { guess };
        bench.advance();
    }
    Ok(Paces { cases: paces, references })
}

/// Numbers of the cases of each setting, in their order.
fn ladders(cases: &[Case]) -> Vec<Vec<usize>> {
    let mut ladders: Vec<Vec<usize>> = Vec::new();
    for (index, case) in cases.iter().enumerate() {
        match ladders.last_mut() {
            Some(ladder) if cases[ladder[0]].setting == case.setting => ladder.push(index),
            _ => ladders.push(vec![index]),
        }
    }
    ladders
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ladders_are_the_settings() {
        let case = |setting: &str| Case { setting: setting.to_owned(), value: String::new(), set: Vec::new() };
        let cases = ["default", "knob igloo", "knob igloo", "layers", "layers", "faces"].map(case);
        assert_eq!(ladders(&cases), [vec![0], vec![1, 2], vec![3, 4], vec![5]]);
    }
}
