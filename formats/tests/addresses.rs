//! Addresses in X3D and VRML lead to files of a folder, and out of it by no spelling.

use std::fs;
use std::path::{Path, PathBuf};

use nurbray_formats::{Import, Limits, WRITERS, open, open_within};

const PART: &str = "#VRML V2.0 utf8\nShape { geometry Sphere { } }\n";

/// A new folder of a test with `in`, where its files are, and beside that one a `secret.wrl`.
fn folder(name: &str) -> PathBuf {
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&place);
    fs::create_dir_all(place.join("in/sub dir")).expect("a folder");
    fs::write(place.join("secret.wrl"), PART).expect("a file");
    fs::write(place.join("in/sub dir/part 1.wrl"), PART).expect("a file");
    // The folder as the system calls it: a link may lead there.
    place.canonicalize().expect("a folder")
}

fn told(import: &Import) -> Vec<String> {
    let warnings = import.warnings.as_slice().iter();
    warnings.map(ToString::to_string).collect()
}

/// A file in the folder that shows another one, by its address; `wide` lets it name files outside.
fn inline(place: &Path, address: &str, wide: bool) -> (u64, Vec<String>) {
    let file = place.join("in/top.wrl");
    let text = format!("#VRML V2.0 utf8\nInline {{ url \"{address}\" }}\n");
    fs::write(&file, text).expect("a file");
    let limits = Limits::default();
    let import = match wide {
        true => open_within(&file, place, &limits),
        false => open(&file, &limits),
    };
    let import = import.expect("a scene");
    (import.scene.placement_count(), told(&import))
}

#[test]
fn addresses_are_decoded_and_lead_to_files_of_this_machine() {
    let place = folder("addresses");
    let whole = place.join("in/sub dir/part 1.wrl");
    let whole = whole.to_str().expect("a name");
    for address in [
        "sub dir/part 1.wrl",
        "sub%20dir/part%201.wrl",
        "sub%20dir%2Fpart 1.wrl",
        "file:sub%20dir/part%201.wrl",
        &format!("file://{}", whole.replace(' ', "%20")),
        &format!("file://localhost{whole}"),
        whole,
    ] {
        assert_eq!(inline(&place, address, false), (1, vec![]), "{address}");
    }
    let (count, told) = inline(&place, "sub%20dir/part%202.wrl", false);
    assert_eq!(count, 0);
    assert!(told[0].contains("read: sub dir/part 2.wrl: "), "{told:?}");
}

#[test]
fn a_name_with_a_percent_sign_comes_before_what_it_stands_for() {
    let place = folder("percent");
    let empty = "#VRML V2.0 utf8\nGroup { }\n";
    fs::write(place.join("in/a%20b.wrl"), PART).expect("a file");
    fs::write(place.join("in/a b.wrl"), empty).expect("a file");
    assert_eq!(inline(&place, "a%20b.wrl", false).0, 1);
    assert_eq!(inline(&place, "a b.wrl", false).0, 0);
    assert_eq!(inline(&place, "a%2520b.wrl", false).0, 1);
}

#[test]
fn no_spelling_of_an_address_leads_out_of_the_folder() {
    let place = folder("outside");
    let secret = place.join("secret.wrl");
    let secret = secret.to_str().expect("a name");
    let beside = place.join("in/../secret.wrl");
    let beside = beside.to_str().expect("a name");
    let addresses = [
        "../secret.wrl".to_owned(),
        "%2e%2e/secret.wrl".to_owned(),
        "%2E%2E%2fsecret.wrl".to_owned(),
        "sub%20dir/..%2f..%2fsecret.wrl".to_owned(),
        "%2e%2e%5Csecret.wrl".to_owned(),
        "file:%2e%2e/secret.wrl".to_owned(),
        format!("file://{secret}"),
        format!("file://{beside}"),
        format!("file:{}", secret.replace('/', "%2f")),
        secret.to_owned(),
    ];
    for address in addresses {
        let (count, told) = inline(&place, &address, false);
        assert_eq!((count, told.len()), (0, 1), "{address}");
        let text = "the name leads out of the folder";
        assert!(told[0].ends_with(text), "{address}: {told:?}");
        // A larger folder may be given.
        assert_eq!(inline(&place, &address, true), (1, vec![]), "{address}");
    }
    for address in ["file://host/secret.wrl", "https://a.b/secret.wrl"] {
        let (count, told) = inline(&place, address, true);
        assert_eq!(count, 0, "{address}");
        assert!(told[0].ends_with("only local files are read"), "{told:?}");
    }
    let (count, _) = inline(&place, "a%00b.wrl", true);
    assert_eq!(count, 0);
}

#[test]
fn names_of_pictures_are_written_as_addresses() {
    let place = folder("pictures").join("in");
    // A bitmap of one grey texel.
    let mut picture = b"P5 1 1 255 ".to_vec();
    picture.push(100);
    for (name, address) in [
        ("my pic.pgm", "my%20pic.pgm"),
        ("50%20off.pgm", "50%2520off.pgm"),
        ("sub dir/a#1.pgm", "sub%20dir/a%231.pgm"),
    ] {
        fs::write(place.join(name), &picture).expect("a picture");
        let text = format!(
            "#X3D V3.3 utf8\nShape {{ geometry Box {{ }} appearance Appearance {{ \
             texture ImageTexture {{ url \"{address}\" }} }} }}\n"
        );
        fs::write(place.join("top.x3dv"), text).expect("a file");
        let first = open(place.join("top.x3dv"), &Limits::default()).expect("a scene");
        assert_eq!(told(&first), [""; 0], "{name}");
        for writer in ["X3D", "X3D ClassicVRML", "VRML 97"] {
            let found = WRITERS.iter().find(|w| w.name == writer);
            let export = (found.expect("a writer").write)(&first.scene, "again").expect("a file");
            let text = String::from_utf8(export.bytes).expect("text");
            assert!(text.contains(address), "{writer}: {text}");
            fs::write(place.join("again"), text).expect("a file");
            let again = open(place.join("again"), &Limits::default()).expect("a scene");
            assert_eq!(told(&again), [""; 0], "{writer}");
            let name_of = |import: &Import| {
                let material = import.scene.placements()[0].material.expect("a material");
                let maps = &import.scene.material(material).maps;
                let map = maps.color.as_ref().or(maps.emissive.as_ref());
                map.expect("a picture").image.name().to_owned()
            };
            assert_eq!([name_of(&first), name_of(&again)], [name, name], "{writer}");
        }
    }
}
