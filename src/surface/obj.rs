//! Wavefront OBJ files, with the diffuse colours of their MTL files.
//!
//! Polygons are cut into triangles, concave ones too. Diffuse colours (`Kd`) are taken as linear Rec.709. Texture coordinates, lines,
//! points, curves and groups are ignored.

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use thiserror::Error;

use super::mesh::{DEFAULT_DIFFUSE, Flaw, Material, Mesh};
use super::screen::{self, BadLine};
use crate::file::read_regular;

/// Larger OBJ files are refused, in bytes.
pub const MAX_OBJ_BYTES: u64 = 8 << 30;

/// Larger MTL files are left out, in bytes.
pub const MAX_MTL_BYTES: u64 = 64 << 20;

/// A mesh from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// Sound: [`Mesh::validate`] holds.
    pub mesh: Mesh,
    /// What a user should be told: what was missing, mended or left out.
    pub notes: Vec<String>,
}

/// Why an OBJ file could not be loaded.
#[derive(Debug, Error)]
pub enum Error {
    #[error("cannot read OBJ file {path}: {source}", path = path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("OBJ file {path}, line {line}: {what}", path = path.display())]
    Line { path: PathBuf, line: usize, what: String },
    #[error("OBJ file {path} holds no face of three corners or more", path = path.display())]
    NoFaces { path: PathBuf },
    #[error("OBJ file {path}: {source}", path = path.display())]
    Parse { path: PathBuf, source: tobj::LoadError },
    #[error("OBJ file {path}: {source}", path = path.display())]
    Mesh { path: PathBuf, source: Flaw },
}

/// Loads an OBJ file as one mesh. A missing or damaged MTL file is a note; its materials are then 0.5 grey.
///
/// # Errors
/// A file that cannot be read, a line that cannot be understood, an index out of range, a mesh without faces.
pub fn load_obj(path: &Path) -> Result<Loaded, Error> {
    let bytes = read_regular(path, MAX_OBJ_BYTES).map_err(|source| Error::Read { path: path.into(), source })?;
    parse(&bytes, path, path.parent().unwrap_or(Path::new("")))
}

/// The content of an OBJ file; `path` serves for messages. What `mtllib` names is asked of `library`.
///
/// # Errors
/// As [`load_obj`].
pub fn parse(bytes: &[u8], path: &Path, library: &(impl Library + ?Sized)) -> Result<Loaded, Error> {
    load_bytes(bytes, library).map_err(|fault| match fault {
        Fault::Line(BadLine { line, what }) => Error::Line { path: path.into(), line, what },
        Fault::NoFaces => Error::NoFaces { path: path.into() },
        Fault::Parse(source) => Error::Parse { path: path.into(), source },
        Fault::Mesh(source) => Error::Mesh { path: path.into(), source },
    })
}

/// Where the MTL files are that an OBJ file names.
pub trait Library {
    /// Whether there is a file of this name.
    fn has(&self, name: &str) -> bool;

    /// Its content.
    ///
    /// # Errors
    /// A file that is not there, cannot be read or is too large.
    fn read(&self, name: &str) -> std::io::Result<Vec<u8>>;
}

/// A folder.
impl Library for Path {
    fn has(&self, name: &str) -> bool {
        self.join(name).is_file()
    }

    fn read(&self, name: &str) -> std::io::Result<Vec<u8>> {
        read_regular(&self.join(name), MAX_MTL_BYTES)
    }
}

/// An error that does not know its file yet.
#[derive(Debug)]
enum Fault {
    Line(BadLine),
    NoFaces,
    Parse(tobj::LoadError),
    Mesh(Flaw),
}

/// The mesh in the bytes of an OBJ file.
fn load_bytes(bytes: &[u8], library: &(impl Library + ?Sized)) -> Result<Loaded, Fault> {
    let screened = screen::obj(&decode(bytes)).map_err(Fault::Line)?;
    if screened.faces == 0 {
        return Err(Fault::NoFaces);
    }
    let mut notes = vec![];
    let materials = read_libraries(library, &screened.libraries, &mut notes);
    let (models, materials) = read_models(&screened.text, &materials).map_err(Fault::Parse)?;
    if screened.left_out > 0 {
        notes.push(format!("{} lines and points are left out", screened.left_out));
    }
    if screened.rough > 0 {
        let count = screened.rough;
        notes
            .push(format!("{count} faces cross themselves, have no area or thousands of corners: cut up as they come"));
    }
    note_missing(&screened.used, &materials, &mut notes);
    let mesh = assemble(models, materials, &mut notes);
    mesh.validate().map_err(Fault::Mesh)?;
    Ok(Loaded { mesh, notes })
}

