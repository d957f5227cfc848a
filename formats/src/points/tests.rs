use super::*;

fn read(text: &str, extension: &str) -> Result<PointSet, Error> {
    read_points(text.as_bytes(), Some(extension), &Limits::default())
}

/// Sizes of the layers of each body, by name.
fn sizes(set: &PointSet) -> Vec<(String, Vec<usize>)> {
    let sizes = |body: &PointBody| body.layers.iter().map(|layer| layer.points.len()).collect();
    let bodies = set.bodies.iter();
    bodies
        .map(|body| (body.name.clone(), sizes(body)))
        .collect()
}

#[test]
fn rows_are_sorted_into_layers() {
    let by_z = "# a comment\n0 0 1\n1 0 1\n0 1 1\n0 0 2\n1 0 2\n";
    let by_gap = "0,0,1\n1,0,1\n\n0,1,2\n0,0,1\n";
    let by_layer = "layer;x;y;z;dose\na;0;0;1;5\na;1;0;1;5\nb;0;1;1;5\n";
    let by_body = "Skull\t1\t0\t0\t0\nSkull\t1\t1\t0\t0\nTumour\t1\t5\t0\t0\n";
    let one = |sizes: &[usize]| vec![(String::new(), sizes.to_vec())];
    assert_eq!(sizes(&read(by_z, "xyz").unwrap()), one(&[3, 2]));
    assert_eq!(sizes(&read(by_gap, "csv").unwrap()), one(&[2, 2]));
    let found = read(by_layer, "csv").unwrap();
    assert_eq!(sizes(&found), one(&[2, 1]));
    assert_eq!(found.warnings.as_slice().len(), 1);
    assert_eq!(found.bodies[0].layers[1].place, Place::item(4, "layer b"));
    let found = sizes(&read(by_body, "tsv").unwrap());
    assert_eq!(
        found,
        [("Skull".into(), vec![2]), ("Tumour".into(), vec![1])]
    );
}

#[test]
fn bad_rows_are_told_with_their_lines() {
    let told = |text: &str, extension: &str| read(text, extension).unwrap_err().to_string();
    assert_eq!(
        told("0,0,0\n1,nan,0\n", "csv"),
        "table line 2: \"nan\" is not a finite number"
    );
    assert_eq!(
        told("0,0,0\n1,0\n", "csv"),
        "table line 2: 2 columns; the rows before have 3"
    );
    assert_eq!(
        told("1,2\n", "csv"),
        "table line 1: 2 columns; a row is x,y,z or layer,x,y,z or body,layer,x,y,z"
    );
    assert_eq!(
        told("x,y,w\n", "csv"),
        "table line 1: the heading names no column 'z'"
    );
    assert_eq!(
        told("1,0,0,0\n2,0,0,1\n1,5,0,0\n", "csv"),
        "table line 3: layer '1' goes on, which began at line 1"
    );
    assert_eq!(
        told("", "csv"),
        "table the file: there are no points in the file"
    );
    assert_eq!(
        told("[[[0, 0, 0], [1, 0, null]]]", "json"),
        "JSON layer 1: point 2 is [1,0,null]; a point is [x, y, z]"
    );
    assert_eq!(
        told("v 0 0 0\nl 1 2\n", "obj"),
        "OBJ polylines line 2: reference 2 to v, of which there are 1 at this line"
    );
}

#[test]
fn polylines_are_joined_and_closed() {
    let text = "o ring\nv 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2\nl 2 3\nl 3 1\ng arc\nl 1 2 3\n";
    let found = read(text, "obj").unwrap();
    assert_eq!(
        sizes(&found),
        [("ring".into(), vec![3]), ("arc".into(), vec![3])]
    );
    let closed = found.bodies.iter().map(|body| body.layers[0].is_closed);
    assert_eq!(closed.collect::<Vec<_>>(), [Some(true), Some(false)]);
}

/// Two bodies of some layers.
fn made() -> PointSet {
    let layer = |k: u32, shift: f64| Layer {
        points: (0..5 + k)
            .map(|j| glam::DVec2::from_angle(f64::from(j)).extend(f64::from(k) / 3.0) * 7.0)
            .map(|p| p + shift)
            .collect(),
        ..Layer::default()
    };
    let body = |name: &str, shift: f64| PointBody {
        name: name.to_owned(),
        color: Some(kernel::linear_from_srgb(DVec3::new(1.0, 0.2, 0.0))),
        layers: (0..4).map(|k| layer(k, shift)).collect(),
        ..PointBody::default()
    };
    PointSet {
        bodies: vec![body("skull", 0.1), body("Tumör", 1e-9)],
        unit: Some(Unit {
            name: "mm".to_owned(),
            metres: 1e-3,
        }),
        ..PointSet::default()
    }
}

