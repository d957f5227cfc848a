//! Solids by construction as exact faces: types 150 to 168. What is made of them (180) is made of their faces.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DAffine3, DMat3, DVec2, DVec3};
use kernel::modelling::{self, Frame};
use kernel::{Curve, Error as GeometryError, KnotVector, Surface, TrimLoop};

use super::curves::Reader;
use super::directory::WHOLE;
use super::parameters::Parameters;
use super::sheets::in_parallelogram;
use super::transform::check_finite;
use super::trims::Parts;
use crate::Problem;

/// Ends of curves no farther apart than this share of their size meet.
const MEETS: f64 = 1e-6;

/// Caps with less area than this share of the square of their size are none.
const FLAT: f64 = 1e-12;

/// Whether it is a solid that is read.
pub(super) fn is_primitive(kind: i64) -> bool {
    matches!(kind, 150 | 152 | 154 | 156 | 158 | 160 | 162 | 164 | 168)
}

/// The faces of a solid, with the name among its properties.
pub(super) fn read(reader: &mut Reader<'_, '_>, index: usize) -> Result<(String, Parts), Problem> {
    let file = reader.file;
    let entry = &file.entries[index];
    let place = reader.transforms.follow(file, entry.transform)?;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let p = &mut parameters;
    let mut parts = match entry.kind {
        150 | 152 => {
            let size = [length(p)?, length(p)?, length(p)?];
            let top = if entry.kind == 150 {
                size[0]
            } else {
                p.real()?
            };
            whole(prism(&axes(p)?, size, top))?
        }
        154 => {
            let (height, radius) = (length(p)?, length(p)?);
            let profile = [[0.0, 0.0], [radius, 0.0], [radius, height], [0.0, height]];
            whole(turned(&profile, &axis(p)?))?
        }
        156 => {
            let (height, radius, other) = (length(p)?, length(p)?, p.real_or(0.0)?);
            let profile = [[0.0, 0.0], [radius, 0.0], [other, height], [0.0, height]];
            whole(turned(&profile, &axis(p)?))?
        }
        158 => {
            let radius = length(p)?;
            let frame = Frame::about(p.point_or(DVec3::ZERO)?, DVec3::Z);
            whole(frame.and_then(|frame| ball(&frame, radius)))?
        }
        160 => {
            let (major, minor) = (length(p)?, length(p)?);
            let around = |frame: Frame| modelling::torus(&frame, major, minor, 0.0..TAU, 0.0..TAU);
            whole(around(axis(p)?).map(|surface| vec![surface]))?
        }
        162 => revolved(reader, p, entry.form == 0)?,
        164 => extruded(reader, p)?,
        _ => {
            let radii = DVec3::new(length(p)?, length(p)?, length(p)?);
            let frame = axes(p)?;
            let columns = DMat3::from_cols(
                frame.x() * radii.x,
                frame.y() * radii.y,
                frame.z() * radii.z,
            );
            let map = DAffine3::from_mat3_translation(columns, frame.origin());
            let unit = ball(&Frame::WORLD, 1.0);
            whole(unit.map(|list| list.iter().map(|s| s.transformed(&map)).collect()))?
        }
    };
    if place != DAffine3::IDENTITY {
        for (surface, _) in &mut parts {
            *surface = surface.transformed(&place);
            check_finite(surface.points())?;
        }
    }
    let name = super::entities::trailing_name(file, &mut parameters);
    Ok((name, parts))
}

/// Surfaces that nothing trims.
fn whole(surfaces: Result<Vec<Surface>, GeometryError>) -> Result<Parts, Problem> {
    let surfaces = surfaces.map_err(Problem::Geometry)?;
    Ok(surfaces.into_iter().map(|s| (s, Vec::new())).collect())
}

fn length(parameters: &mut Parameters<'_>) -> Result<f64, Problem> {
    let found = parameters.real()?;
    if found > 0.0 && found.is_finite() {
        return Ok(found);
    }
    Err(Problem::Geometry(GeometryError::NotPositive { found }))
}

