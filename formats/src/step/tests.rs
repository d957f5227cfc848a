use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};
use kernel::{Scene, modelling::Frame};

use super::arcs::{Basis, Conic, End, between};
use crate::{Import, Limits, NoFiles, ReadOptions};

/// What a file of statements becomes.
pub(super) fn import(data: &str) -> Result<Import, String> {
    let text =
        format!("ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n{data}\nENDSEC;\nEND-ISO-10303-21;\n");
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &NoFiles,
    };
    crate::read(text.as_bytes(), None, &options).map_err(|error| error.to_string())
}

/// The scene and the warnings of a file of statements.
pub(super) fn read(data: &str) -> (Scene, Vec<String>) {
    let import = import(data).unwrap();
    let warnings = import.warnings.as_slice().iter().map(ToString::to_string);
    (import.scene, warnings.collect())
}

/// Millimetres and radians, and a product with the items of a representation.
pub(super) fn product(items: &str, data: &str) -> String {
    format!(
        "#900=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));
#901=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
#902=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#900,#901))\
REPRESENTATION_CONTEXT('',''));
#903=PRODUCT('number','part','',());
#904=PRODUCT_DEFINITION_FORMATION('','',#903);
#905=PRODUCT_DEFINITION('','',#904,$);
#906=PRODUCT_DEFINITION_SHAPE('','',#905);
#907=SHAPE_REPRESENTATION('',({items}),#902);
#908=SHAPE_DEFINITION_REPRESENTATION(#906,#907);
{data}"
    )
}

/// The usual axes, as number 10.
pub(super) const AXES: &str = "#1=CARTESIAN_POINT('',(0.,0.,0.));
#2=DIRECTION('',(0.,0.,1.));
#3=DIRECTION('',(1.,0.,0.));
#10=AXIS2_PLACEMENT_3D('',#1,#2,#3);
";

/// A disk of radius 2 at the origin as number 20, with its edge as number 17.
pub(super) const DISK: &str = "#11=CARTESIAN_POINT('',(2.,0.,0.));
#12=VERTEX_POINT('',#11);
#13=CIRCLE('',#10,2.);
#17=EDGE_CURVE('',#12,#12,#13,.T.);
#14=ORIENTED_EDGE('',*,*,#17,.T.);
#15=EDGE_LOOP('',(#14));
#16=FACE_OUTER_BOUND('',#15,.T.);
#18=PLANE('',#10);
#20=ADVANCED_FACE('disk',(#16),#18,.T.);
#21=OPEN_SHELL('',(#20));
#22=SHELL_BASED_SURFACE_MODEL('',(#21));
";

/// The only place at which a patch is shown.
pub(super) fn shown(scene: &Scene) -> Vec<glam::DAffine3> {
    let places = scene.placements();
    let places = places.iter();
    places
        .map(|placement| placement.world_from_object)
        .collect()
}

