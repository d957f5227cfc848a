//! Writes the scenes on which docs/methods.md measures: `cargo run --example method_scenes`
//! fills `samples/methods/`. They resemble those of the published tables and are our own, but
//! for the teapot.

mod cad;
mod free;
mod parts;

use std::fs;
use std::path::Path;

use nurbray::formats::WRITERS;
use parts::Parts;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// A scene: its file, and what makes it.
type Row = (&'static str, fn() -> Outcome<Parts>);

const SCENES: &[Row] = &[
    ("teapot_plane.obj", free::teapot_plane),
    ("duck.x3d", free::duck),
    ("ducks27.x3d", free::ducks27),
    ("column.x3d", free::column),
    ("water_lily.x3dv", free::water_lily),
    ("phone.igs", cad::phone),
    ("machine.x3d", cad::machine),
    ("skull.x3dv", free::skull),
];

fn main() -> Outcome<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/methods");
    for (name, make) in SCENES {
        let scene = make()?.into_scene()?;
        let (stem, ending) = name.split_once('.').ok_or("a name without ending")?;
        let writer = WRITERS.iter().find(|w| w.extensions.contains(&ending));
        let writer = writer.ok_or("no writer for the ending")?;
        let export = (writer.write)(&scene, stem)?;
        fs::write(folder.join(name), &export.bytes)?;
        for (name, bytes) in &export.beside {
            fs::write(folder.join(name), bytes)?;
        }
    }
    Ok(())
}
