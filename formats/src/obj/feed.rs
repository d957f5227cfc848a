//! The text that `tobj` reads: vertices, and the faces of one mesh after those of another.

use std::fmt::Write as _;
use std::io::{self, BufRead, Read};
use std::ops::Range;

use super::Lists;
use super::polygons::{Corner, Face, NONE};
use super::statements::Statement;

/// A list of [`Lists`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Position,
    Texcoord,
    Normal,
}

/// Statements of vertices, in the order of the file.
#[derive(Clone, Debug)]
enum Piece {
    /// As they stand there.
    Text(Range<usize>),
    /// One that is written anew.
    Entry(Kind, usize),
}

/// All statements of vertices.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices(Vec<Piece>);

impl Vertices {
    /// Takes the `v`, `vt` or `vn` that was added to a list last, with `count` numbers, or with 0
    /// if they could not be read.
    pub(super) fn add(&mut self, statement: &Statement<'_>, lists: &Lists, count: usize) {
        let (kind, entries, is_plain) = match statement.keyword() {
            "v" => (Kind::Position, lists.positions.len(), count == 3),
            "vt" => (Kind::Texcoord, lists.texcoords.len(), count >= 2),
            "vn" => (Kind::Normal, lists.normals.len(), count >= 3),
            _ => return,
        };
        match (statement.plain().filter(|_| is_plain), self.0.last_mut()) {
            (Some(next), Some(Piece::Text(last))) if last.end == next.start => last.end = next.end,
            (Some(next), _) => self.0.push(Piece::Text(next)),
            (None, _) => self.0.push(Piece::Entry(kind, entries - 1)),
        }
    }

    /// The same, all written anew.
    fn written(lists: &Lists) -> Self {
        let counts = [
            (Kind::Position, lists.positions.len()),
            (Kind::Texcoord, lists.texcoords.len()),
            (Kind::Normal, lists.normals.len()),
        ];
        let entries = |(kind, count)| (0..count).map(move |at| Piece::Entry(kind, at));
        Self(counts.into_iter().flat_map(entries).collect())
    }
}

/// The text, made as it is read.
pub(super) struct Feed<'f> {
    source: &'f str,
    vertices: Vertices,
    lists: &'f Lists,
    faces: &'f [Face],
    corners: &'f [Corner],
    /// How many pieces and faces are done.
    done: [usize; 2],
    /// What is to be read next: first what is written anew, then what stands in the file.
    written: String,
    read: usize,
    plain: Range<usize>,
}

impl<'f> Feed<'f> {
    /// The text of these faces, of which those of one mesh stand together. `normals` of the lists
    /// are the file's own; more may follow them.
    pub(super) fn new(
        source: &'f str,
        vertices: Vertices,
        lists: &'f Lists,
        normals: usize,
        faces: &'f [Face],
        corners: &'f [Corner],
    ) -> Self {
        let mut vertices = vertices;
        if lists.colors.is_empty() {
            let added = normals..lists.normals.len();
            vertices
                .0
                .extend(added.map(|at| Piece::Entry(Kind::Normal, at)));
        } else {
            vertices = Vertices::written(lists);
        }
        Self {
            source,
            vertices,
            lists,
            faces,
            corners,
            done: [0; 2],
            written: String::new(),
            read: 0,
            plain: 0..0,
        }
    }

    /// Makes the next part ready; there is none if it is empty.
    fn advance(&mut self) {
        let [piece, face] = self.done;
        match self.vertices.0.get(piece) {
            Some(Piece::Text(range)) => {
                self.plain = range.clone();
                self.done[0] += 1;
            }
            Some(&Piece::Entry(kind, at)) => {
                self.entry(kind, at);
                self.done[0] += 1;
            }
            None => {
                let rest = &self.faces[face..];
                let Some(first) = rest.first() else { return };
                if face == 0 || !first.is_beside(&self.faces[face - 1]) {
                    self.written.push_str("o\n");
                }
                self.done[1] += self.add_faces(rest);
            }
        }
    }

    /// Makes the first of these faces ready, with those that follow it in the file; the result
    /// is their number.
    fn add_faces(&mut self, faces: &'f [Face]) -> usize {
        let Some(mut range) = faces[0].text() else {
            // A line is the same to `tobj`.
            self.written.push('f');
            let corners = faces[0].corners(self.corners).iter();
            corners.for_each(|corner| put_corner(&mut self.written, corner));
            self.written.push('\n');
            return 1;
        };
        let mut count = 1;
        for next in faces[1..]
            .iter()
            .take_while(|next| next.is_beside(&faces[0]))
        {
            match next.text() {
                Some(text) if text.start == range.end => range.end = text.end,
                _ => break,
            }
            count += 1;
        }
        self.plain = range;
        count
    }

    /// Writes an entry of a list; nobody refers to those that could not be read.
    fn entry(&mut self, kind: Kind, at: usize) {
        let lists = self.lists;
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        let text = &mut self.written;
        match kind {
            Kind::Position => {
                let [x, y, z] = lists.positions[at].truncate().to_array().map(finite);
                put(text, format_args!("v {x} {y} {z}"));
                if !lists.colors.is_empty() {
                    let color = lists.colors.get(at).copied().unwrap_or(Lists::NO_COLOR);
                    put(text, format_args!(" {} {} {}", color.x, color.y, color.z));
                }
            }
            Kind::Texcoord => {
                let [u, v] = lists.texcoords[at].to_array().map(finite);
                put(text, format_args!("vt {u} {v}"));
            }
            Kind::Normal => {
                let [x, y, z] = lists.normals[at].to_array().map(finite);
                put(text, format_args!("vn {x} {y} {z}"));
            }
        }
        text.push('\n');
    }
}

fn put(text: &mut String, words: std::fmt::Arguments<'_>) {
    // Writing into a string cannot fail.
    let _ = text.write_fmt(words);
}

fn put_corner(text: &mut String, corner: &Corner) {
    let number = |position: u32| u64::from(position) + 1;
    put(text, format_args!(" {}", number(corner.vertex)));
    match (corner.texcoord, corner.normal) {
        (NONE, NONE) => {}
        (NONE, n) => put(text, format_args!("//{}", number(n))),
        (t, NONE) => put(text, format_args!("/{}", number(t))),
        (t, n) => put(text, format_args!("/{}/{}", number(t), number(n))),
    }
}

impl BufRead for Feed<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.read == self.written.len() && self.plain.is_empty() {
            self.written.clear();
            self.read = 0;
            self.advance();
        }
        Ok(if self.read < self.written.len() {
            &self.written.as_bytes()[self.read..]
        } else {
            &self.source.as_bytes()[self.plain.clone()]
        })
    }

    fn consume(&mut self, amount: usize) {
        if self.read < self.written.len() {
            self.read += amount;
        } else {
            self.plain.start += amount;
        }
    }
}

impl Read for Feed<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let amount = self.fill_buf()?.read(into)?;
        self.consume(amount);
        Ok(amount)
    }
}
