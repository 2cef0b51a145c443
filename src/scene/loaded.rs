//! The scene that is rendered: everything that a description names, loaded, checked and moved to render space.

use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use thiserror::Error;

use super::description::{self, Axis, Description, EnvironmentSources, Gradient, Shadows, SurfaceMaterial};
use super::environment;
use super::space::RenderSpace;
use super::{Document, Place};
use crate::camera::Camera;
use crate::hair::{HairModel, Strands, formats, grow};
use crate::illumination::{DirectLight, Lamp, Radiance, RectLight, Sources, environment::map_axes};
use crate::surface::{Mesh, Optics, SurfaceModel, inspect::inspect, obj, primitives, teapot};
use crate::transform;

/// A scene, ready to be rendered. Lengths and positions are in render space.
#[derive(Debug)]
pub struct Scene {
    /// What the user wrote.
    pub document: Document,
    pub space: RenderSpace,
    pub camera: Camera,
    pub hair: HairModel,
    /// One for each hair object, in the order of the file.
    pub hair_objects: Vec<HairObject>,
    pub surfaces: SurfaceModel,
    pub radiance: Radiance,
    /// Small bright sources of an environment map; none where there are none or the scene does not want them found.
    pub sources: Option<Arc<Sources>>,
    /// From render space to the environment map's axes.
    pub to_map: glam::Mat3,
    /// Lights without extent: points, spots, suns.
    pub direct: Vec<Lamp>,
    /// How shadows of each of them are found.
    pub shadows: Vec<LampShadows>,
    pub area: Vec<RectLight>,
    /// What a user should be told about what was loaded.
    pub notes: Vec<String>,
}

/// How shadows of a light without extent are found.
#[derive(Clone, Debug, PartialEq)]
pub struct LampShadows {
    /// The light's key in the scene file.
    pub key: String,
    pub mode: Shadows,
    /// Pixels along a side of a shadow map.
    pub resolution: Option<u32>,
    /// Largest error of a deep shadow map's functions.
    pub error: f32,
}

/// What all strands of a hair object share.
#[derive(Clone, Debug, PartialEq)]
pub struct HairObject {
    pub name: String,
    pub shading: HairShading,
    /// Whether light from all around reaches it.
    pub gather: bool,
}

/// How the strands of a hair object reflect; for the model and its numbers see the scene file's keys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HairShading {
    /// The highlight's albedo and exponent.
    KajiyaKay { specular: Vec3, exponent: f32 },
    /// What its colour is, roughness along and around the strand, the tilt of its scales in degrees, and its index of refraction.
    Marschner { color_is: description::ColorIs, roughness: [f32; 2], tilt: f32, ior: f32 },
}

impl HairShading {
    fn of(hair: &description::Hair) -> Self {
        match hair.shading {
            description::Shading::KajiyaKay => {
                Self::KajiyaKay { specular: vec3(hair.specular), exponent: hair.exponent as f32 }
            }
            description::Shading::Marschner => Self::Marschner {
                color_is: hair.color_is,
                roughness: [hair.roughness as f32, hair.azimuthal_roughness as f32],
                tilt: hair.cuticle_tilt as f32,
                ior: hair.ior as f32,
            },
        }
    }
}

/// Something that the scene file names cannot be used.
#[derive(Debug, Error)]
#[error("{place}: {message}")]
pub struct AssetError {
    /// Where the scene file names it.
    pub place: Place,
    pub message: String,
}

