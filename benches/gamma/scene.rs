//! Models, points on and below them, what was found about them once, and truths that are kept from run to run.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::sync::OnceLock;

use tress::embree::Device;
use tress::hair::formats::{Options, read};
use tress::hair::{Attribute, HairModel};
use tress::hash::hash;
use tress::occlusion::{Calibration, ClusterTree, HairRays, Igloo, RaySettings, Receiver, Span, Transmittance};
use tress::scene::description::HairFormat;

use crate::common::models::*;
use crate::measure::{FACES, Traced, in_order};

/// Where points lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    Hair,
    Floor,
}

pub const PLACES: [Place; 2] = [Place::Hair, Place::Floor];

impl Place {
    pub fn name(self) -> &'static str {
        match self {
            Self::Hair => "hair",
            Self::Floor => "floor",
        }
    }

    pub fn igloo(self) -> Igloo {
        Igloo::new(if self == Self::Hair { Span::Sphere } else { Span::Hemisphere }, FACES)
    }

    /// Points of the truth.
    pub fn points(self) -> u32 {
        match self {
            Self::Hair => 128,
            Self::Floor => 48,
        }
    }
}

/// Points from this one on are for times alone.
const TIMED: u32 = 1000;

/// A model and what is built of it when first asked for.
pub struct Case {
    pub name: String,
    pub model: HairModel,
    /// Height of the floor below it.
    pub floor: f32,
    rays: OnceLock<HairRays>,
    tree: OnceLock<ClusterTree>,
}

impl Case {
    pub fn new(name: &str, model: HairModel, floor: f32) -> Self {
        Self { name: name.to_owned(), model, floor, rays: OnceLock::new(), tree: OnceLock::new() }
    }

    pub fn rays(&self) -> &HairRays {
        let build = || HairRays::build(&Device::new().unwrap(), &self.model, Transmittance::Crossing).unwrap();
        self.rays.get_or_init(build)
    }

    pub fn tree(&self) -> &ClusterTree {
        self.tree.get_or_init(|| ClusterTree::build(&self.model, Transmittance::Crossing))
    }

    /// Points `from..from + count` of an endless row of them.
    pub fn receivers(&self, place: Place, from: u32, count: u32) -> Vec<Receiver> {
        match place {
            Place::Hair => on_hair(&self.model, from + count).split_off(from as usize),
            Place::Floor => on_floor(self.floor, from + count).split_off(from as usize),
        }
    }

    /// Points for times, others than those of the truth, neighbours after each other.
    pub fn timed(&self, place: Place, count: u32) -> Vec<Receiver> {
        in_order(self.receivers(place, TIMED, count))
    }

    /// What tells the model and the points from others of the same name.
    fn fingerprint(&self, receivers: &[Receiver]) -> u32 {
        let mut sum = 0_u32;
        let points = self.model.points.iter().chain(receivers.iter().map(|receiver| &receiver.position));
        for value in points.flat_map(|p| p.to_array()).chain([self.model.width[0], self.model.transparency[0]]) {
            sum = (sum ^ value.to_bits()).wrapping_mul(0x0100_0193).rotate_left(7);
        }
        hash(&[sum, self.model.segments() as u32])
    }
}

/// What the groups share.
pub struct Bench {
    fresh: bool,
    ball: OnceLock<Case>,
    found: RefCell<HashMap<(String, Place, u64), Calibration>>,
}

impl Bench {
    pub fn new(fresh: bool) -> Self {
        Self { fresh, ball: OnceLock::new(), found: RefCell::default() }
    }

    /// The model of most rows.
    pub fn ball(&self) -> &Case {
        self.ball.get_or_init(|| styled(Style::Ball, 0.5))
    }

    /// What `compute` returns, kept in a file named after what it is of.
    pub fn kept(
        &self,
        case: &Case,
        what: &str,
        receivers: &[Receiver],
        compute: impl FnOnce() -> Vec<f64>,
    ) -> Vec<f64> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/truth");
        let print = case.fingerprint(receivers);
        let path = folder.join(format!("{}-{what}-{}-{print:08x}.bin", case.name, receivers.len()));
        if !self.fresh
            && let Ok(bytes) = std::fs::read(&path)
            && bytes.len() == 8 * receivers.len()
        {
            return bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("eight"))).collect();
        }
        let values = compute();
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, bytes)).expect("a file for a truth");
        values
    }

    /// Γ̄ of each point by rays.
    pub fn truth(&self, case: &Case, place: Place, receivers: &[Receiver], settings: &RaySettings) -> Vec<f64> {
        let what = format!("{}-{}-{:?}", place.name(), settings.rays, settings.crossings).replace([' ', '{', '}'], "");
        self.kept(case, &what.replace(':', "-"), receivers, || {
            Traced::new(case, &place.igloo()).values(receivers, settings)
        })
    }

    /// The points of the truth, and the truth: 200,000 rays a point, every crossing counted.
    pub fn exact(&self, case: &Case, place: Place) -> (Vec<Receiver>, Vec<f64>) {
        let receivers = case.receivers(place, 0, place.points());
        let truth = self.truth(case, place, &receivers, &RaySettings::exact(200_000));
        (receivers, truth)
    }

    /// Settings for an accuracy, found on other points than those of the truth, as many.
    pub fn calibration(&self, case: &Case, place: Place, accuracy: f64) -> Calibration {
        let key = (case.name.clone(), place, accuracy.to_bits());
        if let Some(found) = self.found.borrow().get(&key) {
            return *found;
        }
        let receivers = case.receivers(place, place.points(), place.points());
        let found = calibrated(case.tree(), case.rays(), &case.model, &receivers, &place.igloo(), accuracy);
        self.found.borrow_mut().insert(key, found);
        found
    }
}

/// 50,000 strands of 20 segments.
pub fn styled(style: Style, transparency: f32) -> Case {
    let name = format!("{style:?}-{transparency}").to_lowercase();
    Case::new(&name, grow(style, 50_000, 20, 0.003, transparency), -1.6)
}

/// The hair of a real film head, moved to the origin and scaled to a size of 2; none where the file is not there.
pub fn sintel(transparency: f32) -> Option<HairModel> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/hair/sintel_hair.16points.tfx"));
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
        return None;
    }
    let mut strands = read(path, HairFormat::Tfx, &Options::default()).expect("a sound file").strands;
    let [low, high] = strands.bounds().expect("strands");
    let scale = 2.0 / (high - low).max_element();
    for point in &mut strands.points {
        *point = (*point - 0.5 * (low + high)) * scale;
    }
    // The file gives none: 0.0015 of the size.
    strands.width = Attribute::Uniform(0.003);
    strands.transparency = Attribute::Uniform(transparency);
    let mut model = HairModel::default();
    model.add(&strands, 0);
    Some(model)
}
