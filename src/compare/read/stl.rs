//! STL, binary and text: triangles without anything else.

use formats::{Error, Limits, Problem, Warnings};
use glam::{DVec3, Vec3};
use kernel::Mesh;

use super::{MeshFile, error, of_one};

const NAME: &str = "STL";

/// Bytes before the first triangle of a binary file, and of one triangle.
const HEAD: usize = 84;
const TRIANGLE: usize = 50;

/// Reads a file.
pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<MeshFile, Error> {
    let count = bytes.get(80..HEAD).and_then(|b| b.try_into().ok());
    let count = count.map(|b: [u8; 4]| u32::from_le_bytes(b) as usize);
    let expected = count.and_then(|count| count.checked_mul(TRIANGLE)?.checked_add(HEAD));
    let mut warnings = Warnings::default();
    let is_text = bytes.trim_ascii_start().starts_with(b"solid");
    // Binary files may begin with the word, too; but then their length fits.
    let corners = if is_text && expected != Some(bytes.len()) {
        text(bytes)?
    } else {
        let Some(expected) = expected else {
            let text = format!("{} bytes; a binary file has at least {HEAD}", bytes.len());
            return Err(error(NAME, "", Problem::Invalid(text)));
        };
        if expected > bytes.len() {
            let there = (bytes.len() - HEAD) / TRIANGLE;
            let count = count.unwrap_or_default();
            let text = format!("{count} triangles are announced, there are {there}");
            return Err(error(NAME, "bytes 80 to 84", Problem::Invalid(text)));
        }
        if expected < bytes.len() {
            let place = formats::Place::item(0, "after the last triangle");
            warnings.invalid(place, format!("{} bytes more", bytes.len() - expected));
        }
        binary(&bytes[HEAD..expected])
    };
    if corners.len() > limits.points {
        let text = format!("{} corners; the limit is {}", corners.len(), limits.points);
        return Err(error(NAME, "", Problem::TooLarge(text)));
    }
    let triangles: Vec<[u32; 3]> = (0..u32::try_from(corners.len() / 3).unwrap_or(u32::MAX / 3))
        .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
        .collect();
    let mesh = Mesh::new(corners, Vec::new(), Vec::new(), triangles);
    of_one(NAME, mesh, bytes, warnings)
}

/// The corners of binary triangles, each of which begins with its normal.
fn binary(bytes: &[u8]) -> Vec<DVec3> {
    let numbers = |b: &[u8]| -> DVec3 {
        let at = |k: usize| f32::from_le_bytes([b[k], b[k + 1], b[k + 2], b[k + 3]]);
        Vec3::new(at(0), at(4), at(8)).as_dvec3()
    };
    let corners = |triangle: &[u8]| [12, 24, 36].map(|k| numbers(&triangle[k..k + 12]));
    bytes.chunks_exact(TRIANGLE).flat_map(corners).collect()
}

/// The corners of a text: three numbers after every word `vertex`.
fn text(bytes: &[u8]) -> Result<Vec<DVec3>, Error> {
    let text = String::from_utf8_lossy(bytes);
    let mut corners = Vec::new();
    for (line, number) in text.lines().zip(1..) {
        let mut words = line.split_whitespace();
        if words.next() != Some("vertex") {
            continue;
        }
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        let &[x, y, z] = &numbers[..] else {
            let text = format!("'{}' is not a vertex with three numbers", line.trim());
            let place = formats::Place::line(number);
            let problem = Problem::Invalid(text);
            return Err(Error {
                format: NAME,
                place,
                problem,
            });
        };
        corners.push(DVec3::new(x, y, z));
    }
    if !corners.len().is_multiple_of(3) {
        let text = format!("{} vertices are no triangles", corners.len());
        return Err(error(NAME, "", Problem::Invalid(text)));
    }
    Ok(corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(bytes: &[u8]) -> Result<usize, String> {
        let read = read(bytes, &Limits::default()).map_err(|e| e.to_string())?;
        Ok(read.scene.meshes()[0].triangles().len())
    }

    #[test]
    fn both_kinds_are_told_apart() {
        let mut bytes = b"solid but binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(2_u32.to_le_bytes());
        bytes.extend([0; 100]);
        assert_eq!(triangles(&bytes), Ok(2));
        let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n vertex 0 1e0 0\n";
        let text = format!("solid x\n{facet}endloop\nendfacet\nendsolid x\n");
        assert_eq!(triangles(text.as_bytes()), Ok(1));
        assert_eq!(triangles(b"solid nothing\nendsolid\n"), Ok(0));
    }

    #[test]
    fn what_is_missing_is_told() {
        let mut bytes = vec![0; 80];
        bytes.extend(u32::MAX.to_le_bytes());
        assert!(
            triangles(&bytes)
                .unwrap_err()
                .contains("4294967295 triangles are announced")
        );
        assert!(triangles(b"abc").unwrap_err().contains("at least 84"));
        let text = "solid x\nvertex 0 0\n";
        assert!(triangles(text.as_bytes()).unwrap_err().contains("line 2"));
        let text = "solid x\nvertex 0 0 0\n";
        assert!(
            triangles(text.as_bytes())
                .unwrap_err()
                .contains("1 vertices")
        );
        assert!(triangles(b"solid x\nvertex 0 0 nan\n").is_err());
    }
}