/// A point, and the axis there.
fn axis(parameters: &mut Parameters<'_>) -> Result<Frame, Problem> {
    let origin = parameters.point_or(DVec3::ZERO)?;
    Frame::about(origin, parameters.point_or(DVec3::Z)?).map_err(Problem::Geometry)
}

/// A point, and the x and z axes there.
fn axes(parameters: &mut Parameters<'_>) -> Result<Frame, Problem> {
    let origin = parameters.point_or(DVec3::ZERO)?;
    let x = parameters.point_or(DVec3::X)?;
    Frame::new(origin, parameters.point_or(DVec3::Z)?, x).map_err(Problem::Geometry)
}

/// A block, or a wedge, whose far side is only as long as `top`.
fn prism(frame: &Frame, [x, y, z]: [f64; 3], top: f64) -> Result<Vec<Surface>, GeometryError> {
    let corner =
        |x: f64, y: f64, z: f64| frame.origin() + frame.x() * x + frame.y() * y + frame.z() * z;
    let rim = |z: f64| {
        [
            corner(0.0, 0.0, z),
            corner(x, 0.0, z),
            corner(top, y, z),
            corner(0.0, y, z),
        ]
    };
    let (low, high) = (rim(0.0), rim(z));
    let mut faces = vec![
        [low[0], low[3], low[1], low[2]],
        [high[0], high[1], high[3], high[2]],
    ];
    for k in 0..4 {
        let next = (k + 1) % 4;
        if low[k] != low[next] {
            faces.push([low[k], low[next], high[k], high[next]]);
        }
    }
    let knots = KnotVector::bezier(1, 0.0..1.0)?;
    let face = |[a, b, c, d]: [DVec3; 4]| {
        // Rows run along u: the normal is that of (b - a) x (c - a).
        Surface::new(knots.clone(), knots.clone(), &[a, c, b, d], None)
    };
    faces.into_iter().map(face).collect()
}

/// What the lines between points (distance from the axis, height) pass over in turning around it.
fn turned(profile: &[[f64; 2]], frame: &Frame) -> Result<Vec<Surface>, GeometryError> {
    let place = |[r, z]: [f64; 2]| frame.origin() + frame.x() * r + frame.z() * z;
    let mut surfaces = Vec::new();
    for pair in profile.windows(2) {
        let [from, to] = [place(pair[1]), place(pair[0])];
        // A frustum may end in its apex.
        if from == to {
            continue;
        }
        let line = Curve::line(from, to, 0.0..1.0)?;
        surfaces.push(modelling::revolve(
            &line,
            frame.origin(),
            frame.z(),
            0.0..TAU,
        )?);
    }
    Ok(surfaces)
}

fn ball(frame: &Frame, radius: f64) -> Result<Vec<Surface>, GeometryError> {
    let latitudes = -FRAC_PI_2..FRAC_PI_2;
    modelling::sphere(frame, radius, 0.0..TAU, latitudes).map(|surface| vec![surface])
}

/// A solid of revolution (type 162): its curve is closed by lines to the axis, or by itself.
fn revolved(
    reader: &mut Reader<'_, '_>,
    p: &mut Parameters<'_>,
    to_axis: bool,
) -> Result<Parts, Problem> {
    let mut rim = rim(reader, p)?;
    let share = p.real_or(1.0)?;
    let frame = axis(p)?;
    let on_axis = |q: DVec3| frame.origin() + frame.z() * (q - frame.origin()).dot(frame.z());
    let size = size(&rim);
    if to_axis {
        let [first, last] = [rim[0].start(), rim[rim.len() - 1].end()];
        let points = [last, on_axis(last), on_axis(first), first];
        for pair in points.windows(2) {
            if pair[0].distance(pair[1]) > MEETS * size {
                rim.push(Curve::line(pair[0], pair[1], 0.0..1.0).map_err(Problem::Geometry)?);
            }
        }
    }
    closed(&rim, size)?;
    let points = || rim.iter().flat_map(Curve::points);
    let middle = points().sum::<DVec3>() / points().count() as f64;
    let way = frame.z().cross(middle - frame.origin());
    orient(&mut rim, way);
    let angles = 0.0..TAU * share.min(1.0);
    let mut parts = Vec::new();
    for curve in &rim {
        // What lies on the axis passes over nothing.
        let stays = |q: DVec3| q.distance(on_axis(q)) <= MEETS * size;
        if !curve.points().all(stays) {
            let surface = modelling::revolve(curve, frame.origin(), frame.z(), angles.clone());
            parts.push((surface.map_err(Problem::Geometry)?, Vec::new()));
        }
    }
    if share < 1.0 {
        let turn = DMat3::from_axis_angle(frame.z(), angles.end);
        let shift = frame.origin() - turn * frame.origin();
        let end = DAffine3::from_mat3_translation(turn, shift);
        parts.extend(caps(&rim, &end)?);
    }
    Ok(parts)
}

