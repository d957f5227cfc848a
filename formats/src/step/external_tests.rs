use glam::DVec3;

use super::tests::{AXES, DISK, product, shown};
use crate::{Limits, ReadOptions, Resolver};

#[test]
fn shapes_of_products_may_be_in_other_files() {
    /// Two files by their names.
    struct Others([(&'static str, String); 2]);
    impl Resolver for Others {
        fn resolve(&self, name: &str) -> std::io::Result<Vec<u8>> {
            let found = self.0.iter().find(|(known, _)| *known == name);
            let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
            found.map_or(Err(missing), |(_, text)| Ok(text.clone().into_bytes()))
        }
    }
    let whole = |data: &str| format!("ISO-10303-21;DATA;\n{data}\nENDSEC;END-ISO-10303-21;\n");
    // An inch is the unit of the part; the other file names itself.
    let inch = "(CONVERSION_BASED_UNIT('INCH',#99)LENGTH_UNIT()NAMED_UNIT(*));\n\
                #99=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.0254),#98);\n\
                #98=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.));";
    let part = product("#22", &format!("{AXES}{DISK}"));
    let part = part.replace(
        "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));",
        inch,
    );
    let naming = |name: &str| {
        format!(
            "#70=DOCUMENT_FILE('{name}','','',$,'',$);
#71=PRODUCT_DEFINITION('','',#904,$);
#72=APPLIED_DOCUMENT_REFERENCE(#70,'',(#71));
#73=NEXT_ASSEMBLY_USAGE_OCCURRENCE('1','','',#905,#71,$);
#74=PRODUCT_DEFINITION_SHAPE('','',#73);
#75=CARTESIAN_POINT('',(10.,0.,0.));
#76=AXIS2_PLACEMENT_3D('',#75,$,$);
#77=ITEM_DEFINED_TRANSFORMATION('','',#10,#76);
#78=(REPRESENTATION_RELATIONSHIP('','',#79,#907)\
REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#77)SHAPE_REPRESENTATION_RELATIONSHIP());
#79=SHAPE_REPRESENTATION('',(#10),#902);
#80=PRODUCT_DEFINITION_SHAPE('','',#71);
#81=SHAPE_DEFINITION_REPRESENTATION(#80,#79);
#82=CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#78,#74);"
        )
    };
    let file = |name: &str| whole(&product("#10,#76", &format!("{AXES}{}", naming(name))));
    let others = Others([("part.stp", whole(&part)), ("loop.stp", file("loop.stp"))]);
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &others,
    };
    let import = crate::read(file("part.stp").as_bytes(), None, &options).unwrap();
    assert_eq!(import.warnings.as_slice(), []);
    let [place] = shown(&import.scene)[..] else {
        panic!("one place")
    };
    let moved = place.transform_point3(DVec3::X);
    assert!(
        moved.distance(DVec3::new(35.4, 0.0, 0.0)) < 1e-12,
        "{moved}"
    );
    let patch = import.scene.patches().first().unwrap();
    assert_eq!(patch.source, "#20 ADVANCED_FACE of part.stp");
    assert!(import.ledger.iter().all(|row| row.kind != "ADVANCED_FACE"));
    for (name, reason) in [
        ("loop.stp", "it contains itself"),
        ("none.stp", "entity not found"),
    ] {
        let error = crate::read(file(name).as_bytes(), None, &options).unwrap_err();
        let text = format!("the file \"{name}\" could not be read: {reason}");
        assert!(error.to_string().contains(&text), "{error}");
    }
}
