use glam::DVec3;

use super::tests::{AXES, DISK, product, read};

/// Style `first + 6` of surfaces, of a colour.
fn style(first: u64, color: &str) -> String {
    let [a, b, c, d, e, f, g] = [0, 1, 2, 3, 4, 5, 6].map(|k| first + k);
    format!(
        "#{a}=DRAUGHTING_PRE_DEFINED_COLOUR('{color}');#{b}=FILL_AREA_STYLE_COLOUR('',#{a});\
#{c}=FILL_AREA_STYLE('',(#{b}));#{d}=SURFACE_STYLE_FILL_AREA(#{c});\
#{e}=SURFACE_SIDE_STYLE('',(#{d}));#{f}=SURFACE_STYLE_USAGE(.BOTH.,#{e});\
#{g}=PRESENTATION_STYLE_ASSIGNMENT((#{f}));\n"
    )
}

/// Occurrence `first` of product `child` in product `parent`, moved by `x`: its shape is `first + 1`, the
/// relation of representations `first + 3`, what says so `first + 4`.
fn occurrence(first: u64, [parent, child]: [u64; 2], [outer, inner]: [u64; 2], x: f64) -> String {
    let [a, b, c, d, e, f, g] = [0, 1, 2, 3, 4, 5, 6].map(|k| first + k);
    format!(
        "#{a}=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#{parent},#{child},$);\
#{b}=PRODUCT_DEFINITION_SHAPE('','',#{a});\
#{c}=ITEM_DEFINED_TRANSFORMATION('','',#10,#{f});\
#{d}=(REPRESENTATION_RELATIONSHIP('','',#{inner},#{outer})\
REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{c})SHAPE_REPRESENTATION_RELATIONSHIP());\
#{e}=CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{d},#{b});\
#{f}=AXIS2_PLACEMENT_3D('',#{g},#2,#3);#{g}=CARTESIAN_POINT('',({x:?},0.,0.));\n"
    )
}

/// A part with a yellow disk as product #85, twice in product #75, at 0 and 10 along the first axis,
/// which is twice in the whole, at 0 and 100.
fn assembly(data: &str) -> String {
    let part = |first: u64, items: &str| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| first + k);
        format!(
            "#{a}=PRODUCT_DEFINITION('','',#904,$);#{b}=PRODUCT_DEFINITION_SHAPE('','',#{a});\
#{c}=SHAPE_REPRESENTATION('',({items}),#902);#{d}=SHAPE_DEFINITION_REPRESENTATION(#{b},#{c});\n"
        )
    };
    let parts = part(85, "#10,#22") + &part(75, "#10");
    let small =
        occurrence(100, [75, 85], [77, 87], 0.0) + &occurrence(110, [75, 85], [77, 87], 10.0);
    let large =
        occurrence(120, [905, 75], [907, 77], 0.0) + &occurrence(130, [905, 75], [907, 77], 100.0);
    let styles = style(200, "yellow") + &style(210, "blue");
    let look = "#220=STYLED_ITEM('',(#206),#22);";
    let data = format!("{AXES}{DISK}{parts}{small}{large}{styles}{look}{data}");
    product("#10", &data)
}

/// Where the disks are that are not yellow, with their colours, in order; and how many there are.
fn others(data: &str) -> (Vec<(f64, DVec3)>, usize) {
    let (scene, mut warnings) = read(&assembly(data));
    warnings.retain(|text| !text.ends_with("shown") && !text.ends_with("its owner is not"));
    assert_eq!(warnings, [""; 0]);
    let mut all: Vec<_> = (scene.placements().iter())
        .map(|placement| {
            let material = scene.material(placement.material.unwrap());
            (placement.world_from_object.translation.x, material.diffuse)
        })
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let count = all.len();
    all.retain(|(_, color)| *color != DVec3::new(1.0, 1.0, 0.0));
    (all, count)
}

