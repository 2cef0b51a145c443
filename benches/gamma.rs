//! Tuning harness (throw-away).
#[path = "../tests/common/mod.rs"]
mod common;

use common::models::*;
use std::io::{Read, Write};
use tress::embree::Device;
use tress::hair::HairModel;
use tress::occlusion::{ClusterTree, DepthMap, HairRays, Igloo, Receiver, Scratch, Span, Transmittance};

fn cpu() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

fn cached_truth(
    name: &str,
    rays: &dyn Fn() -> HairRays,
    model: &HairModel,
    receivers: &[Receiver],
    count: u32,
) -> Vec<f64> {
    let path = format!("{}/target/truth/{name}-{}-{count}.bin", env!("CARGO_MANIFEST_DIR"), receivers.len());
    if let Ok(mut f) = std::fs::File::open(&path) {
        let mut bytes = Vec::new();
        f.read_to_end(&mut bytes).unwrap();
        return bytes.chunks(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect();
    }
    let value = traced(&rays(), model, receivers, count);
    let mut f = std::fs::File::create(&path).unwrap();
    for v in &value {
        f.write_all(&v.to_le_bytes()).unwrap();
    }
    value
}

fn values(
    tree: &ClusterTree,
    model: &HairModel,
    receivers: &[Receiver],
    map: &DepthMap,
    faces: usize,
    opening: f32,
) -> Vec<f64> {
    let mut scratch = Scratch::default();
    receivers
        .iter()
        .map(|r| {
            let mut gamma = vec![0.0; faces];
            tree.transmittances(model, r, map, opening, None, &mut gamma, &mut scratch);
            mean(&gamma)
        })
        .collect()
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let names: Vec<&str> = args.first().map(|s| s.split(',').collect()).unwrap_or(vec!["ball5"]);
    let list = |i: usize, default: &str| -> Vec<f32> {
        args.get(i).map_or(default, |s| s.as_str()).split(',').map(|x| x.parse().unwrap()).collect()
    };
    let (sides, openings) = (list(1, "16,24,32"), list(2, "1.4"));
    let faces = 100;
    let timed_points: u32 = std::env::var("POINTS").map_or(2048, |p| p.parse().unwrap());
    for name in names {
        let (base, t) = name.split_at(name.len() - 1);
        let t = t.parse::<f32>().unwrap() / 10.0;
        let model = match base {
            "ball" => grow(Style::Ball, 50_000, 20, 0.003, t),
            "clump" => grow(Style::Clumps, 50_000, 20, 0.003, t),
            "curly" => grow(Style::Curly, 50_000, 20, 0.003, t),
            "lock" => grow(Style::Lock, 30_000, 24, 0.004, t),
            "yuksel" => yuksel_straight(if t == 0.3 { 0.356 } else { t }).unwrap(),
            _ => panic!("{base}"),
        };
        let floor = if base == "yuksel" { -1.1 } else { -1.6 };
        let start = std::time::Instant::now();
        let tree = ClusterTree::build(&model, Transmittance::Crossing);
        println!(
            "{name}: {} segments, tree {:.3} s, {:.1} B/segment",
            model.segments(),
            start.elapsed().as_secs_f64(),
            tree.bytes() as f64 / model.segments() as f64
        );
        let rays = || HairRays::build(&Device::new().unwrap(), &model, Transmittance::Crossing).unwrap();
        for (place, receivers, timed) in [
            ("hair", on_hair(&model, 128), on_hair(&model, timed_points)),
            ("floor", on_floor(floor, 48), on_floor(floor, timed_points)),
        ] {
            let truth = cached_truth(&format!("{name}-{place}"), &rays, &model, &receivers, 100_000);
            let level = truth.iter().sum::<f64>() / truth.len() as f64;
            println!(" {place}: mean {level:.4}");
            if std::env::var_os("RAYS").is_some() {
                let rays = rays();
                let igloo = igloo_for(&receivers[0], 100);
                let far = vec![f32::INFINITY; igloo.len()];
                for n in [200, 800, 1600, 3200] {
                    let s = cpu();
                    let value: Vec<f64> = receivers
                        .iter()
                        .enumerate()
                        .map(|(k, r)| {
                            let mut g = vec![0.0; igloo.len()];
                            rays.transmittances(
                                &model,
                                r,
                                &igloo,
                                &tress::occlusion::RaySettings::fastest(n),
                                &far,
                                7 + k as u32,
                                &mut g,
                            );
                            g.iter().map(|&v| f64::from(v)).sum::<f64>() / g.len() as f64
                        })
                        .collect();
                    let t = (cpu() - s) * 1e6 / receivers.len() as f64;
                    println!(
                        "  rays {n}: {t:.0} µs ({:.2} a ray)  {}",
                        t / n as f64,
                        Difference::between(&value, &truth)
                    );
                }
            }
            let mut timed = timed;
            timed.sort_by_key(|r| morton(r.position));
            let igloo = Igloo::new(if place == "hair" { Span::Sphere } else { Span::Hemisphere }, faces);
            if let Some(targets) = std::env::var_os("CAL") {
                let rays = rays();
                let apart: Vec<Receiver> = if place == "hair" {
                    on_hair(&model, 192).split_off(128)
                } else {
                    on_floor(floor, 96).split_off(48)
                };
                for target in targets.to_str().unwrap().split(',').map(|t| t.parse::<f64>().unwrap()) {
                    let s = std::time::Instant::now();
                    let found = tress::occlusion::calibrate(&tree, &rays, &model, &apart, &igloo, target);
                    let took = s.elapsed().as_secs_f64();
                    let map = found.fineness.map(&igloo);
                    let value = values(&tree, &model, &receivers, &map, igloo.len(), found.fineness.angle(&map));
                    let mut scratch = Scratch::default();
                    let mut gamma = vec![0.0; igloo.len()];
                    let s = cpu();
                    for r in &timed {
                        tree.transmittances(
                            &model,
                            r,
                            &map,
                            found.fineness.angle(&map),
                            None,
                            &mut gamma,
                            &mut scratch,
                        );
                    }
                    let t = (cpu() - s) * 1e6 / timed.len() as f64;
                    println!(
                        "  {name:7} {place} accuracy {target}: {found:?} in {took:.1} s; {t:.1} µs ({:.1} ns a lane); {}",
                        t * 1e3 / found.work,
                        Difference::between(&value, &truth)
                    );
                }
                continue;
            }
            for &side in &sides {
                let map = DepthMap::new(&igloo, side as u32);
                for &opening in &openings {
                    let opening_angle = opening * map.cell_width();
                    let mut scratch = Scratch::default();
                    let value = values(&tree, &model, &receivers, &map, igloo.len(), opening_angle);
                    let mut gamma = vec![0.0; igloo.len()];
                    let mut times: Vec<f64> = (0..std::env::var("REPEAT").map_or(7, |p| p.parse().unwrap()))
                        .map(|_| {
                            let s = cpu();
                            for r in &timed {
                                tree.transmittances(&model, r, &map, opening_angle, None, &mut gamma, &mut scratch);
                            }
                            (cpu() - s) * 1e6 / timed.len() as f64
                        })
                        .collect();
                    times.sort_by(f64::total_cmp);
                    println!(
                        "  {name:7} {place} side {side:3} opening {opening:.2}: {:7.2} µs (least {:.2})  {}",
                        times[times.len() / 2],
                        times[0],
                        Difference::between(&value, &truth)
                    );
                }
            }
        }
    }
}

fn morton(p: glam::Vec3) -> u64 {
    let spread = |x: f32| {
        let bits = ((x + 4.0) * 128.0) as u64;
        (0..10).map(|bit| (bits >> bit & 1) << (3 * bit)).sum::<u64>()
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}
