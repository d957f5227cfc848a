//! A reader of its own for free-form statements, and their bases as the format defines them.

use std::ops::Range;

use glam::{DVec2, DVec3};

/// A `surf`, `curv` or `curv2` with all that was said about it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Element {
    pub(crate) keyword: String,
    pub(crate) basis: String,
    pub(crate) is_rational: bool,
    pub(crate) degrees: Vec<usize>,
    pub(crate) matrices: [Vec<f64>; 2],
    pub(crate) steps: Vec<usize>,
    pub(crate) parms: [Vec<f64>; 2],
    pub(crate) ranges: Vec<f64>,
    /// Three coordinates and a weight.
    pub(crate) points: Vec<[f64; 4]>,
    /// `trim`, `hole` and `scrv`: keyword and words.
    pub(crate) uses: Vec<(String, Vec<f64>)>,
}

/// The elements of a text, statement by statement; good for texts without mistakes.
pub(crate) fn elements(text: &str) -> Vec<Element> {
    let text = text.replace('\r', "").replace("\\\n", " ");
    // Printed texts have a sign of continuation within the line instead of at its end.
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        let goes_on = lines.last().is_some_and(|last| last.contains('\\'));
        match lines.last_mut() {
            Some(last) if goes_on && line.starts_with(|c: char| c.is_ascii_digit()) => {
                *last = format!("{last} {line}");
            }
            _ => lines.push(line.to_owned()),
        }
    }
    let (mut state, mut found) = (Element::default(), Vec::<Element>::new());
    let (mut v, mut vp): (Vec<[f64; 4]>, Vec<[f64; 4]>) = (Vec::new(), Vec::new());
    for line in lines {
        let line = line.replace('\\', " ");
        let words: Vec<&str> = line.split_whitespace().collect();
        let Some((&keyword, rest)) = words.split_first() else {
            continue;
        };
        let numbers = |words: &[&str]| -> Vec<f64> {
            words.iter().filter_map(|word| word.parse().ok()).collect()
        };
        let counts = || rest.iter().filter_map(|word| word.parse().ok()).collect();
        let axis = usize::from(rest.first() == Some(&"v"));
        let points = |list: &[[f64; 4]], words: &[&str]| -> Vec<[f64; 4]> {
            let number = |word: &&str| word.split('/').next()?.parse::<i64>().ok();
            let place = |n: i64| match n {
                1.. => usize::try_from(n).expect("positive") - 1,
                _ => list.len() - usize::try_from(-n).expect("positive"),
            };
            words
                .iter()
                .filter_map(number)
                .map(|n| list[place(n)])
                .collect()
        };
        match keyword {
            "v" => match numbers(rest)[..] {
                [x, y, z] => v.push([x, y, z, 1.0]),
                [x, y, z, w, ..] => v.push([x, y, z, w]),
                _ => panic!("{line}"),
            },
            "vp" => match numbers(rest)[..] {
                [x] => vp.push([x, 0.0, 0.0, 1.0]),
                [x, y] => vp.push([x, y, 0.0, 1.0]),
                [x, y, w, ..] => vp.push([x, y, 0.0, w]),
                _ => panic!("{line}"),
            },
            "cstype" => {
                state.is_rational = rest[0] == "rat";
                state.basis = (*rest.last().expect("a basis")).to_owned();
            }
            "deg" => state.degrees = counts(),
            "step" => state.steps = counts(),
            "bmat" => state.matrices[axis] = numbers(&rest[1..]),
            "surf" | "curv" | "curv2" => {
                let ranges = [("surf", 4), ("curv", 2), ("curv2", 0)];
                let count = ranges
                    .iter()
                    .find(|r| r.0 == keyword)
                    .expect("one of them")
                    .1;
                let list = if keyword == "curv2" { &vp } else { &v };
                found.push(Element {
                    keyword: keyword.to_owned(),
                    ranges: numbers(&rest[..count]),
                    points: points(list, &rest[count..]),
                    ..state.clone()
                });
            }
            "parm" => found.last_mut().expect("an element").parms[axis] = numbers(&rest[1..]),
            "trim" | "hole" | "scrv" => {
                let uses = &mut found.last_mut().expect("an element").uses;
                uses.push((keyword.to_owned(), numbers(rest)));
            }
            _ => {}
        }
    }
    found
}

fn choose(n: usize, k: usize) -> f64 {
    (1..=k).map(|i| (n - k + i) as f64 / i as f64).product()
}

