//! Circular and conic arcs (types 100 and 104).

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};
use std::ops::Range;

use glam::{DMat2, DVec2, DVec3};
use kernel::{Curve, KnotVector, modelling};

use super::curves::Rail;
use super::parameters::Parameters;
use crate::Problem;

/// Determinants below this share of the coefficients belong to parabolas.
const PARABOLA: f64 = 1e-12;

/// Ellipses with determinants below this are so long that a short arc of them is told by its ends better
/// than by its centre.
const LONG: f64 = 1e-6;

/// Ends of an arc no farther apart than this share of its radius are one; so are those of which the
/// numbers differ by no more than this share.
const CLOSES: f64 = 1e-12;
const DIGITS: f64 = 1e-14;

/// The resolution of the file counts up to this share of the radius of an arc, and up to this length,
/// which is of the order of the accuracy of programs for solids.
const TINY: f64 = 1e-6;

/// An open arc is a line where it bends aside by no more than this many times what its ends are
/// beside their conic, which is how well the file tells its numbers.
const STRAIGHT: f64 = 2.0;

/// Ends that are farther beside their conic than this share of their numbers, as of single
/// precision, tell nothing of the kind.
const SINGLE: f64 = 1e-6;

/// `A x^2 + B x y + C y^2 + D x + E y + F = 0`, divided by its largest coefficient.
struct Conic {
    square: DMat2,
    linear: DVec2,
    constant: f64,
}

impl Conic {
    fn value(&self, p: DVec2) -> f64 {
        p.dot(self.square * p) + self.linear.dot(p) + self.constant
    }

    fn gradient(&self, p: DVec2) -> DVec2 {
        self.square * p * 2.0 + self.linear
    }

    /// About how far a point is from the conic.
    fn off(&self, p: DVec2) -> f64 {
        self.value(p).abs() / self.gradient(p).length()
    }

    /// How far one of two points is.
    fn ends_off(&self, [start, end]: [DVec2; 2]) -> f64 {
        self.off(start).max(self.off(end))
    }

    /// The axes of the quadratic form, the one next to the x axis first: parameters count from there,
    /// whichever is longer.
    fn axes(&self) -> [DVec2; 2] {
        let (x, y) = (self.square.x_axis, self.square.y_axis);
        let turn = 0.5 * f64::atan2(2.0 * x.y, x.x - y.y);
        let is_near = turn.abs() <= FRAC_PI_4;
        let axis = DVec2::from_angle(if is_near {
            turn
        } else {
            turn - FRAC_PI_2.copysign(turn)
        });
        [axis, axis.perp()]
    }

    /// The form along an axis.
    fn along(&self, axis: DVec2) -> f64 {
        axis.dot(self.square * axis)
    }

    /// The centre, and what the form is beside it on the conic.
    fn center(&self) -> (DVec2, f64) {
        let center = self.square.inverse() * self.linear * -0.5;
        (center, -self.value(center))
    }

    /// What the parameter is of an arc of a parabola, or of a branch of a hyperbola, between these ends, with
    /// the sign with which it grows: of the parabola the coordinate across its axis, of the hyperbola the
    /// hyperbolic angle. The standard has another angle there, but those who write surfaces of hyperbolas
    /// mean this one. At the ends it is exact; of other arcs it runs from 0 to 1.
    fn open_domain(&self, ends: [DVec2; 2]) -> Range<f64> {
        let determinant = self.square.determinant();
        let [x, y] = self.axes();
        let [from, to] = if determinant.abs() <= PARABOLA {
            let is_y = self.along(y).abs() > self.along(x).abs();
            let across = if is_y { y } else { x };
            ends.map(|p| p.dot(across))
        } else {
            let (center, level) = self.center();
            // Along this axis there is no point of it.
            let beside = if self.along(y) * level < 0.0 { y } else { x };
            let length = (-level / self.along(beside)).sqrt();
            ends.map(|p| ((p - center).dot(beside) / length).asinh())
        };
        let way = to - from;
        if determinant <= PARABOLA && way.abs() > 0.0 && way.is_finite() {
            way.signum() * from..way.signum() * to
        } else {
            0.0..1.0
        }
    }
}

