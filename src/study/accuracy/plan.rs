//! Fits a study to a time: the fineness of its reference and its pictures' size. Which cases are left out is seen when the time is up; how many
//! are expected to be decides the size.

use serde::{Deserialize, Serialize};

use super::measure::Pace;

/// The least pixels of a picture: errors of fewer say nothing.
const LEAST: f64 = 576.0;

/// Share of a budget that renders may take: pictures are also compared and written.
const FOR_RENDERS: f64 = 0.85;

/// Share of it for the reference, where a coarser one is to be had.
const FOR_REFERENCE: f64 = 0.4;

/// Share of a budget that is kept for the reference: what that does not tell no case can.
pub(super) const LEFT_FOR_REFERENCE: f64 = 0.25;

/// What is gained by larger pictures: of this power of their pixels, against a number of cases. Cases that take a time a pixel are worth more than pixels
/// by it, those that take long before the first pixel less.
const OF_PIXELS: f64 = 0.4;
/// What a coarser reference leaves of the worth of all cases, and what a single render of each does.
const COARSER: f64 = 0.9;
const ONCE: f64 = 0.7;

/// Passes of the reference that are planned for, both halves together.
pub(super) const REFERENCE_PASSES: u32 = 4;

/// What is to be rendered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Plan {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Cases that are not expected to fit, by their numbers.
    pub left_out: Vec<usize>,
    /// Wall seconds that all renders are expected to take.
    pub seconds: f64,
    /// Which of the references.
    pub reference: usize,
    /// Renders of each case.
    pub repeats: u32,
    /// What was cut, in words.
    pub cut: Vec<String>,
}

/// What is wished for.
pub(super) struct Wish<'a> {
    /// The largest pictures.
    pub size: [u32; 2],
    /// Whether they are a part of a picture, whose pixels stay as they are.
    pub crop: bool,
    /// Of a render.
    pub cases: &'a [Pace],
    /// Of a pass, from the coarsest to the finest that is of use.
    pub references: &'a [Pace],
    pub repeats: u32,
    /// So many cases at the front are never left out.
    pub kept: usize,
    pub budget: Option<f64>,
}

