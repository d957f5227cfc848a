//! X3D and VRML files that want to be read for ever: each ends in a sentence, within the time and
//! the memory that its process may have.
#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

/// Address space of the process, in KiB: memory that is used is less.
const MEMORY: u32 = 200 * 1024;

/// Seconds of the processor that it may use.
const SECONDS: u32 = 1;

/// A file with its content, and what is said about it.
type Trap = (&'static str, Vec<u8>, &'static str);

fn vrml(inside: &str) -> Vec<u8> {
    format!("#VRML V2.0 utf8\n{inside}").into_bytes()
}

/// Files that nest a million times.
fn deep() -> Vec<Trap> {
    const MILLION: usize = 1_000_000;
    let deep = "nodes nest deeper than 200";
    let nested = "<Group>".repeat(MILLION) + &"</Group>".repeat(MILLION);
    let groups = "Group { children [ ".repeat(MILLION);
    let json = "{\"-children\":[{\"Group\":".repeat(MILLION);
    let xml = format!("<X3D version='3.3'><Scene>{nested}</Scene></X3D>");
    vec![
        ("deep.x3d", xml.into(), deep),
        ("deep.wrl", vrml(&groups), deep),
        (
            "deep.x3dv",
            format!("#X3D V3.3 utf8\n{groups}").into(),
            deep,
        ),
        (
            "deep.x3dj",
            format!("{{\"X3D\":{{\"Scene\":{json}").into(),
            deep,
        ),
        (
            "prototypes.wrl",
            vrml(&"PROTO A [ ] { ".repeat(MILLION)),
            deep,
        ),
    ]
}

/// Small files that stand for a lot.
fn growing() -> Vec<Trap> {
    let mut bomb = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    let blanks = vec![b' '; 1 << 20];
    bomb.write_all(b"#VRML V2.0 utf8\n").unwrap();
    (0..1000).for_each(|_| bomb.write_all(&blanks).unwrap());
    let mut doubled = "DEF G0 Shape { geometry Box { } }\n".to_owned();
    let mut instances = "PROTO P0 [ field SFFloat r 1 ] { Sphere { radius IS r } }\n".to_owned();
    for i in 0..40 {
        let next = i + 1;
        doubled += &format!("DEF G{next} Group {{ children [ USE G{i} USE G{i} ] }}\n");
        instances += &format!(
            "PROTO P{next} [ field SFFloat r 1 ] {{ Group {{ children [ P{i} {{ r IS r }} P{i} \
             {{ r IS r }} ] }} }}\n"
        );
    }
    instances += "P40 { }";
    let entities: String = (0..20)
        .map(|i| format!("<!ENTITY a{} \"{}\">", i + 1, format!("&a{i};").repeat(10)))
        .collect();
    let entities = format!(
        "<!DOCTYPE X3D [<!ENTITY a0 \"aaaaaaaaaa\">{entities}]>\
         <X3D><Scene><Shape><Box size='&a20;'/></Shape></Scene></X3D>"
    );
    let counts = "Shape { geometry NurbsSurface { uDimension 2000000000 vDimension 2000000000 \
                  controlPoint 0 0 0 } }";
    let pixels = "Shape { geometry Box { } appearance Appearance { texture PixelTexture { \
                  image 1000000 1000000 3 1 2 3 } } }";
    vec![
        (
            "bomb.wrl",
            bomb.finish().unwrap(),
            "gzip data that grows beyond",
        ),
        (
            "doubled.wrl",
            vrml(&doubled),
            "shapes after instancing; the limit is 3000000; --relax-limits multiplies the limits",
        ),
        (
            "instances.wrl",
            vrml(&instances),
            "nodes and routes made by prototypes",
        ),
        ("entities.x3d", entities.into(), "unrecognized entity"),
        (
            "counts.wrl",
            vrml(counts),
            "1 control points; 4000000000000000000 are needed",
        ),
        (
            "pixels.wrl",
            vrml(pixels),
            "3 texels of 3 numbers for 1000000 x 1000000",
        ),
    ]
}

/// Files that contain themselves, or lead out of their folder.
fn roaming() -> Vec<Trap> {
    let outside = "Inline { url [ \"../a.wrl\" \"/etc/passwd\" ] }";
    let picture = "Shape { geometry Box { } appearance Appearance { texture ImageTexture { \
                   url [ \"../a.png\" \"/etc/a.png\" ] } } }";
    vec![
        (
            "itself.wrl",
            vrml("Inline { url \"itself.wrl\" }"),
            "it contains itself",
        ),
        (
            "inside.wrl",
            vrml("DEF A Group { children USE A }"),
            "a node is used inside itself",
        ),
        (
            "outside.wrl",
            vrml(outside),
            "../a.wrl: the name leads out of the folder; /etc/passwd: the name leads out of the \
             folder",
        ),
        (
            "picture.wrl",
            vrml(picture),
            "../a.png: the name leads out of the folder; /etc/a.png: the name leads out",
        ),
    ]
}

#[test]
fn hostile_files_end_in_a_sentence_soon() {
    let folder = TempDir::new().unwrap();
    for (name, content, expected) in [deep(), growing(), roaming()].concat() {
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let said = info(&path);
        assert!(said.contains(expected), "{name}: {said}");
    }
}

/// What `info` says about a file, on both channels, with little memory and time.
fn info(path: &Path) -> String {
    let program = env!("CARGO_BIN_EXE_nurbray");
    let limited = format!("ulimit -v {MEMORY}; ulimit -t {SECONDS}; exec \"$0\" info \"$1\"");
    let output = Command::new("sh")
        .args(["-c", &limited, program])
        .arg(path)
        .output()
        .unwrap();
    let texts = [output.stdout, output.stderr];
    texts
        .map(|text| String::from_utf8_lossy(&text).into_owned())
        .concat()
}
