//! Materials with their maps, and where these lie on surfaces.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use kernel::{
    Channel, Filter, KnotVector, Material, MaterialId, Patch, Placement, Scene, Surface, Texture,
    WirePlacement, Wrap, srgb_from_linear,
};

use super::{legal, push_line};
use crate::write::Distinct;
use crate::{Place, Warnings};

/// The materials that something is shown with, each with a name of its own.
pub(super) fn names(
    scene: &Scene,
    placements: &[Placement],
    wires: &[WirePlacement],
) -> HashMap<MaterialId, String> {
    let mut names = HashMap::new();
    let mut distinct = Distinct::default();
    let wires = wires.iter().map(|placement| scene.wire(placement.wire));
    let shown = placements.iter().map(|placement| placement.material);
    for id in shown.chain(wires.map(|wire| wire.material)).flatten() {
        names
            .entry(id)
            .or_insert_with(|| match legal(&scene.material(id).name).as_str() {
                "" => distinct.name("material"),
                name => distinct.name(name),
            });
    }
    names
}

/// The material file.
pub(super) fn file(
    scene: &Scene,
    names: &HashMap<MaterialId, String>,
    warnings: &mut Warnings,
) -> String {
    let mut ids: Vec<_> = names.iter().collect();
    ids.sort_by_key(|(id, _)| id.index());
    let mut text = String::new();
    for (&id, name) in ids {
        let material = scene.material(id);
        // `Pr` and `Pm` take `Kd` for the base colour.
        let model = material.metallic_roughness;
        let diffuse = model.map_or(material.diffuse, |model| model.base_color);
        let (kind, diffuse, emissive) = match material.is_unlit() {
            true => (0, material.emissive, DVec3::ZERO),
            false => (2, diffuse, material.emissive),
        };
        text += &format!("newmtl {name}\nillum {kind}\n");
        let colors = [
            ("Ka", material.ambient),
            ("Kd", diffuse),
            ("Ks", material.specular),
            ("Ke", emissive),
        ];
        for (keyword, color) in colors {
            push_line(&mut text, keyword, srgb_from_linear(color).to_array());
        }
        push_line(&mut text, "Ns", [material.shininess]);
        push_line(&mut text, "d", [material.opacity]);
        if let Some(model) = model {
            push_line(&mut text, "Pr", [model.roughness]);
            push_line(&mut text, "Pm", [model.metallic]);
        }
        push_maps(&mut text, material, [diffuse, emissive], warnings);
        if material.back.is_some() {
            lost(material, "another look from behind", warnings);
        }
    }
    text
}

/// Notes what the format cannot hold of a material.
fn lost(material: &Material, what: &str, warnings: &mut Warnings) {
    let place = Place::item(0, format!("material \"{}\"", material.name));
    let text = format!("{what}: there is no such thing in the format; left out");
    warnings.unsupported(place, text);
}

/// Appends the pictures of a material with these colours. One that multiplies black does nothing,
/// and beside black would be taken for all of the colour.
fn push_maps(
    text: &mut String,
    material: &Material,
    [diffuse, emitted]: [DVec3; 2],
    warnings: &mut Warnings,
) {
    let maps = &material.maps;
    let (color, emissive) = match material.is_unlit() {
        true => (maps.emissive.as_ref(), None),
        false => (maps.color.as_ref(), maps.emissive.as_ref()),
    };
    if color.is_some() && diffuse == DVec3::ZERO && material.ambient != DVec3::ZERO {
        lost(material, "a picture of ambient light alone", warnings);
    }
    let color = color.filter(|_| diffuse != DVec3::ZERO);
    let emissive = emissive.filter(|_| emitted != DVec3::ZERO);
    let colors = [
        ("map_Kd", color),
        ("map_Ks", maps.specular.as_ref()),
        ("map_Ke", emissive),
    ];
    let shares = [
        ("map_d", &maps.opacity),
        ("map_Pr", &maps.roughness),
        ("map_Pm", &maps.metallic),
    ];
    let colors = colors.map(|(keyword, map)| (keyword, map, None));
    let shares = shares.map(|(keyword, map)| {
        let channel = map.as_ref().map(|map| match map.channel {
            Channel::Red => "r",
            Channel::Green => "g",
            Channel::Blue => "b",
            Channel::Alpha => "m",
            Channel::Mean => "l",
        });
        (keyword, map.as_ref().map(|map| &map.texture), channel)
    });
    for (keyword, texture, channel) in colors.into_iter().chain(shares) {
        let Some(texture) = texture else { continue };
        match options(texture, channel) {
            Ok(options) => {
                *text += &format!("{keyword}{options} {}\n", texture.image.name());
                let place = Place::item(0, format!("picture \"{}\"", texture.image.name()));
                let told = "pictures are named and not copied; put the file beside what is written";
                warnings.unsupported(place, told);
            }
            Err(what) => lost(material, what, warnings),
        }
    }
}

