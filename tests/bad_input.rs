//! The program on damaged and odd files: it uses them rightly or says clearly what is wrong, in bounded time and memory.
//!
//! Exit code 0 comes with output, 3 with an error that names the file; a signal, a panic (1), twenty seconds or 1 GiB are
//! failures. Where there are many files one process gets some hundreds of them, and a minute.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use glam::Vec3;
use nix::sys::resource::{UsageWho, getrusage};
use tress::hair::formats::{self, Options, write_hair};
use tress::hair::{Attribute, Strands};
use tress::image::{self, ImageSpec, Limits, PixelFormat, write_atomic};
use tress::scene::description::HairFormat;

const TIME_LIMIT: Duration = Duration::from_secs(20);
/// The same of a run that is about many files.
const BATCH_TIME_LIMIT: Duration = Duration::from_secs(60);
const BATCH: usize = 256;
/// Resident memory of any one run, in KiB.
const MEMORY_LIMIT: i64 = 1 << 20;
const THREADS: usize = 2;

/// A run of the program that is about one file.
struct Job {
    arguments: Vec<PathBuf>,
    file: PathBuf,
    /// Whether only exit code 3 will do.
    must_fail: bool,
}

/// Runs all jobs; the messages of those that went wrong.
fn run_all(jobs: &[Job]) -> Vec<String> {
    let (next, wrong) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Err(message) = judge(job) {
                        wrong.lock().unwrap().push(format!("{:?}: {message}", job.arguments));
                    }
                }
            });
        }
    });
    wrong.into_inner().unwrap()
}

/// Exit code, standard output and standard error of a run, unless it was ended by a signal or took too long.
fn run(arguments: &[PathBuf]) -> Result<(i32, String, String), String> {
    let mut command = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("tress"));
    let limit = if arguments.len() > 3 { BATCH_TIME_LIMIT } else { TIME_LIMIT };
    let output = command.args(arguments).timeout(limit).output().map_err(|e| e.to_string())?;
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    let (out, err) = (text(output.stdout), text(output.stderr));
    let code = output.status.code().ok_or_else(|| format!("ended by {} or out of time: {err}", output.status))?;
    Ok((code, out, err))
}

fn judge(job: &Job) -> Result<(), String> {
    let (code, out, err) = run(&job.arguments)?;
    let name = job.file.file_name().unwrap().to_string_lossy();
    let named = err.lines().any(|line| line.starts_with("error: ") && line.contains(&*name));
    let peak = getrusage(UsageWho::RUSAGE_CHILDREN).unwrap().max_rss();
    match code {
        _ if peak > MEMORY_LIMIT => Err(format!("this or an earlier run took {peak} KiB")),
        0 if job.must_fail => Err(format!("taken for sound: {out}")),
        0 if out.lines().count() > 1 => Ok(()),
        3 if named => Ok(()),
        _ => Err(format!("exit code {code}\n{out}{err}")),
    }
}

fn assert_all(jobs: &[Job]) {
    let wrong = run_all(jobs);
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), jobs.len(), wrong.join("\n"));
    let peak = getrusage(UsageWho::RUSAGE_CHILDREN).unwrap().max_rss();
    eprintln!("{} runs, {} MiB at most", jobs.len(), peak >> 10);
}

fn info(file: &Path, must_fail: bool) -> Job {
    Job { arguments: vec!["info".into(), file.into()], file: file.into(), must_fail }
}

fn infos(files: &[PathBuf]) -> Vec<Job> {
    files.iter().map(|file| info(file, false)).collect()
}

/// A check of a scene, made in `folder`, that uses the file as what it is.
fn check(folder: &Path, file: &Path, must_fail: bool) -> Job {
    static NUMBER: AtomicUsize = AtomicUsize::new(0);
    let place = file.display();
    let text = match file.extension().map(|ending| ending.to_str().unwrap()) {
        Some("obj") => format!("environment.color = [1, 1, 1]\n[[surface]]\nfile = '{place}'\n"),
        Some("hair" | "tfx" | "txt") => format!("environment.color = [1, 1, 1]\n[[hair]]\nfile = '{place}'\n"),
        Some("toml") => return Job { arguments: vec!["check".into(), file.into()], file: file.into(), must_fail },
        _ => format!("environment.file = '{place}'\n[[surface]]\nsphere = {{}}\n"),
    };
    let scene = folder.join(format!("scene{}.toml", NUMBER.fetch_add(1, Ordering::Relaxed)));
    fs::write(&scene, text).unwrap();
    Job { arguments: vec!["check".into(), scene], file: file.into(), must_fail }
}

