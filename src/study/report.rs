//! What a cross-check found, as data: the JSON that is written, and what its text and its plot are made of.

use serde::Serialize;

use super::shadow_check::Shadow;
use super::statistics::{Sample, Stratum, Summary};

/// Fewer points of a kind are reported but not judged: their intervals mean little.
const FEWEST_JUDGED: usize = 8;
/// Bins by distance for each kind of point, where there are points enough.
const BINS: usize = 5;
/// Points that a bin should have at least.
const BIN_POINTS: usize = 10;

/// Whether the two estimators agree to within the accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// There was nothing to compare: the scene has no hair, or neither hair nor surfaces are in the picture.
    Nothing,
    /// The RMS difference is below the accuracy, its whole interval too; and each deep shadow map is as near to rays as it should be.
    Held,
    /// The accuracy lies inside the interval: these points cannot tell.
    Undecided,
    /// The RMS difference exceeds the accuracy, its whole interval too, or a deep shadow map is further from rays than it should be.
    Exceeded,
}

impl Verdict {
    /// Of several: a single one that exceeds decides, then one that cannot tell.
    pub(super) fn worst(verdicts: impl Iterator<Item = Self>) -> Self {
        let verdicts: Vec<Self> = verdicts.collect();
        [Self::Exceeded, Self::Undecided, Self::Held]
            .into_iter()
            .find(|verdict| verdicts.contains(verdict))
            .unwrap_or(Self::Nothing)
    }
}

/// The result of a cross-check. Differences are projection less rays, in sky visibility (0 to 1).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The scene file.
    pub scene: String,
    /// RMS difference of sky visibility that is allowed.
    pub accuracy: f64,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Reference rays a point, at least.
    pub rays: u32,
    /// Whether the scene has hair.
    pub has_hair: bool,
    /// How many points a render of the picture shades.
    pub population: Population,
    pub verdict: Verdict,
    /// All points, each kind by its share of the population.
    pub all: Option<Part>,
    pub hair: Option<Part>,
    pub surface: Option<Part>,
    /// Deep shadow maps, one a light that has one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shadows: Vec<Shadow>,
    /// Each point; left out of a render's statistics.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<Compared>,
}

/// Numbers of shading points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Population {
    pub hair: u64,
    /// Those that reflect light.
    pub surface: u64,
}

/// One set of points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    #[serde(flatten)]
    pub summary: Summary,
    /// The point that differs most; its difference holds the noise of the reference.
    pub largest: Compared,
    /// The points by the distance of the hair around them, nearest first; those around which rays meet no hair come last.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub by_distance: Vec<Bin>,
}

/// Points whose hair is at about the same distance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// Least and greatest mean distance of the first hair that rays meet, in scene units; none where they meet none.
    pub distance: Option<[f64; 2]>,
    #[serde(flatten)]
    pub part: Part,
}

/// What a point lies on. Indices are those of the whole scene, in the order of its file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "on", rename_all = "lowercase")]
pub enum Site {
    Hair {
        /// Name of the hair object.
        object: String,
        strand: u32,
        segment: u32,
    },
    Surface {
        triangle: u32,
    },
}

/// Both estimators at one point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// Column and row in the whole picture.
    pub pixel: [u32; 2],
    #[serde(flatten)]
    pub site: Site,
    /// Sky visibility by projection.
    pub projection: f64,
    /// Sky visibility by rays.
    pub rays: f64,
    /// By each half of the rays.
    pub halves: [f64; 2],
    /// Projection less rays.
    pub difference: f64,
    /// Mean distance of the first hair that rays meet, in scene units; none where they meet none.
    pub hair_distance: Option<f64>,
}

impl Compared {
    fn sample(&self) -> Sample {
        Sample { value: self.projection, reference: self.halves }
    }

    /// Whether it lies on hair.
    pub fn on_hair(&self) -> bool {
        matches!(self.site, Site::Hair { .. })
    }
}

impl Report {
    /// A report of nothing, to be filled.
    pub(super) fn new(scene: String, accuracy: f64, seed: u32, rays: u32) -> Self {
        Self {
            scene,
            accuracy,
            seed,
            rays,
            has_hair: true,
            population: Population::default(),
            verdict: Verdict::Nothing,
            all: None,
            hair: None,
            surface: None,
            shadows: Vec::new(),
            points: Vec::new(),
        }
    }