/// UTF-8 without its mark; names in other encodings lose their odd letters, numbers do not.
fn decode(bytes: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

/// The screened text of all MTL files that are there, one after the other.
fn read_libraries(library: &(impl Library + ?Sized), libraries: &[String], notes: &mut Vec<String>) -> String {
    let mut text = String::new();
    for entry in libraries {
        // One name may hold spaces, or there may be several names.
        let whole = [entry.as_str()];
        let parts: Vec<&str> = entry.split_whitespace().collect();
        let names = if library.has(entry) { &whole[..] } else { &parts[..] };
        for name in names {
            match library.read(name) {
                Ok(bytes) => {
                    let from = notes.len();
                    text.push_str(&screen::mtl(&decode(&bytes), notes));
                    notes[from..].iter_mut().for_each(|note| *note = format!("material file {name}: {note}"));
                }
                Err(e) => notes.push(format!("cannot read the material file {name}: {e}; its materials are 0.5 grey")),
            }
        }
    }
    text
}

type Parsed = (Vec<tobj::Model>, Vec<tobj::Material>);

fn read_models(text: &str, materials: &str) -> Result<Parsed, tobj::LoadError> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let (models, materials) =
        tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| tobj::load_mtl_buf(&mut materials.as_bytes()))?;
    Ok((models, materials?))
}

fn note_missing(used: &[String], materials: &[tobj::Material], notes: &mut Vec<String>) {
    const SHOWN: usize = 5;
    let missing: Vec<&str> =
        used.iter().map(String::as_str).filter(|name| !materials.iter().any(|m| m.name == *name)).collect();
    if !missing.is_empty() {
        let shown = missing.iter().take(SHOWN).map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
        let more = if missing.len() > SHOWN { ", ..." } else { "" };
        notes.push(format!("{} materials are not defined and are 0.5 grey: {shown}{more}", missing.len()));
    }
}

/// Joins the parts, one for each run of faces of one material, into one mesh.
fn assemble(models: Vec<tobj::Model>, materials: Vec<tobj::Material>, notes: &mut Vec<String>) -> Mesh {
    let mut mesh = Mesh::default();
    let mut clamped = 0usize;
    for m in materials {
        let color = m.diffuse.map_or(DEFAULT_DIFFUSE, Vec3::from);
        let diffuse = color.clamp(Vec3::ZERO, Vec3::ONE);
        clamped += usize::from(diffuse != color);
        mesh.materials.push(Material { name: m.name, diffuse });
    }
    if clamped > 0 {
        notes.push(format!("{clamped} diffuse colours were outside 0 to 1 and were clamped"));
    }
    let default_material = mesh.materials.len();
    if mesh.materials.is_empty() || models.iter().any(|m| m.mesh.material_id.is_none()) {
        mesh.materials.push(Material::default());
    }

    let mut mended = 0usize;
    let smooth = models.iter().any(|m| !m.mesh.normals.is_empty());
    for tobj::Model { mesh: part, .. } in models {
        let material = part.material_id.unwrap_or(default_material) as u32;
        let base = mesh.positions.len() as u32;
        let positions: Vec<Vec3> = part.positions.chunks_exact(3).map(Vec3::from_slice).collect();
        let normals: Vec<Vec3> = part.normals.chunks_exact(3).map(Vec3::from_slice).collect();
        let triangles: Vec<[u32; 3]> = part.indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        mesh.material.extend(std::iter::repeat_n(material, triangles.len()));
        if smooth && normals.len() == positions.len() {
            mended += add_smooth(&mut mesh, base, positions, normals, &triangles);
        } else if smooth {
            // Where only some corners have a normal, the parser's normals no longer belong to its vertices.
            add_flat(&mut mesh, base, &positions, &triangles);
        } else {
            mesh.positions.extend(positions);
            mesh.triangles.extend(triangles.iter().map(|t| t.map(|i| base + i)));
        }
    }
    if mended > 0 {
        notes.push(format!("{mended} normals without a direction were replaced by that of a face"));
    }
    mesh
}

