use super::*;
use crate::surface::primitives::{plane, sphere};
use proptest::prelude::*;

fn on_sphere(spec: &Grow) -> Strands {
    let strands = grow(spec, &sphere(DVec3::ZERO, 1.0), Vec3::Y, None).unwrap();
    assert_eq!(strands.validate(), Ok(()));
    strands
}

fn roots_of(strands: &Strands) -> Vec<DVec3> {
    strands.iter().map(|s| s[0].as_dvec3()).collect()
}

#[test]
fn roots_are_spread_evenly_over_a_sphere() {
    let count = 200_000;
    let strands = on_sphere(&Grow { count, segments: 1, ..Grow::default() });
    // 20 bands of equal height have equal area; so have 24 sectors of each.
    let mut counts = [0u32; 20 * 24];
    for p in roots_of(&strands) {
        assert!((0.999..1.000_001).contains(&p.length()), "{p}");
        let band = ((p.y / p.length() + 1.0) * 10.0).min(19.0) as usize;
        let sector = ((p.x.atan2(p.z) / std::f64::consts::TAU + 0.5) * 24.0).min(23.0) as usize;
        counts[band * 24 + sector] += 1;
    }
    let expected = f64::from(count) / counts.len() as f64;
    let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
    let freedom = counts.len() as f64 - 1.0;
    let score = (chi2 - freedom) / (2.0 * freedom).sqrt();
    assert!(score.abs() < 4.5, "χ² is {score} deviations off");
}

#[test]
fn roots_favour_large_triangles_by_area_alone() {
    // Two rectangles in one mesh, nine to one in area, the small one of many more triangles.
    let mut mesh = plane(DVec3::ZERO, DVec3::Y, [9.0, 1.0]);
    let strip = plane(DVec3::new(20.0, 0.0, 0.0), DVec3::Y, [0.01, 1.0]);
    for i in 0..100 {
        let base = mesh.positions.len() as u32;
        mesh.positions.extend(strip.positions.iter().map(|p| *p + Vec3::X * 0.01 * i as f32));
        mesh.normals.extend(&strip.normals);
        mesh.triangles.extend(strip.triangles.iter().map(|t| t.map(|v| v + base)));
        mesh.material.extend([0, 0]);
    }
    let n = 100_000;
    let strands = grow(&Grow { count: n, segments: 1, ..Grow::default() }, &mesh, Vec3::Y, None).unwrap();
    let small = roots_of(&strands).iter().filter(|p| p.x > 10.0).count() as f64;
    let (mean, deviation) = (0.1 * f64::from(n), (0.09 * f64::from(n)).sqrt());
    assert!((small - mean).abs() < 4.5 * deviation, "{small}");
}

#[test]
fn roots_lie_on_the_triangles() {
    // A coarse, bumpy mesh: every root must be in the plane of a triangle, within its corners.
    let mut mesh = sphere(DVec3::ZERO, 1.0);
    mesh.triangles.truncate(40);
    mesh.material.truncate(40);
    let strands = grow(&Grow { count: 2000, ..Grow::default() }, &mesh, Vec3::Y, None).unwrap();
    for root in roots_of(&strands) {
        let inside = |i: usize| {
            let [a, b, c] = mesh.corners(i);
            let n = mesh.area_vector(i);
            let part = |p: DVec3, q: DVec3| (q - p).cross(root - p).dot(n) / n.length_squared();
            let height = (root - a).dot(n) / n.length();
            height.abs() < 1e-6 && part(a, b) > -1e-4 && part(b, c) > -1e-4 && part(c, a) > -1e-4
        };
        assert!((0..40).any(inside), "{root}");
    }
}

