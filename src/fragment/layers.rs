//! The layers of one pixel: hair fragments behind each other, with opaque surfaces between them (Eq. 6, 7 and Figure 6 of the paper).
//!
//! A fragment that covers the share a of the pixel and has transparency t lets γ = 1 - a (1 - t) through. With the layers sorted from the
//! front, T_n is the product of γ before layer n. Surfaces are sampled at K places in the pixel; v_n is the share of the samples whose surface
//! lies behind layer n. What is seen of layer n is w_n = T_n (1 - γ_n) v_n, of a surface sample T at its depth, / K. All weights together with
//! the background's are 1. Weights are in `f64`: thousands of layers with tiny coverage add up to an alpha that `f32` would lose.

use super::choice::draw;
use super::hair::HairFragment;
use super::surface::{NO_SURFACE, SurfaceSample};

/// A layer that is seen less than this is not worth a shading point of its own. The largest error that rounding a colour near 1 to a
/// half-precision float makes is as large.
pub const MIN_WEIGHT: f64 = 1.0 / 4096.0;

/// A hair fragment as a transparent layer over the whole pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Index of the fragment in the list that was composited.
    pub fragment: u32,
    /// Number of the hair segment.
    pub segment: u32,
    /// Depth (camera z).
    pub depth: f32,
    /// 1 - γ, 0 to 1.
    pub opacity: f64,
    /// How much of it is seen: w.
    pub weight: f64,
}

impl Layer {
    /// The share γ that it lets through.
    pub fn gamma(&self) -> f64 {
        1.0 - self.opacity
    }
}

/// Which layers of a pixel are worth shading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rank {
    /// Those that are seen most: of greatest weight w.
    Seen,
    /// Those of lowest γ, as in section 4.1 of the paper: the most opaque, however much hair hides them.
    Gamma,
}

/// A layer to be shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaded {
    /// Index of the fragment in the list that was composited.
    pub fragment: u32,
    /// Its own weight and that of the layers that it stands for.
    pub weight: f64,
}

/// The layers of one pixel. Kept from pixel to pixel, it allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct PixelLayers {
    /// Front to back; those of one depth by segment.
    pub layers: Vec<Layer>,
    /// How much is seen of each group of surface samples.
    pub group_weights: Vec<f64>,
    /// Share of the pixel that hair and surfaces hide, 0 to 1.
    pub alpha: f64,
    order: Vec<u32>,
    candidates: Vec<u32>,
}

impl PixelLayers {
    /// How much is seen of what is behind everything.
    pub fn background(&self) -> f64 {
        1.0 - self.alpha
    }

    /// Composites hair fragments, in any order, with surface samples that belong to the groups 0 to `groups`. `transparency` gives t of a
    /// fragment, 0 to 1. An empty list of samples is a pixel without surfaces.
    ///
    /// # Panics
    /// If a sample's group is neither below `groups` nor [`NO_SURFACE`].
    pub fn composite(
        &mut self,
        fragments: &[HairFragment],
        transparency: impl Fn(&HairFragment) -> f32,
        samples: &[SurfaceSample],
        groups: usize,
    ) {
        self.layers.clear();
        self.layers.extend(fragments.iter().enumerate().map(|(index, fragment)| {
            let opaque = 1.0 - f64::from(transparency(fragment)).clamp(0.0, 1.0);
            let opacity = f64::from(fragment.coverage).clamp(0.0, 1.0) * opaque;
            Layer { fragment: index as u32, segment: fragment.segment, depth: fragment.depth, opacity, weight: 0.0 }
        }));
        self.layers.sort_unstable_by(|a, b| {
            a.depth.total_cmp(&b.depth).then(a.segment.cmp(&b.segment)).then(a.fragment.cmp(&b.fragment))
        });
        self.order.clear();
        self.order.extend((0..samples.len() as u32).filter(|&k| samples[k as usize].group != NO_SURFACE));
        self.order.sort_unstable_by(|&a, &b| {
            let [x, y] = [a, b].map(|k| samples[k as usize].depth);
            x.total_cmp(&y).then(a.cmp(&b))
        });
        self.group_weights.clear();
        self.group_weights.resize(groups, 0.0);
        self.sweep(samples);
    }