#[test]
fn arcs_lie_on_their_conics_between_their_ends() {
    let frame = Frame::new(DVec3::new(1.0, 2.0, 3.0), DVec3::ONE, DVec3::X).unwrap();
    let axes = DVec2::new(3.0, 2.0);
    let at = |p: DVec2| frame.origin() + frame.x() * p.x + frame.y() * p.y;
    let local = |p: DVec3| {
        let off = p - frame.origin();
        DVec2::new(off.dot(frame.x()), off.dot(frame.y()))
    };
    // Ends, and what is zero on the curve.
    type Off<'a> = &'a dyn Fn(DVec2) -> f64;
    let ellipse = |t: f64| axes * DVec2::new(t.cos(), t.sin());
    let parabola = |t: f64| 0.5 * DVec2::new(t * t, 2.0 * t);
    let hyperbola = |t: f64| axes * DVec2::new(t.cosh(), t.sinh());
    let cases: [(Conic, [DVec2; 2], Off<'_>); 3] = [
        (Conic::Ellipse(axes), [ellipse(5.0), ellipse(1.0)], &|p| {
            (p / axes).length() - 1.0
        }),
        (
            Conic::Parabola(0.5),
            [parabola(-1.0), parabola(2.0)],
            &|p| p.y * p.y - 2.0 * p.x,
        ),
        (
            Conic::Hyperbola(axes),
            [hyperbola(-1.0), hyperbola(0.5)],
            &|p| (p.x / axes.x).powi(2) - (p.y / axes.y).powi(2) - 1.0,
        ),
    ];
    for (shape, ends, off) in cases {
        let basis = Basis::Conic { frame, shape };
        let pieces = between(&basis, Some(ends.map(|p| End::Point(at(p))))).unwrap();
        let [curve] = pieces.as_slice() else {
            panic!("{shape:?}: {} pieces", pieces.len())
        };
        assert!(curve.start().distance(at(ends[0])) < 1e-13);
        assert!(curve.end().distance(at(ends[1])) < 1e-13);
        let domain = curve.domain();
        for k in 0..=40 {
            let t = domain.start + (domain.end - domain.start) * f64::from(k) / 40.0;
            assert!(off(local(curve.evaluate(t))).abs() < 1e-12, "{shape:?}");
        }
    }
    // Where it ends where it begins it is whole, from there on.
    let basis = Basis::Conic {
        frame,
        shape: Conic::Ellipse(axes),
    };
    let there = at(ellipse(2.0));
    let whole = between(&basis, Some([End::Point(there); 2])).unwrap();
    assert_eq!(whole.len(), 1);
    assert!((whole[0].domain().end - whole[0].domain().start - TAU).abs() < 1e-12);
    assert!(whole[0].start().distance(there) < 1e-12);
    let against = [End::At(2.0), End::At(1.0)];
    assert!(
        between(
            &Basis::Conic {
                frame,
                shape: Conic::Parabola(1.0)
            },
            Some(against)
        )
        .is_err()
    );
}

#[test]
fn closed_splines_are_cut_over_their_seam() {
    let circle = kernel::modelling::circle(&Frame::WORLD, 1.0).unwrap();
    let basis = Basis::Free(circle);
    let point = |angle: f64| DVec3::new(angle.cos(), angle.sin(), 0.0);
    let cut = |a: f64, b: f64| {
        let pieces = between(&basis, Some([a, b].map(|t| End::Point(point(t))))).unwrap();
        let ends = pieces.iter().map(|c| [c.start(), c.end()]);
        let ends: Vec<_> = ends.collect();
        assert!(ends[0][0].distance(point(a)) < 1e-7);
        assert!(ends[ends.len() - 1][1].distance(point(b)) < 1e-7);
        assert!(ends.windows(2).all(|p| p[0][1].distance(p[1][0]) < 1e-9));
        pieces.len()
    };
    assert_eq!(cut(1.0, 2.0), 1);
    assert_eq!(cut(2.0, 1.0), 2);
    assert_eq!(cut(0.0, 1.0), 1);
    assert_eq!(cut(1.0, 0.0), 1);
    assert_eq!(cut(0.0, 0.0), 1);
    assert_eq!(cut(1.0, 1.0), 2);
}

#[test]
fn points_of_knots_that_stand_too_often_have_no_influence() {
    let point = |k: u32| format!("#{}=CARTESIAN_POINT('',({k}.,0.,1.));", 10 + k);
    let points: String = (0..4).map(point).collect();
    let curve = "#30=B_SPLINE_CURVE_WITH_KNOTS('',2,(#10,#11,#12,#13),.UNSPECIFIED.,.F.,.F.,\
                 (3,1,3),(0.,0.,1.),.UNSPECIFIED.);";
    let (scene, warnings) = read(&product("#30", &format!("{points}{curve}")));
    let kernel::WireShape::Curve(curve) = &scene.wires()[0].shape else {
        panic!("{warnings:?}")
    };
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert_eq!(curve.points().count(), 3);
    assert_eq!(curve.start(), DVec3::new(1.0, 0.0, 1.0));
    assert!(curve.evaluate(0.5).distance(DVec3::new(2.0, 0.0, 1.0)) < 1e-14);
    // An inner knot once too often, where both sides meet, and where they do not.
    let twice = |pointers: &str| {
        let curve = format!(
            "#30=B_SPLINE_CURVE_WITH_KNOTS('',1,({pointers}),.UNSPECIFIED.,.F.,.F.,(2,2,2),(0.,1.,2.),\
             .UNSPECIFIED.);"
        );
        import(&product("#30", &format!("{points}{curve}")))
    };
    let scene = twice("#10,#12,#12,#13").unwrap().scene;
    let kernel::WireShape::Curve(curve) = &scene.wires()[0].shape else {
        panic!("no curve")
    };
    assert_eq!(curve.points().count(), 3);
    assert!(curve.evaluate(1.5).distance(DVec3::new(2.5, 0.0, 1.0)) < 1e-14);
    let error = twice("#10,#11,#12,#13").unwrap_err().to_string();
    assert!(error.contains("knot 1 stands 2 times"), "{error}");
}

#[test]
fn a_disk_is_shown_in_its_place_with_its_name() {
    let import = import(&product("#10,#22", &format!("{AXES}{DISK}"))).unwrap();
    assert_eq!(import.format, "STEP");
    assert_eq!(import.warnings.as_slice(), []);
    let scene = &import.scene;
    assert_eq!(scene.unit.as_ref().unwrap().name, "mm");
    assert_eq!(shown(scene).len(), 1);
    let patch = scene.patches().first().unwrap();
    assert_eq!(patch.name, "disk");
    assert_eq!(patch.source, "#20 ADVANCED_FACE");
    assert_eq!(patch.loops.len(), 1);
    let region = patch.region().unwrap();
    let inside = |x: f64, y: f64| region.contains(DVec2::new(x, y));
    assert!(inside(1.4, 1.4) && !inside(1.45, 1.42) && inside(-1.99, 0.0));
    let tally = |kind: &str| import.ledger.iter().find(|row| row.kind == kind).unwrap();
    assert_eq!(tally("ADVANCED_FACE").used, [20]);
    assert_eq!(tally("PLANE").mark, "#");
}

/// The points of the boundary of a closed surface without bounds, and a product of it.
fn natural(surface: &str) -> Scene {
    let face = "#30=ADVANCED_FACE('',(),#29,.T.);\n#31=CLOSED_SHELL('',(#30));\n\
                #32=MANIFOLD_SOLID_BREP('',#31);";
    let (scene, warnings) = read(&product("#32", &format!("{AXES}#29={surface};\n{face}")));
    assert_eq!(warnings, [""; 0]);
    scene
}

#[test]
fn closed_surfaces_need_no_bounds() {
    for (surface, radius) in [
        ("SPHERICAL_SURFACE('',#10,3.)", 3.0),
        ("TOROIDAL_SURFACE('',#10,5.,2.)", 7.0),
        // Apple and lemon.
        ("DEGENERATE_TOROIDAL_SURFACE('',#10,1.,2.,.T.)", 3.0),
        ("DEGENERATE_TOROIDAL_SURFACE('',#10,1.,2.,.F.)", 1.0),
    ] {
        let scene = natural(surface);
        let surface = &scene.patches().first().unwrap().surface;
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        let share = |k: i32| f64::from(k) / 50.0;
        let points = (0..=50).flat_map(|i| (0..=50).map(move |j| (share(i), share(j))));
        let out = points.map(|(a, b)| {
            let uv = DVec2::new(
                u.start + a * (u.end - u.start),
                v.start + b * (v.end - v.start),
            );
            surface.evaluate(uv).truncate().length()
        });
        let found = out.fold(0.0, f64::max);
        assert!((found - radius).abs() < 1e-9, "{surface:?}: {found}");
    }
}

#[test]
fn lines_that_turn_are_planes_cylinders_and_cones() {
    // Start and direction of the line, and a face between two circles around the z axis, from
    // radius 2 at height 0 to another.
    for (line, direction, [radius, height]) in [
        ("2.,0.,1.", "0.,0.,1.", [2.0, 3.0]),
        ("2.,0.,1.", "0.,0.,-1.", [2.0, 3.0]),
        ("1.,0.,0.", "1.,0.,0.", [5.0, 0.0]),
        ("1.,0.,0.", "-1.,0.,0.", [5.0, 0.0]),
        ("0.,0.,-2.", "1.,0.,1.", [5.0, 3.0]),
        ("4.,0.,-2.", "-1.,0.,1.", [1.0, 1.0]),
        ("4.,0.,-2.", "1.,0.,-1.", [1.0, 1.0]),
    ] {
        let data = format!(
            "{AXES}#40=CARTESIAN_POINT('',({line}));
#41=DIRECTION('',({direction}));
#42=VECTOR('',#41,1.);
#43=LINE('',#40,#42);
#44=AXIS1_PLACEMENT('',#1,#2);
#45=SURFACE_OF_REVOLUTION('',#43,#44);
#11=CARTESIAN_POINT('',(2.,0.,0.));
#12=VERTEX_POINT('',#11);
#13=CIRCLE('',#10,2.);
#17=EDGE_CURVE('',#12,#12,#13,.T.);
#14=ORIENTED_EDGE('',*,*,#17,.T.);
#15=EDGE_LOOP('',(#14));
#16=FACE_BOUND('',#15,.T.);
#50=CARTESIAN_POINT('',(0.,0.,{height:?}));
#51=AXIS2_PLACEMENT_3D('',#50,#2,#3);
#52=CIRCLE('',#51,{radius:?});
#53=CARTESIAN_POINT('',({radius:?},0.,{height:?}));
#54=VERTEX_POINT('',#53);
#55=EDGE_CURVE('',#54,#54,#52,.T.);
#56=ORIENTED_EDGE('',*,*,#55,.F.);
#57=EDGE_LOOP('',(#56));
#58=FACE_BOUND('',#57,.T.);
#59=ADVANCED_FACE('',(#16,#58),#45,.T.);
#60=OPEN_SHELL('',(#59));
#61=SHELL_BASED_SURFACE_MODEL('',(#60));"
        );
        let (scene, warnings) = read(&product("#61", &data));
        assert_eq!(warnings, [""; 0], "{line} {direction}");
        let patch = scene.patches().first().unwrap();
        // Half way between both circles the face is there, beyond them it is not.
        let region = patch.region().unwrap();
        let nearby = kernel::nearest::Nearby::new(&patch.surface, patch.surface.closed());
        let inside = |share: f64| {
            let out = 2.0 + (radius - 2.0) * share;
            let point = DVec3::new(-out, 0.0, height * share);
            let found = nearby.nearest(point, None);
            found.distance < 1e-9 && region.contains(found.uv)
        };
        assert!(inside(0.5), "{line} {direction}");
        assert!(!inside(-0.01) && !inside(1.01), "{line} {direction}");
    }
}

#[test]
fn colours_of_faces_count_before_those_of_solids() {
    let style = |first: u64, item: u64, color: &str| {
        let [a, b, c, d, e, f] = [0, 1, 2, 3, 4, 5].map(|k| first + k);
        format!(
            "#{a}={color};#{b}=FILL_AREA_STYLE_COLOUR('',#{a});#{c}=FILL_AREA_STYLE('',(#{b}));\
#{d}=SURFACE_STYLE_FILL_AREA(#{c});#{e}=SURFACE_SIDE_STYLE('',(#{d}));\
#{f}=SURFACE_STYLE_USAGE(.BOTH.,#{e});#{}=PRESENTATION_STYLE_ASSIGNMENT((#{f}));\
#{}=STYLED_ITEM('',(#{}),#{item});\n",
            first + 6,
            first + 7,
            first + 6
        )
    };
    let red = style(100, 22, "COLOUR_RGB('',1.,0.,0.)");
    let blue = style(200, 20, "DRAUGHTING_PRE_DEFINED_COLOUR('blue')");
    // Curves have colours of their own.
    let black = "#300=COLOUR_RGB('',0.,0.,0.);#301=CURVE_STYLE('',$,$,#300);\
                 #302=PRESENTATION_STYLE_ASSIGNMENT((#301));#303=STYLED_ITEM('',(#302),#20);";
    let color = |styles: &str| {
        let (scene, warnings) = read(&product("#22", &format!("{AXES}{DISK}{styles}")));
        assert_eq!(warnings, [""; 0]);
        let placement = scene.placements().remove(0);
        placement.material.map(|id| scene.material(id).diffuse)
    };
    assert_eq!(color(&red), Some(DVec3::X));
    assert_eq!(color(&(red + &blue)), Some(DVec3::Z));
    assert_eq!(color(black), None);
}

#[test]
fn hostile_files_are_refused() {
    let cases = [
        ("#1=SOLID_REPLICA('',#1,#10);", "#1", "it contains itself"),
        (
            "#1=MAPPED_ITEM('',#3,#10);#3=REPRESENTATION_MAP(#10,#907);",
            "#1",
            "inside itself",
        ),
        (
            "#1=CLOSED_SHELL('',#2);",
            "#1",
            "a list is expected, but is #2",
        ),
        (
            "#1=MANIFOLD_SOLID_BREP('',#99);",
            "#1",
            "#99 is wanted, but not there",
        ),
        (
            "#1=B_SPLINE_SURFACE_WITH_KNOTS('',1,1,((#11,#11),(#11,#11)),$,.F.,.F.,.F.,\
             (1000000000000,2),(2,2),(0.,1.),(0.,1.),$);",
            "#1",
            "add up to 1000000000002; 2 points of degree 1 need 4",
        ),
        (
            "#1=B_SPLINE_CURVE_WITH_KNOTS('',999999999,(#11,#11),$,.F.,.F.,(2,2),(0.,1.),$);",
            "#1",
            "2 points are too few for degree 999999999",
        ),
        (
            "#1=BEZIER_CURVE('',0,(#11,#11),$,.F.,.F.);",
            "#1",
            "too few for degree 0",
        ),
        (
            "#1=COMPOSITE_CURVE('',(#2),.F.);#2=COMPOSITE_CURVE_SEGMENT($,.T.,#1);",
            "#1",
            "nested",
        ),
    ];
    let sets = |k: u64| format!("#{k}=GEOMETRIC_SET('',(#{}));", k + 1);
    let deep: String = (1000..9000).map(sets).collect();
    let cases = cases
        .into_iter()
        .chain([(&*deep, "#1000", "nested more than 216 deep")]);
    for (data, item, text) in cases {
        let axes = AXES
            .replace("#1=", "#51=")
            .replace("#2=", "#52=")
            .replace("#3=", "#53=");
        let axes = axes.replace("#1,#2,#3", "#51,#52,#53");
        let point = "#11=CARTESIAN_POINT('',(0.,0.,0.));";
        let found = import(&product(item, &format!("{axes}{point}{data}")));
        let error = found.expect_err(data);
        assert!(error.contains(text), "{data}: {error}");
    }
}

#[test]
fn faces_go_along_with_their_sense() {
    // A half of a cylinder, with the loop as either sense of the face has it.
    let half = |sense: char, orders: [&str; 4], turned: [char; 4]| {
        let oriented = |k: usize| {
            format!(
                "#{}=ORIENTED_EDGE('',*,*,{},.{}.);",
                60 + k,
                orders[k],
                turned[k]
            )
        };
        let oriented: String = (0..4).map(oriented).collect();
        let data = format!(
            "{AXES}#11=CARTESIAN_POINT('',(2.,0.,0.));#12=VERTEX_POINT('',#11);
#13=CARTESIAN_POINT('',(-2.,0.,0.));#14=VERTEX_POINT('',#13);
#15=CARTESIAN_POINT('',(2.,0.,3.));#16=VERTEX_POINT('',#15);
#17=CARTESIAN_POINT('',(-2.,0.,3.));#18=VERTEX_POINT('',#17);
#19=CARTESIAN_POINT('',(0.,0.,3.));#20=AXIS2_PLACEMENT_3D('',#19,#2,#3);
#21=CIRCLE('',#10,2.);#22=CIRCLE('',#20,2.);#23=VECTOR('',#2,1.);
#24=LINE('',#11,#23);#25=LINE('',#13,#23);
#31=EDGE_CURVE('',#12,#14,#21,.T.);#32=EDGE_CURVE('',#14,#18,#25,.T.);
#33=EDGE_CURVE('',#16,#18,#22,.T.);#34=EDGE_CURVE('',#12,#16,#24,.T.);
{oriented}
#70=EDGE_LOOP('',(#60,#61,#62,#63));#71=FACE_OUTER_BOUND('',#70,.T.);
#72=CYLINDRICAL_SURFACE('',#10,2.);#73=ADVANCED_FACE('',(#71),#72,.{sense}.);
#74=OPEN_SHELL('',(#73));#75=SHELL_BASED_SURFACE_MODEL('',(#74));"
        );
        let (scene, warnings) = read(&product("#75", &data));
        assert_eq!(warnings, [""; 0]);
        let patch = scene.patches().first().unwrap();
        let region = patch.region().unwrap();
        let u = patch.surface.knots_u();
        let at = |angle: f64| DVec2::new(kernel::modelling::arc_parameter(u, angle), 1.5);
        assert!(region.contains(at(FRAC_PI_2)));
        assert!(!region.contains(at(1.5 * PI)));
    };
    half('T', ["#31", "#32", "#33", "#34"], ['T', 'T', 'F', 'F']);
    half('F', ["#34", "#33", "#32", "#31"], ['T', 'T', 'F', 'F']);
}

#[test]
fn areas_with_holes_are_swept() {
    let data = |solid: &str| {
        format!(
            "{AXES}#4=CARTESIAN_POINT('',(5.,0.,0.));#5=AXIS2_PLACEMENT_3D('',#4,#6,#3);
#6=DIRECTION('',(0.,1.,0.));
#11=CIRCLE('',#5,2.);#12=CIRCLE('',#5,1.);
#13=COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#11);
#14=COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.F.,#12);
#15=OUTER_BOUNDARY_CURVE('',(#13),.F.);#16=BOUNDARY_CURVE('',(#14),.F.);
#17=PLANE('',#5);#18=CURVE_BOUNDED_SURFACE('',#17,(#15,#16),.F.);
#19=AXIS1_PLACEMENT('',#1,#2);
#20={solid};"
        )
    };
    // Sides and caps, and how far they reach upwards and to the other side.
    for (solid, faces, low, high) in [
        (
            "EXTRUDED_AREA_SOLID('',#18,#6,3.)",
            4,
            [3.0, 0.0],
            [7.0, 3.0],
        ),
        (
            "REVOLVED_AREA_SOLID('',#18,#19,1.5707963267948966)",
            4,
            [0.0, 0.0],
            [7.0, 7.0],
        ),
        (
            "REVOLVED_AREA_SOLID('',#18,#19,6.283185307179586)",
            2,
            [-7.0, -7.0],
            [7.0, 7.0],
        ),
    ] {
        let (scene, warnings) = read(&product("#20", &data(solid)));
        assert_eq!(warnings, [""; 0], "{solid}");
        let patches = scene.patches();
        assert_eq!(patches.len(), faces, "{solid}");
        let caps = patches.iter().filter(|patch| !patch.loops.is_empty());
        assert!(caps.clone().all(|patch| patch.loops.len() == 2), "{solid}");
        assert_eq!(caps.count(), faces - 2, "{solid}");
        let sides = patches.iter().filter(|patch| patch.loops.is_empty());
        let bounds = sides.map(kernel::Patch::bounds);
        let all = bounds.reduce(|a, b| a.union(b)).unwrap();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
        assert!(
            near(all.min.x, low[0]) && near(all.min.y, low[1]),
            "{solid}: {all:?}"
        );
        assert!(
            near(all.max.x, high[0]) && near(all.max.y, high[1]),
            "{solid}: {all:?}"
        );
    }
}

#[test]
fn solids_by_construction_have_all_their_faces() {
    let axis = "#9=AXIS1_PLACEMENT('',#1,#2);";
    for (solid, faces) in [
        ("BLOCK('',#10,1.,2.,3.)", 6),
        ("RIGHT_ANGULAR_WEDGE('',#10,3.,2.,1.,1.)", 6),
        ("RIGHT_CIRCULAR_CYLINDER('',#9,2.,1.)", 3),
        ("RIGHT_CIRCULAR_CONE('',#9,2.,1.,0.3)", 3),
        ("SPHERE('',1.,#1)", 1),
        ("TORUS('',#9,3.,1.)", 1),
        ("ELLIPSOID('',#10,1.,2.,3.)", 1),
        ("RECTANGULAR_PYRAMID('',#10,1.,2.,3.)", 5),
    ] {
        let (scene, warnings) = read(&product("#20", &format!("{AXES}{axis}#20={solid};")));
        assert_eq!(warnings, [""; 0], "{solid}");
        assert_eq!(scene.patches().len(), faces, "{solid}");
    }
}

#[test]
fn a_face_without_a_surface_has_the_plane_of_its_edges() {
    // Two halves of a circle: their ends alone tell no plane.
    let halves = "#30=CARTESIAN_POINT('',(-2.,0.,0.));#31=VERTEX_POINT('',#30);
#32=EDGE_CURVE('',#12,#31,#13,.T.);#33=EDGE_CURVE('',#31,#12,#13,.T.);
#34=ORIENTED_EDGE('',*,*,#32,.T.);#35=ORIENTED_EDGE('',*,*,#33,.T.);
#36=EDGE_LOOP('',(#34,#35));#37=FACE_OUTER_BOUND('',#36,.T.);
#38=ADVANCED_FACE('',(#37),$,.T.);#39=OPEN_SHELL('',(#38));";
    let (scene, warnings) = read(&product("#39", &format!("{AXES}{DISK}{halves}")));
    let [patch] = scene.patches() else {
        panic!("one face")
    };
    let area = kernel::Integrals::of(patch, DVec3::ZERO).area();
    assert!((area - 4.0 * PI).abs() < 1e-6, "{area}");
    let text = "it has no surface; its edges are in one plane, which is taken";
    assert!(warnings[0].ends_with(text), "{warnings:?}");
    // Edges that are not in one plane tell none.
    let tilted =
        "#50=DIRECTION('',(0.,1.,1.));#51=AXIS2_PLACEMENT_3D('',#1,#50,#3);#52=CIRCLE('',#51,2.);";
    let halves = halves.replace("#12,#31,#13", "#12,#31,#52") + tilted;
    let (_, warnings) = read(&product("#39,#22", &format!("{AXES}{DISK}{halves}")));
    let text = "it has no surface, and its edges are not in one plane";
    assert!(warnings[0].ends_with(text), "{warnings:?}");
}
