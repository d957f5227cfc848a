//! From scene to X3D in XML or classic spelling, and to VRML 97 with its Amendment 1.
//!
//! One tree of nodes is made for all three and spelled as each wants it. Control points are
//! multiplied by their weights, as the readers take them. What a name may not contain in a file
//! is replaced there, and the name itself stands in the metadata of the node.

mod look;
mod shapes;
mod spell;
mod textures;
mod tree;

use kernel::{Scene, Unit};

use self::spell::{Out, Value};
pub(super) use self::tree::NAME;
use self::tree::Tree;
use crate::write::{Export, Writer, tell_clear_vertices, tell_seams, tell_voids};
use crate::{Error, Place};

/// The rows of these formats.
pub(crate) const X3D: Writer = Writer {
    name: "X3D",
    extensions: &["x3d"],
    write: |scene, stem| write(scene, stem, Dialect::Xml),
};
pub(crate) const CLASSIC: Writer = Writer {
    name: "X3D ClassicVRML",
    extensions: &["x3dv"],
    write: |scene, stem| write(scene, stem, Dialect::Classic),
};
pub(crate) const VRML97: Writer = Writer {
    name: "VRML 97",
    extensions: &["wrl", "vrml"],
    write: |scene, stem| write(scene, stem, Dialect::Vrml97),
};

/// The ways to write a scene graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dialect {
    Xml,
    Classic,
    Vrml97,
}

impl Dialect {
    fn name(self) -> &'static str {
        match self {
            Self::Xml => X3D.name,
            Self::Classic => CLASSIC.name,
            Self::Vrml97 => VRML97.name,
        }
    }
}

/// What is said about the control points.
const CONVENTION: &str = "control points of NURBS are multiplied by their weights";

fn write(scene: &Scene, stem: &str, dialect: Dialect) -> Result<Export, Error> {
    let mut tree = Tree::new(scene, dialect);
    tell_voids(scene, &mut tree.warnings);
    tell_seams(scene, &mut tree.warnings);
    if scene.unit.is_none() {
        let text = "lengths are metres in this format, and the scene has no unit; it is written as if in metres";
        tree.warnings.unsupported(Place::item(0, "the unit"), text);
    }
    if dialect == Dialect::Vrml97 {
        tell_clear_vertices(scene, &mut tree.warnings);
    }
    let nodes = tree.all().map_err(|problem| Error {
        format: dialect.name(),
        place: Place::default(),
        problem,
    })?;
    let one = 1.0_f64.to_bits();
    let is_metre = |unit: &&Unit| unit.name == "m" && unit.metres.to_bits() == one;
    let head = Head {
        version: if tree.is_physical { "4.0" } else { "3.3" },
        title: stem,
        generator: concat!("nurbray ", env!("CARGO_PKG_VERSION")),
        unit: scene.unit.as_ref().filter(|unit| !is_metre(unit)),
    };
    let text = match dialect {
        Dialect::Xml => head.xml(nodes),
        Dialect::Classic => head.classic(&nodes),
        Dialect::Vrml97 => head.vrml97(&nodes),
    };
    Ok(Export {
        bytes: text.into_bytes(),
        warnings: tree.warnings,
        ..Export::default()
    })
}

/// What a file says before its nodes.
struct Head<'a> {
    version: &'static str,
    title: &'a str,
    generator: &'static str,
    /// The unit of length, if it is not the metre.
    unit: Option<&'a Unit>,
}

impl Head<'_> {
    fn about(&self) -> [(&'static str, &str); 3] {
        [
            ("title", self.title),
            ("generator", self.generator),
            ("description", CONVENTION),
        ]
    }

    fn xml(&self, nodes: Vec<Out>) -> String {
        let text = |text: &str| Value::Text(text.to_owned());
        let mut head = Out::new("head");
        let mut component = Out::new("component");
        component.field("name", text("NURBS"));
        component.field("level", Value::number(4.0));
        head.child("", component);
        if let Some(unit) = self.unit {
            let mut out = Out::new("unit");
            out.field("category", text("length"));
            out.field("name", text(&unit.name));
            out.field("conversionFactor", Value::number(unit.metres));
            head.child("", out);
        }
        for (name, content) in self.about() {
            let mut meta = Out::new("meta");
            meta.field("name", text(name));
            meta.field("content", text(content));
            head.child("", meta);
        }
        let mut scene = Out::new("Scene");
        let children = nodes.into_iter();
        children.for_each(|node| scene.child("children", node));
        let mut x3d = Out::new("X3D");
        x3d.field("profile", text("Immersive"));
        x3d.field("version", text(self.version));
        x3d.child("", head);
        x3d.child("", scene);
        let mut text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned();
        x3d.xml(&mut text, "", 0);
        text
    }

    fn classic(&self, nodes: &[Out]) -> String {
        let version = self.version;
        let mut text = format!("#X3D V{version} utf8\nPROFILE Immersive\nCOMPONENT NURBS:4\n");
        if let Some(unit) = self.unit {
            let name = spell::identifier(&unit.name);
            text += &format!("UNIT length {name} {:?}\n", unit.metres);
        }
        for (name, content) in self.about() {
            text += &format!("META {} {}\n", spell::quoted(name), spell::quoted(content));
        }
        nodes.iter().for_each(|node| node.classic(&mut text, 0));
        text
    }

    fn vrml97(&self, nodes: &[Out]) -> String {
        let mut info = Out::new("WorldInfo");
        let texts = [self.generator, CONVENTION].map(str::to_owned);
        info.field("title", Value::Text(self.title.to_owned()));
        info.field("info", Value::Texts(texts.to_vec()));
        let mut text = "#VRML V2.0 utf8\n".to_owned();
        info.classic(&mut text, 0);
        nodes.iter().for_each(|node| node.classic(&mut text, 0));
        text
    }
}