    /// From the front to the back through layers and surface samples alike.
    fn sweep(&mut self, samples: &[SurfaceSample]) {
        let share = 1.0 / samples.len().max(1) as f64;
        let mut transmittance = 1.0;
        // 1 - T as a sum of what the layers take away: it keeps its digits where T is nearly 1.
        let mut absorbed = 0.0;
        let mut surfaces = self.order.iter().map(|&k| samples[k as usize]).peekable();
        let mut passed = 0usize;
        for layer in &mut self.layers {
            // A surface at the depth of a layer hides it.
            while let Some(surface) = surfaces.next_if(|surface| surface.depth <= layer.depth) {
                self.group_weights[surface.group as usize] += transmittance * share;
                passed += 1;
            }
            let taken = transmittance * layer.opacity;
            let visible = 1.0 - passed as f64 * share;
            layer.weight = if passed == samples.len() && passed > 0 { 0.0 } else { taken * visible };
            absorbed += taken;
            transmittance *= 1.0 - layer.opacity;
        }
        for surface in surfaces {
            self.group_weights[surface.group as usize] += transmittance * share;
        }
        let empty = match samples.len() {
            0 => 1.0,
            count => (count - self.order.len()) as f64 * share,
        };
        self.alpha = ((1.0 - empty) + empty * absorbed).clamp(0.0, 1.0);
    }

    /// Chooses the layers to shade: the `count` (at least one) that come first by `rank` among those seen by more than `min_weight`, see
    /// [`MIN_WEIGHT`]; if there are none, the one that is seen most. Each other layer adds its weight to the shaded layer nearest in depth, the
    /// front one of two equally near, so that alpha is right for every `count`. The result is in depth order; it is empty if no hair is seen.
    pub fn select(&mut self, count: usize, rank: Rank, min_weight: f64, shaded: &mut Vec<Shaded>) {
        let Self { layers, candidates, .. } = self;
        shaded.clear();
        candidates.clear();
        candidates.extend((0..layers.len() as u32).filter(|&n| layers[n as usize].weight > min_weight));
        let count = count.max(1);
        if candidates.is_empty() {
            // The first of equals: max_by takes the last, hence backwards.
            let seen = (0..layers.len()).rev().filter(|&n| layers[n].weight > 0.0);
            match seen.max_by(|&a, &b| layers[a].weight.total_cmp(&layers[b].weight)) {
                Some(heaviest) => candidates.push(heaviest as u32),
                None => return,
            }
        } else if candidates.len() > count {
            let key = |n: u32| match rank {
                Rank::Seen => layers[n as usize].weight,
                Rank::Gamma => layers[n as usize].opacity,
            };
            candidates.select_nth_unstable_by(count - 1, |&a, &b| key(b).total_cmp(&key(a)).then(a.cmp(&b)));
            candidates.truncate(count);
            candidates.sort_unstable();
        }
        let depth = |n: usize| f64::from(layers[candidates[n] as usize].depth);
        shaded.extend(candidates.iter().map(|&n| Shaded { fragment: layers[n as usize].fragment, weight: 0.0 }));
        let mut near = 0;
        for (n, layer) in layers.iter().enumerate() {
            let z = f64::from(layer.depth);
            // A shaded layer keeps its own weight, also where several lie at one depth.
            while near + 1 < candidates.len()
                && (candidates[near + 1] as usize <= n
                    || candidates[near] as usize <= n && depth(near + 1) - z < z - depth(near))
            {
                near += 1;
            }
            shaded[near].weight += layer.weight;
        }
    }

