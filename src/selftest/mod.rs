//! What the program promises of its numbers, as checks that anyone can run: `tress selftest`, and the tests with more cases.
//!
//! A check compares a quantity with an independent truth (`f64` arithmetic along another way, a closed form, brute force, or the
//! same question asked differently) and says by how much they differ and what bound that must keep to; the bound is derived beside it. A
//! [`Property`] does so for one case made of random numbers, so that any number of cases may be drawn, and a failing one shrunk; a
//! [`Study`] does so for a fixed list. docs/numerics.md tells which place in the program each is about.

mod enclosed;
pub mod estimators;
pub mod hard;
mod layers;
mod lights;
pub mod machine;
pub mod maps;
pub mod pictures;
mod pixels;
mod places;
pub mod rooms;
mod segments;
mod thinned;
pub mod truth;

use rayon::prelude::*;

use crate::hash::hash64;

/// Unit roundoff of `f32`: half the distance from 1 to the next number.
pub const U32: f64 = 1.0 / 16_777_216.0;

/// Purpose of the random numbers of cases.
const CASE: u32 = 0x4E55_4D53;

/// How many numbers a case may draw.
pub const NUMBERS: usize = 24;

/// A difference from the truth, and what it must not exceed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    pub error: f64,
    pub bound: f64,
}

impl Measured {
    /// Whether the bound is kept; not where the error is not a number.
    pub fn holds(&self) -> bool {
        self.error <= self.bound
    }

    /// The error as a share of its bound; infinite where either is not a number.
    pub fn share(&self) -> f64 {
        let share = if self.error == 0.0 { 0.0 } else { self.error / self.bound };
        if share.is_nan() || self.error.is_nan() { f64::INFINITY } else { share }
    }

    /// Whichever comes nearer to its bound, or is further beyond it.
    pub fn worse(self, other: Self) -> Self {
        if other.share() > self.share() { other } else { self }
    }
}

/// Numbers in [0, 1) that make up a case, taken one after the other; 0.5 when they have run out.
#[derive(Clone, Debug)]
pub struct Draw<'a> {
    numbers: &'a [f64],
}

impl<'a> Draw<'a> {
    /// A case of these numbers.
    pub fn new(numbers: &'a [f64]) -> Self {
        Self { numbers }
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        let Some((&first, rest)) = self.numbers.split_first() else { return 0.5 };
        self.numbers = rest;
        first
    }

    /// A number in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A number from `low` to `high`, each power of ten as likely; both above 0.
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        (self.between(low.ln(), high.ln())).exp()
    }

    /// One of a list.
    pub fn pick<T: Copy>(&mut self, list: &[T]) -> T {
        list[((self.unit() * list.len() as f64) as usize).min(list.len() - 1)]
    }

    /// A unit direction: anywhere, or one of those where code tends to divide by zero.
    pub fn direction(&mut self) -> glam::DVec3 {
        let kind = self.unit();
        let z = 2.0 * self.unit() - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * self.unit()).sin_cos();
        // Poles, the horizon, meridians, and next to them.
        let z = if kind < 0.1 {
            z.signum()
        } else if kind < 0.2 {
            1e-7 * z
        } else if kind < 0.3 {
            (1.0 - 1e-7 * z.abs()).copysign(z)
        } else {
            z
        };
        let (sin, cos) = if (0.3..0.4).contains(&kind) { (0.0, cos.signum()) } else { (sin, cos) };
        let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
        glam::DVec3::new(r * cos, r * sin, z)
    }
}

/// Something that holds for every case.
#[derive(Clone, Copy, Debug)]
pub struct Property {
    pub name: &'static str,
    /// Cases of `tress selftest`.
    pub quick: u32,
    pub check: fn(&mut Draw) -> Measured,
}

/// The numbers of case `index`. One in eight is replaced by one from the ends of the range or its middle.
pub fn numbers(index: u32) -> [f64; NUMBERS] {
    std::array::from_fn(|i| {
        let bits = hash64(&[CASE, index, i as u32]);
        match bits & 31 {
            0 => 0.0,
            1 => 1.0 - f64::EPSILON,
            2 => 0.5,
            _ => crate::hash::to_unit64(bits),
        }
    })
}

/// What came of a property or a study.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Outcome {
    pub name: String,
    pub cases: u32,
    /// Of the case that comes nearest to its bound.
    pub error: f64,
    pub bound: f64,
    pub ok: bool,
    /// Which case that was, where cases are numbered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst: Option<u32>,
}

impl Outcome {
    /// Of a single comparison.
    pub fn one(name: impl Into<String>, measured: Measured) -> Self {
        let Measured { error, bound } = measured;
        Self { name: name.into(), cases: 1, error, bound, ok: measured.holds(), worst: None }
    }
}

impl Property {
    /// Checks cases 0 to `count`, in parallel; the outcome does not depend on the number of threads.
    pub fn outcome(&self, count: u32) -> Outcome {
        let none = || (0.0_f64, u32::MAX, Measured { error: 0.0, bound: 0.0 });
        let case = |index| {
            let measured = (self.check)(&mut Draw::new(&numbers(index)));
            (measured.share(), index, measured)
        };
        // The worst, the first of equals.
        let worse = |a: (f64, u32, Measured), b: (f64, u32, Measured)| {
            if b.0 > a.0 || (b.0 == a.0 && b.1 < a.1) { b } else { a }
        };
        let (_, worst, Measured { error, bound }) = (0..count).into_par_iter().map(case).reduce(none, worse);
        Outcome { name: self.name.to_owned(), cases: count, error, bound, ok: error <= bound, worst: Some(worst) }
    }
}

/// Why a check could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Embree(#[from] crate::embree::Error),
    #[error(transparent)]
    Render(#[from] crate::render::RenderError),
    #[error("a scene of the self-test cannot be loaded: {0}")]
    Scene(String),
    #[error("a folder for scenes of the self-test cannot be had: {0}")]
    Folder(#[from] std::io::Error),
}

/// A fixed list of comparisons.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    pub name: &'static str,
    pub run: fn() -> Result<Vec<Outcome>, Error>,
}

/// Every property.
pub fn properties() -> Vec<Property> {
    [
        segments::PROPERTIES,
        thinned::PROPERTIES,
        layers::PROPERTIES,
        pixels::PROPERTIES,
        lights::PROPERTIES,
        places::PROPERTIES,
        enclosed::PROPERTIES,
    ]
    .concat()
}

/// Every study of `tress selftest`.
pub const STUDIES: [Study; 4] = [
    Study { name: "estimators", run: estimators::quick },
    Study { name: "maps", run: maps::quick },
    Study { name: "machine", run: machine::instructions },
    Study { name: "pictures", run: pictures::quick },
];

/// All checks, one after the other; `done` hears of each outcome.
///
/// # Errors
/// Where a check cannot be made at all.
pub fn run(mut done: impl FnMut(&Outcome)) -> Result<Vec<Outcome>, Error> {
    let mut all = Vec::new();
    for property in properties() {
        all.push(property.outcome(property.quick));
        all.last().into_iter().for_each(&mut done);
    }
    for study in STUDIES {
        let outcomes = (study.run)()?;
        outcomes.iter().for_each(&mut done);
        all.extend(outcomes);
    }
    Ok(all)
}
