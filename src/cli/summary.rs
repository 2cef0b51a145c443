//! The summary after a render.

use std::path::PathBuf;

use crate::render::statistics::Claim;
use crate::render::{Settled, Statistics};

/// What was done, what it took, and where it went: a line each. With `effects`, also which effects the scene called for.
pub(super) fn lines(statistics: &Statistics, outputs: &[PathBuf], effects: bool) -> Vec<String> {
    let s = statistics;
    let mut lines = Vec::new();
    if effects {
        let state = |on| if on { "on " } else { "off" };
        lines.extend(s.effects.iter().map(|e| format!("effect {}: {}: {}", state(e.on), e.name, e.reason)));
    }
    lines.extend(s.occlusion.iter().flat_map(occlusion));
    lines.extend([
        format!(
            "shaded {} points on hair and {} on surfaces, from {} fragments of {} segments; {} triangles",
            grouped(s.hair_points),
            grouped(s.surface_points),
            grouped(s.hair_fragments),
            grouped(s.segments),
            grouped(s.triangles)
        ),
        format!(
            "time: {} ({:.2} s in all, {:.2} s of CPU time, {} threads); peak memory {:.0} MiB",
            s.stages
                .iter()
                .map(|stage| format!("{} {:.2} s", stage.name, stage.seconds))
                .collect::<Vec<_>>()
                .join(", "),
            s.seconds(),
            s.all_cpu_seconds(),
            s.threads,
            s.stages.iter().map(|stage| stage.peak_bytes).max().unwrap_or(0) as f64 / (1 << 20) as f64
        ),
        format!(
            "rendering, CPU time: fragments {:.2} s, hair occlusion {:.2} s, arriving light {:.2} s, point and directional lights {:.2} s",
            s.cpu_seconds.fragments, s.cpu_seconds.gamma, s.cpu_seconds.lambda, s.cpu_seconds.direct
        ),
    ]);
    lines.extend(s.specular.filter(|cut| cut.seen.max(cut.caustics) >= 1e-4).map(|cut| {
        format!(
            "mirrors and glass: {:.2} % of what rays see there and {:.2} % of the caustics' light are missing: indirect.specular_depth cuts their ways",
            100.0 * cut.seen,
            100.0 * cut.caustics
        )
    }));
    lines.extend(s.claim.iter().map(|claim| claimed(claim, s.passes)));
    if s.non_finite > 0 {
        lines.push(format!(
            "warning: {} shading points gave values that are not finite and were replaced by their neighbours' mean:",
            s.non_finite
        ));
        lines.extend(s.non_finite_examples.iter().map(|n| {
            let sample = n.sample.map_or_else(String::new, |sample| format!(" point {sample},"));
            format!("  pixel {},{}:{sample} {}", n.pixel[0], n.pixel[1], n.what)
        }));
        lines.push("  tress render --pixel x,y shows all that makes up such a pixel".to_owned());
    }
    lines.extend(outputs.iter().map(|path| format!("wrote {}", path.display())));
    lines
}

/// The error of the picture.
fn claimed(claim: &Claim, passes: u32) -> String {
    let percent = |share: f64| format!("{:.3} %", 100.0 * share);
    let warning = if claim.reached { "" } else { "warning: the error asked for was not reached: " };
    format!(
        "{warning}relative RMS error {} (95 %: {} to {}), found at {} pixels; settings \"{}\", {passes} pass{}",
        percent(claim.error),
        percent(claim.low),
        percent(claim.high),
        claim.pixels,
        claim.settings,
        if passes == 1 { "" } else { "es" }
    )
}

/// How hair occlusion was found.
fn occlusion(settled: &Settled) -> Vec<String> {
    let mut lines = vec![format!("hair occlusion: {}: {}", settled.estimator, settled.reason)];
    for (place, found) in [("hair", settled.hair), ("surfaces", settled.surface)] {
        let Some(found) = found else { continue };
        lines.push(match found.projection.filter(|_| settled.estimator == "igloo") {
            Some(found) if found.reached => format!(
                "  on {place}: {0}x{0} cells, opening {1}; RMS error of sky visibility {2:.4}, asked for {3}",
                found.side, found.opening, found.error, settled.accuracy
            ),
            Some(found) => format!(
                "  warning: on {place}: the accuracy of {} is not reached; the finest settings have an RMS error of {:.4}; use --occlusion raytraced",
                settled.accuracy, found.error
            ),
            None => format!("  on {place}: {} rays a point", grouped(found.rays.into())),
        });
    }
    lines
}

/// A number with its thousands apart.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_stand_apart() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
    }
}
