//! The summary after a render.

use std::path::PathBuf;

use crate::effects::Effect;
use crate::render::costs::{Cost, Planned};
use crate::render::memory::amount;
use crate::render::statistics::Claim;
use crate::render::{Settled, Statistics};

/// What was done, what it took, and where it went: a line each. With `effects`, also which effects the scene called for.
pub(super) fn lines(statistics: &Statistics, outputs: &[PathBuf], effects: bool) -> Vec<String> {
    let s = statistics;
    let mut lines = Vec::new();
    if effects {
        let state = |on| if on { "on " } else { "off" };
        lines.extend(s.effects.iter().map(|e| format!("effect {}: {}: {}", state(e.on), e.name, e.reason)));
    } else {
        lines.extend(overridden(&s.effects));
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
    if effects || s.planned_cpu_seconds.is_some() {
        lines.extend(costs(s));
    }
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

/// The effects that the user left out or forced on.
fn overridden(effects: &[Effect]) -> Vec<String> {
    let names = |wanted: fn(&Effect) -> bool| {
        effects.iter().filter(|effect| wanted(effect)).map(|effect| effect.name).collect::<Vec<_>>().join(", ")
    };
    [("left out", names(|effect| effect.left_out)), ("forced on", names(|effect| effect.forced))]
        .into_iter()
        .filter(|(_, names)| !names.is_empty())
        .map(|(what, names)| format!("effects {what}: {names}"))
        .collect()
}

/// What each effect took that took anything, beside what was planned.
fn costs(statistics: &Statistics) -> Vec<String> {
    let seconds = |seconds: f64| format!("{seconds:.2} s");
    let row = |name: &str, [time, planned, held, expected]: [String; 4]| {
        if statistics.planned_cpu_seconds.is_some() {
            format!("  {time:>9} {planned:>9}  {held:>13} {expected:>13}  {name}")
        } else {
            format!("  {time:>9}  {held:>13}  {name}")
        }
    };
    let took_any = |cost: &&Cost| cost.cpu_seconds() >= 0.005 || cost.bytes > 0 || planned(cost).cpu_seconds >= 0.005;
    let mut lines = vec![row("effect", ["CPU time", "planned", "memory", "planned"].map(str::to_owned))];
    lines.extend(statistics.costs.iter().filter(took_any).map(|cost| {
        let Planned { cpu_seconds, bytes } = planned(cost);
        row(cost.name, [seconds(cost.cpu_seconds()), seconds(cpu_seconds), amount(cost.bytes), amount(bytes)])
    }));
    let [own, own_planned] = [Cost::cpu_seconds, |cost: &Cost| planned(cost).cpu_seconds]
        .map(|part| statistics.costs.iter().map(part).sum());
    let pictures =
        statistics.stages.iter().filter(|stage| !matches!(&*stage.name, "loading" | "writing" | "cross-check"));
    let all: f64 = pictures.map(|stage| stage.cpu_seconds).sum();
    let rest = |all: f64, own: f64| seconds((all - own).max(0.0));
    let planned = statistics.planned_cpu_seconds.unwrap_or_default();
    let nothing = String::new;
    lines.push(row("all else", [rest(all, own), rest(planned, own_planned), nothing(), nothing()]));
    lines
}

fn planned(cost: &Cost) -> Planned {
    cost.planned.unwrap_or_default()
}

/// The error of the picture.
fn claimed(claim: &Claim, passes: u32) -> String {
    let percent = |share: f64| format!("{:.3} %", 100.0 * share);
    let warning = if claim.reached { "" } else { "warning: the error asked for was not reached: " };
    // So few pixels that they tell no upper end.
    let high = if claim.high.is_finite() { format!("to {}", percent(claim.high)) } else { "or more".to_owned() };
    format!(
        "{warning}relative RMS error {} (95 %: {} {high}), found at {} pixel{}; settings \"{}\", {passes} pass{}",
        percent(claim.error),
        percent(claim.low),
        claim.pixels,
        if claim.pixels == 1 { "" } else { "s" },
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
    fn an_error_that_one_pixel_tells_has_no_upper_end() {
        let claim = Claim {
            asked: Some(0.5),
            error: 0.09,
            low: 0.0,
            high: f64::INFINITY,
            pixels: 1,
            settings: "draft".to_owned(),
            set: Vec::new(),
            reached: true,
        };
        let text = claimed(&claim, 1);
        assert_eq!(
            text,
            "relative RMS error 9.000 % (95 %: 0.000 % or more), found at 1 pixel; settings \"draft\", 1 pass"
        );
        let text = claimed(&Claim { high: 0.2, pixels: 96, ..claim }, 4);
        assert!(
            text.contains("(95 %: 0.000 % to 20.000 %), found at 96 pixels;") && text.ends_with("4 passes"),
            "{text}"
        );
    }

    #[test]
    fn thousands_stand_apart() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
    }
}
