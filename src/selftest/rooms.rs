//! Pictures of surfaces against what is known of them: a closed box in light from outside is black within; a rounded body in a sun's light is as bright as its
//! normal says, up to the terminator.

use std::fmt::Write;

use glam::{DMat3, DQuat, DVec3};

use super::{Error, Measured, Outcome, truth};
use crate::render::progress::Unwatched;
use crate::render::{self, Film, Options};
use crate::scene::{self, Scene};

/// A size, and how far away in sizes, of a whole scene.
pub const PLACES: [[f64; 2]; 4] = [[1.0, 0.0], [1e-4, 0.0], [1e6, 1.0], [1.0, 1e6]];

fn picture(text: &str, files: &[(&str, String)]) -> Result<Film, Error> {
    let folder = tempfile::tempdir()?;
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content)?;
    }
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text)?;
    let document = scene::load(&path, &[]).map_err(|e| Error::Scene(e.to_string()))?;
    let mut scene = Scene::load(document).map_err(|e| Error::Scene(e.to_string()))?;
    Ok(render::render(&mut scene, &Options::default(), &Unwatched)?.0)
}

fn list(v: DVec3) -> String {
    format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z)
}

/// A white box with a tuft of hair in it, turned so that no wall lies along an axis, under a white sky, with a lamp a thousandth of the box beside a wall, one at a
/// corner, suns along and nearly along walls, and an area light that touches one; seen from within, by one bounce and by photons. The brightest value in it: nothing
/// that is lit is inside, so it is exactly 0.
///
/// # Errors
/// What loading and rendering give; a folder that cannot be had.
pub fn dark(places: &[[f64; 2]]) -> Result<Vec<Outcome>, Error> {
    let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7));
    let mut outcomes = Vec::new();
    for &[size, away] in places {
        for (kind, turn) in [("along the axes", DMat3::IDENTITY), ("turned", turn)] {
            for indirect in ["single-bounce", "photons"] {
                let film = picture(&box_text(size, away, turn, indirect), &box_files(size, turn))?;
                let brightest = film.pixels.iter().map(|p| p.beauty.max_element()).fold(0.0, f32::max);
                let name = format!("picture, in a closed box {kind}, size {size:e}, {away:e} away, {indirect}");
                // It is a box and nothing is seen through it.
                let closed = film.pixels.iter().all(|p| p.alpha >= 1.0 - 1e-6 && p.beauty.min_element() >= 0.0);
                let error = if closed { f64::from(brightest) } else { f64::INFINITY };
                outcomes.push(Outcome::one(name, Measured { error, bound: 0.0 }));
            }
        }
    }
    Ok(outcomes)
}

