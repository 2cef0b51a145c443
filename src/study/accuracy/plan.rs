//! Fits a study to a time: its pictures' size, and what is left out.

use serde::{Deserialize, Serialize};

use super::measure::Pace;

/// The least pixels of a picture that is still worth looking at.
pub(super) const FEWEST_PIXELS: f64 = 2304.0;

/// Share of a budget that renders may take: pictures are also compared and written.
const FOR_RENDERS: f64 = 0.85;

/// Passes of the reference that are planned for, both halves together.
pub(super) const REFERENCE_PASSES: u32 = 4;

/// What is to be rendered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Plan {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Cases that are left out, by their numbers.
    pub left_out: Vec<usize>,
    /// Wall seconds that all renders are expected to take.
    pub seconds: f64,
    /// Settings of the reference.
    pub reference: Vec<String>,
    /// What was cut, in words.
    pub cut: Vec<String>,
}

/// The plan for cases that take `paces` and a reference of `reference`, at most `size` large. The first `kept` cases are never left out.
pub(super) fn plan(
    size: [u32; 2],
    paces: &[Pace],
    names: &[String],
    reference: Pace,
    repeats: u32,
    kept: usize,
    budget: Option<f64>,
) -> Plan {
    let whole = f64::from(size[0]) * f64::from(size[1]);
    let mut left_out: Vec<usize> = Vec::new();
    let cost = |left_out: &[usize]| {
        let fixed = Pace { before: reference.before, pixel: reference.pixel * f64::from(REFERENCE_PASSES) };
        let cases = (0..paces.len()).filter(|i| !left_out.contains(i)).map(|i| paces[i]);
        let n = f64::from(repeats);
        cases.fold(fixed, |sum, pace| Pace { before: sum.before + n * pace.before, pixel: sum.pixel + n * pace.pixel })
    };
    let Some(budget) = budget else {
        return Plan { size, left_out, seconds: cost(&[]).of(whole), reference: Vec::new(), cut: Vec::new() };
    };
    let affordable = |left_out: &[usize]| {
        let cost = cost(left_out);
        (FOR_RENDERS * budget - cost.before) / cost.pixel.max(1e-12)
    };
    let fewest = FEWEST_PIXELS.min(whole);
    while affordable(&left_out) < fewest {
        // The dearest first: it says the least for its time.
        let price = |&i: &usize| paces[i].of(fewest);
        let candidates = (kept..paces.len()).filter(|i| !left_out.contains(i));
        match candidates.max_by(|a, b| price(a).total_cmp(&price(b))) {
            Some(dearest) => left_out.push(dearest),
            None => break,
        }
    }
    let mut cut: Vec<String> =
        left_out.iter().map(|&i| format!("{} was left out: it takes too long for the budget", names[i])).collect();
    let scale = (affordable(&left_out).max(fewest) / whole).sqrt().min(1.0);
    let mut fitted = size;
    if scale < 1.0 {
        fitted = size.map(|side| ((f64::from(side) * scale).floor() as u32).max(1));
        let [from, to] = [size, fitted].map(|[w, h]| format!("{w}x{h}"));
        cut.push(format!("pictures are of {to} pixels in place of {from}"));
    }
    let pixels = f64::from(fitted[0]) * f64::from(fitted[1]);
    Plan { size: fitted, seconds: cost(&left_out).of(pixels), left_out, reference: Vec::new(), cut }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHEAP: Pace = Pace { before: 0.1, pixel: 1e-4 };
    const DEAR: Pace = Pace { before: 0.1, pixel: 1e-1 };

    fn of(paces: &[Pace], budget: Option<f64>) -> Plan {
        let names: Vec<String> = (0..paces.len()).map(|i| format!("case {i}")).collect();
        plan([512, 256], paces, &names, Pace { before: 1.0, pixel: 1e-3 }, 2, 1, budget)
    }

    #[test]
    fn without_a_budget_nothing_is_cut() {
        let plan = of(&[CHEAP, DEAR], None);
        assert_eq!((plan.size, plan.left_out.len(), plan.cut.len()), ([512, 256], 0, 0));
        assert!((plan.seconds - (1.0 + 0.4 + 131_072.0 * (4e-3 + 2e-4 + 2e-1))).abs() < 1.0, "{plan:?}");
    }

    #[test]
    fn pictures_shrink_before_the_dearest_goes() {
        let plan = of(&[CHEAP, CHEAP], Some(60.0));
        assert!(plan.left_out.is_empty() && plan.size[0] < 512 && plan.seconds <= 60.0, "{plan:?}");
        assert!((f64::from(plan.size[0]) / f64::from(plan.size[1]) - 2.0).abs() < 0.05, "{plan:?}");
        assert_eq!(plan.cut.len(), 1);
        let plan = of(&[CHEAP, DEAR, CHEAP], Some(60.0));
        assert_eq!(plan.left_out, [1]);
        assert!(plan.cut[0].contains("case 1") && plan.seconds <= 60.0, "{plan:?}");
        // Not even the first fits: it is done all the same, as small as can be.
        let plan = of(&[DEAR, CHEAP], Some(1.0));
        assert_eq!((plan.left_out, plan.size[0] * plan.size[1] <= 2304), (vec![1], true));
    }
}
