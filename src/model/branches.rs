//! Contours of one body, sorted into stacks with one contour in each layer.

use formats::{Error, Layer, Warnings};
use glam::{DVec2, DVec3};

use super::contour::{Overlap, Plane, both, contains, overlap};
use super::{About, ModelOptions, middle};

/// Contours closer in height than this share of all heights lie in one layer.
const SAME_HEIGHT: f64 = 1e-6;

/// A contour and where it lies.
struct Placed {
    layer: Layer,
    flat: Vec<DVec2>,
    /// The direction in which heights count, of all contours.
    normal: DVec3,
    height: f64,
}

/// Stacks of contours, each from the lowest to the highest or the other way round.
///
/// A body with one contour in each layer is one stack. One that branches is refused, or cut
/// where it does: each branch begins with its own contour at the height of the last common one.
pub(super) fn stacks(
    layers: Vec<Layer>,
    about: &About<'_>,
    options: &ModelOptions,
    warnings: &mut Warnings,
) -> Result<Vec<Vec<Layer>>, Error> {
    let levels = levels(layers, about, options.repair, warnings)?;
    let is_single = levels.iter().all(|level| level.len() == 1);
    if let (true, [only]) = (is_single, levels.as_slice()) {
        let text = "there is one layer; a body has at least two";
        return Err(about.error(&only[0].layer.place, text));
    }
    for level in &levels {
        check_level(level, about, options.split)?;
    }
    if is_single {
        return Ok(vec![
            levels.into_iter().flatten().map(|p| p.layer).collect(),
        ]);
    }
    split(&levels, about)
}

/// Contours by their heights.
fn levels(
    layers: Vec<Layer>,
    about: &About<'_>,
    repair: bool,
    warnings: &mut Warnings,
) -> Result<Vec<Vec<Placed>>, Error> {
    let planes: Vec<Plane> = layers.iter().filter_map(|l| Plane::of(&l.points)).collect();
    let Some(first) = planes.first().copied() else {
        return Ok(Vec::new());
    };
    let same_side = |plane: &Plane| plane.normal * plane.normal.dot(first.normal).signum();
    let normal = planes
        .iter()
        .map(same_side)
        .sum::<DVec3>()
        .normalize_or_zero();
    let mut placed: Vec<Placed> = layers
        .into_iter()
        .map(|layer| Placed {
            flat: layer.points.iter().map(|p| first.flat(*p)).collect(),
            normal,
            height: middle(&layer.points).dot(normal),
            layer,
        })
        .collect();
    let heights = || placed.iter().map(|p| p.height);
    let (least, most) = (
        heights().fold(f64::INFINITY, f64::min),
        heights().fold(f64::NEG_INFINITY, f64::max),
    );
    let near = SAME_HEIGHT * (most - least);
    // The way from the first layer to the last one tells which way all should go.
    let way = placed.last().map_or(0.0, |last| last.height) - placed[0].height;
    let is_back = |pair: &[Placed]| (pair[1].height - pair[0].height) * way.signum() < -near;
    if let Some(pair) = placed.windows(2).find(|pair| is_back(pair)) {
        if repair {
            let place = about.place(&pair[1].layer.place);
            warnings.invalid(place, "layers are put in order");
            placed.sort_by(|a, b| a.height.total_cmp(&b.height));
        } else {
            let text = format!(
                "the layer at height {} follows one at {}, against the order of the layers; \
                 --repair sorts them",
                pair[1].height, pair[0].height
            );
            return Err(about.error(&pair[1].layer.place, text));
        }
    }
    let mut levels: Vec<Vec<Placed>> = Vec::new();
    for one in placed {
        let level = levels
            .last_mut()
            .filter(|level| (one.height - level[0].height).abs() <= near);
        match level {
            Some(level) => level.push(one),
            None => levels.push(vec![one]),
        }
    }
    Ok(levels)
}

/// Refuses contours of one layer that cross or lie in each other, and more than one unless
/// bodies are split.
fn check_level(level: &[Placed], about: &About<'_>, may_split: bool) -> Result<(), Error> {
    for (k, a) in level.iter().enumerate() {
        for b in &level[k + 1..] {
            let text = match overlap(&a.flat, &b.flat) {
                Overlap::Crossing => "the two contours cross",
                Overlap::Nested => "one contour lies in the other; bodies with holes are not made",
                Overlap::None => continue,
            };
            return Err(about.error(&both(&a.layer, &b.layer), text));
        }
    }
    if level.len() > 1 && !may_split {
        let text = format!(
            "{} contours at height {}: the body branches; give its branches as bodies of their \
             own, or --branches split",
            level.len(),
            level[0].height
        );
        return Err(about.error(&both(&level[0].layer, &level[1].layer), text));
    }
    Ok(())
}

/// Cuts a body where contours divide or join.
fn split(levels: &[Vec<Placed>], about: &About<'_>) -> Result<Vec<Vec<Layer>>, Error> {
    let lies_on = |a: &Placed, b: &Placed| {
        let inside = |a: &Placed, b: &Placed| b.flat.iter().any(|p| contains(&a.flat, *p));
        inside(a, b) || inside(b, a) || overlap(&a.flat, &b.flat) != Overlap::None
    };
    let mut done: Vec<Vec<Layer>> = Vec::new();
    // The stack that each contour of the level belongs to.
    let mut open: Vec<Vec<Layer>> = levels[0].iter().map(|p| vec![p.layer.clone()]).collect();
    for pair in levels.windows(2) {
        let above = |a: &Placed| -> Vec<usize> {
            (0..pair[1].len())
                .filter(|&k| lies_on(a, &pair[1][k]))
                .collect()
        };
        let links: Vec<Vec<usize>> = pair[0].iter().map(above).collect();
        let mut next: Vec<Option<Vec<Layer>>> = vec![None; pair[1].len()];
        for ((stack, links), own) in open.into_iter().zip(&links).zip(&pair[0]) {
            let is_shared =
                |k: usize| pair[0].iter().filter(|a| lies_on(a, &pair[1][k])).count() > 1;
            match links.as_slice() {
                [only] if !is_shared(*only) => next[*only] = Some(stack),
                [only] => {
                    // It joins another one: as it is up to there.
                    let mut stack = stack;
                    stack.push(raised(own, pair[1][*only].height));
                    done.push(stack);
                }
                _ => done.push(stack),
            }
        }
        let levels = pair[1].iter().zip(next);
        open = levels
            .map(|(placed, stack)| match stack {
                Some(mut stack) => {
                    stack.push(placed.layer.clone());
                    stack
                }
                None => {
                    let below = pair[0]
                        .iter()
                        .filter(|a| lies_on(a, placed))
                        .collect::<Vec<_>>();
                    let mut stack = Vec::new();
                    if let [trunk] = below.as_slice() {
                        stack.push(raised(placed, trunk.height));
                    }
                    stack.push(placed.layer.clone());
                    stack
                }
            })
            .collect();
    }
    done.extend(open);
    for stack in &done {
        if let [only] = stack.as_slice() {
            let text = "the contour has none above or below it; a body has at least two layers";
            return Err(about.error(&only.place, text));
        }
    }
    Ok(done)
}

/// A contour at another height.
fn raised(placed: &Placed, height: f64) -> Layer {
    let shift = placed.normal * (height - placed.height);
    Layer {
        points: placed.layer.points.iter().map(|p| p + shift).collect(),
        ..placed.layer.clone()
    }
}
