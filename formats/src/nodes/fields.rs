//! The fields that the standards give to nodes, so that others are told: a misspelt field, or one
//! that another program has made up, would be passed over in silence, and so would nodes that stand
//! where no field is for them.

use std::collections::HashMap;

use super::animate::plain_name;
use super::kinds::is_misplaced;
use super::{Link, Node, Tree};
use crate::Warnings;

/// Tells of the fields that the standards do not give to their nodes, and of nodes in those that have
/// no place for them.
pub(super) fn check(tree: &Tree, warnings: &mut Warnings) {
    let mut known: HashMap<&str, Vec<&str>> = HashMap::new();
    for (kinds, fields) in FIELDS {
        for kind in kinds.split_whitespace() {
            known
                .entry(kind)
                .or_default()
                .extend(fields.split_whitespace());
        }
    }
    let has = |node: &Node, name: &str| {
        let plain = plain_name(name);
        known.get(&*node.kind).is_none_or(|known| {
            // Words of other standards, as those of XML.
            name.contains([':', '-']) || known.contains(&plain) || EVERYWHERE.contains(&plain)
        })
    };
    let mut tell = |node: &Node, name: &str, what: &str| {
        let name: String = name.chars().take(40).collect();
        let text = format!("{} has no field {name}{what}", node.kind);
        warnings.unsupported(node.place(), text);
    };
    for node in &tree.nodes {
        // Coordinates are found wherever they stand.
        let is_found = |link: &&Link| {
            let kind = &*tree.nodes[link.node].kind;
            matches!(kind, "Coordinate" | "CoordinateDouble")
        };
        let nodes = node.children.iter().filter(|link| !is_found(link));
        let nodes = nodes.filter_map(|link| link.field.as_ref());
        let values = node.fields.iter().map(|field| &field.name);
        for (name, what) in values
            .map(|name| (name, "; it is not read"))
            .chain(nodes.map(|name| (name, " for a node")))
        {
            if !has(node, name) {
                tell(node, name, what);
            }
        }
    }
    for route in &tree.routes {
        for (node, name, what) in [
            (route.from, &route.from_field, ", from which a ROUTE leads"),
            (route.to, &route.to_field, ", to which a ROUTE leads"),
        ] {
            let node = &tree.nodes[node];
            if !has(node, name) && !EVENTS.contains(&plain_name(name)) {
                tell(node, name, what);
            }
        }
    }
    for node in &tree.nodes {
        for inside in tree.inside(node) {
            if is_misplaced(&inside.kind, &node.kind) {
                let text = format!(
                    "it stands in {}, which shows none; it is left out",
                    node.kind
                );
                warnings.invalid(inside.place(), text);
            }
        }
    }
}

/// The fields of all nodes.
const EVERYWHERE: &[&str] = &["class", "id", "metadata", "style"];

/// What nodes send and take besides the values of fields.
const EVENTS: &[&str] = &[
    "bind",
    "bindTime",
    "collideTime",
    "cycleTime",
    "duration",
    "elapsedTime",
    "exitTime",
    "enterTime",
    "fraction",
    "isActive",
    "isBound",
    "isLoaded",
    "isPaused",
    "level",
    "normal",
    "position",
    "time",
    "transitionComplete",
    "value",
];