/// All files of the folder of bad files; none, with a message, where it is absent.
fn bad_files() -> Vec<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/bad"));
    if !folder.exists() {
        eprintln!("skipped: {} is absent", folder.display());
        return Vec::new();
    }
    fn below(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { below(&path, found) } else { found.push(path) }
        }
    }
    let mut found = Vec::new();
    below(folder, &mut found);
    found.sort();
    assert!(found.len() > 100, "{} files", found.len());
    found
}

fn is_material(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "mtl")
}

/// Runs some hundreds of jobs of one subcommand as one: each file is either described or refused, whatever came before it.
fn assert_each_is_reported(jobs: &[Job]) {
    let named = jobs.iter().map(|job| job.arguments[1].clone());
    let arguments: Vec<PathBuf> = std::iter::once(jobs[0].arguments[0].clone()).chain(named).collect();
    let (code, out, err) = run(&arguments).unwrap();
    let mut sound = true;
    for job in jobs {
        let name = format!("{}", job.arguments[1].display());
        let described = out.lines().filter(|line| line.starts_with(&format!("{name}: "))).count();
        // Both ends matter: "a.hdr" is the beginning of "a.hdr.reference.tiff".
        let refused = err.lines().any(|line| {
            let mut after = line.match_indices(&name).map(|(at, _)| &line[at + name.len()..]);
            line.starts_with("error: ") && after.any(|rest| rest.starts_with([':', ',', ' ']))
        });
        assert_eq!(described + usize::from(refused), 1, "{name}\n{out}{err}");
        assert!(refused || !job.must_fail, "{} is taken for sound\n{out}", job.file.display());
        sound &= !refused;
    }
    assert_eq!(code, if sound { 0 } else { 3 }, "{err}");
}

/// All jobs of a subcommand, by processes that get some hundreds each.
fn assert_batches_are_reported(jobs: &[Job]) {
    jobs.chunks(BATCH).for_each(assert_each_is_reported);
    let peak = getrusage(UsageWho::RUSAGE_CHILDREN).unwrap().max_rss();
    assert!(peak <= MEMORY_LIMIT, "{peak} KiB");
    eprintln!("{} files, {} MiB at most", jobs.len(), peak >> 10);
}

#[test]
fn bad_files_are_described_or_refused() {
    assert_batches_are_reported(&infos(&bad_files()));
}

#[test]
fn bad_files_in_scenes_are_used_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> = bad_files().into_iter().filter(|file| !is_material(file)).collect();
    let checks: Vec<Job> = files.iter().map(|file| check(folder.path(), file, false)).collect();
    assert_batches_are_reported(&checks);
    // What one file leaves behind must not hide what the next would do alone.
    assert_all(&checks.into_iter().step_by(24).collect::<Vec<_>>());
}