#[test]
fn what_is_written_is_read_again() {
    let made = made();
    for format in POINT_FORMATS {
        let Some(write) = format.write else { continue };
        let bytes = write(&made).bytes;
        assert_eq!(bytes, write(&made).bytes);
        let found = read_points(&bytes, Some(format.extensions[0]), &Limits::default()).unwrap();
        assert_eq!(found.format, format.name);
        assert_eq!(found.warnings.as_slice(), []);
        assert_eq!(sizes(&found), sizes(&made), "{}", format.name);
        let points = |set: &PointSet| -> Vec<DVec3> {
            let layers = set.bodies.iter().flat_map(|body| body.layers.clone());
            layers.flat_map(|layer| layer.points).collect()
        };
        // Numbers of DICOM have 16 characters.
        let most = if format.name == "DICOM" { 1e-11 } else { 0.0 };
        let pairs = points(&found).into_iter().zip(points(&made));
        let off = pairs.map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
        assert!(off <= most, "{}: {off:e}", format.name);
        if format.name != "table" {
            assert_eq!(found.unit, made.unit);
            let off = found.bodies[0].color.unwrap() - made.bodies[0].color.unwrap();
            assert!(off.length() < 1e-12);
        }
    }
}

#[test]
fn what_is_lost_of_points_is_told() {
    let told = |extension: &str, set: &PointSet| -> Vec<String> {
        let named = |format: &&PointFormat| format.extensions.contains(&extension);
        let format = POINT_FORMATS.iter().find(named).unwrap();
        let export = format.write.unwrap()(set);
        let warnings = export.warnings.as_slice().iter();
        warnings.map(ToString::to_string).collect()
    };
    let mut set = made();
    assert_eq!(told("csv", &set).len(), 2);
    assert!(told("json", &set).is_empty() && told("dcm", &set).is_empty());
    set.unit = None;
    set.bodies[0].transparency = 0.5;
    assert_eq!(told("csv", &set).len(), 2);
    assert_eq!(told("json", &set).len(), 1);
    assert_eq!(told("dcm", &set).len(), 2);
    let text = br#"{"name": "a", "color": [200, 180, 140], "layers": [[[0, 0, 0]]]}"#;
    let set = read_points(text, None, &Limits::default()).unwrap();
    let told = set.warnings.as_slice()[0].to_string();
    assert!(
        told.contains("[200,180,140]; it is three numbers"),
        "{told}"
    );
}

#[test]
fn tables_are_known_by_their_first_row() {
    let read = |text: &str| read_points(text.as_bytes(), None, &Limits::default());
    for text in [
        "5,0,0\n4,1,0\n",
        "# by hand\n\n5 0 0\n",
        "\u{feff}layer;x;y;z\n1;2;3;4\n",
    ] {
        assert_eq!(read(text).unwrap().format, "table", "{text}");
    }
    for text in ["5,0\n", "five points\n", "a,b,c\n1,2,3\n"] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains("the format is not known"), "{error}");
    }
}

#[test]
fn contours_of_no_region_are_told() {
    let mut bytes = POINT_FORMATS[0].write.unwrap()(&made()).bytes;
    let number = b"\x06\x30\x22\x00\x02\x00\x00\x002";
    let at = bytes.windows(number.len()).position(|w| w == number);
    bytes[at.unwrap() + number.len() - 1] = b'7';
    let set = read_points(&bytes, None, &Limits::default()).unwrap();
    assert_eq!(set.bodies.len(), 1);
    let told: Vec<_> = set
        .warnings
        .as_slice()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(
        told,
        [
            "ROI 7 \"Tumör\": the ROI has no contours",
            "contours of ROI 2: there is no ROI of this number; they are not used"
        ]
    );
}

#[test]
fn damaged_structure_sets_end_in_errors() {
    let good = POINT_FORMATS[0].write.unwrap()(&made()).bytes;
    let read = |bytes: &[u8]| read_points(bytes, Some("dcm"), &Limits::default());
    for length in 0..good.len() {
        // At the end of an element nothing seems to be missing, until something is.
        let _ = read(&good[..length]);
    }
    // Lengths of all kinds of size, everywhere.
    for place in (132..good.len() - 4).step_by(3) {
        for wrong in [
            [0xff; 4],
            [0xfe, 0xff, 0xff, 0xff],
            [0, 0, 0, 0x7f],
            [1, 0, 0, 0],
        ] {
            let mut bad = good.clone();
            bad[place..place + 4].copy_from_slice(&wrong);
            let _ = read(&bad);
        }
    }
    // A sequence in a sequence, and so on.
    let mut deep = good[..good.iter().position(|b| *b == 8).unwrap()].to_vec();
    for _ in 0..100_000 {
        deep.extend([0x06, 0x30, 0x39, 0x00, 0xff, 0xff, 0xff, 0xff]);
        deep.extend([0xfe, 0xff, 0x00, 0xe0, 0xff, 0xff, 0xff, 0xff]);
    }
    let told = read(&deep).unwrap_err().to_string();
    assert!(
        told.ends_with("sequences nest deeper than 32"),
        "{}",
        &told[..200]
    );
    let limits = Limits {
        points: 10,
        ..Limits::default()
    };
    let told = read_points(&good, None, &limits).unwrap_err().to_string();
    assert!(told.ends_with("more than 10 points"), "{told}");
}

#[test]
fn other_files_are_refused() {
    let text = "the moon is far\n";
    let told = read(text, "doc").unwrap_err().to_string();
    assert!(told.contains("points are read from DICOM, JSON"), "{told}");
}