/// Nodes that are read, and fields that they have in X3D 3 or 4 or in VRML 97, or that are read where
/// files have them. A node may stand in several rows, and has the fields of all.
const FIELDS: &[(&str, &str)] = &[
    (
        "Anchor Billboard CADAssembly CADFace CADLayer CADPart Collision Group HAnimHumanoid \
         HAnimJoint HAnimSegment HAnimSite Inline LOD NurbsSet PickableGroup Shape \
         StaticGroup Switch Transform",
        "bboxCenter bboxDisplay bboxSize visible",
    ),
    (
        "Anchor Billboard CADAssembly CADLayer CADPart Collision Contour2D CoordinateDeformer \
         Group HAnimHumanoid HAnimJoint HAnimSegment HAnimSite LOD Layer NurbsGroup \
         PickableGroup StaticGroup Switch Transform ViewpointGroup",
        "addChildren children removeChildren",
    ),
    (
        "CADPart HAnimHumanoid HAnimJoint HAnimSite Transform",
        "center rotation scale scaleOrientation translation",
    ),
    (
        "IndexedFaceSet IndexedLineSet IndexedQuadSet IndexedTriangleFanSet \
         IndexedTriangleSet IndexedTriangleStripSet LineSet PointSet QuadSet TriangleFanSet \
         TriangleSet TriangleStripSet",
        "attrib color coord fogCoord normal",
    ),
    (
        "ElevationGrid IndexedFaceSet IndexedQuadSet IndexedTriangleFanSet IndexedTriangleSet \
         IndexedTriangleStripSet QuadSet TriangleFanSet TriangleSet TriangleStripSet",
        "ccw colorPerVertex normalPerVertex solid texCoord",
    ),
    (
        "DirectionalLight PointLight SpotLight",
        "ambientIntensity color global intensity on shadowIntensity shadows",
    ),
    (
        "ColorInterpolator CoordinateInterpolator CoordinateInterpolator2D NormalInterpolator \
         OrientationInterpolator PositionInterpolator PositionInterpolator2D \
         ScalarInterpolator SplinePositionInterpolator SplinePositionInterpolator2D \
         SplineScalarInterpolator SquadOrientationInterpolator",
        "key keyValue",
    ),
    (
        "CoordinateDeformer NurbsPatchSurface NurbsSurface NurbsSurfaceInterpolator \
         NurbsTextureCoordinate NurbsTextureSurface NurbsTrimmedSurface",
        "controlPoint uDimension uKnot uOrder vDimension vKnot vOrder weight",
    ),
    (
        "NurbsPatchSurface NurbsSurface NurbsTrimmedSurface",
        "solid texCoord uClosed uTessellation vClosed vTessellation",
    ),
    (
        "NurbsCurve NurbsCurve2D NurbsOrientationInterpolator NurbsPositionInterpolator",
        "controlPoint knot order weight",
    ),
    (
        "Material PhysicalMaterial UnlitMaterial",
        "emissiveColor emissiveTexture emissiveTextureMapping normalScale normalTexture \
         normalTextureMapping transparency",
    ),
    (
        "Material PhysicalMaterial",
        "occlusionStrength occlusionTexture occlusionTextureMapping",
    ),
    (
        "ImageTexture PixelTexture",
        "description repeatS repeatT textureProperties",
    ),
    (
        "Anchor ImageTexture Inline",
        "autoRefresh autoRefreshTimeLimit description load url",
    ),
    (
        "Background TextureBackground",
        "groundAngle groundColor skyAngle skyColor transparency",
    ),
    (
        "Material TwoSidedMaterial",
        "ambientIntensity diffuseColor emissiveColor shininess specularColor transparency",
    ),
    ("Anchor", "parameter"),
    (
        "Appearance",
        "acousticProperties alphaCutoff alphaMode backMaterial fillProperties lineProperties \
         material pointProperties shaders texture textureTransform",
    ),
    ("Arc2D", "endAngle radius startAngle"),
    ("ArcClose2D", "closureType endAngle radius solid startAngle"),
    (
        "Background",
        "backUrl bottomUrl frontUrl leftUrl rightUrl topUrl",
    ),
    ("Billboard", "axisOfRotation"),
    ("Box Rectangle2D", "size solid"),
    ("CADAssembly CADLayer CADPart", "name"),
    ("CADFace", "name shape"),
    ("Circle2D", "radius"),
    ("Collision", "collide description enabled proxy"),
    ("Color ColorRGBA", "color"),
    ("Cone", "bottom bottomRadius height side solid"),
    (
        "ContourPolyline2D Polyline2D",
        "controlPoint lineSegments point",
    ),
    ("Coordinate CoordinateDouble Polypoint2D", "point"),
    (
        "CoordinateDeformer",
        "bboxCenter bboxSize inputCoord inputTransform outputCoord wDimension wKnot wOrder",
    ),
    ("Cylinder", "bottom height radius side solid top"),
    ("DirectionalLight", "direction"),
    ("Disk2D", "innerRadius outerRadius solid"),
    (
        "ElevationGrid",
        "attrib color creaseAngle fogCoord height normal xDimension xSpacing zDimension \
         zSpacing",
    ),
    (
        "Extrusion",
        "beginCap ccw convex creaseAngle crossSection endCap orientation scale solid spine",
    ),
    (
        "HAnimHumanoid",
        "description displacers humanoidVersion info jointBindingPositions \
         jointBindingRotations jointBindingScales joints loa motions motionsEnabled name \
         segments sites skeletalConfiguration skeleton skin skinBindingCoords \
         skinBindingNormals skinCoord skinNormal version viewpoints",
    ),
    (
        "HAnimJoint",
        "description displacers limitOrientation llimit name skinCoordIndex skinCoordWeight \
         stiffness ulimit",
    ),
    (
        "HAnimSegment",
        "centerOfMass coord description displacers mass momentsOfInertia name",
    ),
    ("HAnimSite", "description name"),
    (
        "IndexedFaceSet",
        "colorIndex convex coordIndex creaseAngle normalIndex tangent texCoordIndex",
    ),
    ("IndexedLineSet", "colorIndex colorPerVertex coordIndex"),
    (
        "IndexedQuadSet IndexedTriangleFanSet IndexedTriangleSet IndexedTriangleStripSet",
        "index tangent",
    ),
    ("Inline", "global"),
    ("InlineLoadControl", "bboxCenter bboxSize load url"),
    ("LOD", "center forceTransitions level range"),
    ("Layer", "isPickable objectType pickable viewport visible"),
    ("LayerSet", "activeLayer layers order"),
    ("LineSet", "vertexCount"),
    (
        "Material",
        "ambientTexture ambientTextureMapping diffuseTexture diffuseTextureMapping \
         shininessTexture shininessTextureMapping specularTexture specularTextureMapping",
    ),
    (
        "MultiTexture",
        "alpha color description function mode source texture",
    ),
    ("MultiTextureCoordinate", "texCoord"),
    ("MultiTextureTransform", "textureTransform"),
    (
        "NavigationInfo",
        "avatarSize headlight speed transitionTime transitionType type visibilityLimit",
    ),
    ("Normal", "vector"),
    ("NurbsCurve NurbsCurve2D", "closed tessellation"),
    ("NurbsGroup", "bboxCenter bboxSize tessellationScale"),
    ("NurbsPositionInterpolator", "dimension keyValue keyWeight"),
    (
        "NurbsSet",
        "addGeometry geometry removeGeometry tessellationScale",
    ),
    ("NurbsPatchSurface NurbsSurface NurbsTrimmedSurface", "ccw"),
    (
        "NurbsSweptSurface",
        "ccw crossSectionCurve solid trajectoryCurve",
    ),
    (
        "NurbsSwungSurface",
        "ccw profileCurve solid trajectoryCurve",
    ),
    ("NurbsTextureSurface", "uTessellation vTessellation"),
    (
        "NurbsTrimmedSurface",
        "addTrimmingContour removeTrimmingContour trimmingContour",
    ),
    (
        "OrthoViewpoint Viewpoint",
        "centerOfRotation description farDistance fieldOfView jump navigationInfo \
         nearDistance orientation position retainUserOffsets viewAll",
    ),
    (
        "PhysicalMaterial",
        "baseColor baseTexture baseTextureMapping metallic metallicRoughnessTexture \
         metallicRoughnessTextureMapping roughness",
    ),
    ("PickableGroup", "description objectType pickable"),
    ("PixelTexture", "image"),
    ("PointLight", "attenuation location radius"),
    ("QuadSet TriangleSet", "tangent"),
    ("Shape", "appearance castShadow geometry"),
    ("Sphere", "radius solid"),
    (
        "SplinePositionInterpolator SplinePositionInterpolator2D SplineScalarInterpolator",
        "closed keyVelocity normalizeVelocity",
    ),
    (
        "SpotLight",
        "attenuation beamWidth cutOffAngle direction location radius",
    ),
    ("SquadOrientationInterpolator", "normalizeVelocity"),
    ("Switch", "choice whichChoice"),
    (
        "TextureBackground",
        "backTexture bottomTexture frontTexture leftTexture rightTexture topTexture",
    ),
    ("TextureCoordinate", "mapping point"),
    ("TextureCoordinateGenerator", "mapping mode parameter"),
    (
        "TextureProperties",
        "anisotropicDegree borderColor borderWidth boundaryModeR boundaryModeS boundaryModeT \
         generateMipMaps magnificationFilter minificationFilter textureCompression \
         texturePriority",
    ),
    (
        "TextureTransform",
        "center mapping rotation scale translation",
    ),
    (
        "TimeSensor",
        "cycleInterval description enabled loop pauseTime resumeTime startTime stopTime",
    ),
    ("TriangleFanSet", "fanCount tangent"),
    ("TriangleSet2D", "solid vertices"),
    ("TriangleStripSet", "stripCount tangent"),
    (
        "TrimmedSurface",
        "addTrimmingContour removeTrimmingContour surface trimmingContour",
    ),
    (
        "TwoSidedMaterial",
        "backAmbientIntensity backDiffuseColor backEmissiveColor backShininess \
         backSpecularColor backTransparency separateBackColor",
    ),
    (
        "ViewpointGroup",
        "center description displayed retainUserOffsets size",
    ),
    ("WorldInfo", "info title"),
];

