use super::*;
use crate::surface::inspect::inspect;
use std::collections::{HashMap, HashSet};

fn newell(sagitta: f64) -> Mesh {
    tessellated(DVec3::ZERO, LENGTH, DVec3::Z, sagitta)
}

#[test]
fn it_has_its_size_its_place_and_its_up() {
    for (up, order) in [(DVec3::Z, [0, 1, 2]), (DVec3::Y, [0, 2, 1]), (DVec3::X, [1, 2, 0])] {
        let mesh = teapot(DVec3::new(5.0, 6.0, 7.0), 2.0, up);
        assert_eq!(mesh.validate(), Ok(()));
        let [low, high] = mesh.bounds().unwrap();
        assert!((0.5 * (low + high)).distance(glam::Vec3::new(5.0, 6.0, 7.0)) < 1e-5);
        let extent = (high - low).to_array();
        // Newell's numbers: 6.43 long, 4 across, 3.15 high.
        for (axis, length) in order.into_iter().zip([6.434, 4.0, 3.15]) {
            assert!((extent[axis] / 2.0 - length as f32 / 6.434).abs() < 2e-3, "{up}: {extent:?}");
        }
        // The knob is the only thing near the top and lies in the middle; the spout's end is the farthest from it.
        let top = mesh.positions.iter().max_by(|a, b| a.as_dvec3().dot(up).total_cmp(&b.as_dvec3().dot(up))).unwrap();
        let aside = (top.as_dvec3() - DVec3::new(5.0, 6.0, 7.0)) * (DVec3::ONE - up);
        assert!(aside.length() < 0.1, "{up}: {top}");
        assert!(mesh.volume() > 0.0);
    }
}

#[test]
fn the_table_is_the_data() {
    let path = std::path::Path::new("../shared/data/mesh/teapot_newell.bpt");
    let Ok(text) = std::fs::read_to_string(path) else {
        eprintln!("skipped: {} is not there", path.display());
        return;
    };
    let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
    assert_eq!(numbers[0], 32.0);
    for (patch, data) in PATCHES.iter().zip(numbers[1..].chunks(50)) {
        for (&index, point) in patch.iter().zip(data[2..].chunks(3)) {
            assert_eq!(POINTS[usize::from(index)], point);
        }
    }
}

/// Edges that belong to one triangle only, by place.
fn rims(mesh: &Mesh) -> Vec<usize> {
    let place = |i: u32| mesh.positions[i as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    for [a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (from, to) = (place(*from), place(*to));
            *edges.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    let mut next: HashMap<[u32; 3], Vec<[u32; 3]>> = HashMap::new();
    for ([a, b], count) in edges {
        assert!(count.abs() <= 1);
        if count != 0 {
            next.entry(a).or_default().push(b);
            next.entry(b).or_default().push(a);
        }
    }
    let mut seen = HashSet::new();
    let mut loops = Vec::new();
    for start in next.keys() {
        let mut stack = vec![*start];
        let mut length = 0;
        while let Some(at) = stack.pop() {
            if seen.insert(at) {
                length += 1;
                assert_eq!(next[&at].len(), 2, "a rim branches");
                stack.extend(&next[&at]);
            }
        }
        if length > 0 {
            loops.push(length);
        }
    }
    loops.sort_unstable();
    loops
}

#[test]
fn it_is_open_at_six_rings_and_nowhere_else() {
    let steps = steps(SAGITTA * LENGTH);
    // Rim and lid are made of four patches, the ends of spout and handle of two.
    assert_eq!(rims(&newell(SAGITTA)), [2 * steps, 2 * steps, 2 * steps, 2 * steps, 4 * steps, 4 * steps]);
    assert_eq!(inspect(&newell(SAGITTA)).degenerate_triangles, 0);
}

#[test]
fn normals_are_those_of_the_surface_and_point_outwards() {
    for sagitta in [1e-2, 1e-3, 1e-4] {
        let mesh = newell(sagitta);
        let mut worst = 1.0_f64;
        for i in 0..mesh.triangles.len() {
            let flat = mesh.area_vector(i).normalize();
            for vertex in mesh.triangles[i] {
                let normal = mesh.normals[vertex as usize].as_dvec3();
                assert!((normal.length() - 1.0).abs() < 1e-6);
                worst = worst.min(flat.dot(normal));
            }
        }
        println!("sagitta {sagitta}: {} triangles, worst {worst}", mesh.triangles.len());
        // Flat triangles lag behind most where the spout's lip turns over.
        assert!(worst > if sagitta > 5e-3 { 0.2 } else { 0.8 }, "sagitta {sagitta}: {worst}");
        // Outwards from the axis on the body, up on the knob, down on the bottom.
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            let (p, n) = (p.as_dvec3() + DVec3::new(0.217, 0.0, 1.575), n.as_dvec3());
            let radius = p.x.hypot(p.y);
            if p.z > 0.3 && p.z < 2.2 && radius < 2.001 && radius > 1.9 && p.y.abs() > 1.0 {
                assert!((n.x * p.x + n.y * p.y) / radius > 0.8, "{p} {n}");
            }
            if radius < 1e-3 {
                assert!(n.z * (p.z - 1.0) > 0.999, "{p} {n}");
            }
        }
    }
}

#[test]
fn it_is_as_near_to_the_surface_as_is_asked() {
    for sagitta in [1e-2, 3e-3, 1e-3] {
        let steps = steps(sagitta * LENGTH);
        let mut worst = 0.0_f64;
        for patch in &PATCHES {
            let controls = patch.map(|index| DVec3::from(POINTS[usize::from(index)]));
            let at = |i: f64, j: f64| evaluate(&controls, i / steps as f64, j / steps as f64).0;
            for cell in 0..steps * steps {
                let (i, j) = ((cell / steps) as f64, (cell % steps) as f64);
                // The middles of a cell's sides and diagonal, where the triangles are farthest off.
                for (a, b) in [([0.0, 0.0], [1.0, 0.0]), ([0.0, 0.0], [0.0, 1.0]), ([1.0, 0.0], [0.0, 1.0])] {
                    let [p, q] = [a, b].map(|[di, dj]| at(i + di, j + dj));
                    let middle = at(i + 0.5 * (a[0] + b[0]), j + 0.5 * (a[1] + b[1]));
                    worst = worst.max(middle.distance(0.5 * (p + q)));
                }
            }
        }
        let worst = worst / LENGTH;
        println!("sagitta {sagitta}: {steps} steps, {worst}");
        assert!(worst < sagitta && worst > 0.05 * sagitta, "sagitta {sagitta}: {worst}");
    }
}

#[test]
fn its_area_converges() {
    let fine = newell(2e-5).area();
    let off: Vec<f64> = [1e-2, 3e-3, 1e-3].map(|sagitta| (newell(sagitta).area() / fine - 1.0).abs()).to_vec();
    println!("area {fine}, off by {off:?}");
    assert!(off[0] < 0.02 && off[1] < 0.006 && off[2] < 0.002, "{off:?}");
    assert!(off[0] > off[1] && off[1] > off[2], "{off:?}");
}
