use super::*;
use proptest::prelude::*;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/hair/");

/// Reads a real file, or says that it is not there.
fn real(name: &str, options: &Options) -> Option<Loaded> {
    let path = Path::new(DATA).join(name);
    if !path.exists() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(read(&path, HairFormat::Auto, options).unwrap_or_else(|e| panic!("{e}")))
}

fn auto(bytes: &[u8]) -> Result<Loaded, Fault> {
    parse(bytes, HairFormat::Auto, None, &Options::default())
}

fn encode(strands: &Strands) -> Vec<u8> {
    let mut bytes = vec![];
    write::write_content(strands, &mut bytes).unwrap();
    bytes
}

/// Three strands of 2, 4 and 3 points with every attribute per point.
fn sample() -> Strands {
    let points: Vec<Vec3> = (0..9).map(|i| Vec3::new(i as f32, 0.5 * i as f32, 1.0)).collect();
    Strands {
        first: vec![0, 2, 6, 9],
        width: Attribute::PerPoint(points.iter().map(|p| 0.1 + p.x / 100.0).collect()),
        color: Attribute::PerPoint(points.iter().map(|p| Vec3::new(p.x / 10.0, 0.5, 0.25)).collect()),
        transparency: Attribute::PerPoint(points.iter().map(|p| p.x / 20.0).collect()),
        points,
    }
}

#[test]
fn straight_hair_is_read() {
    let Some(loaded) = real("yuksel_straight.hair", &Options::default()) else { return };
    let s = &loaded.strands;
    assert_eq!((s.strand_count(), s.point_count(), s.segment_count()), (10_000, 160_000, 150_000));
    assert!(s.iter().all(|points| points.len() == 16));
    assert_eq!(s.width, Attribute::Uniform(0.1));
    assert!(matches!(s.transparency, Attribute::Uniform(t) if (t - 0.356).abs() < 5e-4));
    assert!(matches!(&s.color, Attribute::PerPoint(c) if c.len() == 160_000));
    let [low, high] = s.bounds().unwrap();
    assert!(low.abs_diff_eq(Vec3::new(-32.5, -33.9, -22.7), 0.06), "{low}");
    assert!(high.abs_diff_eq(Vec3::new(30.9, 24.1, 63.7), 0.06), "{high}");
    assert_eq!((loaded.dropped.count, loaded.format), (0, HairFormat::Hair));
    assert_eq!(loaded.has, Has { width: true, color: true, transparency: true });

    let radius = Options { thickness_is: Some(ThicknessIs::Radius), ..Options::default() };
    assert_eq!(real("yuksel_straight.hair", &radius).unwrap().strands.width, Attribute::Uniform(0.2));
}

#[test]
fn tressfx_files_are_read() {
    let Some(loaded) = real("sintel_hair.16points.tfx", &Options::default()) else { return };
    let s = &loaded.strands;
    assert_eq!((s.strand_count(), s.point_count()), (11_400, 182_400));
    let first = Vec3::new(f32::from_bits(0xbd297ca9), f32::from_bits(0x3fc06fe6), f32::from_bits(0xbd799783));
    assert_eq!(s.points[0], first);
    assert_eq!(loaded.has, Has::default());
    assert!(loaded.notes.iter().any(|n| n.contains("set `width`")), "{:?}", loaded.notes);
    let [low, high] = s.bounds().unwrap();
    let Attribute::Uniform(width) = s.width else { panic!("one width for all") };
    assert!((width * 2000.0 - low.distance(high)).abs() < 1e-4);
    // A head of hair in metres: no stray fourth component or shifted offset would keep within this box.
    assert!(low.distance(high) < 1.5, "{low} {high}");

    let loaded = real("TestHair1.v3.tfx", &Options::default()).unwrap();
    assert_eq!((loaded.strands.strand_count(), loaded.strands.point_count()), (10_027, 40_108));
    assert_eq!(loaded.strands.points[0].x, f32::from_bits(0x42432a99));
    let [low, high] = loaded.strands.bounds().unwrap();
    assert!(low.distance(high) < 400.0 && low.distance(high) > 20.0, "{low} {high}");
}