/// The options of a map, or what of it the format does not know.
fn options(texture: &Texture, channel: Option<&str>) -> Result<String, &'static str> {
    let map = texture.picture_from_shape;
    if texture.image.name().is_empty() {
        return Err("a picture without a file of its own");
    }
    let [a, b, c, d] = map.matrix2.to_cols_array();
    if b.abs().max(c.abs()) > 1e-12 * a.abs().max(d.abs()) {
        return Err("a picture that is turned");
    }
    let mut text = String::new();
    let scale = DVec2::new(a, d);
    for (option, value, usual) in [
        (" -s", scale, DVec2::ONE),
        (" -o", map.translation, DVec2::ZERO),
    ] {
        if value != usual {
            text += &format!("{option} {:?} {:?} 0", value.x, value.y);
        }
    }
    match texture.wrap {
        [Wrap::Repeat, Wrap::Repeat] => {}
        [Wrap::Clamp, Wrap::Clamp] => text += " -clamp on",
        _ => return Err("a picture that goes on mirrored, or along one axis only"),
    }
    if texture.filter == Filter::Nearest {
        text += " -blendu off -blendv off";
    }
    if let Some(channel) = channel {
        text += &format!(" -imfchan {channel}");
    }
    Ok(text)
}

/// Where pictures lie on a patch, as texture vertices for its control points, rows of v inside
/// rows of u; `Ok(None)` if they lie where its parameters are, or there are none.
pub(super) fn coordinates(
    patch: &Patch,
    is_textured: bool,
) -> Result<Option<Vec<DVec2>>, &'static str> {
    let surface = &patch.surface;
    let [u, v] = [surface.knots_u().domain(), surface.knots_v().domain()];
    let mut texture = match &patch.texture {
        Some(texture) => Surface::clone(texture),
        None if is_textured => {
            let corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]];
            let corners = corners.map(|[x, y]| DVec3::new(x, y, 0.0));
            let knots = |range| KnotVector::bezier(1, range);
            let whole = knots(u.clone()).and_then(|u| Ok((u, knots(v.clone())?)));
            let whole = whole.and_then(|(u, v)| Surface::new(u, v, &corners, None));
            whole.map_err(|_| "texture coordinates over this domain")?
        }
        None => return Ok(None),
    };
    let ends = [
        [u.start, v.start],
        [u.start, v.end],
        [u.end, v.start],
        [u.end, v.end],
    ];
    let is_own = |at: [f64; 2]| texture.evaluate(at.into()).truncate() == DVec2::from(at);
    let degrees = [texture.knots_u(), texture.knots_v()].map(KnotVector::degree);
    if degrees == [1, 1] && texture.points().count() == 4 && ends.into_iter().all(is_own) {
        return Ok(None);
    }
    let other = "texture coordinates over other knots than those of their surface";
    for axis in 0..2 {
        let knots = [surface.knots_u(), surface.knots_v()][axis];
        texture = over(&texture, axis, knots).ok_or(other)?;
    }
    if texture.is_rational() {
        return Err("texture coordinates with weights");
    }
    Ok(Some(texture.points().map(|p| p.truncate()).collect()))
}

/// The same surface over these knots along u (0) or v (1), if they can hold it.
fn over(texture: &Surface, axis: usize, knots: &KnotVector) -> Option<Surface> {
    let along = |texture: &Surface| match axis {
        0 => texture.knots_u().clone(),
        _ => texture.knots_v().clone(),
    };
    let mut texture = match axis {
        0 => texture.elevated_u(knots.degree()).ok()?,
        _ => texture.elevated_v(knots.degree()).ok()?,
    };
    let domain = knots.domain();
    let inner = |t: &f64| domain.start < *t && *t < domain.end;
    for knot in knots.breaks().into_iter().filter(inner) {
        let wanted = knots.multiplicity(knot);
        if wanted > along(&texture).multiplicity(knot) {
            texture = match axis {
                0 => texture.with_knot_u(knot, wanted).ok()?,
                _ => texture.with_knot_v(knot, wanted).ok()?,
            };
        }
    }
    (along(&texture) == *knots).then_some(texture)
}
