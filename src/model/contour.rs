//! Whether contours are such as bodies have.

use formats::{Error, Layer, Place, Warnings};
use glam::{DVec2, DVec3};

use super::{About, distinct, middle};

/// The gap of a contour that says nothing about being closed may be as many times as long as
/// its longest side.
const GAP: f64 = 8.0;

/// How far points of a contour may be from its plane, as a share of its size.
const FLAT: f64 = 0.05;

/// Most pairs of sides that are held against each other.
const PAIRS: usize = 200_000_000;

/// Refuses contours that bound no area or have fewer points than `least`, or repairs them where that is asked for.
pub(super) fn check(
    layers: &mut [Layer],
    (about, least): (&About<'_>, usize),
    repair: bool,
    warnings: &mut Warnings,
) -> Result<(), Error> {
    let mut pairs = PAIRS;
    for layer in layers {
        if layer.is_closed != Some(true) {
            distinct_ends(layer);
        }
        distinct(layer, true, about, repair, warnings)?;
        let count = layer.points.len();
        if count < least {
            let points = if count == 1 { "point" } else { "points" };
            let wanted = match least {
                3 => "a closed contour has at least 3".to_owned(),
                _ => format!("the method needs at least {least}"),
            };
            let text = format!("the layer has {count} {points}; {wanted}");
            return Err(about.error(&layer.place, text));
        }
        check_closed(layer, about, repair, warnings)?;
        let plane = Plane::of(&layer.points).ok_or_else(|| {
            let text = "the contour has no area: its points lie on one line, or it crosses itself";
            about.error(&layer.place, text)
        })?;
        let stray = layer
            .points
            .iter()
            .map(|p| plane.height(*p).abs())
            .fold(0.0, f64::max);
        if stray > FLAT * plane.size {
            let text = format!("the contour is not flat: points are {stray:.3} from its plane");
            return Err(about.error(&layer.place, text));
        }
        let flat: Vec<DVec2> = layer.points.iter().map(|p| plane.flat(*p)).collect();
        let found = crossing(&flat, &mut pairs);
        let found = found.ok_or_else(|| {
            about.error(&layer.place, "the contour has too many sides that overlap")
        })?;
        if let Some([a, b]) = found {
            let lines = match (layer.lines.get(a), layer.lines.get(b)) {
                (Some(a), Some(b)) => format!(" (lines {a} and {b})"),
                _ => String::new(),
            };
            let text = format!(
                "the contour crosses itself: its sides after points {} and {}{lines} meet",
                a + 1,
                b + 1
            );
            return Err(about.error(&layer.place, text));
        }
    }
    Ok(())
}

/// A contour that ends where it begins says that it is closed.
fn distinct_ends(layer: &mut Layer) {
    if layer.is_closed.is_none()
        && layer.points.len() > 3
        && layer.points.first() == layer.points.last()
    {
        layer.is_closed = Some(true);
    }
}

/// Refuses open contours, or closes them.
fn check_closed(
    layer: &mut Layer,
    about: &About<'_>,
    repair: bool,
    warnings: &mut Warnings,
) -> Result<(), Error> {
    let points = &layer.points;
    let longest = points
        .windows(2)
        .map(|w| w[0].distance(w[1]))
        .fold(0.0, f64::max);
    let gap = points[0].distance(points[points.len() - 1]);
    let is_open = match layer.is_closed {
        Some(is_closed) => !is_closed,
        None => gap > GAP * longest,
    };
    if !is_open {
        return Ok(());
    }
    if repair {
        warnings.invalid(
            about.place(&layer.place),
            "an open contour is closed by a straight line",
        );
        return Ok(());
    }
    let text = format!(
        "the contour is open: its ends are {gap:.3} apart, its longest side has {longest:.3}; \
         --repair closes it by a straight line"
    );
    Err(about.error(&layer.place, text))
}

/// The plane of a contour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    middle: DVec3,
    x: DVec3,
    y: DVec3,
    pub(super) normal: DVec3,
    size: f64,
}

impl Plane {
    /// The plane at right angles to the area; `None` if there is none.
    pub(super) fn of(points: &[DVec3]) -> Option<Self> {
        let middle = middle(points);
        let next = points.iter().cycle().skip(1);
        let turns = points
            .iter()
            .zip(next)
            .map(|(a, b)| (a - middle).cross(b - middle));
        let area = turns.sum::<DVec3>() * 0.5;
        let size = points
            .iter()
            .map(|p| p.distance(middle))
            .fold(0.0, f64::max);
        if area.length() <= 1e-9 * size * size {
            return None;
        }
        let normal = area.normalize();
        let x = normal.any_orthonormal_vector();
        Some(Self {
            middle,
            x,
            y: normal.cross(x),
            normal,
            size,
        })
    }

