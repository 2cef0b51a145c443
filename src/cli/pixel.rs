//! What `tress render --pixel` prints: one pixel laid open, as text.

use std::fmt::Write;

use crate::render::{Fragment, Inspected, Shading};

/// The pixel as lines for a reader.
pub(super) fn text(pixel: &Inspected) -> String {
    let mut out = String::new();
    let [x, y] = pixel.pixel;
    let _ = writeln!(out, "pixel {x},{y}: {} hair fragments, front to back", pixel.fragments.len());
    if !pixel.fragments.is_empty() {
        let _ = writeln!(out, "  strand   segment  u        depth        coverage   t          γ          seen");
    }
    for fragment in &pixel.fragments {
        let Fragment { segment, strand, u, depth, coverage, transparency, gamma, weight } = fragment;
        let _ = writeln!(
            out,
            "  {strand:<8} {segment:<8} {u:<8.5} {depth:<12.7} {coverage:<10.3e} {transparency:<10.3e} {gamma:<10.7} {weight:.3e}"
        );
    }
    let [samples, met] = pixel.surface_samples;
    if samples > 0 {
        let _ = writeln!(out, "surfaces: met by {met} of {samples} samples");
    }
    let _ = writeln!(out, "shading points: {}", pixel.points.len());
    pixel.points.iter().for_each(|point| shading(&mut out, point));
    let [r, g, b] = pixel.beauty;
    let _ = writeln!(
        out,
        "alpha {}, occlusion {}, depth {}, beauty {r} {g} {b}",
        pixel.alpha, pixel.occlusion, pixel.depth
    );
    for bad in &pixel.non_finite {
        let sample = bad.sample.map_or_else(String::new, |sample| format!("point {sample}, "));
        let _ = writeln!(out, "not finite: {sample}{}", bad.what);
    }
    out
}

fn shading(out: &mut String, point: &Shading) {
    let [x, y, z] = point.position;
    let sample = point.sample;
    let _ = writeln!(
        out,
        "  point {sample}: {}, at {x:.6} {y:.6} {z:.6}, depth {:.7}, weight {:.3e}, key {:08x}{}",
        point.what,
        point.depth,
        point.weight,
        point.key,
        if point.finite { "" } else { "  NOT FINITE" }
    );
    let [mean, least, most] = point.gamma;
    if point.faces > 0 {
        let _ = writeln!(
            out,
            "    Γ {mean:.6} ({least:.6} to {most:.6}) over {} faces, {} of them not finite; {} end at a surface",
            point.faces, point.faces_not_finite, point.blocked_faces
        );
    }
    let lights = [
        ("Σ F Γ Λ", Some(point.environment)),
        ("Σ F Λ  ", point.unoccluded),
        ("direct ", Some(point.direct)),
        ("emitted", Some(point.emission)),
    ];
    for (name, light) in lights {
        if let Some([r, g, b]) = light {
            let _ = writeln!(out, "    {name} {r:e} {g:e} {b:e}");
        }
    }
}