impl Scene {
    /// Loads everything that a scene file names.
    ///
    /// # Errors
    /// The first asset that cannot be read or makes no sense, with its place in the scene file.
    pub fn load(document: Document) -> Result<Self, AssetError> {
        let mut loader = Loader { document: &document, notes: Vec::new() };
        let meshes = loader.meshes()?;
        let files = loader.hair_files()?;
        let space = loader.space(&meshes, &files);
        let mut hair = HairModel::default();
        let mut hair_objects = Vec::new();
        for (index, file) in files.into_iter().enumerate() {
            let strands = loader.strands(index, file, &meshes, &space, &space.from_scene())?;
            loader.add_hair(index, &strands, &mut hair, &mut hair_objects);
        }
        let mut surfaces = SurfaceModel::default();
        for (description, loaded) in document.description.surface.iter().zip(&meshes) {
            if description.visible {
                let mut mesh = loaded.mesh.clone();
                transform::transform_mesh(&(space.from_scene() * loaded.map), &mut mesh);
                match optics(description) {
                    None => surfaces.add(&mesh, description.smooth),
                    Some(optics) => surfaces.add_optics(&mesh, description.smooth, optics),
                }
            }
        }
        let (direct, shadows) = loader.lamps(&space)?;
        let area = loader.area_lights(&space)?;
        for light in &area {
            surfaces.add_light(light.corner, light.edge_u, light.edge_v, light.radiance);
        }
        let camera = loader.camera(&space)?;
        let (radiance, sources, to_map) = loader.environment()?;
        let notes = loader.notes;
        let mut scene = Self {
            space,
            camera,
            hair,
            hair_objects,
            surfaces,
            radiance,
            sources,
            to_map,
            direct,
            shadows,
            area,
            notes,
            document,
        };
        scene.leave_out();
        Ok(scene)
    }

    /// What the user wrote.
    pub fn description(&self) -> &Description {
        &self.document.description
    }

    /// Puts other settings in place of its own: of sampling, occlusion, reflections, the lights and the environment's small sources. What hair, surfaces and
    /// camera are stays as it was loaded.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn set(&mut self, description: Description) -> Result<(), AssetError> {
        let of_sources =
            |description: &Description| (description.environment.sources, description.occlusion.face_count());
        let before = of_sources(self.description());
        self.document.description = description;
        let mut loader = Loader { document: &self.document, notes: Vec::new() };
        if self.description().environment.file.is_some() && of_sources(self.description()) != before {
            (self.radiance, self.sources, self.to_map) = loader.environment()?;
        }
        (self.direct, self.shadows) = loader.lamps(&self.space)?;
        self.leave_out();
        Ok(())
    }
}

/// The grown hair of a scene, in the scene's space: what [`Scene::load`] grows, but for the rounding of its points.
#[derive(Clone, Debug)]
pub struct GrownHair {
    /// Name and strands of each hair object that is grown, in the order of the file.
    pub objects: Vec<(String, Strands)>,
    /// What a user should be told about what was loaded.
    pub notes: Vec<String>,
}

impl GrownHair {
    /// Grows the hair of a scene file; none where no hair object is grown.
    ///
    /// # Errors
    /// As [`Scene::load`], of surfaces and hair. Hair files are read, too: where the hair stands says how it is rounded.
    pub fn of(document: &Document) -> Result<Self, AssetError> {
        let mut loader = Loader { document, notes: Vec::new() };
        let meshes = loader.meshes()?;
        let files = loader.hair_files()?;
        let space = loader.space(&meshes, &files);
        let mut objects = Vec::new();
        for (index, hair) in document.description.hair.iter().enumerate() {
            if hair.grow.is_some() {
                let strands = loader.strands(index, None, &meshes, &space, &DAffine3::IDENTITY)?;
                objects.push((loader.hair_name(index), strands));
            }
        }
        Ok(Self { objects, notes: loader.notes })
    }
}

/// A surface's mesh before its transform.
struct LoadedMesh {
    mesh: Mesh,
    map: DAffine3,
}

struct Loader<'a> {
    document: &'a Document,
    notes: Vec<String>,
}