/// A sound file of each kind, small enough that many cuts are quick, and whether every shorter file is damaged.
fn sound_files(folder: &Path) -> Vec<(PathBuf, bool)> {
    let path = |name: &str| folder.join(name);
    let points: Vec<Vec3> = (0..30).map(|i| Vec3::new((i / 3) as f32, (i % 3) as f32, 0.5)).collect();
    let strands = Strands {
        first: (0..=10).map(|i| 3 * i).collect(),
        width: Attribute::PerPoint(vec![0.1; 30]),
        color: Attribute::PerPoint(vec![Vec3::splat(0.25); 30]),
        transparency: Attribute::PerPoint(vec![0.5; 30]),
        points: points.clone(),
    };
    write_hair(&strands, &path("a.hair")).unwrap();

    let mut tfx = vec![0; 160];
    for (word, value) in [4.0_f32.to_bits(), 10, 3, 160].into_iter().enumerate() {
        tfx[4 * word..][..4].copy_from_slice(&value.to_le_bytes());
    }
    tfx.extend(points.iter().flat_map(|p| [p.x, p.y, p.z, 1.0]).flat_map(f32::to_le_bytes));
    fs::write(path("a.tfx"), tfx).unwrap();

    let line =
        |(i, p): (usize, &Vec3)| format!("{} {} {} 0.125\n{}", p.x, p.y, p.z, if i % 3 == 2 { "\n" } else { "" });
    fs::write(path("a.txt"), points.iter().enumerate().map(line).collect::<String>()).unwrap();
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1.5 -1e-1\nvn 0 0 1\nusemtl red\nf 1//1 2//1 3//1 4//1\nf -1 -2 -3\n";
    fs::write(path("a.obj"), obj).unwrap();
    fs::write(path("a.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
    let toml = "up = \"z\"\n[camera]\nfov = 40.5\nposition = [0, -5, 0]\n[[hair]]\nname = 'fur'\ngrow = { on = 'ball', count = 10 }\n[[surface]]\nname = 'ball'\nsphere.radius = 2\n[environment]\ncolor = [1, 1, 1]\n";
    fs::write(path("a.toml"), toml).unwrap();

    // Rows of fewer than eight pixels are stored flat.
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 6 +X 6\n".to_vec();
    hdr.extend((0..6 * 6 * 4_u8).map(|i| 100 + i % 50));
    fs::write(path("a.hdr"), hdr).unwrap();
    let channels = ["R", "G", "B"].map(|name| (name.to_owned(), PixelFormat::Half)).to_vec();
    let noise = |i: u32| (i.wrapping_mul(0x85EB_CA6B) >> 8) as f32 / (1 << 24) as f32;
    write_atomic(&path("a.exr"), &ImageSpec::new(8, 8, channels), &(0..192).map(noise).collect::<Vec<_>>()).unwrap();

    let strict = ["a.hair", "a.tfx", "a.hdr", "a.exr"].map(|name| (path(name), true));
    let lenient = ["a.txt", "a.obj", "a.toml"].map(|name| (path(name), false));
    strict.into_iter().chain(lenient).collect()
}

/// Copies of a file that end early: at its first bytes, at its last, and at places between.
fn cuts(file: &Path) -> Vec<PathBuf> {
    let bytes = fs::read(file).unwrap();
    let between = (0..24).map(|i| bytes.len() * i / 24);
    let mut ends: Vec<usize> = between.chain([1, 2, 3, 4, 7, 8, 15, 16]).chain([bytes.len() - 1]).collect();
    ends.sort_unstable();
    ends.dedup();
    let ending = file.extension().unwrap().to_str().unwrap();
    let cut = |end: usize| {
        let path = file.with_file_name(format!("cut{end}.{ending}"));
        fs::write(&path, &bytes[..end]).unwrap();
        path
    };
    ends.into_iter().map(cut).collect()
}

#[test]
fn files_cut_short_are_described_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let files = sound_files(folder.path());
    let (mut short_files, mut checks) = (Vec::new(), Vec::new());
    for (file, strict) in &files {
        for job in [info(file, false), check(folder.path(), file, false)] {
            let (code, _, err) = run(&job.arguments).unwrap();
            assert_eq!(code, 0, "the whole file must be sound: {err}");
        }
        for short in cuts(file) {
            checks.push(check(folder.path(), &short, *strict));
            short_files.push(short);
        }
    }
    assert!(checks.len() > 7 * 24);
    assert_batches_are_reported(&infos(&short_files));
    assert_batches_are_reported(&checks);
}

/// A header alone must not make the program hold what it promises.
#[test]
fn promises_of_headers_are_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut hair = b"HAIR".to_vec();
    for word in [100_000_000_u32, 1_600_000_000, 0x12, 15] {
        hair.extend(word.to_le_bytes());
    }
    hair.resize(128, 0);
    fs::write(path("a.hair"), hair).unwrap();
    let mut tfx = vec![0; 160];
    for (word, value) in [4.0_f32.to_bits(), 50_000_000, 16, 160].into_iter().enumerate() {
        tfx[4 * word..][..4].copy_from_slice(&value.to_le_bytes());
    }
    fs::write(path("a.tfx"), tfx).unwrap();
    fs::write(path("a.hdr"), "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 30000 +X 30000\n").unwrap();
    // A picture of 9000x9000 of which one pixel is stored.
    let one = vec![("Y".to_owned(), PixelFormat::Half)];
    let mut window = ImageSpec::new(1, 1, one);
    window.full_size = [9000, 9000];
    write_atomic(&path("window.exr"), &window, &[1.0]).unwrap();
    let jobs = ["a.hair", "a.tfx", "a.hdr", "window.exr"].map(|name| {
        let must_fail = name != "window.exr";
        [info(&path(name), must_fail), check(folder.path(), &path(name), must_fail)]
    });
    assert_all(jobs.as_flattened());
}

/// Good files, real ones where they are there, each of at most some kilobytes: large ones are cut down to sound small ones.
fn small_good_files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = sound_files(folder).into_iter().map(|(file, _)| file).collect();
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    for kind in ["hair", "mesh", "env"] {
        let Ok(entries) = fs::read_dir(data.join(kind)) else {
            eprintln!("skipped: {} is absent", data.join(kind).display());
            continue;
        };
        for (index, entry) in entries.flatten().enumerate() {
            let path = entry.path();
            let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
            if path.is_file() && ["hair", "tfx", "txt", "obj", "exr", "hdr"].contains(&ending) {
                let small = folder.join(format!("real{kind}{index}.{ending}"));
                shorten(&path, ending, &small);
                files.push(small);
            }
        }
    }
    files
}

