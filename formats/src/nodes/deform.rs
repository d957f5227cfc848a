//! `CoordinateDeformer` of VRML 97: points carried through a rational B-spline volume.

use glam::{DAffine3, DVec3, DVec4};
use kernel::Error as GeometryError;

use super::build::Builder;
use super::knots::{Direction, Knots, weights};
use super::proto::COPIES;
use super::scene::transform;
use super::{Field, Node};
use crate::Problem;

/// A volume: knots along u, v and w, and homogeneous control points, u fastest.
struct Volume {
    knots: [Knots; 3],
    counts: [usize; 3],
    points: Vec<DVec4>,
}

impl Volume {
    /// The point at the parameters of `place`.
    fn at(&self, place: DVec3) -> DVec3 {
        let axis = |k: usize| self.knots[k].knots.basis_functions(place[k]);
        let [(u0, u), (v0, v), (w0, w)] = [axis(0), axis(1), axis(2)];
        let mut sum = DVec4::ZERO;
        for (k, c) in w.iter().enumerate() {
            for (j, b) in v.iter().enumerate() {
                let row = ((w0 + k) * self.counts[1] + v0 + j) * self.counts[0] + u0;
                for (i, a) in u.iter().enumerate() {
                    sum += self.points[row + i] * (a * b * c);
                }
            }
        }
        sum.truncate() / sum.w
    }
}

impl Builder<'_> {
    /// Gives each `Coordinate` in `outputCoord` the points of its fellow in `inputCoord`, moved
    /// by the transform there and carried through the volume: what stands before are its
    /// parameters.
    pub(super) fn deform(&mut self, node: &Node) {
        let inside = |field: &str| -> Vec<usize> {
            let links = node.children.iter();
            let links = links.filter(|link| link.field.as_deref() == Some(field));
            links.map(|link| link.node).collect()
        };
        let [inputs, outputs] = ["inputCoord", "outputCoord"].map(inside);
        let transforms = inside("inputTransform");
        if inputs.is_empty() {
            return;
        }
        let volume = match self.volume(node) {
            Ok(volume) => volume,
            Err(problem) => {
                self.warnings.add(node.place(), problem);
                return;
            }
        };
        for (at, (input, output)) in inputs.into_iter().zip(outputs).enumerate() {
            let map = transforms.get(at).or(transforms.last());
            let map = map.map_or(DAffine3::IDENTITY, |&map| {
                transform(&self.tree.nodes[map], &mut self.warnings)
            });
            let points = self.tree.nodes[input].points_3d("point", &mut self.warnings);
            self.copies = self.copies.saturating_add(points.len());
            if self.copies > self.options.limits.entities / COPIES {
                let text = "too many points to deform; the others stay where they are";
                self.warnings
                    .add(node.place(), Problem::TooLarge(text.to_owned()));
                return;
            }
            let moved = points.iter().map(|&p| volume.at(map.transform_point3(p)));
            let text: Vec<String> = moved
                .map(|p| format!("{:e} {:e} {:e}", p.x, p.y, p.z))
                .collect();
            let (name, value) = ("point".into(), text.join(" ").into());
            // Whatever stood there, once; a field for each of many USEs would fill the memory.
            self.tree.nodes[output].fields = vec![Field { name, value }];
        }
    }

    fn volume(&mut self, node: &Node) -> Result<Volume, GeometryError> {
        let warnings = &mut self.warnings;
        let points = node.points_3d("controlPoint", warnings);
        let counts = ["uDimension", "vDimension", "wDimension"].map(|f| node.count(f, 0, warnings));
        let expected = counts.iter().fold(1_usize, |n, &c| n.saturating_mul(c));
        if expected != points.len() {
            let found = points.len();
            return Err(GeometryError::PointCount { found, expected });
        }
        let weights = weights(node, points.len(), warnings);
        let mut knots =
            |k: usize| Knots::of(node, &Direction::VOLUME[k], counts[k], false, warnings);
        let knots = [knots(0)?, knots(1)?, knots(2)?];
        let weight = |i: usize| weights.as_ref().map_or(1.0, |weights| weights[i]);
        // The points are multiplied by their weights in the file.
        let points = points
            .iter()
            .enumerate()
            .map(|(i, p)| p.extend(weight(i)))
            .collect();
        Ok(Volume {
            knots,
            counts,
            points,
        })
    }
}
