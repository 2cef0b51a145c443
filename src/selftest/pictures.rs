//! Whole pictures that must not change: the scene and its camera turned, moved, scaled and mirrored together; strands in another order, turned
//! round, cut finer, with points twice.
//!
//! The difference is Σ |a - b| over pixels and colours, over Σ a. Two scenes: *direct* has a lamp and a sun with their shadows through hair and on a
//! floor, where only rounding may tell the pictures apart (and the few crossings and pixel borders that it decides); *sky* has light from all
//! around and Γ by every segment, whose igloo is fixed in space.

use std::fmt::Write;

use glam::{DMat3, DVec3};

use super::{Error, Measured, Outcome};
use crate::hash::unit;
use crate::render::progress::Unwatched;
use crate::render::{self, Film, Options, Statistics};
use crate::scene::{self, Scene};

/// Pixels along a picture's side.
pub const SIDE: usize = 40;

/// What is done to the whole scene: a point x goes to scale · turn · x + shift.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub turn: DMat3,
    pub scale: f64,
    pub shift: DVec3,
}

impl Place {
    /// Nothing.
    pub const HERE: Self = Self { turn: DMat3::IDENTITY, scale: 1.0, shift: DVec3::ZERO };

    /// Turned about an oblique axis.
    pub fn turned(angle: f64) -> Self {
        Self { turn: DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), angle), ..Self::HERE }
    }

    /// Of another size.
    pub fn scaled(scale: f64) -> Self {
        Self { scale, ..Self::HERE }
    }

    /// Moved.
    pub fn moved(by: f64) -> Self {
        Self { shift: DVec3::new(by, -by, 0.5 * by), ..Self::HERE }
    }

    /// Seen in a mirror across the plane x = 0.
    pub fn mirrored() -> Self {
        Self { turn: DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), ..Self::HERE }
    }

    fn vector(&self, v: DVec3) -> DVec3 {
        self.turn * v * self.scale
    }
}

/// Light of a test picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Light {
    Direct,
    Sky,
}

/// The strands of the picture: a tuft of wavy hair over a floor.
pub fn strands() -> Vec<Vec<DVec3>> {
    let strand = |i: u32| {
        let random = |axis| unit(&[0x5049_4354, i, axis]);
        let root = DVec3::new(1.2 * random(0) - 0.6, -0.5, 1.2 * random(1) - 0.6);
        let lean = DVec3::new(random(2) - 0.5, 0.0, random(3) - 0.5);
        let point = |k: u32| {
            let t = f64::from(k) / 6.0;
            let wave = 0.04 * (5.0 * t + 6.0 * random(4)).sin();
            // Of f32, as files hold them.
            (root + DVec3::new(wave, t, wave) + lean * t * t).as_vec3().as_dvec3()
        };
        (0..=6).map(point).collect()
    };
    (0..70).map(strand).collect()
}

/// Each segment cut in `parts`.
pub fn cut(strands: &[Vec<DVec3>], parts: u32) -> Vec<Vec<DVec3>> {
    let one = |strand: &Vec<DVec3>| {
        let mut points = vec![strand[0]];
        for pair in strand.windows(2) {
            points.extend((1..=parts).map(|i| pair[0].lerp(pair[1], f64::from(i) / f64::from(parts))));
        }
        points
    };
    strands.iter().map(one).collect()
}