/// Ends that are farther beside their conic than this share of their distance are not on it.
const BESIDE: f64 = 1e-3;

/// Reads a conic arc; ellipses run counter-clockwise. The second result is whether the ends are on
/// the conic.
pub(super) fn read(
    parameters: &mut Parameters<'_>,
    resolution: f64,
) -> Result<(Rail, bool), Problem> {
    let mut c = [0.0; 6];
    for value in &mut c {
        *value = parameters.real()?;
    }
    let largest = c[..3].iter().fold(0.0_f64, |max, x| max.max(x.abs()));
    let [a, b, c, d, e, f] = c.map(|x| x / largest);
    let conic = Conic {
        square: DMat2::from_cols(DVec2::new(a, b / 2.0), DVec2::new(b / 2.0, c)),
        linear: DVec2::new(d, e),
        constant: f,
    };
    let z = parameters.real()?;
    let mut point = || Ok::<_, Problem>(DVec2::new(parameters.real()?, parameters.real()?));
    let [start, end] = [point()?, point()?];
    let no_conic = || Problem::Invalid("the coefficients of the conic arc are no conic".to_owned());
    if !(largest > 0.0 && conic.square.is_finite()) {
        return Err(no_conic());
    }
    let curve = if conic.square.determinant() > PARABOLA {
        ellipse(&conic, [start, end], z, resolution)
    } else {
        open_arc(&conic, start, end, z)
    };
    let is_on = conic.ends_off([start, end]) <= BESIDE * start.distance(end) || start == end;
    Ok((curve.ok_or_else(no_conic)?, is_on))
}

/// A circular arc, counter-clockwise, over its angles.
pub(super) fn circle(parameters: &mut Parameters<'_>, resolution: f64) -> Result<Rail, Problem> {
    let z = parameters.real()?;
    let mut point = || Ok::<_, Problem>(DVec2::new(parameters.real()?, parameters.real()?));
    let [center, start, end] = [point()?, point()?, point()?];
    let radius = start.distance(center);
    let near = near([start, end], radius, resolution);
    let angles = angles([start, end], near, |p| (p - center).to_angle());
    let (x, y) = (DVec3::X * radius, DVec3::Y * radius);
    let arc = modelling::arc(center.extend(z), x, y, angles);
    arc.map(Rail::arc).map_err(Problem::Geometry)
}

/// The angles over which an arc runs: once around where its ends are no farther apart than `near`.
fn angles(ends: [DVec2; 2], near: f64, angle: impl Fn(DVec2) -> f64) -> Range<f64> {
    let [from, to] = ends.map(|end| angle(end).rem_euclid(TAU));
    let turn = (to - from).rem_euclid(TAU);
    if ends[0].distance(ends[1]) > near && turn > 0.0 {
        return from..from + turn;
    }
    // What begins just before zero is meant to begin there.
    let from = if from > TAU - TINY { from - TAU } else { from };
    from..from + TAU
}

/// How far apart the ends of a whole arc may be: by the rounding of numbers as large as theirs, or by
/// less than what the file resolves, as no arc is meant to be that short. Since some files state a
/// resolution far above their smallest curves, it counts up to a bound only.
fn near([start, end]: [DVec2; 2], radius: f64, resolution: f64) -> f64 {
    let largest = start.abs().max(end.abs()).max_element();
    let rounding = CLOSES * radius + DIGITS * largest;
    rounding.max(resolution.min(TINY * radius.min(1.0)))
}