    /// Fills in what follows from the points.
    pub(super) fn judge(&mut self, population: Population, points: Vec<Compared>, shadows: Vec<Shadow>) {
        let (hair, surface): (Vec<&Compared>, Vec<&Compared>) = points.iter().partition(|point| point.on_hair());
        let samples = |points: &[&Compared]| -> Vec<Sample> { points.iter().map(|point| point.sample()).collect() };
        let kinds = [samples(&hair), samples(&surface)];
        let total = (population.hair + population.surface).max(1) as f64;
        let counts = [population.hair, population.surface];
        let strata = [0, 1].map(|kind| Stratum { share: counts[kind] as f64 / total, samples: &kinds[kind] });
        let all: Vec<&Compared> = points.iter().collect();
        self.all = Summary::stratified(&strata).zip(largest(&all)).map(|(summary, largest)| Part {
            summary,
            largest,
            by_distance: Vec::new(),
        });
        self.hair = part(&hair).map(|part| Part { by_distance: bins(&hair), ..part });
        self.surface = part(&surface).map(|part| Part { by_distance: bins(&surface), ..part });
        self.shadows = shadows;
        self.verdict = self.verdict();
        self.population = population;
        self.points = points;
    }

    /// The sets of points that are judged: all, and each kind that has points enough.
    pub fn judged(&self) -> impl Iterator<Item = (&'static str, &Part)> {
        let kinds = [("on hair", &self.hair), ("on surfaces", &self.surface)];
        let enough = |part: &&Part| part.summary.points >= FEWEST_JUDGED;
        let kinds = kinds.into_iter().filter_map(move |(name, part)| Some((name, part.as_ref().filter(enough)?)));
        self.all.iter().map(|part| ("at all points", part)).chain(kinds)
    }

    fn verdict(&self) -> Verdict {
        let verdict = |part: &Part| match (part.summary.rms.low, part.summary.rms.high) {
            (Some(low), _) if low > self.accuracy => Verdict::Exceeded,
            (_, Some(high)) if high <= self.accuracy => Verdict::Held,
            _ => Verdict::Undecided,
        };
        let shadows = self.shadows.iter().map(|shadow| shadow.verdict(self.accuracy));
        Verdict::worst(self.judged().map(|(_, part)| verdict(part)).chain(shadows))
    }
}

fn part(points: &[&Compared]) -> Option<Part> {
    let samples: Vec<Sample> = points.iter().map(|point| point.sample()).collect();
    Some(Part { summary: Summary::of(&samples)?, largest: largest(points)?, by_distance: Vec::new() })
}

/// The first of those that differ most.
fn largest(points: &[&Compared]) -> Option<Compared> {
    let key = |point: &Compared| point.difference.abs();
    points.iter().rev().max_by(|a, b| key(a).total_cmp(&key(b))).map(|&point| point.clone())
}