/// Renders the picture of some strands.
///
/// # Errors
/// What loading and rendering give; a folder that cannot be had.
pub fn render(
    strands: &[Vec<DVec3>],
    place: Place,
    light: Light,
    settings: &[&str],
) -> Result<(Film, Statistics), Error> {
    let folder = tempfile::tempdir()?;
    let mut hair = String::new();
    for strand in strands {
        for &point in strand {
            let DVec3 { x, y, z } = place.vector(point);
            let _ = writeln!(hair, "{x:e} {y:e} {z:e} {:e}", 0.006 * place.scale);
        }
        hair.push('\n');
    }
    std::fs::write(folder.path().join("hair.txt"), hair)?;
    let mut floor = String::new();
    for corner in [[-9.0, 9.0], [9.0, 9.0], [9.0, -9.0], [-9.0, -9.0]] {
        let DVec3 { x, y, z } = place.vector(DVec3::new(corner[0], -0.52, corner[1]));
        let _ = writeln!(floor, "v {x:e} {y:e} {z:e}");
    }
    // A mirror turns the face round.
    floor.push_str(if place.turn.determinant() > 0.0 { "f 1 2 3 4\n" } else { "f 4 3 2 1\n" });
    std::fs::write(folder.path().join("floor.obj"), floor)?;
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text(place, light))?;
    let mut settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    // Γ by every segment, unless another way is asked for.
    if light == Light::Sky && !settings.iter().any(|setting| setting.starts_with("occlusion.")) {
        settings.push("occlusion.thinning={fraction=1}".to_owned());
    }
    let document = scene::load(&path, &settings).map_err(|e| Error::Scene(e.to_string()))?;
    let mut scene = Scene::load(document).map_err(|e| Error::Scene(e.to_string()))?;
    Ok(render::render(&mut scene, &Options::default(), &Unwatched)?)
}

fn text(place: Place, light: Light) -> String {
    let list = |v: DVec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let at = |x: f64, y: f64, z: f64| list(place.vector(DVec3::new(x, y, z)) + place.shift);
    let along = |x: f64, y: f64, z: f64| list(place.turn * DVec3::new(x, y, z));
    let shift = list(place.shift);
    let camera = format!(
        "[camera]\nposition = {}\ntarget = {}\nup = {}\nfov = 26\nresolution = [{SIDE}, {SIDE}]\nnear = {:?}\n",
        at(0.6, 1.3, 3.6),
        at(0.0, -0.1, 0.0),
        along(0.0, 1.0, 0.0),
        0.01 * place.scale
    );
    let models = format!(
        "[[hair]]\nfile = \"hair.txt\"\ncolor = [0.6, 0.5, 0.3]\ntransparency = 0.4\ntransform = {{ translate = {shift} }}\n\
         [[surface]]\nfile = \"floor.obj\"\ncolor = [0.5, 0.5, 0.6]\ntransform = {{ translate = {shift} }}\n"
    );
    let square = place.scale * place.scale;
    let light = match light {
        Light::Direct => format!(
            "[environment]\ncolor = [0, 0, 0]\n[occlusion]\nmode = \"none\"\n\
             [[light.point]]\nposition = {}\nintensity = [{2:?}, {2:?}, {2:?}]\n\
             [[light.directional]]\ndirection = {1}\nirradiance = [1, 1, 1]\n",
            at(1.5, 2.0, 1.0),
            along(0.5, -1.0, -0.3),
            9.0 * square
        ),
        Light::Sky => "[environment]\ncolor = [0.5, 0.6, 0.8]\n[occlusion]\nfaces = 64\n".to_owned(),
    };
    format!("{camera}{models}{light}[sampling]\nsurface_samples = 16\nlayers = 1000\n")
}

/// Σ |a - b| / Σ a; the second read from right to left where it is a mirror's.
pub fn difference(a: &Film, b: &Film, mirrored: bool) -> f64 {
    let (mut sum, mut whole) = (0.0, 0.0);
    for (i, p) in a.pixels.iter().enumerate() {
        let (x, y) = (i % a.width(), i / a.width());
        let j = y * a.width() + if mirrored { a.width() - 1 - x } else { x };
        let off = (p.beauty - b.pixels[j].beauty).abs().as_dvec3().element_sum();
        sum += if off >= 0.0 { off } else { f64::INFINITY };
        whole += p.beauty.as_dvec3().element_sum();
    }
    sum / whole
}

/// A change that should change nothing, and what it may change.
#[derive(Clone, Debug)]
pub struct Change {
    pub name: &'static str,
    pub strands: Vec<Vec<DVec3>>,
    pub place: Place,
    /// For [`Light::Direct`] and [`Light::Sky`].
    pub bounds: [f64; 2],
}