/// A small, sound version of a file.
fn shorten(path: &Path, ending: &str, small: &Path) {
    let bytes = fs::read(path).unwrap();
    match ending {
        _ if bytes.len() <= 8192 => fs::write(small, bytes).unwrap(),
        "hair" => {
            let mut strands = formats::read(path, HairFormat::Auto, &Options::default()).unwrap().strands;
            strands.retain(|strand| strand < 8);
            write_hair(&strands, small).unwrap();
        }
        "tfx" => {
            // The first strands, and a header that says so.
            let mut short = bytes[..8192].to_vec();
            short[4..8].copy_from_slice(&8_u32.to_le_bytes());
            fs::write(small, short).unwrap();
        }
        "exr" => {
            let image = image::read(path, &Limits::default()).unwrap();
            let channels = image.channels.iter().map(|name| (name.clone(), PixelFormat::Half)).collect();
            let values = image.pixels[..32 * 8 * image.channels.len()].to_vec();
            write_atomic(small, &ImageSpec::new(32, 8, channels), &values).unwrap();
        }
        "hdr" => {
            // The first two rows; more bytes than they take do no harm.
            let text = bytes.windows(2).position(|pair| pair == b"-Y").unwrap();
            let end = text + bytes[text..].iter().position(|&byte| byte == b' ').unwrap() + 1;
            let rest = end + bytes[end..].iter().position(|&byte| byte == b' ').unwrap();
            fs::write(small, [&bytes[..end], b"2", &bytes[rest..rest + 12_000]].concat()).unwrap();
        }
        _ => {
            // The vertices that the first faces need are all there in the first lines of each kind.
            let text = String::from_utf8_lossy(&bytes);
            let first = |start: &str, count| {
                text.lines().filter(|line| line.starts_with(start)).take(count).collect::<Vec<_>>()
            };
            let faces = ["f 1 2 3", "f 4 5 6", "f -1 -2 -3"];
            fs::write(small, [first("v ", 60), first("vn ", 10), faces.to_vec()].concat().join("\n")).unwrap();
        }
    }
}

#[test]
fn files_cut_at_each_64th_byte_are_described_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for file in small_good_files(folder.path()) {
        let bytes = fs::read(&file).unwrap();
        let (code, _, err) = run(&["info".into(), file.clone()]).unwrap();
        // A file that is refused whole teaches nothing.
        assert_eq!(code, 0, "{}: {err}", file.display());
        for end in (0..bytes.len()).step_by(64) {
            let name = format!("{}.{end}.{}", file.file_stem().unwrap().display(), file.extension().unwrap().display());
            files.push(folder.path().join(name));
            fs::write(files.last().unwrap(), &bytes[..end]).unwrap();
        }
    }
    // Real files add some eight hundred; a clone without them has its own small ones.
    let real = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/hair")).is_dir();
    assert!(files.len() > if real { 800 } else { 50 }, "{}", files.len());
    assert_batches_are_reported(&infos(&files));
}

/// How many bytes of a file count as its header: what says how the rest is to be read.
fn header_bytes(file: &Path, bytes: &[u8]) -> usize {
    match file.extension().and_then(|e| e.to_str()).unwrap() {
        "hair" => 128,
        "tfx" => 160,
        // To the end of the line of the size.
        "hdr" => bytes.windows(2).position(|pair| pair == b"+X").unwrap() + 5,
        // All attributes: the last one is the screen's width or what sorts after it.
        "exr" => bytes.windows(10).rposition(|name| name == b"worldToNDC" || name == b"screenWind").unwrap() + 48,
        _ => 128,
    }
    .min(bytes.len())
}

#[test]
fn each_bit_of_a_header_may_be_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for (file, _) in sound_files(folder.path()) {
        let ending = file.extension().unwrap().to_str().unwrap().to_owned();
        if !["hair", "tfx", "hdr", "exr", "obj"].contains(&&*ending) {
            continue;
        }
        let bytes = fs::read(&file).unwrap();
        for bit in 0..8 * header_bytes(&file, &bytes) {
            let mut wrong = bytes.clone();
            wrong[bit / 8] ^= 1 << (bit % 8);
            files.push(folder.path().join(format!("bit{bit}.{ending}")));
            fs::write(files.last().unwrap(), wrong).unwrap();
        }
    }
    assert!(files.len() > 5 * 8 * 80, "{}", files.len());
    assert_batches_are_reported(&infos(&files));
}