#[test]
fn text_files_are_read() {
    for (name, strands, points) in
        [("mitsuba_curve.txt", 1, 4), ("mitsuba_curve_6.txt", 4, 18), ("mitsuba_curve_doc.txt", 1, 7)]
    {
        let Some(loaded) = real(name, &Options::default()) else { return };
        assert_eq!((loaded.strands.strand_count(), loaded.strands.point_count()), (strands, points), "{name}");
        assert_eq!(loaded.format, HairFormat::Text);
        let repeats = loaded.notes.iter().any(|n| n.contains("repeat the one before"));
        assert_eq!(repeats, name == "mitsuba_curve_6.txt", "{name}: {:?}", loaded.notes);
    }
    let loaded = real("mitsuba_curve_doc.txt", &Options::default()).unwrap();
    assert_eq!(loaded.strands.width, Attribute::PerPoint(vec![0.2; 7]));
}

#[test]
fn usd_files_are_refused_by_name() {
    let path = Path::new(DATA).join("usd_pinnedCurves.usda");
    if path.exists() {
        let error = read(&path, HairFormat::Auto, &Options::default()).unwrap_err().to_string();
        assert!(error.contains("usd_pinnedCurves.usda: USD files are not read"), "{error}");
    }
}

#[test]
fn text_is_forgiving_about_space_only() {
    let text = b"\r\n\n# roots first\r\n0 0 0 1 # root\r\n  1 0 0 0.5\t\r\n\r\n   \r\n0 0 1 1\n# inside\n0 1 1 1\n\n\n";
    let loaded = auto(text).unwrap();
    assert_eq!(loaded.strands.first, [0, 2, 4]);
    assert_eq!(loaded.strands.width, Attribute::PerPoint(vec![2.0, 1.0, 2.0, 2.0]));

    let radius = Options { thickness_is: Some(ThicknessIs::Radius), ..Options::default() };
    let same = parse(text, HairFormat::Text, None, &radius).unwrap();
    assert_eq!(same.strands, loaded.strands);
    assert!(same.notes.contains(&"`thickness_is` is ignored: text files hold radii by definition".into()));

    let message = |text: &[u8]| auto(text).unwrap_err().to_string();
    assert_eq!(message(b"0 0 0 1\n1 0 0\n"), "line 2: 3 numbers instead of the four of `x y z radius`");
    assert_eq!(message(b"0 0 0 1\n\n1 0 zero 1\n"), "line 3: \"zero\" is not a finite number");
    assert_eq!(message(b"0 0 0 1\n1 0 inf 1\n"), "line 2: \"inf\" is not a finite number");
    assert_eq!(message(b"0 0 0 1\n1 0 0 -1\n"), "line 2: the radius -1 is negative");
    assert!(message(b"# nothing\n").contains("no line holds a point"));
    assert!(message(b"0 0 0 1\n").contains("no strand is left of 1"));
    assert!(auto(b"0 0 0 1\n1 0 0 1\n\n5 5 5 1\n").unwrap().notes.iter().any(|n| n.contains("dropped 1 damaged")));
}