/// All of them, with their bounds.
///
/// *direct*: coordinates are rounded to `f32` once more, which moves points by 1e-7; a pixel is 5e-2 wide, so some 1e-5 of the coverage of a fragment,
/// and a crossing that rounding decides changes a whole shadow of one point: of 10,000 points a few. Hair also sees the lit floor, by rays whose random places
/// go with the number of the segment and with the igloo: some 1e-3. Mirrored: see [`mirrored`]. *sky* turned: the faces lie elsewhere around
/// hair and on the floor, and the rays that look for the floor with them: the discretisation of 64 faces, some 1 %. Cut in four, a pixel that held one
/// layer of coverage a holds two of a/2, which let a²/4 more through where the cut falls in it.
pub fn changes() -> Vec<Change> {
    let same = strands();
    let mut permuted = same.clone();
    permuted.reverse();
    permuted.rotate_left(23);
    let backwards = same.iter().map(|strand| strand.iter().rev().copied().collect()).collect();
    let doubled = same.iter().map(|strand| strand.iter().flat_map(|&p| [p, p]).collect()).collect();
    let quarters = cut(&same, 4);
    let placed = |name, place, bounds| Change { name, strands: same.clone(), place, bounds };
    let changed = |name, strands, bounds| Change { name, strands, place: Place::HERE, bounds };
    vec![
        placed("turned by 1 radian", Place::turned(1.0), [2e-3, 2e-2]),
        placed("moved by 1e6", Place::moved(1e6), [2e-3, 2e-3]),
        placed("scaled by 1e-4", Place::scaled(1e-4), [2e-3, 2e-3]),
        placed("scaled by 1e4", Place::scaled(1e4), [2e-3, 2e-3]),
        // Of direct light `mirrored` has the bounds.
        placed("mirrored", Place::mirrored(), [f64::INFINITY, 2e-2]),
        changed("strands in another order", permuted, [2e-3, 5e-3]),
        changed("strands turned round", backwards, [2e-3, 5e-3]),
        changed("points twice", doubled, [0.0, 0.0]),
        changed("segments cut in four", quarters, [2e-2, 2e-2]),
    ]
}

/// Every change, in one light.
///
/// # Errors
/// As [`render()`].
pub fn invariances(light: Light, settings: &[&str]) -> Result<Vec<Outcome>, Error> {
    let (reference, _) = render(&strands(), Place::HERE, light, settings)?;
    let mut outcomes = Vec::new();
    for change in changes().into_iter().filter(|change| change.bounds[usize::from(light == Light::Sky)].is_finite()) {
        let (film, statistics) = render(&change.strands, change.place, light, settings)?;
        let mirrored = change.place.turn.determinant() < 0.0;
        let mut error = difference(&reference, &film, mirrored);
        let sane =
            film.pixels.iter().all(|p| (0.0..=1.0).contains(&p.alpha) && (0.0..=1.0 + 1e-6).contains(&p.occlusion));
        if statistics.non_finite > 0 || !sane {
            error = f64::INFINITY;
        }
        let bound = change.bounds[usize::from(light == Light::Sky)];
        let name = format!("picture, {}: {}", if light == Light::Sky { "sky" } else { "direct" }, change.name);
        outcomes.push(Outcome::one(name, Measured { error, bound }));
    }
    Ok(outcomes)
}