#[test]
fn looks_in_one_place_hold_only_there() {
    assert_eq!(others(""), (vec![], 4));
    // The occurrence is named by the relation that places it, by a representation, or by a context.
    let by_relation = "#230=CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM('',(#216),#22,#220,(#114));";
    let by_representation = "#230=OVER_RIDING_STYLED_ITEM('',(#231),#22,#220);\
#231=PRESENTATION_STYLE_BY_CONTEXT((#215),#232);#232=SHAPE_REPRESENTATION('',(#115),#902);\
#233=SHAPE_DEFINITION_REPRESENTATION(#111,#232);";
    for data in [by_relation, by_representation] {
        let blue = vec![(10.0, DVec3::Z), (110.0, DVec3::Z)];
        assert_eq!(others(data), (blue, 4), "{data}");
    }
    // In an assembly it holds for all that is in it.
    let outer = "#230=CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM('',(#216),#22,#220,(#134));";
    let blue = vec![(100.0, DVec3::Z), (110.0, DVec3::Z)];
    assert_eq!(others(outer), (blue, 4));
    // Of two places both are meant.
    let both = "#230=CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM('',(#216),#22,#220,(#134,#114));";
    let path = "#230=OVER_RIDING_STYLED_ITEM('',(#231),#22,#220);\
#231=PRESENTATION_STYLE_BY_CONTEXT((#215),#232);#232=SHAPE_REPRESENTATION('',(#115),#902);\
#233=SHAPE_DEFINITION_REPRESENTATION(#234,#232);#234=PRODUCT_DEFINITION_SHAPE('','',#235);\
#235=SPECIFIED_HIGHER_USAGE_OCCURRENCE('','','',#905,#85,$,#130,#110);";
    for data in [both, path] {
        assert_eq!(others(data), (vec![(110.0, DVec3::Z)], 4), "{data}");
    }
    // What stands for no place holds everywhere.
    let part = "#230=OVER_RIDING_STYLED_ITEM('',(#231),#22,#220);\
#231=PRESENTATION_STYLE_BY_CONTEXT((#215),#87);";
    assert_eq!(others(part).0.len(), 4);
}

#[test]
fn what_is_hidden_in_one_place_is_shown_in_others() {
    let data = "#230=CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM('',(#206),#22,#220,(#114));\
#231=INVISIBILITY((#230));";
    assert_eq!(others(data), (vec![], 2));
    // Colours from farther outside come first.
    let data = "#230=CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM('',(#216),#22,#220,(#134));\
#231=CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM('',(#206),#22,#220,(#114));";
    let blue = vec![(100.0, DVec3::Z), (110.0, DVec3::Z)];
    assert_eq!(others(data), (blue, 4));
}

#[test]
fn items_that_show_representations_may_give_them_another_look() {
    let data = format!(
        "{AXES}{DISK}{}{}#220=STYLED_ITEM('',(#206),#22);#87=SHAPE_REPRESENTATION('',(#10,#22),#902);\
#88=REPRESENTATION_MAP(#10,#87);#89=MAPPED_ITEM('',#88,#10);#90=MAPPED_ITEM('',#88,#10);\
#230=OVER_RIDING_STYLED_ITEM('',(#216),#90,#220);",
        style(200, "yellow"),
        style(210, "blue")
    );
    let (scene, warnings) = read(&product("#10,#89,#90", &data));
    assert_eq!(warnings, [""; 0]);
    let colors: Vec<_> = (scene.placements().iter())
        .map(|placement| scene.material(placement.material.unwrap()).diffuse)
        .collect();
    assert_eq!(colors, [DVec3::new(1.0, 1.0, 0.0), DVec3::Z]);
}

#[test]
fn paths_without_an_end_are_no_places() {
    let data = "#230=CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM('',(#216),#22,#220,(#235));\
#235=SPECIFIED_HIGHER_USAGE_OCCURRENCE('','','',#905,#85,$,#235,#235);";
    assert_eq!(others(data).1, 4);
}