#[test]
fn slope_keeps_to_its_range() {
    let spec = Grow { count: 20_000, segments: 1, slope: [0.25, 0.75], ..Grow::default() };
    let mut bands = [0u32; 10];
    for p in roots_of(&on_sphere(&spec)) {
        let cosine = p.y / p.length();
        assert!((0.25 - 1e-3..0.75 + 1e-3).contains(&cosine), "{cosine}");
        bands[((cosine - 0.25) * 20.0).clamp(0.0, 9.0) as usize] += 1;
    }
    // By Archimedes the area between two heights is proportional to their difference.
    let chi2: f64 = bands.iter().map(|&c| (f64::from(c) - 2000.0).powi(2) / 2000.0).sum();
    assert!(chi2 < 33.0, "{chi2} for nine degrees of freedom");

    // Exactly level ground, and the small cap within one triangle of the coarse mesh.
    let level = Grow { slope: [1.0, 1.0], count: 10, ..Grow::default() };
    assert!(grow(&level, &plane(DVec3::ZERO, DVec3::Y, [1.0; 2]), Vec3::Y, None).is_ok());
    assert!(grow(&level, &plane(DVec3::ZERO, DVec3::X, [1.0; 2]), Vec3::Y, None).is_err());
    on_sphere(&Grow { slope: [0.99999, 1.0], count: 100, ..Grow::default() });
}

#[test]
fn nothing_depends_on_threads_or_count() {
    let spec = Grow { count: 3000, clumping: 0.7, curl_radius: 0.02, color_variation: 0.5, ..Grow::default() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| on_sphere(&spec))
    };
    assert_eq!(run(1), run(3));

    let loose = Grow { clumping: 0.0, ..spec };
    let (few, many) = (on_sphere(&Grow { count: 100, ..loose.clone() }), on_sphere(&loose));
    assert_eq!(few.points[..], many.points[..few.points.len()]);
    assert_eq!(few.color.values(), &many.color.values()[..100]);
    let other = on_sphere(&Grow { seed: 2, ..loose });
    assert!(many.points.iter().zip(&other.points).all(|(a, b)| a != b));
}

#[test]
fn lengths_vary_as_told() {
    let spec = Grow { count: 4000, length: 2.0, length_variation: 0.25, gravity: 1.0, ..Grow::default() };
    let strands = on_sphere(&spec);
    let lengths: Vec<f64> = (0..4000).map(|i| strands.length(i)).collect();
    assert!(lengths.iter().all(|l| (1.5 - 1e-5..2.5 + 1e-5).contains(l)));
    let mean = lengths.iter().sum::<f64>() / 4000.0;
    // Uniform between 1.5 and 2.5: a deviation of 1/√12.
    assert!((mean - 2.0).abs() < 4.0 * 0.289 / 4000f64.sqrt(), "{mean}");
    // Even the shortest are strands.
    on_sphere(&Grow { length_variation: 1.0, count: 4000, ..Grow::default() });
}

#[test]
fn strands_leave_the_surface() {
    for (lean, gravity, curl_radius) in [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0), (0.5, 3.0, 0.0), (0.5, 100.0, 0.02)] {
        for segments in [1, 12] {
            let spec = Grow { count: 3000, lean, gravity, curl_radius, segments, ..Grow::default() };
            for s in on_sphere(&spec).iter() {
                let (root, first) = (s[0].as_dvec3(), s[1].as_dvec3());
                assert!((first - root).dot(root) > 0.0, "lean {lean}, gravity {gravity}: {root} to {first}");
            }
        }
    }
}

#[test]
fn clumps_close_up_at_the_tips() {
    let tips = |clumping: f64| {
        let spec = Grow { count: 2000, clumping, clump_size: 50, length_variation: 0.0, ..Grow::default() };
        let strands = on_sphere(&spec);
        strands.iter().map(|s| s[s.len() - 1]).collect::<Vec<_>>()
    };
    let spread = |tips: &[Vec3]| {
        let near = |a: &Vec3| tips.iter().map(|b| a.distance(*b)).filter(|d| *d > 0.0).fold(f32::INFINITY, f32::min);
        tips.iter().map(near).sum::<f32>() / tips.len() as f32
    };
    let (loose, half, closed) = (tips(0.0), tips(0.5), tips(1.0));
    assert!(spread(&half) < 0.8 * spread(&loose), "{} {}", spread(&half), spread(&loose));
    // All tips of a clump meet in one point: no more points than clumps.
    let mut distinct: Vec<[u32; 3]> = closed.iter().map(|t| t.to_array().map(f32::to_bits)).collect();
    distinct.sort_unstable();
    distinct.dedup();
    assert!(distinct.len() <= 40, "{}", distinct.len());
}

