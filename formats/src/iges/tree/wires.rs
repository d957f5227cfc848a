//! Curves and points that stand for themselves.

use kernel::{Node, Wire, WireShape};

use super::Tree;
use crate::Problem;
use crate::iges::entities::{Content, Entity};
use crate::iges::trims;

impl Tree<'_, '_> {
    /// Adds the curve or the points of an entity to a node.
    pub(super) fn wire(
        &mut self,
        index: usize,
        entity: &Entity,
        color: i64,
        node: &mut Node,
    ) -> Result<(), Problem> {
        let shapes = match &entity.content {
            Content::Points(points) => vec![WireShape::Points(points.clone())],
            _ => {
                let is_on_surface = self.file.entries[index].kind == 142;
                let (curves, repairs) = self.reading(|reader, _| {
                    if is_on_surface {
                        return trims::on_surface(reader, index);
                    }
                    let rails = reader.rails(index)?.into_iter();
                    Ok(rails.map(|rail| rail.curve).collect())
                });
                self.repairs(repairs);
                let curves = curves?;
                if is_on_surface {
                    self.spend(curves.iter().map(|c| c.homogeneous().len()).sum())?;
                }
                curves.into_iter().map(WireShape::Curve).collect()
            }
        };
        let material = self.material(index, color);
        for shape in shapes {
            let wire = Wire {
                name: node.name.clone(),
                source: self.file.source(index),
                shape,
                material,
            };
            node.wires
                .push(self.scene.add_wire(wire).map_err(Problem::Geometry)?);
        }
        Ok(())
    }
}