impl Wish<'_> {
    fn pixels(&self) -> f64 {
        f64::from(self.size[0]) * f64::from(self.size[1])
    }

    fn of_reference(&self, place: usize) -> Pace {
        let pace = self.references[place];
        Pace { before: pace.before, pixel: pace.pixel * f64::from(REFERENCE_PASSES) }
    }

    /// Wall seconds of the reference: what its passes take that are planned for, or what is kept for more of them.
    fn seconds_of_reference(&self, place: usize, pixels: f64) -> f64 {
        let kept = LEFT_FOR_REFERENCE * self.budget.unwrap_or(0.0);
        self.of_reference(place).of(pixels).max(kept)
    }

    /// Wall seconds of all renders but for some.
    fn seconds(&self, reference: usize, repeats: u32, left_out: &[usize], pixels: f64) -> f64 {
        let cases = (0..self.cases.len()).filter(|i| !left_out.contains(i)).map(|i| self.cases[i].of(pixels));
        self.seconds_of_reference(reference, pixels) + f64::from(repeats) * cases.sum::<f64>()
    }

    /// The finest reference that keeps to its share.
    fn reference(&self, time: f64, pixels: f64) -> usize {
        let fits = |place: &usize| self.of_reference(*place).of(pixels) < FOR_REFERENCE * time;
        (0..self.references.len()).rev().find(fits).unwrap_or(0)
    }

    /// What does not fit at a size: all but the cheapest that do.
    fn left_out(&self, time: f64, reference: usize, repeats: u32, pixels: f64) -> Vec<usize> {
        let price = |i: usize| f64::from(repeats) * self.cases[i].of(pixels);
        let mut left = time - self.seconds_of_reference(reference, pixels) - (0..self.kept).map(price).sum::<f64>();
        let mut order: Vec<usize> = (self.kept..self.cases.len()).collect();
        order.sort_by(|&a, &b| price(a).total_cmp(&price(b)));
        let mut left_out = order.split_off(
            order
                .iter()
                .take_while(|&&i| {
                    left -= price(i);
                    left >= 0.0
                })
                .count(),
        );
        left_out.sort_unstable();
        left_out
    }

    /// The plan.
    pub fn plan(&self) -> Plan {
        let (whole, finest) = (self.pixels(), self.references.len() - 1);
        let Some(budget) = self.budget else {
            let (size, repeats, left_out, cut) = (self.size, self.repeats, Vec::new(), Vec::new());
            let seconds = self.seconds(finest, repeats, &[], whole);
            return Plan { size, left_out, seconds, reference: finest, repeats, cut };
        };
        let time = FOR_RENDERS * budget;
        let mut best: Option<(f64, Plan)> = None;
        // Of equal worth the first: the larger picture, and all repetitions.
        for step in 0.. {
            let scale = 0.95_f64.powi(step);
            let size = self.size.map(|side| ((f64::from(side) * scale).round() as u32).max(1));
            let pixels = f64::from(size[0]) * f64::from(size[1]);
            if step > 0 && pixels < LEAST {
                break;
            }
            let reference = self.reference(time, pixels);
            for repeats in if self.repeats > 1 { vec![self.repeats, 1] } else { vec![1] } {
                let left_out = self.left_out(time, reference, repeats, pixels);
                let seconds = self.seconds(reference, repeats, &left_out, pixels);
                let worth = (self.cases.len() - left_out.len()) as f64
                    * pixels.powf(OF_PIXELS)
                    * COARSER.powi((finest - reference) as i32)
                    * if repeats < self.repeats { ONCE } else { 1.0 }
                    // Where not even what is kept fits, nothing but time counts.
                    * (time / seconds).min(1.0).powi(4);
                if best.as_ref().is_none_or(|(most, _)| worth > *most) {
                    best = Some((worth, Plan { size, left_out, seconds, reference, repeats, cut: Vec::new() }));
                }
            }
        }
        let mut plan = best.map_or_else(|| Wish { budget: None, ..*self }.plan(), |(_, plan)| plan);
        plan.cut = self.cut(&plan);
        plan
    }

    /// What was cut, in words; the cases that are left out in the end are known only then.
    fn cut(&self, plan: &Plan) -> Vec<String> {
        let [from, to] = [self.size, plan.size].map(|[w, h]| format!("{w}x{h}"));
        if from == to {
            Vec::new()
        } else if self.crop {
            vec![format!("pictures are of the middle {to} pixels in place of {from}")]
        } else {
            vec![format!(
                "pictures are of {to} pixels in place of {from}: a pixel sees more hair, so layers err by more"
            )]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHEAP: Pace = Pace { before: 0.1, pixel: 1e-4 };
    const DEAR: Pace = Pace { before: 0.1, pixel: 1e-1 };
    const SLOW_START: Pace = Pace { before: 10.0, pixel: 1e-4 };
    const REFERENCE: Pace = Pace { before: 1.0, pixel: 1e-3 };

    fn of(cases: &[Pace], references: &[Pace], budget: Option<f64>) -> Plan {
        Wish { size: [512, 256], crop: false, cases, references, repeats: 2, kept: 1, budget }.plan()
    }

    #[test]
    fn without_a_budget_nothing_is_cut() {
        let plan = of(&[CHEAP, DEAR], &[CHEAP, REFERENCE], None);
        assert_eq!((plan.size, plan.left_out.len(), plan.cut.len(), plan.reference), ([512, 256], 0, 0, 1));
        assert!((plan.seconds - (1.4 + 131_072.0 * (4e-3 + 2e-4 + 2e-1))).abs() < 1.0, "{plan:?}");
    }

    #[test]
    fn pictures_shrink_before_the_dearest_goes() {
        let plan = of(&[CHEAP, CHEAP], &[REFERENCE], Some(60.0));
        assert!(plan.left_out.is_empty() && plan.size[0] < 512 && plan.seconds <= 60.0, "{plan:?}");
        assert!((f64::from(plan.size[0]) / f64::from(plan.size[1]) - 2.0).abs() < 0.05, "{plan:?}");
        assert_eq!(plan.cut.len(), 1);
        let plan = of(&[CHEAP, DEAR, CHEAP], &[REFERENCE], Some(60.0));
        assert_eq!(plan.left_out, [1]);
        assert!(plan.cut.len() == 1 && plan.seconds <= 60.0, "{plan:?}");
    }

    #[test]
    fn cheap_cases_stay_where_leaving_them_out_cannot_help() {
        // What is kept takes all of the time already: nothing is gained by others, and nothing lost by few pixels.
        let plan = of(&[DEAR, CHEAP, CHEAP], &[REFERENCE], Some(10.0));
        assert!(f64::from(plan.size[0] * plan.size[1]) < 1.2 * LEAST, "{plan:?}");
        // The reference takes most of it.
        let slow = Pace { before: 1.0, pixel: 1e-2 };
        let plan = of(&[CHEAP, CHEAP, SLOW_START], &[slow], Some(30.0));
        assert_eq!(plan.left_out, [2]);
        let plan = of(&[CHEAP, CHEAP], &[REFERENCE, Pace { before: 100.0, ..slow }], Some(60.0));
        assert_eq!((plan.reference, plan.left_out.len()), (0, 0));
    }

    #[test]
    fn many_cheap_cases_are_none_too_many() {
        let plan = of(&[CHEAP; 60], &[REFERENCE], Some(60.0));
        assert!(plan.left_out.len() <= 2 && plan.repeats == 2 && plan.seconds <= 60.0, "{plan:?}");
        // One among them that takes a third of the time goes for the sake of all others' pixels.
        let plan = of(&[&[CHEAP; 25][..], &[SLOW_START]].concat(), &[REFERENCE], Some(60.0));
        assert_eq!((plan.left_out, plan.repeats), (vec![25], 2));
        // Each takes a second before its first pixel: once each, and still more than half of them.
        let plan = of(&[Pace { before: 1.0, pixel: 1e-4 }; 60], &[REFERENCE], Some(75.0));
        assert!(plan.left_out.len() < 30 && plan.repeats == 1 && plan.seconds <= 75.0, "{plan:?}");
    }

    #[test]
    fn a_share_of_the_time_is_kept_for_the_reference() {
        // Half a second each at any size, and a reference that takes next to nothing: 24 of 40 s are left for them, 10 kept, 6 not planned with.
        let plan = of(&[Pace { before: 0.5, pixel: 0.0 }; 100], &[Pace { before: 0.1, pixel: 0.0 }], Some(40.0));
        assert_eq!((plan.repeats, 100 - plan.left_out.len()), (1, 48), "{plan:?}");
    }
}