#[test]
fn written_strands_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.hair");
    let mut even = sample();
    even.retain(|i| i == 0);
    let mut uniform = sample();
    uniform.width = Attribute::Uniform(0.25);
    uniform.color = Attribute::Uniform(Vec3::new(0.1, 0.2, 0.3));
    uniform.transparency = Attribute::PerStrand(vec![0.0, 0.5, 1.0]);
    for strands in [sample(), even, uniform] {
        write_hair(&strands, &path).unwrap();
        let loaded = read(&path, HairFormat::Auto, &Options::default()).unwrap();
        let back = &loaded.strands;
        assert_eq!((&back.points, &back.first), (&strands.points, &strands.first));
        for i in 0..strands.strand_count() {
            for p in strands.range(i) {
                assert_eq!(back.width.at(i, p), strands.width.at(i, p));
                assert_eq!(back.color.at(i, p), strands.color.at(i, p));
                assert_eq!(back.transparency.at(i, p), strands.transparency.at(i, p));
            }
        }
    }
    // Nothing but the file itself stays in the folder.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn what_cannot_be_written_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let n = 65_537u32;
    let mut strands = sample();
    strands.points = (0..=n).map(|i| Vec3::splat(i as f32)).collect();
    strands.first = vec![0, n];
    strands.points.truncate(n as usize);
    (strands.width, strands.color) = (Attribute::Uniform(1.0), Attribute::Uniform(Vec3::ONE));
    strands.transparency = Attribute::Uniform(0.0);
    let path = folder.path().join("b.hair");
    assert!(write_hair(&strands, &path).unwrap_err().to_string().contains("strand 0 has 65536 segments"));
    strands.points.pop();
    strands.first = vec![0, n - 1];
    write_hair(&strands, &path).unwrap();
    strands.points[3].y = f32::INFINITY;
    assert!(write_hair(&strands, &path).unwrap_err().to_string().contains("strand 0 is damaged"));
    let nowhere = folder.path().join("no/such/folder.hair");
    assert!(matches!(write_hair(&sample(), &nowhere), Err(Error::Write { .. })));
}

#[test]
fn hair_headers_that_lie_are_found_out() {
    let message = |edit: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = encode(&sample());
        edit(&mut bytes);
        auto(&bytes).unwrap_err().to_string()
    };
    let put = |at: usize, value: u32| move |b: &mut Vec<u8>| b[at..at + 4].copy_from_slice(&value.to_le_bytes());
    assert_eq!(message(&|b| b.truncate(100)), "byte 100: a HAIR header has 128 bytes, but the file ends here");
    assert!(message(&put(12, 0x1d)).starts_with("byte 12: the flags 0x1d say that the file holds no points"));
    assert!(message(&put(12, 0x3f)).contains("only bits 0 to 4"));
    assert!(message(&put(4, u32::MAX)).starts_with("byte 128: the array of segments needs 8589934590 bytes"));
    assert!(message(&put(8, u32::MAX)).starts_with("byte 134: the array of points needs 51539607540 bytes"));
    assert!(message(&put(8, 8)).starts_with("byte 132: strand 2 ends at point 9, but byte 8 says that there are 8"));
    assert!(message(&|b| b.truncate(b.len() - 1)).contains("the array of colours needs 108 bytes"));

    // Without the array of segments the header alone must agree with itself.
    let mut strands = sample();
    strands.retain(|i| i == 1);
    let mut bytes = encode(&strands);
    bytes[16] = 7;
    assert_eq!(
        auto(&bytes).unwrap_err().to_string(),
        "byte 4: 1 strands of 7 segments have 8 points, but byte 8 says 4"
    );

    let mut bytes = encode(&sample());
    bytes.extend_from_slice(b"tail");
    let end = bytes.len() - 4;
    let note = format!("4 bytes behind the last array, from byte {end}, are ignored");
    assert!(auto(&bytes).unwrap().notes.contains(&note));
}

#[test]
fn odd_values_are_mended_and_told() {
    let mut strands = sample();
    strands.color.values_mut()[0] = Vec3::new(2.0, -1.0, 0.5);
    strands.transparency.values_mut()[1] = 1.5;
    strands.points[7].x = f32::NAN;
    let loaded = auto(&encode(&strands)).unwrap();
    assert_eq!(loaded.strands.color.at(0, 0), Vec3::new(1.0, 0.0, 0.5));
    assert_eq!(loaded.strands.transparency.at(0, 1), 1.0);
    assert_eq!((loaded.dropped.count, loaded.dropped.examples[0].0), (1, 2));
    assert_eq!(loaded.strands.validate(), Ok(()));
    assert_eq!(loaded.notes.len(), 4, "{:?}", loaded.notes);

    strands = sample();
    strands.width = Attribute::Uniform(0.0);
    let loaded = auto(&encode(&strands)).unwrap();
    assert!(!loaded.has.width);
    assert!(matches!(loaded.strands.width, Attribute::Uniform(w) if w > 0.0));
}