/// Adds a part with its own normals, made unit. Returns how many had no direction and were taken from a face.
fn add_smooth(mesh: &mut Mesh, base: u32, positions: Vec<Vec3>, normals: Vec<Vec3>, triangles: &[[u32; 3]]) -> usize {
    let begin = mesh.normals.len();
    mesh.positions.extend(positions);
    mesh.normals.extend(normals.iter().map(|n| n.as_dvec3().try_normalize().map_or(Vec3::ZERO, |n| n.as_vec3())));
    let mended = mesh.normals[begin..].iter().filter(|n| **n == Vec3::ZERO).count();
    for triangle in triangles {
        mesh.triangles.push(triangle.map(|i| base + i));
        let normal = flat_normal(mesh.area_vector(mesh.triangles.len() - 1));
        for &i in triangle {
            let slot = &mut mesh.normals[begin + i as usize];
            if *slot == Vec3::ZERO {
                *slot = normal;
            }
        }
    }
    mended
}

/// Adds a part without normals to a mesh that has some: each triangle gets corners of its own, with its geometric normal.
fn add_flat(mesh: &mut Mesh, base: u32, positions: &[Vec3], triangles: &[[u32; 3]]) {
    for (k, triangle) in triangles.iter().enumerate() {
        let corner = base + 3 * k as u32;
        mesh.positions.extend(triangle.map(|i| positions[i as usize]));
        mesh.triangles.push([corner, corner + 1, corner + 2]);
        let normal = flat_normal(mesh.area_vector(mesh.triangles.len() - 1));
        mesh.normals.extend([normal; 3]);
    }
}

