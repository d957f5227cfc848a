//! Where subfigures and arrays (types 408, 412, 414 and 420) place what they show.

use std::collections::HashSet;

use glam::{DAffine3, DQuat, DVec3};

use super::parameters::Parameters;
use crate::Problem;

/// An entity shown in one or many places.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Copies {
    /// Pointer to what is shown.
    pub base: i64,
    layout: Layout,
    /// Numbers of places, from 1 on, and whether they are those left out; all others are the
    /// other way round.
    listed: Option<(HashSet<u64>, bool)>,
}

/// How places follow each other.
#[derive(Clone, Debug, PartialEq)]
enum Layout {
    One(DAffine3),
    /// Columns, each from its lowest row up.
    Grid {
        first: DAffine3,
        scale: f64,
        columns: u64,
        rows: u64,
        step: [f64; 2],
    },
    Circle {
        center: DVec3,
        radius: f64,
        count: u64,
        start: f64,
        step: f64,
    },
}

impl Copies {
    /// Reads the entity of a type.
    pub(super) fn read(kind: i64, parameters: &mut Parameters<'_>) -> Result<Self, Problem> {
        let base = parameters.integer()?;
        let (layout, listed) = match kind {
            412 => (grid(parameters)?, listed(parameters)?),
            414 => (circle(parameters)?, listed(parameters)?),
            _ => {
                let origin = parameters.point_or(DVec3::ZERO)?;
                let x = scale(parameters, 1.0)?;
                let scale = if kind == 420 {
                    DVec3::new(x, scale(parameters, x)?, scale(parameters, x)?)
                } else {
                    DVec3::splat(x)
                };
                if kind == 420 {
                    skip_connections(parameters);
                }
                let place = DAffine3::from_translation(origin) * DAffine3::from_scale(scale);
                (Layout::One(place), None)
            }
        };
        Ok(Self {
            base,
            layout,
            listed,
        })
    }

    /// How many places there are, counting those left out.
    pub(super) fn count(&self) -> u64 {
        match self.layout {
            Layout::One(_) => 1,
            Layout::Grid { columns, rows, .. } => columns.saturating_mul(rows),
            Layout::Circle { count, .. } => count,
        }
    }

    /// Where copies are placed.
    pub(super) fn places(&self) -> impl Iterator<Item = DAffine3> {
        let is_shown = |k: &u64| match &self.listed {
            Some((numbers, are_left_out)) => numbers.contains(&(k + 1)) != *are_left_out,
            None => true,
        };
        (0..self.count()).filter(is_shown).map(|k| self.place(k))
    }

    fn place(&self, k: u64) -> DAffine3 {
        match self.layout {
            Layout::One(place) => place,
            Layout::Grid {
                first,
                scale,
                rows,
                step,
                ..
            } => {
                let [x, y] = [(k / rows) as f64 * step[0], (k % rows) as f64 * step[1]];
                let origin = first.transform_point3(DVec3::new(x, y, 0.0));
                DAffine3::from_translation(origin) * DAffine3::from_scale(DVec3::splat(scale))
            }
            Layout::Circle {
                center,
                radius,
                start,
                step,
                ..
            } => {
                let angle = start + k as f64 * step;
                let way = DVec3::new(angle.cos(), angle.sin(), 0.0);
                DAffine3::from_translation(center + way * radius)
            }
        }
    }
}

/// A rectangular array (type 412): its angle turns the places, but not what stands there.
fn grid(parameters: &mut Parameters<'_>) -> Result<Layout, Problem> {
    let scale = scale(parameters, 1.0)?;
    let origin = parameters.point_or(DVec3::ZERO)?;
    let [columns, rows] = [size(parameters)?, size(parameters)?];
    let step = [parameters.real()?, parameters.real()?];
    let angle = parameters.real_or(0.0)?;
    Ok(Layout::Grid {
        first: DAffine3::from_rotation_translation(DQuat::from_rotation_z(angle), origin),
        scale,
        columns,
        rows,
        step,
    })
}

/// A circular array (type 414).
fn circle(parameters: &mut Parameters<'_>) -> Result<Layout, Problem> {
    Ok(Layout::Circle {
        count: size(parameters)?,
        center: parameters.point_or(DVec3::ZERO)?,
        radius: parameters.real()?,
        start: parameters.real_or(0.0)?,
        step: parameters.real()?,
    })
}

/// Passes over what a network subfigure has beside its members or place: its type, its name in the
/// network and how that is displayed, and its points of connection.
pub(super) fn skip_connections(parameters: &mut Parameters<'_>) {
    parameters.skip(3);
    let count = parameters.integer_or(0).unwrap_or(0);
    parameters.skip(u64::try_from(count).unwrap_or(0));
}

/// How many copies there are along a direction.
fn size(parameters: &mut Parameters<'_>) -> Result<u64, Problem> {
    match parameters.count()? {
        0 => {
            let text = "an array of no copies; there is one at least";
            Err(Problem::Invalid(text.to_owned()))
        }
        count => Ok(count),
    }
}

fn scale(parameters: &mut Parameters<'_>, default: f64) -> Result<f64, Problem> {
    let scale = parameters.real_or(default)?;
    if !scale.is_normal() {
        let text = format!("the scale is {scale}; it must not be zero");
        return Err(Problem::Invalid(text));
    }
    Ok(scale)
}

/// The places that are named, and whether these are left out; `None` if there are none.
fn listed(parameters: &mut Parameters<'_>) -> Result<Option<(HashSet<u64>, bool)>, Problem> {
    let count = parameters.integer_or(0)?;
    let are_left_out = parameters.integer_or(0)? == 1;
    if count == 0 {
        return Ok(None);
    }
    let count = parameters.expect(u64::try_from(count).unwrap_or(u64::MAX), "places")?;
    let number = |_| Ok(u64::try_from(parameters.integer()?).unwrap_or(0));
    let numbers: Result<HashSet<u64>, Problem> = (0..count).map(number).collect();
    Ok(Some((numbers?, are_left_out)))
}