/// A solid of linear extrusion (type 164).
fn extruded(reader: &mut Reader<'_, '_>, p: &mut Parameters<'_>) -> Result<Parts, Problem> {
    let mut rim = rim(reader, p)?;
    closed(&rim, size(&rim))?;
    let along = length(p)?;
    let way = p.point_or(DVec3::Z)?.try_normalize();
    let way = way.ok_or(Problem::Geometry(GeometryError::NoDirection))? * along;
    orient(&mut rim, way);
    let mut parts = Vec::new();
    for curve in &rim {
        let surface = modelling::extrude(curve, way).map_err(Problem::Geometry)?;
        parts.push((surface, Vec::new()));
    }
    parts.extend(caps(&rim, &DAffine3::from_translation(way))?);
    Ok(parts)
}

/// The curves that a solid is made of, without those that are points.
fn rim(reader: &mut Reader<'_, '_>, p: &mut Parameters<'_>) -> Result<Vec<Curve<DVec3>>, Problem> {
    let index = reader.file.follow(p.integer()?, "the curve of a solid")?;
    let rails = reader.rails(index)?;
    let curves: Vec<_> = rails.into_iter().map(|rail| rail.curve).collect();
    let size = size(&curves);
    let is_long = |curve: &Curve<DVec3>| curve.hull_bounds().diagonal() > MEETS * size;
    let curves: Vec<_> = curves.into_iter().filter(is_long).collect();
    if curves.is_empty() {
        return Err(Problem::Invalid("a solid without a curve".to_owned()));
    }
    Ok(curves)
}

fn size(curves: &[Curve<DVec3>]) -> f64 {
    let points = || curves.iter().flat_map(Curve::points);
    let low = points().fold(DVec3::INFINITY, DVec3::min);
    let high = points().fold(DVec3::NEG_INFINITY, DVec3::max);
    low.distance(high)
}

/// Makes sure that every curve begins where the one before ends.
fn closed(rim: &[Curve<DVec3>], size: f64) -> Result<(), Problem> {
    let before = rim.iter().cycle().skip(rim.len() - 1);
    let meets =
        |(a, b): (&Curve<DVec3>, &Curve<DVec3>)| a.end().distance(b.start()) <= MEETS * size;
    if before.zip(rim).all(meets) {
        return Ok(());
    }
    let text = "the curve of the solid is not closed";
    Err(Problem::Invalid(text.to_owned()))
}

/// Twice the area inside a closed curve, as a vector, roughly.
fn area(rim: &[Curve<DVec3>]) -> DVec3 {
    let points: Vec<DVec3> = rim.iter().flat_map(Curve::points).collect();
    let pairs = points.iter().zip(points.iter().cycle().skip(1));
    pairs
        .map(|(a, b)| (*a - points[0]).cross(*b - points[0]))
        .sum()
}

/// Turns a closed curve so that what it passes over in moving along `way` has its normals outside.
fn orient(rim: &mut [Curve<DVec3>], way: DVec3) {
    if area(rim).dot(way) < 0.0 {
        rim.reverse();
        for curve in rim {
            *curve = curve.reversed();
        }
    }
}