#[test]
fn format_and_content_must_agree() {
    let bytes = encode(&sample());
    let message =
        |format, extension, bytes: &[u8]| parse(bytes, format, extension, &Options::default()).unwrap_err().to_string();
    assert!(
        message(HairFormat::Tfx, None, &bytes).contains("`format` says TressFX, but its first bytes are those of HAIR")
    );
    assert!(message(HairFormat::Auto, Some("TFX"), &bytes).contains("its ending says TressFX"));
    assert!(message(HairFormat::Hair, None, b"\x01\x02\x03\x04\x05").contains("the file begins with 01 02 03 04"));
    assert!(message(HairFormat::Auto, Some("abc"), b"\x01\x02\x03\x04").contains("set `format`"));
    assert!(message(HairFormat::Auto, None, b"").contains("empty"));
    assert!(parse(&bytes, HairFormat::Auto, Some("bin"), &Options::default()).is_ok());
    let folder = std::env::temp_dir();
    assert!(read(&folder, HairFormat::Auto, &Options::default()).is_err());
}

/// A TressFX file of either version.
fn tressfx(version: f32, strands: u32, each: u32) -> Vec<u8> {
    let (header, floats) = if version < 4.0 { (296usize, 3) } else { (160, 4) };
    let mut bytes = vec![0u8; header];
    bytes[0..4].copy_from_slice(&version.to_le_bytes());
    bytes[4..8].copy_from_slice(&strands.to_le_bytes());
    bytes[8..12].copy_from_slice(&each.to_le_bytes());
    let at = if version < 4.0 { 144 } else { 12 };
    bytes[at..at + 4].copy_from_slice(&(header as u32).to_le_bytes());
    for i in 0..strands * each * floats {
        bytes.extend_from_slice(&(i as f32).to_le_bytes());
    }
    bytes
}

#[test]
fn tressfx_headers_that_lie_are_found_out() {
    assert_eq!(auto(&tressfx(3.0, 2, 3)).unwrap().strands.points[1], Vec3::new(3.0, 4.0, 5.0));
    assert_eq!(auto(&tressfx(4.0, 2, 3)).unwrap().strands.points[1], Vec3::new(4.0, 5.0, 6.0));
    for version in [3.0, 4.0] {
        let good = tressfx(version, 2, 3);
        for (at, value) in [(4, u32::MAX), (8, u32::MAX), (4, 3), (8, 1), (8, 0), (4, 0)] {
            let mut bytes = good.clone();
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            assert!(auto(&bytes).is_err(), "version {version}, {value} at byte {at}");
        }
        let mut bytes = good.clone();
        let at = if version < 4.0 { 144 } else { 12 };
        bytes[at..at + 4].copy_from_slice(&17u32.to_le_bytes());
        assert!(auto(&bytes).unwrap_err().to_string().contains("begin at byte 17"));
    }
}