/// The direction of an area vector; any one for a triangle without area.
fn flat_normal(area_vector: DVec3) -> Vec3 {
    area_vector.try_normalize().unwrap_or(DVec3::Y).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::inspect::inspect;
    use proptest::prelude::*;

    const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/");

    fn load(files: &[(&str, &[u8])]) -> Result<Loaded, Error> {
        let folder = tempfile::tempdir().unwrap();
        for (name, content) in files {
            std::fs::write(folder.path().join(name), content).unwrap();
        }
        load_obj(&folder.path().join(files[0].0))
    }

    fn all_obj_files(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                all_obj_files(&path, found);
            } else if path.extension().is_some_and(|e| e == "obj") {
                found.push(path);
            }
        }
    }

    #[test]
    fn every_real_file_gives_a_mesh_or_a_clear_error() {
        let mut files = vec![];
        for folder in ["mesh", "bad/obj", "hair/sintel_head"] {
            all_obj_files(&Path::new(DATA).join(folder), &mut files);
        }
        if files.is_empty() {
            eprintln!("skipped: no files in {DATA}");
            return;
        }
        // These have no face, or one that names what is not there; all others must load.
        let refused = [
            "invalid-face-definition.obj",
            "invalid-relative-vertex-index.obj",
            "issue-140-zero-face-idx.obj",
            "issue-356-leading-spaces-newmtl.obj",
            "lines.obj",
            "line-prim.obj",
            "points-prim.obj",
        ];
        for path in files {
            let name = path.file_name().unwrap().to_str().unwrap();
            match load_obj(&path) {
                Ok(loaded) => {
                    assert_eq!(loaded.mesh.validate(), Ok(()), "{name}");
                    inspect(&loaded.mesh);
                    eprintln!("{name}: {} triangles {:?}", loaded.mesh.triangles.len(), loaded.notes);
                    assert!(!refused.contains(&name), "{name} should be refused");
                }
                Err(e) => {
                    eprintln!("{e}");
                    assert!(e.to_string().contains(name), "{e}");
                    assert!(refused.contains(&name), "{e}");
                }
            }
        }
    }

    #[test]
    fn spot_is_closed_in_spite_of_texture_seams() {
        let path = Path::new(DATA).join("mesh/spot.obj");
        if !path.exists() {
            eprintln!("skipped: {} is not there", path.display());
            return;
        }
        let mesh = load_obj(&path).unwrap().mesh;
        let report = inspect(&mesh);
        assert_eq!((report.vertices, report.triangles, report.closed), (2930, 5856, true));
        assert!(mesh.volume() > 0.0 && report.suspicious.is_empty());
    }

    #[test]
    fn quads_materials_and_notes() {
        let obj = b"\xef\xbb\xbfmtllib my colours.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n# caf\xe9\n\
            usemtl red\nf 1 2 3 4\nusemtl nowhere\nf 1 2 3\nf 1 3 2 4\n";
        let loaded = load(&[("a.obj", obj), ("my colours.mtl", b"newmtl red\nKd 2 0 0\nKa 1\n")]).unwrap();
        let mesh = &loaded.mesh;
        assert_eq!(mesh.triangles.len(), 5);
        let names: Vec<&str> = mesh.material.iter().map(|&m| &mesh.materials[m as usize].name[..]).collect();
        assert_eq!(names, ["red", "red", "default", "default", "default"]);
        assert_eq!(mesh.materials[0].diffuse, Vec3::X);
        assert_eq!(mesh.materials[1].diffuse, Vec3::splat(0.5));
        let notes = loaded.notes.join("\n");
        for part in ["clamped", "`nowhere`", "1 faces cross themselves"] {
            assert!(notes.contains(part), "{part} in {notes}");
        }
    }

    #[test]
    fn several_and_missing_material_files() {
        let obj = b"mtllib a.mtl gone.mtl /dev/zero\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl a\nf 1 2 3\n";
        let loaded = load(&[("a.obj", obj), ("a.mtl", b"newmtl a\nKd 0.25 0.5 1\n")]).unwrap();
        assert_eq!(loaded.mesh.materials[0].diffuse, Vec3::new(0.25, 0.5, 1.0));
        assert_eq!(loaded.notes.iter().filter(|n| n.contains("cannot read")).count(), 2, "{:?}", loaded.notes);
    }

    #[test]
    fn normals_belong_to_their_vertices() {
        // The second face lacks one normal, in another material so that it is a part of its own; the third has a zero one.
        let obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 2\nvn 1 0 0\nvn 0 0 0\nmtllib m.mtl\n\
            usemtl a\nf 1//1 2//1 3//2\nusemtl b\nf 1//1 3//2 4\nusemtl a\nf 1//3 4//1 2//1\n";
        let loaded = load(&[("n.obj", obj), ("m.mtl", b"newmtl a\nnewmtl b\n")]).unwrap();
        let mesh = &loaded.mesh;
        assert_eq!(mesh.normals.len(), mesh.positions.len());
        let normals = |t: usize| mesh.triangles[t].map(|i| mesh.normals[i as usize]);
        assert_eq!(normals(0), [Vec3::Z, Vec3::Z, Vec3::X]);
        assert_eq!(normals(1), [Vec3::X; 3]);
        assert_eq!(normals(2), [Vec3::Y, Vec3::Z, Vec3::Z]);
        assert!(loaded.notes.iter().any(|n| n.contains("1 normals without a direction")));
    }

    #[test]
    fn what_is_no_file_is_refused() {
        for path in ["/dev/zero", "/", "/no/such/file.obj"] {
            assert!(matches!(load_obj(Path::new(path)), Err(Error::Read { .. })), "{path}");
        }
        assert!(matches!(load(&[("e.obj", b"")]), Err(Error::NoFaces { .. })));
        let e = load(&[("f.obj", b"v 0 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 4\n")]).unwrap_err().to_string();
        assert!(e.ends_with("f.obj, line 4: the face uses vertex 4, but the file has only 3"), "{e}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn damaged_files_never_panic(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3u8), 1..8),
        ) {
            let mut bytes = b"mtllib a b\nv 0 0 0\nv 1 0 0 2\nv 0 1 0 1 0 0\nv 1 1 1\nvt 0 0\nvn 0 0 1\nvn 1 0 0\n\
                usemtl x\nf 1/1/1 2//2 -2/1/1 4\no y\nf 1//1 2//1 3//1\nusemtl z\nf 1 2 3 4 1\nl 1 2\n".to_vec();
            for (index, value, kind) in changes {
                let at = index.index(bytes.len());
                match kind {
                    0 => bytes[at] = value,
                    // Digits, signs and spaces do more harm than random bytes.
                    1 => bytes[at] = b"0123456789-/. \n"[usize::from(value) % 15],
                    _ => { bytes.remove(at); }
                }
            }
            if let Ok(loaded) = load_bytes(&bytes, Path::new("/no/such/folder")) {
                prop_assert_eq!(loaded.mesh.validate(), Ok(()));
            }
        }

        #[test]
        fn damaged_material_files_never_panic(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        ) {
            let mut bytes = b"newmtl a\nKd 1 0.5 0\nmap_Kd x\nillum 2\nKa 1\nnewmtl b\nKd 0.1\nNs 3\nd 1\n".to_vec();
            for (index, value) in changes {
                let at = index.index(bytes.len());
                bytes[at] = if value < 128 { value } else { b"0123456789-. \n#K"[usize::from(value) % 16] };
            }
            let text = screen::mtl(&decode(&bytes), &mut vec![]);
            prop_assert!(read_models("mtllib m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n", &text).is_ok());
        }
    }
}