/// The recursion of Cox and de Boor, with 0/0 = 0; the last span holds its end.
fn bspline(knots: &[f64], i: usize, n: usize, t: f64, end: f64) -> f64 {
    if n == 0 {
        let is_last = t >= end && knots[i] < end && knots[i + 1] >= end;
        return f64::from(is_last || (knots[i] <= t && t < knots[i + 1] && t < end));
    }
    let share = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    share(t - knots[i], knots[i + n] - knots[i]) * bspline(knots, i, n - 1, t, end)
        + share(knots[i + n + 1] - t, knots[i + n + 1] - knots[i + 1])
            * bspline(knots, i + 1, n - 1, t, end)
}

impl Element {
    pub(crate) fn degree(&self, axis: usize) -> usize {
        if self.basis == "cardinal" {
            3
        } else {
            self.degrees[axis]
        }
    }

    pub(crate) fn count(&self, axis: usize) -> usize {
        let (n, values) = (self.degree(axis), self.parms[axis].len());
        match self.basis.as_str() {
            "bspline" => values - n - 1,
            "bezier" => (values - 1) * n + 1,
            "cardinal" => values + 2,
            "taylor" => (values - 1) * (n + 1),
            _ => (values - 2) * self.steps[axis] + n + 1,
        }
    }

    pub(crate) fn domain(&self, axis: usize) -> Range<f64> {
        let (parm, n) = (&self.parms[axis], self.degree(axis));
        let last = parm.len() - 1;
        match self.basis.as_str() {
            "bspline" => parm[n]..parm[last - n],
            _ => parm[0]..parm[last],
        }
    }

    /// The value of every basis function at a parameter.
    pub(crate) fn basis(&self, axis: usize, t: f64) -> Vec<f64> {
        let (n, parm, count) = (self.degree(axis), &self.parms[axis], self.count(axis));
        if self.basis == "bspline" {
            let end = self.domain(axis).end;
            return (0..count).map(|i| bspline(parm, i, n, t, end)).collect();
        }
        let segments = parm.len() - 1;
        let inner = (1..segments).filter(|&i| parm[i] <= t).count();
        let s = (t - parm[inner]) / (parm[inner + 1] - parm[inner]);
        let power = |j: usize| s.powi(i32::try_from(j).expect("small"));
        let complement = |j: usize| (1.0 - s).powi(i32::try_from(j).expect("small"));
        let (first, local): (usize, Vec<f64>) = match self.basis.as_str() {
            "bezier" => {
                let value = |k| choose(n, k) * power(k) * complement(n - k);
                (inner * n, (0..=n).map(value).collect())
            }
            "cardinal" => {
                let cubic = |c: [f64; 4]| c[0] + c[1] * s + c[2] * s * s + c[3] * s * s * s;
                let rows = [
                    [0.0, -0.5, 1.0, -0.5],
                    [1.0, 0.0, -2.5, 1.5],
                    [0.0, 0.5, 2.0, -1.5],
                    [0.0, 0.0, -0.5, 0.5],
                ];
                (inner, rows.map(cubic).to_vec())
            }
            "taylor" => (inner * (n + 1), (0..=n).map(power).collect()),
            _ => {
                let matrix = &self.matrices[axis];
                let value = |i| (0..=n).map(|j| matrix[i * (n + 1) + j] * power(j)).sum();
                (inner * self.steps[axis], (0..=n).map(value).collect())
            }
        };
        let mut all = vec![0.0; count];
        all[first..=first + n].copy_from_slice(&local);
        all
    }

    /// The sum over all points, with weights where they count.
    pub(crate) fn sum(&self, factors: impl Iterator<Item = f64>) -> DVec3 {
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for (factor, point) in factors.zip(&self.points) {
            let weight = if self.is_rational { point[3] } else { 1.0 };
            sum += DVec3::new(point[0], point[1], point[2]) * (factor * weight);
            weights += factor * weight;
        }
        if self.is_rational { sum / weights } else { sum }
    }

    pub(crate) fn curve(&self, t: f64) -> DVec3 {
        self.sum(self.basis(0, t).into_iter())
    }

    pub(crate) fn surface(&self, uv: DVec2) -> DVec3 {
        let (u, v) = (self.basis(0, uv.x), self.basis(1, uv.y));
        self.sum(v.iter().flat_map(|b| u.iter().map(move |a| a * b)))
    }

    /// Parameters all over the part of the domain that is used, and its ends.
    pub(crate) fn samples(&self, axis: usize) -> Vec<f64> {
        let domain = self.domain(axis);
        let (mut low, mut high) = (domain.start, domain.end);
        if let Some([a, b]) = self.ranges.get(2 * axis..2 * axis + 2)
            && a < b
        {
            (low, high) = (low.max(*a), high.min(*b));
        }
        (0..=24)
            .map(|k| (low + (high - low) * f64::from(k) / 24.0).min(high))
            .collect()
    }

    pub(crate) fn size(&self) -> f64 {
        let points = self.points.iter().flat_map(|p| &p[..3]);
        points.fold(0.0, |m: f64, x| m.max(x.abs()))
    }
}
