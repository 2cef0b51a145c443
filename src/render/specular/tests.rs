use super::*;
use glam::Vec3;

fn glimpse(color: Vec3, segment: u32) -> Glimpse {
    Glimpse { found: Found::Hair { segment, u: 0.5 }, color, view: Vec3::Z, length: 1.0 }
}

#[test]
fn a_few_stand_for_all_on_the_average() {
    // Fifty layers of which six are shaded: over many pixels each has its own colour.
    let list: Vec<Glimpse> = (0..50)
        .map(|i| glimpse(Vec3::new(1.0, 0.5, 0.1 + i as f32 / 50.0) * (0.02 * unit(&[7, i]) as f32).powi(2), i))
        .collect();
    let all: Vec3 = list.iter().map(|seen| seen.color).sum();
    let trials = 20_000;
    let mut sums = vec![glam::DVec3::ZERO; list.len()];
    for trial in 0..trials {
        let (mut taken, mut sum) = (0, Vec3::ZERO);
        some(&list, 6, unit(&[9, trial]), &mut |seen, color| {
            let Found::Hair { segment, .. } = seen.found else { panic!("no hair") };
            sums[segment as usize] += color.as_dvec3();
            taken += 1;
            sum += color;
        });
        assert!(taken <= 6);
        // What they count together is never off: only which colours stand for it is chance.
        assert!((sum.element_sum() / all.element_sum() - 1.0).abs() < 1e-4, "{sum}");
    }
    let step = f64::from(all.element_sum()) / 6.0;
    for (seen, sum) in list.iter().zip(sums) {
        let (mean, want) = (sum / f64::from(trials), seen.color.as_dvec3());
        // One of chance p is worth step: a standard error of sqrt(p (1 - p) / trials) steps.
        let p = (want.element_sum() / step).fract();
        let bound = 5.0 * step * (p * (1.0 - p) / f64::from(trials)).sqrt() + 1e-6 * step;
        assert!((mean.element_sum() - want.element_sum()).abs() < bound, "{mean} against {want}, bound {bound}");
    }
}

#[test]
fn few_are_all_shaded_as_they_are() {
    let list: Vec<Glimpse> = (0..6).map(|i| glimpse(Vec3::splat(0.1 * i as f32), i)).collect();
    let mut taken = Vec::new();
    some(&list, 6, 0.3, &mut |seen, color| taken.push((seen.found.segment(), color)));
    assert_eq!(taken, list.iter().map(|seen| (seen.found.segment(), seen.color)).collect::<Vec<_>>());
    some(&list[..1], 0, 0.3, &mut |_, _| panic!("nothing counts"));
}

impl Found {
    fn segment(&self) -> u32 {
        match self {
            Self::Hair { segment, .. } => *segment,
            Self::Surface(point) => point.triangle,
        }
    }
}