#[cfg(test)]
mod tests {
    use super::super::tests::read_scene;

    #[test]
    fn nodes_that_have_no_place_where_they_stand_are_told() {
        let plane = "uDimension 2 vDimension 2 uOrder 2 vOrder 2 \
            controlPoint Coordinate { point [0 0 0 1 0 0 0 1 0 1 1 0] }";
        for inside in [
            "geometry Transform { children Shape { geometry Sphere { } } }".to_owned(),
            "appearance Appearance { texture Box { } }".to_owned(),
            format!("geometry NurbsTrimmedSurface {{ {plane} trimmingContour [ Box {{ }} ] }}"),
            format!("geometry NurbsPatchSurface {{ {plane} texCoord Box {{ }} }}"),
        ] {
            let import = read_scene(&format!("Shape {{ {inside} }}"));
            let told = import.warnings.as_slice().iter().map(ToString::to_string);
            let told: Vec<_> = told.filter(|t| t.contains("which shows none")).collect();
            assert_eq!(told.len(), 1, "{inside}: {told:?}");
            assert!(import.scene.patches().len() <= 1, "{inside}");
        }
    }

    #[test]
    fn fields_that_no_standard_has_are_told() {
        let told = |text: &str| {
            let import = read_scene(&format!("Shape {{ {text} }} Shape {{ {text} }}"));
            let told = import.warnings.as_slice().iter().map(ToString::to_string);
            told.collect::<Vec<_>>()
        };
        let text = "appearance Appearance { material Material { diffuseColour 1 0 0 } } \
            geometry Sphere { radius 2 metadata MetadataSet { } }";
        let found = told(text);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(
            found[0].contains("Material has no field diffuseColour; it is not read"),
            "{found:?}"
        );
        assert!(
            told("geometry IndexedFaceSet { set_coordIndex [ ] }")
                .iter()
                .all(|t| !t.contains("field"))
        );
        let found = told("geometry Sphere { } decor Sphere { }");
        assert!(
            found.iter().any(|t| t.contains("Shape has no field decor")),
            "{found:?}"
        );
    }

    #[test]
    fn routes_between_fields_that_are_not_there_are_told() {
        let nodes = "DEF T TimeSensor { } DEF I PositionInterpolator { } DEF M Transform { } \
            DEF S Script { }";
        let right = "ROUTE T.fraction_changed TO I.set_fraction \
            ROUTE I.value_changed TO M.set_translation ROUTE T.isActive TO S.any \
            ROUTE T.cycleTime TO T.startTime";
        let told = |routes: &str| {
            let import = read_scene(&format!("{nodes} {routes}"));
            let told = import.warnings.as_slice().iter().map(ToString::to_string);
            told.filter(|t| t.contains("ROUTE")).collect::<Vec<_>>()
        };
        assert_eq!(told(right), [""; 0]);
        let [from, to] = ["I.nix TO M.translation", "I.value_changed TO M.nix"];
        for (route, text) in [
            (
                from,
                "PositionInterpolator has no field nix, from which a ROUTE leads",
            ),
            (to, "Transform has no field nix, to which a ROUTE leads"),
        ] {
            let found = told(&format!("{right} ROUTE {route}"));
            assert!(found.len() == 1 && found[0].contains(text), "{found:?}");
        }
    }
}