impl Loader<'_> {
    fn description(&self) -> &Description {
        &self.document.description
    }

    fn error(&self, key: &str, message: impl ToString) -> AssetError {
        AssetError { place: self.document.locate(key), message: format!("{key}: {}", message.to_string()) }
    }

    fn map(&self, key: &str, transform: &description::Transform) -> Result<DAffine3, AssetError> {
        transform::affine(transform).map_err(|e| self.error(&format!("{key}.transform"), e))
    }

    fn meshes(&mut self) -> Result<Vec<LoadedMesh>, AssetError> {
        let surfaces = self.description().surface.clone();
        surfaces.iter().enumerate().map(|(index, surface)| self.mesh(index, surface)).collect()
    }

    fn mesh(&mut self, index: usize, surface: &description::Surface) -> Result<LoadedMesh, AssetError> {
        let key = format!("surface[{index}]");
        let mut map = self.map(&key, &surface.transform)?;
        let mut mesh = if let Some(file) = &surface.file {
            let path = self.document.resolve(file);
            let loaded = obj::load_obj(&path).map_err(|e| self.error(&format!("{key}.file"), e))?;
            self.notes.extend(loaded.notes.iter().map(|note| format!("{}: {note}", path.display())));
            loaded.mesh
        } else if let Some(sphere) = &surface.sphere {
            // Made at the origin and moved in f64: far away, f32 would not hold it.
            map *= DAffine3::from_translation(DVec3::from(sphere.center));
            primitives::sphere(DVec3::ZERO, sphere.radius)
        } else if let Some(plane) = &surface.plane {
            let normal = plane.normal.map_or(up_axis(self.description().up), DVec3::from);
            map *= DAffine3::from_translation(DVec3::from(plane.center));
            primitives::plane(DVec3::ZERO, normal, plane.size)
        } else if let Some(pot) = &surface.teapot {
            map *= DAffine3::from_translation(DVec3::from(pot.center));
            teapot::teapot(DVec3::ZERO, pot.size, up_axis(self.description().up))
        } else {
            return Err(self.error(&key, "it has none of file, sphere, plane and teapot; give one"));
        };
        if let Some(color) = surface.color {
            for material in &mut mesh.materials {
                material.diffuse = vec3(color);
            }
        }
        mesh.validate().map_err(|e| self.error(&key, e))?;
        if surface.material == SurfaceMaterial::Glass && surface.visible {
            let open = inspect(&mesh).open_edges;
            if open > 0 {
                self.notes.push(format!(
                    "{key}: it is of glass, but not closed ({open} open edges): light that goes in may not come out again; give a closed body"
                ));
            }
        }
        Ok(LoadedMesh { mesh, map })
    }

    /// The strands of hair objects that come from files; none for grown ones.
    fn hair_files(&mut self) -> Result<Vec<Option<Strands>>, AssetError> {
        let objects = self.description().hair.clone();
        let mut files = Vec::with_capacity(objects.len());
        for (index, object) in objects.iter().enumerate() {
            let Some(file) = &object.file else {
                files.push(None);
                continue;
            };
            let path = self.document.resolve(file);
            let options = formats::Options {
                thickness_is: object.thickness_is,
                replaced: formats::Has {
                    width: object.width.is_some(),
                    color: object.color.is_some(),
                    transparency: object.transparency.is_some(),
                },
            };
            let loaded = formats::read(&path, object.format, &options)
                .map_err(|e| self.error(&format!("hair[{index}].file"), e))?;
            self.notes.extend(loaded.notes.iter().map(|note| format!("{}: {note}", path.display())));
            files.push(Some(loaded.strands));
        }
        Ok(files)
    }

    /// Render space: around the hair and what it grows on; without hair, around the surfaces.
    fn space(&self, meshes: &[LoadedMesh], files: &[Option<Strands>]) -> RenderSpace {
        let mut bounds = Bounds::default();
        for (object, strands) in self.description().hair.iter().zip(files) {
            let map = transform::affine(&object.transform).unwrap_or(DAffine3::IDENTITY);
            if let Some(strands) = strands {
                bounds.add(&map, &strands.points, 0.0);
            } else if let Some(grow) = &object.grow
                && let Some(mesh) = self.surface_named(&grow.on).map(|index| &meshes[index])
            {
                bounds.add(&(map * mesh.map), &mesh.mesh.positions, grow.length);
            }
        }
        if bounds.is_empty() {
            for mesh in meshes {
                bounds.add(&mesh.map, &mesh.mesh.positions, 0.0);
            }
        }
        if bounds.is_empty() {
            bounds = Bounds { low: DVec3::NEG_ONE, high: DVec3::ONE };
        }
        RenderSpace::around(bounds.low, bounds.high)
    }

    fn surface_named(&self, name: &str) -> Option<usize> {
        self.description().surface.iter().position(|surface| surface.name.as_deref() == Some(name))
    }

    /// A hair object's strands in the space that `from_scene` leads to, with the scene's overrides.
    fn strands(
        &mut self,
        index: usize,
        file: Option<Strands>,
        meshes: &[LoadedMesh],
        space: &RenderSpace,
        from_scene: &DAffine3,
    ) -> Result<Strands, AssetError> {
        let object = self.description().hair[index].clone();
        let key = format!("hair[{index}]");
        let map = self.map(&key, &object.transform)?;
        let (mut strands, to_target) = match (file, &object.grow) {
            (Some(strands), _) => (strands, from_scene * map),
            (None, Some(settings)) => {
                let strands = self.grow(&key, settings, object.color, meshes, space)?;
                let centered = space.centered();
                (strands, from_scene * map * centered.inverse())
            }
            (None, None) => return Err(self.error(&key, "it has neither file nor grow; give one")),
        };
        if let Some(width) = object.width {
            strands.width = crate::hair::Attribute::Uniform(width as f32);
        }
        if let Some(transparency) = object.transparency {
            strands.transparency = crate::hair::Attribute::Uniform(transparency as f32);
        }
        // A grown strand's colour came from `color` already, varied.
        if let Some(color) = object.color.filter(|_| object.grow.is_none()) {
            strands.color = crate::hair::Attribute::Uniform(vec3(color));
        }
        transform::transform_strands(&to_target, &mut strands);
        let dropped = strands.cut_damaged().map_err(|e| self.error(&key, e))?;
        if let Some(note) = dropped.note() {
            self.notes.push(format!("{key}: {note}"));
        }
        Ok(strands)
    }

    /// Grows hair in the scene moved to the origin: lengths stay the scene's, positions keep their digits.
    fn grow(
        &self,
        key: &str,
        settings: &description::Grow,
        color: Option<[f64; 3]>,
        meshes: &[LoadedMesh],
        space: &RenderSpace,
    ) -> Result<Strands, AssetError> {
        let key = format!("{key}.grow");
        let index = self.surface_named(&settings.on).ok_or_else(|| {
            self.error(&format!("{key}.on"), format!("there is no surface named \"{}\"", settings.on))
        })?;
        let mut mesh = meshes[index].mesh.clone();
        transform::transform_mesh(&(space.centered() * meshes[index].map), &mut mesh);
        let up = up_axis(self.description().up).as_vec3();
        grow::grow(settings, &mesh, up, color).map_err(|e| self.error(&key, e))
    }

    /// What messages call a hair object: its name, else its file's, else its key.
    fn hair_name(&self, index: usize) -> String {
        let description = &self.description().hair[index];
        description.name.clone().unwrap_or_else(|| {
            description
                .file
                .as_deref()
                .and_then(Path::file_name)
                .map_or_else(|| format!("hair[{index}]"), |file| file.to_string_lossy().into_owned())
        })
    }

    fn add_hair(&mut self, index: usize, strands: &Strands, model: &mut HairModel, objects: &mut Vec<HairObject>) {
        let description = &self.description().hair[index];
        let name = self.hair_name(index);
        let degenerate = model.add(strands, objects.len() as u16);
        objects.push(HairObject {
            name: name.clone(),
            shading: HairShading::of(description),
            gather: description.gather,
        });
        if degenerate > 0 {
            self.notes.push(format!("{name}: {degenerate} segments without length are not drawn"));
        }
    }

    fn lamps(&self, space: &RenderSpace) -> Result<(Vec<Lamp>, Vec<LampShadows>), AssetError> {
        let lights = &self.description().light;
        let (mut lamps, mut shadows) = (Vec::new(), Vec::new());
        let mut add = |light, key, mode, resolution, error: f64| {
            lamps.push(Lamp { light, blocked: mode != Shadows::None });
            shadows.push(LampShadows { key, mode, resolution, error: error as f32 });
        };
        // Intensity over squared distance: the same irradiance needs the scale's square in render units.
        let intensity = |scene: [f64; 3]| (DVec3::from(scene) * space.scale() * space.scale()).as_vec3();
        let position = |scene: [f64; 3]| space.point32(DVec3::from(scene));
        let unit = |key: &str, direction: [f64; 3]| {
            let none = || self.error(&format!("{key}.direction"), "it has no length; give a direction");
            DVec3::from(direction).try_normalize().map(|d| d.as_vec3()).ok_or_else(none)
        };
        for (index, light) in lights.point.iter().enumerate() {
            let point =
                DirectLight::Point { position: position(light.position), intensity: intensity(light.intensity) };
            add(point, format!("light.point[{index}]"), light.shadows, light.map_resolution, light.map_error);
        }
        for (index, light) in lights.spot.iter().enumerate() {
            let key = format!("light.spot[{index}]");
            let half_angle = (0.5 * light.angle).to_radians();
            let spot = DirectLight::Spot {
                position: position(light.position),
                axis: unit(&key, light.direction)?,
                inner: (half_angle * (1.0 - light.blend)).cos() as f32,
                outer: half_angle.cos() as f32,
                intensity: intensity(light.intensity),
            };
            add(spot, key, light.shadows, light.map_resolution, light.map_error);
        }
        for (index, light) in lights.directional.iter().enumerate() {
            let key = format!("light.directional[{index}]");
            let toward = -unit(&key, light.direction)?;
            let sun = DirectLight::Directional { toward, irradiance: vec3(light.irradiance) };
            add(sun, key, light.shadows, light.map_resolution, light.map_error);
        }
        Ok((lamps, shadows))
    }

    fn area_lights(&self, space: &RenderSpace) -> Result<Vec<RectLight>, AssetError> {
        let mut area = Vec::new();
        for (index, light) in self.description().light.rect.iter().enumerate() {
            let edge = |edge: [f64; 3]| (DVec3::from(edge) * space.scale()).as_vec3();
            let center = space.point32(DVec3::from(light.center));
            let rect = RectLight::new(center, edge(light.edge_u), edge(light.edge_v), vec3(light.radiance));
            area.push(rect.ok_or_else(|| {
                self.error(&format!("light.rect[{index}]"), "edge_u and edge_v span no area; they must not be parallel")
            })?);
        }
        Ok(area)
    }

    fn camera(&self, space: &RenderSpace) -> Result<Camera, AssetError> {
        let camera = &self.description().camera;
        let up = camera.up.map_or(up_axis(self.description().up), DVec3::from);
        let near = camera.near.map_or(1e-4, |near| space.length(near));
        let position = space.point(DVec3::from(camera.position));
        let target = space.point(DVec3::from(camera.target));
        Camera::new(position, target, up, camera.fov, camera.resolution, near).map_err(|e| self.error("camera", e))
    }

    fn environment(&mut self) -> Result<(Radiance, Option<Arc<Sources>>, glam::Mat3), AssetError> {
        let environment = self.description().environment.clone();
        let scale = environment.scale as f32;
        let to_map = map_axes(up_axis(self.description().up).as_vec3(), environment.rotate);
        let mut sources = None;
        let radiance = if let Some(file) = &environment.file {
            let path = self.document.resolve(file);
            let loaded = environment::load(&path, environment.mapping, scale);
            let (map, notes) = loaded.map_err(|e| self.error(e.key, e.message))?;
            self.notes.extend(notes);
            if environment.sources == EnvironmentSources::Auto {
                sources = environment::sources(&path, &map, self.description().occlusion.face_count(), &mut self.notes);
            }
            Radiance::Map(map)
        } else if let Some(Gradient { zenith, horizon, nadir }) = environment.gradient {
            let [zenith, horizon, nadir] = [zenith, horizon, nadir].map(|color| vec3(color) * scale);
            Radiance::Gradient { zenith, horizon, nadir }
        } else {
            Radiance::Uniform(vec3(environment.color.unwrap_or_default()) * scale)
        };
        Ok((radiance, sources, to_map))
    }
}

/// What a surface that is not diffuse does with light.
fn optics(surface: &description::Surface) -> Option<Optics> {
    match surface.material {
        SurfaceMaterial::Diffuse => None,
        SurfaceMaterial::Mirror => Some(Optics::Mirror { reflectance: vec3(surface.reflectance) }),
        SurfaceMaterial::Glass => {
            Some(Optics::Glass { ior: surface.ior as f32, transmission: vec3(surface.transmission) })
        }
    }
}

struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY }
    }
}

impl Bounds {
    fn is_empty(&self) -> bool {
        self.low.x > self.high.x
    }

    fn add(&mut self, map: &DAffine3, points: &[Vec3], margin: f64) {
        for point in points.iter().filter(|point| point.is_finite()) {
            let point = map.transform_point3(point.as_dvec3());
            self.low = self.low.min(point - margin);
            self.high = self.high.max(point + margin);
        }
    }
}

fn vec3(triple: [f64; 3]) -> Vec3 {
    DVec3::from(triple).as_vec3()
}

fn up_axis(axis: Axis) -> DVec3 {
    match axis {
        Axis::X => DVec3::X,
        Axis::Y => DVec3::Y,
        Axis::Z => DVec3::Z,
    }
}