/// Holds for whatever a reader accepts.
fn check(bytes: &[u8], format: HairFormat) -> Result<(), TestCaseError> {
    if let Ok(loaded) = parse(bytes, format, None, &Options::default()) {
        prop_assert_eq!(loaded.strands.validate(), Ok(()));
        // The leanest point takes 8 bytes of text; each point is at least 12 bytes in the other formats.
        prop_assert!(loaded.strands.point_count() <= bytes.len() / 8 + 1);
        prop_assert!(loaded.strands.color.values().iter().all(|c| c.min_element() >= 0.0 && c.max_element() <= 1.0));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..600), pick in 0..5usize) {
        let mut bytes = bytes;
        let (head, format): (&[u8], _) = [
            (b"HAIR".as_slice(), HairFormat::Hair),
            (&[0, 0, 0x40, 0x40], HairFormat::Tfx),
            (&[0, 0, 0x80, 0x40], HairFormat::Tfx),
            (b"0 0 0 1\n", HairFormat::Text),
            (b"", HairFormat::Auto),
        ][pick];
        bytes.splice(0..head.len().min(bytes.len()), head.iter().copied());
        check(&bytes, format)?;
    }

    #[test]
    fn mutated_files_never_panic(
        pick in 0..4usize,
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8u32), 0..6),
        header_flip in (0..48usize, 0..8u32),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let text = b"0 0 0 1\n1 0 0 1\n\n0 0 1 1\n0 1 1 .5\n".to_vec();
        let (mut bytes, format) = match pick {
            0 => (encode(&sample()), HairFormat::Hair),
            1 => (tressfx(3.0, 3, 4), HairFormat::Tfx),
            2 => (tressfx(4.0, 3, 4), HairFormat::Tfx),
            _ => (text, HairFormat::Text),
        };
        for (index, bit) in flips {
            let at = index.index(bytes.len());
            bytes[at] ^= 1 << bit;
        }
        let at = header_flip.0 % bytes.len();
        bytes[at] ^= 1 << header_flip.1;
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        check(&bytes, format)?;
        check(&bytes, HairFormat::Auto)?;
    }

    #[test]
    fn any_strands_survive_the_round_trip(
        counts in prop::collection::vec(2usize..6, 1..20),
        values in prop::collection::vec((-1e6f32..1e6, 0.0f32..1.0), 128),
    ) {
        let mut first = vec![0u32];
        for count in &counts {
            first.push(first[first.len() - 1] + *count as u32);
        }
        let n = first[counts.len()] as usize;
        let strands = Strands {
            points: (0..n).map(|i| Vec3::new(values[i].0, values[i + 1].0, values[i + 2].0)).collect(),
            first,
            width: Attribute::PerPoint((0..n).map(|i| values[i].1).collect()),
            color: Attribute::PerPoint((0..n).map(|i| Vec3::splat(values[i].1)).collect()),
            transparency: Attribute::PerPoint((0..n).map(|i| values[i].1).collect()),
        };
        prop_assert_eq!(auto(&encode(&strands)).unwrap().strands, strands);
    }
}

/// The writer's file, byte for byte where the format fixes them.
#[test]
fn the_header_is_as_the_format_says() {
    let bytes = encode(&sample());
    assert_eq!(&bytes[..16], b"HAIR\x03\0\0\0\x09\0\0\0\x1f\0\0\0");
    assert_eq!(bytes.len(), 128 + 2 * 3 + (12 + 4 + 4 + 12) * 9);
    assert_eq!(&bytes[128..134], [1, 0, 3, 0, 2, 0]);
}

/// Distance from a point to a triangle: to the face where the foot of the perpendicular is inside, else to an edge.
fn distance(p: glam::DVec3, [a, b, c]: [glam::DVec3; 3]) -> f64 {
    let n = (b - a).cross(c - a);
    let inside = [(a, b), (b, c), (c, a)].iter().all(|(from, to)| (*to - *from).cross(p - *from).dot(n) >= 0.0);
    if inside && n.length() > 0.0 {
        return (p - a).dot(n.normalize()).abs();
    }
    let edge = |from: glam::DVec3, to: glam::DVec3| {
        let t = (p - from).dot(to - from) / (to - from).length_squared().max(1e-300);
        p.distance(from.lerp(to, t.clamp(0.0, 1.0)))
    };
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}

/// Hair and head come from different files in different formats, so axes, units and offsets of both must be right.
#[test]
fn sintels_hair_stands_on_her_head() {
    let Some(hair) = real("sintel_hair.16points.tfx", &Options::default()) else { return };
    let head = crate::surface::obj::load_obj(&Path::new(DATA).join("sintel_head/sintel.obj")).unwrap().mesh;
    let mut distances: Vec<f64> = (hair.strands.iter().step_by(57))
        .map(|s| s[0].as_dvec3())
        .map(|root| (0..head.triangles.len()).map(|i| distance(root, head.corners(i))).fold(f64::INFINITY, f64::min))
        .collect();
    distances.sort_by(f64::total_cmp);
    let median = distances[distances.len() / 2];
    assert!((0.0002..0.0006).contains(&median), "{median}");
}