/// Bins of equal counts by distance, and one of the points that see no hair.
fn bins(points: &[&Compared]) -> Vec<Bin> {
    let mut near: Vec<(f64, &Compared)> =
        points.iter().filter_map(|&point| Some((point.hair_distance?, point))).collect();
    near.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let count = (near.len() / BIN_POINTS).clamp(1, BINS);
    let bounds = |bin: usize| bin * near.len() / count;
    let runs = (0..count).map(|bin| &near[bounds(bin)..bounds(bin + 1)]);
    let mut bins: Vec<Bin> = runs
        .filter_map(|run| {
            let points: Vec<&Compared> = run.iter().map(|(_, point)| *point).collect();
            Some(Bin { distance: Some([run.first()?.0, run.last()?.0]), part: part(&points)? })
        })
        .collect();
    let free: Vec<&Compared> = points.iter().copied().filter(|point| point.hair_distance.is_none()).collect();
    bins.extend(part(&free).map(|part| Bin { distance: None, part }));
    bins
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::unit;

    /// A point whose estimators differ by `offset` and a little more.
    fn point(index: u32, hair: bool, offset: f64) -> Compared {
        let site = if hair {
            Site::Hair { object: "fur".to_owned(), strand: index, segment: 9 * index }
        } else {
            Site::Surface { triangle: index }
        };
        let random = |purpose| unit(&[index, u32::from(hair), purpose]) - 0.5;
        let rays = 0.5 + 0.8 * random(0);
        let halves = [rays + 0.002 * random(1), rays + 0.002 * random(2)];
        let rays = 0.5 * (halves[0] + halves[1]);
        let projection = rays + offset + 0.002 * random(3);
        let hair_distance = (!index.is_multiple_of(10)).then_some(f64::from(index));
        Compared { pixel: [index, 1], site, projection, rays, halves, difference: projection - rays, hair_distance }
    }

    fn report(accuracy: f64, population: [u64; 2], points: Vec<Compared>) -> Report {
        let mut report = Report::new("a.toml".to_owned(), accuracy, 0, 1000);
        report.judge(Population { hair: population[0], surface: population[1] }, points, Vec::new());
        report
    }

    fn points(hair: u32, surface: u32, offsets: [f64; 2]) -> Vec<Compared> {
        let hair = (0..hair).map(|i| point(i, true, offsets[0]));
        hair.chain((0..surface).map(|i| point(i, false, offsets[1]))).collect()
    }

    #[test]
    fn the_verdict_is_that_of_the_worst_kind() {
        let verdict = |accuracy, offsets| report(accuracy, [9000, 1000], points(100, 100, offsets)).verdict;
        assert_eq!(verdict(0.01, [0.005, 0.005]), Verdict::Held);
        assert_eq!(verdict(0.001, [0.005, 0.005]), Verdict::Exceeded);
        // All together, by their shares, are within the accuracy; the few on surfaces are not.
        assert_eq!(verdict(0.01, [0.0, 0.02]), Verdict::Exceeded);
        let near = report(0.005, [9000, 1000], points(100, 100, [0.005, 0.0]));
        assert_eq!(near.verdict, Verdict::Undecided, "{:?}", near.hair.map(|part| part.summary));
        assert_eq!(report(0.01, [0, 0], Vec::new()).verdict, Verdict::Nothing);
        assert_eq!(report(0.01, [9, 0], points(9, 0, [0.0, 0.0])).verdict, Verdict::Held);
        // One point tells nothing, and a kind of few points is not judged.
        assert_eq!(report(0.01, [1, 0], points(1, 0, [0.5, 0.0])).verdict, Verdict::Undecided);
        assert_eq!(report(0.1, [1_000_000, 3], points(100, 3, [0.0, 0.5])).verdict, Verdict::Held);
    }

    #[test]
    fn bins_are_equally_full_and_run_from_near_to_far() {
        let mut points = points(200, 30, [0.001, 0.0]);
        points[77].projection += 0.1;
        points[77].difference += 0.1;
        let report = report(0.01, [200, 30], points);
        let hair = report.hair.unwrap();
        let counts: Vec<usize> = hair.by_distance.iter().map(|bin| bin.part.summary.points).collect();
        assert_eq!(counts, [36, 36, 36, 36, 36, 20]);
        let distances: Vec<[f64; 2]> = hair.by_distance.iter().filter_map(|bin| bin.distance).collect();
        assert!(distances.len() == 5 && distances.as_flattened().is_sorted(), "{distances:?}");
        assert_eq!(hair.by_distance[5].distance, None);
        assert_eq!(hair.largest.pixel, [77, 1]);
        assert_eq!(report.all.unwrap().largest.pixel, [77, 1]);
        assert_eq!(report.surface.unwrap().by_distance.len(), 3);
    }

    #[test]
    fn the_json_has_the_documented_shape() {
        let json = serde_json::to_value(report(0.01, [200, 30], points(40, 12, [0.0, 0.0]))).unwrap();
        assert_eq!((json["verdict"].as_str(), json["population"]["hair"].as_u64()), (Some("held"), Some(200)));
        for part in ["all", "hair", "surface"] {
            for number in ["/points", "/mean/value", "/mean/low", "/rms/high", "/noise", "/rms_with_noise"] {
                assert!(json[part].pointer(number).is_some_and(|n| n.is_number()), "{part}{number}: {json}");
            }
        }
        assert_eq!(json["points"].as_array().unwrap().len(), 52);
        let largest = &json["hair"]["largest"];
        assert_eq!((&largest["on"], &largest["object"]), (&"hair".into(), &"fur".into()));
        assert!(largest["strand"].is_u64() && largest["pixel"].is_array(), "{largest}");
        assert_eq!(json["surface"]["largest"]["on"], "surface");
        assert!(json["hair"]["by_distance"][0]["distance"][1].is_number());
    }
}