/// The picture by direct light in a mirror, three ways.
///
/// A pixel of the floor is lit at one place in it, which random numbers choose by the pixel's own column and row. In the mirror it is another place, where the
/// sharp shadow of a hair may lie that missed the first. So:
/// - *hair alone* (a black floor) has no such place: only rounding differs, as in a picture that is moved;
/// - *whole*, the difference is that of two pictures which differ in nothing but the seed: no more than 1.25 times that (some 500 pixels lie in or beside a hair's shadow, and
///   their sum is good to some 5 %; four deviations);
/// - *16 passes* average 16 places: so it is with them, and the seeds' difference is at most half of what one pass has. (Independent places would bring a quarter; a shadow
///   that few of them meet brings less.)
///
/// # Errors
/// As [`render()`].
pub fn mirrored() -> Result<Vec<Outcome>, Error> {
    let of =
        |place, settings: &[&str]| -> Result<Film, Error> { Ok(render(&strands(), place, Light::Direct, settings)?.0) };
    let reflected = |film: &Film, settings: &[&str]| -> Result<f64, Error> {
        Ok(difference(film, &of(Place::mirrored(), settings)?, true))
    };
    // What the mirror changes, and what other seeds do.
    let changed = |passes: u32| -> Result<[f64; 2], Error> {
        let passes = format!("sampling.passes={passes}");
        let film = |seed: u32| of(Place::HERE, &[&format!("sampling.seed={seed}"), &passes]);
        let [a, b, c] = [film(0)?, film(1)?, film(2)?];
        let seeds = (difference(&a, &b, false) + difference(&b, &c, false) + difference(&c, &a, false)) / 3.0;
        Ok([reflected(&a, &["sampling.seed=0", &passes])?, seeds])
    };
    let black = ["surface[0].color=[0,0,0]"];
    let alone = Measured { error: reflected(&of(Place::HERE, &black)?, &black)?, bound: 2e-3 };
    let ([one, one_seeds], [sixteen, sixteen_seeds]) = (changed(1)?, changed(16)?);
    let whole = Measured { error: one, bound: 1.25 * one_seeds };
    let many = Measured { error: sixteen, bound: 1.25 * sixteen_seeds.min(0.5 * one_seeds) };
    let outcome = |name: &str, measured| Outcome::one(format!("picture, {name}: mirrored"), measured);
    Ok(vec![outcome("hair alone", alone), outcome("direct", whole), outcome("direct, 16 passes", many)])
}

/// By direct light on hair alone (the floor is black and hides it as before) nothing is random, layers have an order of their own and crossings are
/// counted in whole numbers: the order of strands changes no bit.
///
/// # Errors
/// As [`render()`].
pub fn permutation() -> Result<Outcome, Error> {
    let of = |strands: &[Vec<DVec3>]| render(strands, Place::HERE, Light::Direct, &["surface[0].color=[0,0,0]"]);
    let here = strands();
    let mut permuted = here.clone();
    permuted.reverse();
    permuted.rotate_left(23);
    let error = difference(&of(&here)?.0, &of(&permuted)?.0, false);
    Ok(Outcome::one("picture, hair alone: strands in another order", Measured { error, bound: 0.0 }))
}

/// White hair and a white floor under a sky of 1 are never brighter than it: the largest value, less 1.
///
/// A face's mean of sin θ is taken at its middle; with 64 faces the sum over the sphere is good to 1e-3. There is no highlight: its albedo would come on top.
///
/// # Errors
/// As [`render()`].
pub fn furnace() -> Result<Outcome, Error> {
    let white =
        ["environment.color=[1,1,1]", "hair[0].color=[1,1,1]", "surface[0].color=[1,1,1]", "hair[0].specular=[0,0,0]"];
    let (film, _) = render(&strands(), Place::HERE, Light::Sky, &white)?;
    let brightest = film.pixels.iter().map(|p| p.beauty.max_element()).fold(0.0, f32::max);
    Ok(Outcome::one(
        "picture: the furnace's excess over 1",
        Measured { error: f64::from(brightest) - 1.0, bound: 1e-3 },
    ))
}

/// The pictures of `tress selftest`.
///
/// # Errors
/// As [`render()`].
pub fn quick() -> Result<Vec<Outcome>, Error> {
    let mut all = invariances(Light::Direct, &[])?;
    all.extend(mirrored()?);
    all.push(permutation()?);
    all.push(furnace()?);
    all.extend(super::rooms::quick()?);
    Ok(all)
}