    /// Draws the layers to shade, `count` (at least one) or as many as are seen, so that each counts in the mean what is seen of it: the mean over
    /// many `random` in [0, 1) is the picture in which all layers are shaded. The result is in depth order, and its weights add up to those of
    /// all layers.
    pub fn draw(&self, count: usize, random: f64, shaded: &mut Vec<Shaded>) {
        shaded.clear();
        let weight = |n: usize| self.layers[n].weight;
        draw(self.layers.len(), weight, count, random, |n, weight| {
            shaded.push(Shaded { fragment: self.layers[n].fragment, weight });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::fragment::hair::{HairSegment, PixelRect, scan_convert};
    use crate::fragment::surface::{SurfaceHit, SurfacePixel};
    use crate::hash::{hash, to_unit};
    use crate::sequence::Sequence;
    use glam::{DVec2, DVec3, Vec3};
    use proptest::prelude::*;

    fn fragment(depth: f32, coverage: f32, segment: u32) -> HairFragment {
        HairFragment { depth, coverage, segment, u: 0.5, span: 1.0 }
    }

    fn surface(depth: f32, group: u32) -> SurfaceSample {
        SurfaceSample { depth, group }
    }

    fn total(pixel: &PixelLayers) -> f64 {
        let hair: f64 = pixel.layers.iter().map(|layer| layer.weight).sum();
        hair + pixel.group_weights.iter().sum::<f64>() + pixel.background()
    }

    #[test]
    fn two_layers_over_each_other() {
        let mut pixel = PixelLayers::default();
        pixel.composite(&[fragment(2.0, 0.5, 0), fragment(1.0, 0.5, 1)], |_| 0.5, &[], 0);
        let weights: Vec<_> = pixel.layers.iter().map(|layer| (layer.fragment, layer.gamma(), layer.weight)).collect();
        assert_eq!(weights, [(1, 0.75, 0.25), (0, 0.75, 0.1875)]);
        assert_eq!(pixel.alpha, 0.4375);
        // Of one depth: by segment, whatever their order in the list.
        pixel.composite(&[fragment(1.0, 0.5, 9), fragment(1.0, 0.5, 4)], |_| 0.5, &[], 0);
        assert_eq!(pixel.layers.iter().map(|layer| layer.segment).collect::<Vec<_>>(), [4, 9]);
    }

    #[test]
    fn surfaces_hide_what_is_behind_them() {
        let mut pixel = PixelLayers::default();
        let hair = [fragment(1.0, 0.5, 0), fragment(3.0, 0.5, 1), fragment(5.0, 0.5, 2)];
        let samples = [surface(2.0, 1), surface(3.0, 0), surface(4.0, 1), SurfaceSample::EMPTY];
        pixel.composite(&hair, |_| 0.0, &samples, 2);
        // In front of all; behind two samples, for the one at its depth hides it; before the empty sample only.
        let weights: Vec<_> = pixel.layers.iter().map(|layer| layer.weight).collect();
        assert_eq!(weights, [0.5, 0.25 * 0.5, 0.125 * 0.25]);
        assert_eq!(pixel.group_weights, [0.5 / 4.0, (0.5 + 0.25) / 4.0]);
        assert_eq!(pixel.background(), 0.125 / 4.0);
        // An opaque hair in front leaves nothing.
        pixel.composite(&[fragment(1.0, 1.0, 0), fragment(2.0, 1.0, 1)], |_| 0.0, &samples, 2);
        assert_eq!((pixel.alpha, pixel.layers[1].weight, pixel.group_weights[0]), (1.0, 0.0, 0.0));
    }

    #[test]
    fn thousands_of_thin_layers_keep_their_alpha() {
        let mut pixel = PixelLayers::default();
        for coverage in [1e-9f32, 1e-20] {
            let hair: Vec<_> = (0..10_000).map(|i| fragment(1.0 + i as f32, coverage, i)).collect();
            pixel.composite(&hair, |_| 0.0, &[], 0);
            let exact = -(1e4 * (-f64::from(coverage)).ln_1p()).exp_m1();
            assert!((pixel.alpha / exact - 1.0).abs() < 1e-12, "{} {exact}", pixel.alpha);
            assert!((total(&pixel) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn selection_takes_the_lowest_gamma_and_keeps_the_weight() {
        let mut pixel = PixelLayers::default();
        let mut shaded = Vec::new();
        let coverages = [0.1, 0.4, 0.2, 0.3, 0.1];
        let hair: Vec<_> = (0..5).map(|i| fragment(1.0 + i as f32, coverages[i as usize], i)).collect();
        pixel.composite(&hair, |_| 0.0, &[], 0);
        let w: Vec<_> = pixel.layers.iter().map(|layer| layer.weight).collect();
        pixel.select(2, Rank::Gamma, MIN_WEIGHT, &mut shaded);
        // Layers 1 and 3 are the most opaque; layer 2 is as near to both and goes to the front one.
        assert_eq!(shaded.iter().map(|s| s.fragment).collect::<Vec<_>>(), [1, 3]);
        assert!((shaded[0].weight - (w[0] + w[1] + w[2])).abs() < 1e-15);
        assert!((shaded[1].weight - (w[3] + w[4])).abs() < 1e-15);
        pixel.select(usize::MAX, Rank::Gamma, 0.0, &mut shaded);
        assert_eq!(shaded.iter().map(|s| s.weight).collect::<Vec<_>>(), w);
        // Several at one depth keep their own weights.
        let hair: Vec<_> = (0..4).map(|i| fragment(1.0, 0.25, i)).collect();
        pixel.composite(&hair, |_| 0.0, &[], 0);
        pixel.select(9, Rank::Gamma, MIN_WEIGHT, &mut shaded);
        assert!(shaded.iter().zip(&pixel.layers).all(|(s, layer)| s.weight == layer.weight));
        // Nothing above the bound: the heaviest, here the first of equal coverage.
        let hair: Vec<_> = (0..4).map(|i| fragment(1.0 + i as f32, 1e-5, i)).collect();
        pixel.composite(&hair, |_| 0.0, &[], 0);
        pixel.select(3, Rank::Gamma, MIN_WEIGHT, &mut shaded);
        assert_eq!((shaded.len(), shaded[0].fragment), (1, 0));
        assert!((shaded[0].weight - pixel.alpha).abs() < 1e-17);
        // Hidden hair is not shaded at all.
        pixel.composite(&hair, |_| 0.0, &[surface(0.5, 0)], 1);
        pixel.select(3, Rank::Gamma, MIN_WEIGHT, &mut shaded);
        assert!(shaded.is_empty());
    }

    #[test]
    fn what_is_seen_counts_rather_than_what_is_opaque() {
        let mut pixel = PixelLayers::default();
        let mut shaded = Vec::new();
        let hair: Vec<_> = (0..3).map(|i| fragment(1.0 + i as f32, [0.5, 0.45, 0.48][i as usize], i)).collect();
        pixel.composite(&hair, |_| 0.0, &[], 0);
        let mut chosen = |rank| {
            pixel.select(2, rank, MIN_WEIGHT, &mut shaded);
            shaded.iter().map(|s| s.fragment).collect::<Vec<_>>()
        };
        assert_eq!(chosen(Rank::Gamma), [0, 2]);
        assert_eq!(chosen(Rank::Seen), [0, 1]);
    }

    #[test]
    fn layers_that_are_drawn_count_what_is_seen_of_them() {
        let mut pixel = PixelLayers::default();
        let mut shaded = Vec::new();
        let coverage = |i: u32| if i == 3 { 0.6 } else { 0.02 + 0.2 * to_unit(hash(&[i, 7])) };
        let hair: Vec<_> = (0..40).map(|i| fragment(1.0 + i as f32, coverage(i), i)).collect();
        pixel.composite(&hair, |_| 0.2, &[], 0);
        for count in [1, 2, 5, 12, 40, 60] {
            let mut sums = vec![0.0; 40];
            let steps = 20_000;
            for step in 0..steps {
                pixel.draw(count, (f64::from(step) + 0.5) / f64::from(steps), &mut shaded);
                assert_eq!(shaded.len(), count.min(40));
                assert!(shaded.is_sorted_by(|a, b| a.fragment < b.fragment), "front to back, none twice");
                shaded.iter().for_each(|s| sums[s.fragment as usize] += s.weight / f64::from(steps));
            }
            // Even steps through [0, 1): each chance is right to one of them.
            for layer in &pixel.layers {
                let error = (sums[layer.fragment as usize] - layer.weight).abs();
                assert!(error <= 2.0 / f64::from(steps), "{count} of 40, layer {}: {error}", layer.fragment);
            }
        }
    }

    #[test]
    fn random_hair_is_as_dense_as_points_in_the_pixel_say() {
        // Lines in random places cover the pixel independently, which is what layers assume: the means over many pixels agree.
        let projection = Projection { focal: 1.0, center: DVec2::ZERO, near: 0.1 };
        let rect = PixelRect::image([1, 1]);
        let (mut hair, mut pixel) = (Vec::new(), PixelLayers::default());
        let (mut layered, mut sampled, mut front_layered, mut front_sampled) = (0.0, 0.0, 0.0, 0.0);
        let trials = 4000;
        for trial in 0..trials {
            hair.clear();
            let random = |i: u32, k: u32| f64::from(to_unit(hash(&[trial, i, k])));
            let point = DVec2::new(random(99, 0), random(99, 1));
            let (mut seen, mut front) = (1.0, 0.0);
            for i in 0..40 {
                let [from, to] = [0, 2].map(|k| DVec2::new(random(i, k) * 7.0 - 3.0, random(i, k + 1) * 7.0 - 3.0));
                let z = 1.0 + f64::from(i);
                let ends = [from, to].map(|p| (DVec3::new(p.x, -p.y, 1.0) * z).as_vec3());
                let widths = [0.2 * z as f32; 2];
                let segment = HairSegment { ends, widths, index: i };
                scan_convert(&segment, &projection, &rect, |_, _, f| hair.push(f));
                let shape = crate::fragment::footprint::Footprint::new(&segment, &projection).unwrap();
                let s = (point - shape.start).dot(shape.delta) / shape.length.powi(2);
                let off = (point - shape.start).perp_dot(shape.delta).abs() / shape.length;
                if (0.0..=1.0).contains(&s) && off < 0.5 * shape.width_at(s) {
                    front += if i < 10 { 0.7 * seen } else { 0.0 };
                    seen *= 0.3;
                }
            }
            pixel.composite(&hair, |_| 0.3, &[], 0);
            layered += pixel.alpha;
            sampled += 1.0 - seen;
            let nearest = pixel.layers.iter().filter(|layer| layer.segment < 10);
            front_layered += nearest.map(|layer| layer.weight).sum::<f64>();
            front_sampled += front;
        }
        // The points' standard error is below 0.007.
        let mean = |sum: f64| sum / f64::from(trials);
        assert!(mean(layered) > 0.2, "{}", mean(layered));
        assert!((mean(layered) - mean(sampled)).abs() < 0.02, "{} {}", mean(layered), mean(sampled));
        assert!((mean(front_layered) - mean(front_sampled)).abs() < 0.02);
    }

    #[test]
    fn a_surface_edge_hides_half_of_the_hair() {
        let camera = Camera::new(DVec3::Z, DVec3::ZERO, DVec3::Y, 90.0, [4, 4], 0.1).unwrap();
        let mut surfaces = SurfacePixel::default();
        // A wall at depth 1 that ends in the middle of pixel (2, 2), where x is 0.25.
        surfaces.gather(&camera, [2, 2], 8, Sequence::start(0), |origin, direction| {
            let position = origin - direction * (origin.z / direction.z);
            let hit = SurfaceHit { depth: 1.0, group: 3, index: 0, position, normal: Vec3::Z };
            (position.x < 0.25).then_some(hit)
        });
        let mut pixel = PixelLayers::default();
        pixel.composite(
            &[fragment(0.5, 0.5, 0), fragment(2.0, 0.5, 1)],
            |_| 0.0,
            &surfaces.samples,
            surfaces.groups.len(),
        );
        let weights: Vec<_> = pixel.layers.iter().map(|layer| layer.weight).collect();
        assert_eq!(weights, [0.5, 0.125]);
        assert_eq!(pixel.group_weights, [0.25]);
        assert_eq!(pixel.background(), 0.125);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        #[test]
        fn all_weights_together_are_one(
            hair in prop::collection::vec((0u32..20, 0f32..=1.0, 0f32..=1.0), 0..60),
            samples in prop::collection::vec((0u32..22, 0u32..3), 0..40),
            count in 0usize..12,
            random in 0f64..1.0,
        ) {
            let list: Vec<_> = (hair.iter().enumerate()).map(|(i, &(z, a, _))| fragment(z as f32, a * a, i as u32)).collect();
            // Depth 20 and more is no surface.
            let at = |&(z, group)| if z < 20 { surface(z as f32, group) } else { SurfaceSample::EMPTY };
            let samples: Vec<_> = samples.iter().map(at).collect();
            let transparency = |f: &HairFragment| hair[f.segment as usize].2;
            let mut pixel = PixelLayers::default();
            pixel.composite(&list, transparency, &samples, 3);
            prop_assert!((total(&pixel) - 1.0).abs() < 1e-12);

            // By the definition, from the list as it is.
            let before = |z: f32, segment: u32| -> f64 {
                let front = list.iter().filter(|f| (f.depth, f.segment) < (z, segment));
                front.map(|f| 1.0 - f64::from(f.coverage) * (1.0 - f64::from(transparency(f)))).product()
            };
            for layer in &pixel.layers {
                let behind = samples.iter().filter(|s| s.depth > layer.depth).count();
                let share = if samples.is_empty() { 1.0 } else { behind as f64 / samples.len() as f64 };
                let weight = before(layer.depth, layer.segment) * layer.opacity * share;
                prop_assert!((layer.weight - weight).abs() < 1e-14);
            }
            for group in 0..3 {
                let seen: f64 = samples.iter().filter(|s| s.group == group).map(|s| before(s.depth, 0)).sum();
                prop_assert!((pixel.group_weights[group as usize] - seen / samples.len().max(1) as f64).abs() < 1e-14);
            }

            let hair_weight: f64 = pixel.layers.iter().map(|layer| layer.weight).sum();
            let mut shaded = Vec::new();
            pixel.select(count, Rank::Gamma, MIN_WEIGHT, &mut shaded);
            let kept: f64 = shaded.iter().map(|s| s.weight).sum();
            prop_assert!((kept - hair_weight).abs() < 1e-14);
            prop_assert!(shaded.len() <= count.max(1));
            prop_assert_eq!(shaded.is_empty(), hair_weight == 0.0);
            let mut drawn = Vec::new();
            pixel.draw(count, random, &mut drawn);
            prop_assert!((drawn.iter().map(|s| s.weight).sum::<f64>() - hair_weight).abs() < 1e-14);
            prop_assert!(drawn.len() <= count.max(1) && drawn.is_empty() == (hair_weight == 0.0));
            // Every layer went to a shaded layer than which none is nearer.
            let depths: Vec<_> = shaded.iter().map(|s| list[s.fragment as usize].depth).collect();
            for (n, s) in shaded.iter().enumerate() {
                let nearest: f64 = pixel.layers.iter().filter(|layer| {
                    let own = shaded.iter().position(|other| other.fragment == layer.fragment);
                    let best = depths.iter().map(|z| (z - layer.depth).abs()).fold(f32::INFINITY, f32::min);
                    own.map_or((depths[n] - layer.depth).abs() == best, |own| own == n)
                }).map(|layer| layer.weight).sum();
                prop_assert!(s.weight <= nearest + 1e-14);
            }
        }
    }
}