    fn height(&self, point: DVec3) -> f64 {
        (point - self.middle).dot(self.normal)
    }

    /// A point in coordinates of the plane.
    pub(super) fn flat(&self, point: DVec3) -> DVec2 {
        let from = point - self.middle;
        DVec2::new(from.dot(self.x), from.dot(self.y))
    }
}

/// Two sides of a closed polygon that meet elsewhere than at a common corner; `None` if there
/// are too many to tell.
fn crossing(points: &[DVec2], pairs: &mut usize) -> Option<Option<[usize; 2]>> {
    let count = points.len();
    let side = |k: usize| [points[k], points[(k + 1) % count]];
    let ends = |k: usize| {
        let [a, b] = side(k);
        [a.x.min(b.x), a.x.max(b.x)]
    };
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| ends(a)[0].total_cmp(&ends(b)[0]));
    for (position, &a) in order.iter().enumerate() {
        let beside = order[position + 1..].iter();
        for &b in beside.take_while(|&&b| ends(b)[0] <= ends(a)[1]) {
            *pairs = pairs.checked_sub(1)?;
            let (first, second) = (a.min(b), a.max(b));
            let is_next = second - first == 1;
            let is_around = first == 0 && second == count - 1;
            let meets = if is_next {
                turns_back(side(first), side(second))
            } else if is_around {
                turns_back(side(second), side(first))
            } else {
                meet(side(a), side(b))
            };
            if meets {
                return Some(Some([first, second]));
            }
        }
    }
    Some(None)
}

/// Whether the second of two sides with a common corner runs back on the first one.
fn turns_back([a, b]: [DVec2; 2], [_, c]: [DVec2; 2]) -> bool {
    let (before, after) = (b - a, c - b);
    let sine = before.perp_dot(after);
    before.dot(after) < 0.0 && sine.abs() <= 1e-12 * before.length() * after.length()
}

/// Whether two segments have a common point.
fn meet([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> bool {
    let side = |from: DVec2, to: DVec2, p: DVec2| (to - from).perp_dot(p - from);
    let is_split = |x: f64, y: f64| (x <= 0.0 && y >= 0.0) || (x >= 0.0 && y <= 0.0);
    let boxes = a.min(b).cmple(c.max(d)).all() && c.min(d).cmple(a.max(b)).all();
    boxes && is_split(side(a, b, c), side(a, b, d)) && is_split(side(c, d, a), side(c, d, b))
}

/// Whether a contour has a point inside.
pub(super) fn contains(contour: &[DVec2], point: DVec2) -> bool {
    let next = contour.iter().cycle().skip(1);
    let crossings = contour.iter().zip(next).filter(|(a, b)| {
        (a.y > point.y) != (b.y > point.y)
            && point.x < (b.x - a.x) * (point.y - a.y) / (b.y - a.y) + a.x
    });
    crossings.count() % 2 == 1
}

/// Two contours of one plane that cross, or of which one is in the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Overlap {
    /// Beside each other.
    None,
    /// One is in the other.
    Nested,
    /// They cross.
    Crossing,
}

/// How two contours of one plane lie.
pub(super) fn overlap(a: &[DVec2], b: &[DVec2]) -> Overlap {
    let sides = |points: &[DVec2]| -> Vec<[DVec2; 2]> {
        let next = points.iter().cycle().skip(1);
        points.iter().zip(next).map(|(a, b)| [*a, *b]).collect()
    };
    let (first, second) = (sides(a), sides(b));
    let crosses = first.iter().any(|s| second.iter().any(|t| meet(*s, *t)));
    if crosses {
        Overlap::Crossing
    } else if contains(a, b[0]) || contains(b, a[0]) {
        Overlap::Nested
    } else {
        Overlap::None
    }
}

/// The place of a layer with another one.
pub(super) fn both(a: &Layer, b: &Layer) -> Place {
    let what = match b.place.line {
        0 => format!("{} and {}", a.place.what, b.place.what),
        line => format!("{} and {} (line {line})", a.place.what, b.place.what),
    };
    Place::item(a.place.line, what)
}