/// The flat faces inside a closed curve, and inside its image at the other end of a solid, looking
/// away from it; nothing if they have no area.
fn caps(rim: &[Curve<DVec3>], to_end: &DAffine3) -> Result<Parts, Problem> {
    let end: Vec<_> = rim.iter().map(|curve| curve.transformed(to_end)).collect();
    if area(rim).length() <= FLAT * size(rim).powi(2) {
        return Ok(Vec::new());
    }
    Ok(vec![cap(rim, -area(rim))?, cap(&end, area(&end))?])
}

/// The flat face inside a closed curve, with its normal along `side`.
fn cap(rim: &[Curve<DVec3>], side: DVec3) -> Result<(Surface, Vec<TrimLoop>), Problem> {
    let points = || rim.iter().flat_map(Curve::points);
    let first = rim[0].start();
    let frame = Frame::about(first, side).map_err(Problem::Geometry)?;
    if points().any(|q| (q - first).dot(frame.z()).abs() > MEETS * size(rim)) {
        let text = "the curve of the solid is not flat, so that its ends have no faces";
        return Err(Problem::Invalid(text.to_owned()));
    }
    let flat = |q: DVec3| DVec2::new((q - first).dot(frame.x()), (q - first).dot(frame.y()));
    let low = points().map(flat).fold(DVec2::INFINITY, DVec2::min);
    let high = points().map(flat).fold(DVec2::NEG_INFINITY, DVec2::max);
    let corner = first + frame.x() * low.x + frame.y() * low.y;
    let edges = [frame.x() * (high.x - low.x), frame.y() * (high.y - low.y)];
    let plane = modelling::plane(corner, edges[0], edges[1], 0.0..1.0, 0.0..1.0);
    let plane = plane.map_err(Problem::Geometry)?;
    let laid = |curve: &Curve<DVec3>| in_parallelogram(&plane, [corner, edges[0], edges[1]], curve);
    let outline: Option<Vec<_>> = rim.iter().map(laid).collect();
    let outline = outline.ok_or(Problem::Geometry(GeometryError::Singular))?;
    let outline = TrimLoop::new(outline, 4.0 * MEETS).map_err(Problem::Geometry)?;
    Ok((plane, vec![outline]))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use kernel::{Integrals, Patch};

    use super::super::testing::{Made, made, read};
    use super::*;

    /// The area of all faces and, with normals that look outside, what they enclose.
    fn measured(entities: &[Made]) -> [f64; 2] {
        let (scene, warnings) = read(entities);
        assert!(warnings.is_empty(), "{warnings:?}");
        let of = |patch: &Patch| Integrals::of(patch, DVec3::ZERO);
        let all: Vec<Integrals> = scene.patches().iter().map(of).collect();
        let sum = |get: fn(&Integrals) -> f64| all.iter().map(get).sum();
        [sum(Integrals::area), sum(Integrals::volume)]
    }

    fn curve(kind: i64, parameters: &str) -> Made {
        Made {
            status: "00010000",
            ..made(kind, parameters)
        }
    }

    #[test]
    fn solids_have_their_areas_and_volumes() {
        let slant = 13.0_f64.sqrt();
        let cases = [
            (150, "2.,3.,4.,1.,2.,3.,0.,1.,0.,1.,0.,0.", [52.0, 24.0]),
            (150, "1.,2.,3.,,,,,,,,,", [22.0, 6.0]),
            (
                152,
                "4.,3.,2.,1.",
                [15.0 + 16.0 + 6.0 * 2.0_f64.sqrt(), 15.0],
            ),
            (152, "4.,3.,2.,0.", [12.0 + 8.0 + 6.0 + 10.0, 12.0]),
            (154, "5.,2.,1.,2.,3.,1.,0.,1.", [28.0 * PI, 20.0 * PI]),
            (
                156,
                "5.,3.,1.,1.,2.,3.",
                [(10.0 + 4.0 * 29.0_f64.sqrt()) * PI, 65.0 / 3.0 * PI],
            ),
            (156, "2.,3.", [(9.0 + 3.0 * slant) * PI, 6.0 * PI]),
            (158, "2.,1.,2.,3.", [16.0 * PI, 32.0 / 3.0 * PI]),
            (
                160,
                "4.,1.,1.,2.,3.,1.,1.,1.",
                [16.0 * PI * PI, 8.0 * PI * PI],
            ),
        ];
        for (kind, parameters, [area, volume]) in cases {
            let [found_area, found_volume] = measured(&[made(kind, parameters)]);
            assert!(
                (found_area / area - 1.0).abs() < 1e-9,
                "{kind}: {found_area} {area}"
            );
            assert!(
                (found_volume / volume - 1.0).abs() < 1e-9,
                "{kind}: {found_volume}"
            );
        }
        let [_, ellipsoid] = measured(&[made(168, "4.,3.,2.,1.,2.,3.,0.,1.,0.,0.,0.,1.")]);
        assert!((ellipsoid / (32.0 * PI) - 1.0).abs() < 1e-9, "{ellipsoid}");
    }

    #[test]
    fn swept_solids_are_closed_by_flat_faces() {
        // Circles, moved both ways; a square beside the axis; and a line closed to it.
        for circle in ["0.,0.,0.,1.,0.,1.,0.", "2.,3.,0.,4.,0.,4.,0."] {
            for way in ["0.,0.,1.", "0.,0.,-1."] {
                let solid = [curve(100, circle), made(164, &format!("1,5.,{way}"))];
                let [area, volume] = measured(&solid);
                assert!((area - 12.0 * PI).abs() < 1e-8, "{circle} {way}: {area}");
                assert!((volume - 5.0 * PI).abs() < 1e-8, "{circle} {way}: {volume}");
            }
        }
        let formed = |form: i64, parameters: &str| Made {
            form,
            ..made(162, parameters)
        };
        let square = "1,5,0.,2.,0.,3.,0.,3.,1.,2.,1.,2.,0.";
        for (share, caps) in [(1.0, 0.0), (0.25, 2.0)] {
            let axis = "0.,0.,0.,0.,1.,0.";
            let solid = [
                Made {
                    form: 63,
                    ..curve(106, square)
                },
                formed(1, &format!("1,{share},{axis}")),
            ];
            let [area, volume] = measured(&solid);
            assert!((area - share * 20.0 * PI - caps).abs() < 1e-8, "{area}");
            assert!((volume - share * 5.0 * PI).abs() < 1e-8, "{volume}");
            let solid = [
                curve(110, "2.,0.,0.,2.,4.,0."),
                formed(0, &format!("1,{share},{axis}")),
            ];
            let [area, volume] = measured(&solid);
            assert!(
                (area - share * 24.0 * PI - 8.0 * caps).abs() < 1e-8,
                "{area}"
            );
            assert!((volume - share * 16.0 * PI).abs() < 1e-8, "{volume}");
        }
    }

    #[test]
    fn solids_that_cannot_be_are_told() {
        let sphere = || made(158, "1.");
        for (solid, told) in [
            (made(158, "-1."), "must be positive"),
            (
                made(164, "3,5.,0.,0.,1."),
                "the curve of the solid is not closed",
            ),
        ] {
            let (scene, warnings) = read(&[sphere(), curve(110, "0.,0.,0.,1.,0.,0."), solid]);
            assert_eq!(scene.patches().len(), 1);
            assert!(warnings[0].contains(told), "{warnings:?}");
        }
        let assembly = [
            sphere(),
            made(124, "1.,0.,0.,5.,0.,1.,0.,0.,0.,0.,1.,0."),
            Made {
                status: "00000200",
                ..made(184, "2,1,1,0,3")
            },
        ];
        let (scene, warnings) = read(&assembly);
        assert!(warnings.is_empty(), "{warnings:?}");
        let x = scene
            .placements()
            .iter()
            .map(|p| p.world_from_object.translation.x)
            .collect::<Vec<_>>();
        assert_eq!(x, [0.0, 5.0]);
    }
}