fn box_files(size: f64, turn: DMat3) -> [(&'static str, String); 2] {
    let mut walls = String::new();
    for i in 0..8 {
        let corner = DVec3::from_array([0, 1, 2].map(|axis| f64::from(i >> axis & 1) * 2.0 - 1.0));
        let DVec3 { x, y, z } = turn * corner * size;
        let _ = writeln!(walls, "v {x:e} {y:e} {z:e}");
    }
    walls.push_str("f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n");
    let mut hair = String::new();
    for i in 0..40 {
        let root = truth::lattice(i, 40) * 0.3 - DVec3::Y * 0.4;
        for k in 0..5 {
            let DVec3 { x, y, z } = turn * (root + DVec3::new(0.02, 0.15, -0.01) * f64::from(k)) * size;
            let _ = writeln!(hair, "{x:e} {y:e} {z:e} {:e}", 0.01 * size);
        }
        hair.push('\n');
    }
    [("box.obj", walls), ("hair.txt", hair)]
}

fn box_text(size: f64, away: f64, turn: DMat3, indirect: &str) -> String {
    let shift = DVec3::new(1.0, -1.0, 0.5) * size * away;
    let at = |x: f64, y: f64, z: f64| list(turn * DVec3::new(x, y, z) * size + shift);
    let along = |x: f64, y: f64, z: f64| list(turn * DVec3::new(x, y, z));
    let vector = |x: f64, y: f64, z: f64| list(turn * DVec3::new(x, y, z) * size);
    let strong = format!("intensity = [{0:?}, {0:?}, {0:?}]", 1e4 * size * size);
    let mut text = format!(
        "[camera]\nposition = {}\ntarget = {}\nup = {}\nfov = 100\nresolution = [24, 24]\nnear = {:?}\n\
         [environment]\ncolor = [1, 1, 1]\n[occlusion]\nfaces = 32\n[sampling]\nsurface_samples = 16\n\
         [indirect]\nmode = \"{indirect}\"\nphotons = 20000\n\
         [[surface]]\nfile = \"box.obj\"\ncolor = [0.9, 0.9, 0.9]\ntransform = {{ translate = {4} }}\n\
         [[hair]]\nfile = \"hair.txt\"\ncolor = [0.6, 0.5, 0.3]\ntransform = {{ translate = {4} }}\n",
        at(-0.8, 0.7, 0.75),
        // Into a corner, along three edges.
        at(0.9, -0.9, -0.85),
        along(0.0, 1.0, 0.0),
        1e-3 * size,
        list(shift),
    );
    for place in [[1.001, 0.0, 0.2], [1.001, 1.001, 1.001], [0.0, -1.0001, 0.0]] {
        let _ = writeln!(text, "[[light.point]]\nposition = {}\n{strong}", at(place[0], place[1], place[2]));
    }
    for way in [[1.0, 0.0, 0.0], [1.0, -1e-6, 0.0], [-1.0, -1.0, -1.0], [0.0, -1.0, 1e-4]] {
        let direction = along(way[0], way[1], way[2]);
        let _ = writeln!(text, "[[light.directional]]\ndirection = {direction}\nirradiance = [100, 100, 100]");
    }
    let _ = writeln!(
        text,
        "[[light.rect]]\ncenter = {}\nedge_u = {}\nedge_v = {}\nradiance = [100, 100, 100]",
        at(0.0, 1.01, 0.0),
        vector(0.5, 0.0, 0.0),
        vector(0.0, 0.0, 0.5)
    );
    text
}

/// Balls of few facets with smooth normals in the light of a sun from many sides: by how much a pixel is off α E max(0, n·l) / π, n its shading normal, as a share of α E / π.
///
/// A pixel has one point or a few, whose normals are alike to 20 degrees where they are lit as one, and the normal that it shows is their mean: at the
/// terminator max(0, n·l) is bent, and the mean of it over the points is more than that of the mean normal, by a fraction of the normals' spread in a pixel, 1/40 of the ball's radius. Where a facet
/// turns away from the sun its rays leave from the rounded body; an icosahedron cut in four has facets whose normals differ by up to 20 degrees from the
/// shading normal, sin 20° = .34 of the light.
///
/// # Errors
/// As [`dark`].
pub fn terminator() -> Result<Vec<Outcome>, Error> {
    let mut outcomes = Vec::new();
    for (name, level) in [("80 facets", 1), ("320 facets", 2), ("1,280 facets", 3)] {
        let mut worst = 0.0_f64;
        for i in 0..6 {
            let sun = truth::lattice(i, 6);
            let text = format!(
                "[camera]\nposition = [0, 0, 6]\ntarget = [0, 0, 0]\nfov = 21\nresolution = [80, 80]\n\
                 [environment]\ncolor = [0, 0, 0]\n[indirect]\nmode = \"none\"\n\
                 [[surface]]\nfile = \"ball.obj\"\ncolor = [0.5, 0.5, 0.5]\n\
                 [[light.directional]]\ndirection = {}\nirradiance = [3, 3, 3]\n",
                list(-sun)
            );
            let film = picture(&text, &[("ball.obj", ball(level))])?;
            for pixel in film.pixels.iter().filter(|p| p.alpha > 0.999) {
                let cosine = pixel.normal.as_dvec3().dot(sun).max(0.0);
                let lit = f64::from(pixel.beauty.x) / (0.5 * 3.0 / std::f64::consts::PI);
                worst = worst.max((lit - cosine).abs());
            }
        }
        outcomes.push(Outcome::one(
            format!("picture, a ball of {name}: light by its normal"),
            Measured { error: worst, bound: 0.02 },
        ));
    }
    Ok(outcomes)
}

/// A ball of 20 · 4^level facets as OBJ text, with the normals of a sphere.
fn ball(level: u32) -> String {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut points = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        points.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)].map(DVec3::normalize));
    }
    let near = |i: usize, j: usize| points[i].distance(points[j]) < 1.2;
    let mut facets = Vec::new();
    for (i, j, k) in (0..12).flat_map(|i| (i + 1..12).flat_map(move |j| (j + 1..12).map(move |k| (i, j, k)))) {
        if near(i, j) && near(j, k) && near(k, i) {
            let outside = (points[j] - points[i]).cross(points[k] - points[i]).dot(points[i]) > 0.0;
            facets.push(if outside { [points[i], points[j], points[k]] } else { [points[i], points[k], points[j]] });
        }
    }
    for _ in 0..level {
        let quarter = |&[a, b, c]: &[DVec3; 3]| {
            let [d, e, f] = [a + b, b + c, c + a].map(DVec3::normalize);
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        facets = facets.iter().flat_map(quarter).collect();
    }
    let mut text = String::new();
    for DVec3 { x, y, z } in facets.iter().flatten() {
        let _ = writeln!(text, "v {x:e} {y:e} {z:e}\nvn {x:e} {y:e} {z:e}");
    }
    for i in 0..facets.len() {
        let [a, b, c] = [1, 2, 3].map(|k| 3 * i + k);
        let _ = writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}");
    }
    text
}

/// Those of `tress selftest`.
///
/// # Errors
/// As [`dark`].
pub fn quick() -> Result<Vec<Outcome>, Error> {
    let mut all = dark(&PLACES[..1])?;
    all.extend(terminator()?);
    Ok(all)
}