#[test]
fn widths_and_colours_are_as_told() {
    let base = [0.4, 0.2, 0.1];
    let spec =
        Grow { count: 5000, segments: 4, width_root: 0.03, width_tip: 0.01, color_variation: 0.5, ..Grow::default() };
    let mesh = plane(DVec3::ZERO, DVec3::Y, [1.0, 1.0]);
    let strands = grow(&spec, &mesh, Vec3::Y, Some(base)).unwrap();
    assert_eq!(&strands.width.values()[5..10], &[0.03, 0.025, 0.02, 0.015, 0.01]);
    let factors: Vec<f32> = strands.color.values().iter().map(|c| c.x / 0.4).collect();
    assert!(factors.iter().all(|f| (0.499..1.501).contains(f)));
    let mean = factors.iter().sum::<f32>() / 5000.0;
    assert!((mean - 1.0).abs() < 4.0 * 0.289 / 5000f32.sqrt(), "{mean}");
    assert!(strands.color.values().iter().all(|c| (c.y / c.x - 0.5).abs() < 1e-5), "the hue stays");
    let plain = Grow { color_variation: 0.0, width_tip: 0.03, ..spec };
    let strands = grow(&plain, &mesh, Vec3::Y, None).unwrap();
    assert_eq!((strands.width, strands.color), (Attribute::Uniform(0.03), Attribute::Uniform(DEFAULT_COLOR)));
}

#[test]
fn bad_values_are_named() {
    let mesh = plane(DVec3::ZERO, DVec3::Y, [1.0, 1.0]);
    let message = |spec: Grow| grow(&spec, &mesh, Vec3::Y, None).unwrap_err().to_string();
    let ok = Grow::default;
    assert_eq!(message(Grow { length: 0.0, ..ok() }), "`grow.length` is 0; it must be a positive number");
    assert!(message(Grow { gravity: f64::NAN, ..ok() }).starts_with("`grow.gravity` is NaN"));
    assert!(message(Grow { slope: [0.5, 0.2], ..ok() }).starts_with("`grow.slope` is [0.5, 0.2]"));
    assert!(message(Grow { count: u32::MAX, ..ok() }).contains("more than 1073741824"));
    assert!(message(Grow { slope: [-1.0, -0.5], ..ok() }).contains("has a slope of -1 to -0.5"));
    assert_eq!(grow(&ok(), &mesh, Vec3::ZERO, None), Err(GrowError::Up));
    let mut flat = mesh.clone();
    flat.positions.fill(Vec3::ONE);
    assert_eq!(grow(&ok(), &flat, Vec3::Y, None), Err(GrowError::NoArea));
    flat.triangles[0][2] = 9;
    assert!(matches!(grow(&ok(), &flat, Vec3::Y, None), Err(GrowError::Surface(_))));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn every_allowed_description_grows_sound_hair(
        (length, vary, lean, gravity) in (1e-9f64..1e6, 0.0f64..=1.0, 0.0f64..100.0, -100.0f64..100.0),
        (curl_radius, curl_frequency) in (prop_oneof![Just(0.0), 0.0f64..1e6], 0.0f64..1000.0),
        (clumping, clump_size) in (prop_oneof![Just(0.0), 0.0f64..=1.0], 1u32..100_000),
        (count, segments, seed) in (1u32..60, 1u32..20, any::<u32>()),
        (low, high) in (-1.0f64..0.0, 0.0f64..1.0),
    ) {
        let spec = Grow {
            count, segments, seed, length, length_variation: vary, lean, gravity, curl_radius, curl_frequency, clumping,
            clump_size, color_variation: vary, slope: [low, high], ..Grow::default()
        };
        let strands = on_sphere(&spec);
        prop_assert_eq!(strands.strand_count(), count as usize);
        prop_assert!(roots_of(&strands).iter().all(|r| (r.length() - 1.0).abs() < 1e-3));
    }
}