/// An arc of an ellipse, over the angles of its parametric form.
fn ellipse(conic: &Conic, ends: [DVec2; 2], z: f64, resolution: f64) -> Option<Rail> {
    let (center, level) = conic.center();
    let [x, y] = conic.axes();
    let length = |axis: DVec2| (level / conic.along(axis)).sqrt();
    let (long, short) = (length(x), length(y));
    if !(long > 0.0 && short > 0.0 && long.is_finite() && short.is_finite()) {
        return None;
    }
    let angle = |p: DVec2| {
        let offset = p - center;
        f64::atan2(offset.dot(y) / short, offset.dot(x) / long)
    };
    let angles = angles(ends, near(ends, long.min(short), resolution), angle);
    let is_short = angles.end - angles.start <= FRAC_PI_2;
    if is_short && conic.square.determinant() < LONG {
        let curve = open_arc(conic, ends[0], ends[1], z)?.curve;
        return curve.remapped(angles).map(Rail::arc).ok();
    }
    let (x, y) = ((x * long).extend(0.0), (y * short).extend(0.0));
    let curve = modelling::arc(center.extend(z), x, y, angles);
    curve.map(Rail::arc).ok()
}

/// An arc of a parabola, of one branch of a hyperbola, or less than half of an ellipse: one rational
/// quadratic piece.
///
/// All comes from the chord `d`: the conic is `-d.S d / 4` in its middle and `K = 0` where it is a
/// pair of lines, so the weight is `w^2 = 1 - d.S d det S / (4 K)` and the middle point, the pole of
/// the chord, is `adj S (gradient of the middle) d.S d / (8 K w^2)` beside that. Where the tangents
/// at the ends meet tells the same, but of an arc that is nearly straight nothing.
fn open_arc(conic: &Conic, start: DVec2, end: DVec2, z: f64) -> Option<Rail> {
    let chord = end - start;
    let middle = start.midpoint(end);
    let bend = chord.dot(conic.square * chord);
    let sag = bend.abs() / (4.0 * conic.gradient(middle).length());
    let largest = start.abs().max(end.abs()).max_element();
    let off = conic.ends_off([start, end]).min(SINGLE * largest);
    let domain = conic.open_domain([start, end]);
    let is_bent = sag > STRAIGHT * off.max(DIGITS * largest);
    if !is_bent {
        let line = Curve::line(start.extend(z), end.extend(z), domain);
        return (start != end).then(|| line.ok().map(Rail::from)).flatten();
    }
    let determinant = conic.square.determinant();
    let (x, y) = (conic.square.x_axis, conic.square.y_axis);
    let adjugate = DMat2::from_cols(DVec2::new(y.y, -x.y), DVec2::new(-y.x, x.x));
    let lines = conic.linear.dot(adjugate * conic.linear) / 4.0 - conic.constant * determinant;
    let weight = (1.0 - bend * determinant / (4.0 * lines)).sqrt();
    let way = adjugate * conic.gradient(middle) * (bend / (8.0 * lines * weight * weight));
    if !(weight > 0.0 && weight.is_finite() && way.is_finite()) {
        return None;
    }
    let points: [DVec3; 3] = [start, middle + way, end].map(|p| p.extend(z));
    let knots = KnotVector::bezier(2, domain).ok()?;
    let curve = Curve::new(knots, &points, Some(&[1.0, weight, 1.0])).ok()?;
    Some(Rail::from(curve))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::iges::parameters::Delimiters;

    fn parameters(record: &str) -> Parameters<'_> {
        Parameters::new(record.as_bytes(), Delimiters::default(), 1)
    }

    fn conic(record: &str) -> Curve<DVec3> {
        read(&mut parameters(record), 0.0).unwrap().0.curve
    }

    fn check(record: &str, on: impl Fn(DVec2) -> f64, middle: DVec2) {
        let curve = conic(record);
        let domain = curve.domain();
        for k in 0..=16 {
            let t = domain.start + (domain.end - domain.start) * f64::from(k) / 16.0;
            assert!(
                on(curve.evaluate(t).truncate()).abs() < 1e-12,
                "{record} {t}"
            );
        }
        let found = curve.evaluate(f64::midpoint(domain.start, domain.end));
        assert!(
            found.distance(middle.extend(5.0)) < 1e-12,
            "{record}: {found}"
        );
    }

    #[test]
    fn arcs_stay_on_their_circle() {
        for (record, middle) in [
            ("7.,1.,1.,3.,1.,1.,3.;", 45.0_f64),
            ("7.,1.,1.,1.,3.,3.,1.;", 225.0),
            ("7.,1.,1.,3.,1.,3.,1.;", 180.0),
        ] {
            let arc = circle(&mut parameters(record), 0.0).unwrap().curve;
            let domain = arc.domain();
            let center = DVec3::new(1.0, 1.0, 7.0);
            for k in 0..=20 {
                let t = domain.start + (domain.end - domain.start) * f64::from(k) / 20.0;
                let distance = arc.evaluate(t).distance(center);
                assert!((distance - 2.0).abs() < 1e-14, "{record} {t}");
            }
            let expected = center + DVec2::from_angle(middle.to_radians()).extend(0.0) * 2.0;
            let found = arc.evaluate(f64::midpoint(domain.start, domain.end));
            assert!(found.distance(expected) < 1e-14, "{record} {found}");
        }
    }

    #[test]
    fn arcs_are_full_where_their_ends_differ_by_rounding_only() {
        for (end, sweep) in [
            ("1.,2.4E-16", TAU),
            ("1.,-2.4E-16", TAU),
            ("1.,1.E-9", 1e-9),
            ("1.,-1.E-9", TAU - 1e-9),
        ] {
            let circle = circle(&mut parameters(&format!("0.,0.,0.,1.,0.,{end};")), 0.0).unwrap();
            let ellipse = format!("0.25,0.,1.,0.,0.,-0.25,0.,1.,0.,{end};");
            let (ellipse, _) = read(&mut parameters(&ellipse), 0.0).unwrap();
            // A degree of the ellipse is half as high there.
            for (rail, sweep) in [(circle, sweep), (ellipse, sweep)] {
                let domain = rail.curve.domain();
                let found = domain.end - domain.start;
                assert!((found - sweep).abs() < 1.1e-9, "{end}: {found}");
            }
        }
        let far = "0.,1000.,0.,1000.01,0.,1000.0100000000001,0.;";
        let far = circle(&mut parameters(far), 0.0).unwrap().curve.domain();
        assert!((far.end - far.start - TAU).abs() < 1e-12, "{far:?}");
    }

    #[test]
    fn arcs_shorter_than_the_resolution_are_full() {
        // The second begins just before the angle zero; the third is too long, whatever the file says.
        for (from, to, resolution, expected) in [
            ("2.,0.", "2.,3.E-7", 1e-5, 0.0..TAU),
            ("2.,-2.5E-7", "2.,6.6E-15", 1e-5, 0.0..TAU),
            ("2.,0.", "2.,3.E-6", 10.0, 0.0..1.5e-6),
            ("2.,0.", "2.,3.E-7", 1e-7, 0.0..1.5e-7),
            ("2.E6,0.", "2.E6,1.", 10.0, 0.0..5e-7),
        ] {
            let record = format!("0.,0.,0.,{from},{to};");
            let arc = circle(&mut parameters(&record), resolution).unwrap();
            let found = arc.curve.domain();
            let off = (found.start - expected.start).abs() + (found.end - expected.end).abs();
            assert!(off < 0.1 * expected.end.min(3e-6), "{record} {found:?}");
        }
    }

    #[test]
    fn ellipses_parabolas_and_hyperbolas_are_met() {
        // x^2 / 4 + y^2 = 1, the upper half and, turned by 45 degrees, the whole.
        let upper = "0.25,0.,1.,0.,0.,-1.,5.,2.,0.,-2.,0.;";
        check(upper, |p| p.x * p.x / 4.0 + p.y * p.y - 1.0, DVec2::Y);
        let turned = "2.5,-3.,2.5,0.,0.,-4.,5.,1.4142135623730951,1.4142135623730951,\
                      1.4142135623730951,1.4142135623730951;";
        let on = |p: DVec2| 2.5 * (p.x * p.x + p.y * p.y) - 3.0 * p.x * p.y - 4.0;
        check(turned, on, DVec2::splat(-(2.0_f64.sqrt())));
        // y = x^2 and x^2 - y^2 = 1.
        check(
            "1.,0.,0.,0.,-1.,0.,5.,-1.,1.,1.,1.;",
            |p| p.x * p.x - p.y,
            DVec2::ZERO,
        );
        let end = (1.0_f64 + 9.0).sqrt();
        let hyperbola = format!("1.,0.,-1.,0.,0.,-1.,5.,{end:?},-3.,{end:?},3.;");
        check(&hyperbola, |p| p.x * p.x - p.y * p.y - 1.0, DVec2::X);
    }

    /// Points of a record with ten digits, as most programs write them.
    fn arc_of(coefficients: [f64; 6], ends: [DVec2; 2]) -> Curve<DVec3> {
        let ends = ends.iter().flat_map(|p| [p.x, p.y]);
        let numbers = coefficients.into_iter().chain([0.0]).chain(ends);
        let numbers: Vec<_> = numbers.map(|x| format!("{x:.9e}")).collect();
        conic(&format!("{};", numbers.join(",")))
    }

    #[test]
    fn arcs_are_as_near_to_their_conics_as_the_digits_of_their_ends() {
        // Planes ever nearer to the tip of a cone, then parabolas and ellipses ever flatter.
        let shares = (0..60).map(|k| f64::from(k) / 10.0);
        for bend in shares.map(|share| 10.0_f64.powf(-share)) {
            for (from, to) in [(8.9, 9.0), (0.1, 9.0), (-7.0, 3.0), (2.0, 2.001)] {
                let cone = |y: f64| DVec2::new(y.hypot(bend) * 0.5, y);
                let parabola = |x: f64| DVec2::new(x, x * x * bend);
                let ellipse = |x: f64| DVec2::new(x, (1.0 - x * x * bend / 100.0).sqrt());
                let square = bend * bend;
                for (coefficients, ends) in [
                    ([4.0, 0.0, -1.0, 0.0, 0.0, -square], [cone(from), cone(to)]),
                    (
                        [bend, 0.0, 0.0, 0.0, -1.0, 0.0],
                        [parabola(from), parabola(to)],
                    ),
                    (
                        [bend / 100.0, 0.0, 1.0, 0.0, 0.0, -1.0],
                        [ellipse(to), ellipse(from)],
                    ),
                ] {
                    let curve = arc_of(coefficients, ends);
                    let domain = curve.domain();
                    for k in 0..=16 {
                        let t = domain.start + (domain.end - domain.start) * f64::from(k) / 16.0;
                        let p = curve.evaluate(t).truncate();
                        let [a, _, c, d, e, f] = coefficients;
                        let value = a * p.x * p.x + c * p.y * p.y + d * p.x + e * p.y + f;
                        let slope = DVec2::new(2.0 * a * p.x + d, 2.0 * c * p.y + e).length();
                        let off = (value / slope).abs() / curve.hull_bounds().diagonal().max(9.0);
                        assert!(off < 1e-9, "{coefficients:?} {ends:?}: {off}");
                    }
                }
            }
        }
    }

    #[test]
    fn short_arcs_of_long_ellipses_end_where_they_should() {
        // k x^2 + y^2 = 2 x, near the origin.
        for k in [1e-5, 1e-7, 1e-9, 1e-11, 3e-12] {
            let at = |y: f64| DVec2::new(y * y / (1.0 + (1.0 - k * y * y).sqrt()), y);
            let ends = [at(2.0), at(1.0)]
                .map(|p| format!("{:?},{:?}", p.x, p.y))
                .join(",");
            let curve = conic(&format!("{k:?},0.,1.,-2.,0.,0.,0.,{ends};"));
            let domain = curve.domain();
            assert!((domain.end - domain.start - k.sqrt()).abs() < 0.1 * k.sqrt());
            for t in [
                domain.start,
                f64::midpoint(domain.start, domain.end),
                domain.end,
            ] {
                let p = curve.evaluate(t).truncate();
                assert!(p.distance(at(p.y)) < 1e-9, "{k}: {p}");
            }
            let off = curve.start().truncate().distance(at(2.0));
            assert!(
                off + curve.end().truncate().distance(at(1.0)) < 1e-9,
                "{k}: {off}"
            );
        }
    }

    #[test]
    fn parabolas_run_over_their_coordinates() {
        // y = x^2 to both sides, and x = y^2 / 4.
        for (record, domain, at) in [
            (
                "1.,0.,0.,0.,-1.,0.,0.,1.,1.,3.,9.;",
                1.0..3.0,
                DVec2::new(2.0, 4.0),
            ),
            (
                "1.,0.,0.,0.,-1.,0.,0.,3.,9.,1.,1.;",
                -3.0..-1.0,
                DVec2::new(2.0, 4.0),
            ),
            (
                "0.,0.,1.,-4.,0.,0.,0.,1.,2.,4.,4.;",
                2.0..4.0,
                DVec2::new(2.25, 3.0),
            ),
        ] {
            let curve = conic(record);
            assert_eq!(curve.domain(), domain, "{record}");
            let middle = curve.evaluate(f64::midpoint(domain.start, domain.end));
            assert!(middle.truncate().distance(at) < 1e-12, "{record}: {middle}");
        }
    }

    #[test]
    fn hyperbolas_run_over_their_hyperbolic_angles() {
        let at = |t: f64| DVec2::new(3.0 * t.cosh(), 2.0 * t.sinh());
        for (from, to) in [(0.3, 1.2), (1.2, 0.3), (-1.0, 2.0)] {
            let curve = arc_of([4.0, 0.0, -9.0, 0.0, 0.0, -36.0], [at(from), at(to)]);
            let (domain, sign) = (curve.domain(), if from < to { 1.0 } else { -1.0 });
            let off = (domain.start - sign * from).abs() + (domain.end - sign * to).abs();
            assert!(off < 1e-8, "{domain:?}");
        }
        // Upwards and downwards instead of to the sides.
        let at = |t: f64| DVec2::new(2.0 * t.sinh(), 3.0 * t.cosh());
        let curve = arc_of([-9.0, 0.0, 4.0, 0.0, 0.0, -36.0], [at(-0.5), at(0.7)]);
        assert!(
            (curve.domain().end - 0.7).abs() < 1e-8,
            "{:?}",
            curve.domain()
        );
    }

    #[test]
    fn ends_beside_their_conic_are_told() {
        // y = x^2, and one with a wrong coefficient.
        let is_on = |record: &str| read(&mut parameters(record), 0.0).unwrap().1;
        assert!(is_on("1.,0.,0.,0.,-1.,0.,0.,1.,1.0001,3.,9.;"));
        assert!(!is_on("1.,0.,0.,0.,-25.4,0.,0.,1.,1.,3.,9.;"));
    }

    #[test]
    fn what_is_no_conic_is_told() {
        for record in [
            "0.,0.,0.,0.,0.,1.,0.,1.,0.,0.,1.;",
            "1.,0.,1.,0.,0.,1.,0.,1.,0.,0.,1.;",
        ] {
            assert!(read(&mut parameters(record), 0.0).is_err(), "{record}");
        }
    }
}
