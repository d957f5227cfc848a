//! Curves over logarithmic axes, as SVG.

use std::fmt::Write as _;

/// A curve: its name, its colour and its points.
pub(super) struct Series<'a> {
    pub(super) name: &'a str,
    pub(super) color: &'a str,
    pub(super) points: Vec<[f64; 2]>,
}

/// Size of a plot, and of the frame inside it.
const SIZE: [f64; 2] = [460.0, 300.0];
const LEFT: f64 = 58.0;
const TOP: f64 = 30.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 44.0;

/// The powers of ten between which the values of both axes lie.
struct Axes([(f64, f64); 2]);

impl Axes {
    fn around(points: &[&[f64; 2]]) -> Self {
        let range = |axis: usize| {
            let logs = points.iter().map(|p| p[axis].log10());
            let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
            (low.floor(), high.ceil().max(low.floor() + 1.0))
        };
        Self([range(0), range(1)])
    }

    fn place(&self, p: &[f64; 2]) -> (f64, f64) {
        let share = |axis: usize| {
            let (low, high) = self.0[axis];
            (p[axis].log10() - low) / (high - low)
        };
        let x = LEFT + share(0) * (SIZE[0] - LEFT - RIGHT);
        (x, SIZE[1] - BOTTOM - share(1) * (SIZE[1] - TOP - BOTTOM))
    }

    /// Lines at the powers of ten, with their values.
    fn draw(&self, svg: &mut String) {
        let (bottom, right) = (SIZE[1] - BOTTOM, SIZE[0] - RIGHT);
        for axis in 0..2 {
            let (mut power, high) = self.0[axis];
            while power <= high {
                let mut at = self.0.map(|(low, _)| 10.0_f64.powf(low));
                at[axis] = 10.0_f64.powf(power);
                let (x, y) = self.place(&at);
                let (line, place) = if axis == 0 {
                    let place = format!(
                        "x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\"",
                        bottom + 16.0
                    );
                    (format!("M{x:.1} {TOP}V{bottom}"), place)
                } else {
                    let place = format!(
                        "x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\"",
                        LEFT - 6.0,
                        y + 4.0
                    );
                    (format!("M{LEFT} {y:.1}H{right}"), place)
                };
                // Writing into a string cannot fail.
                let _ = write!(
                    svg,
                    "<path class=\"grid\" d=\"{line}\"/><text {place}>1e{power}</text>"
                );
                power += 1.0;
            }
        }
    }
}

/// A plot of what is positive; empty if there is no curve with two points.
pub(super) fn plot(title: &str, along: &str, series: &[Series<'_>]) -> String {
    let is_seen = |p: &&[f64; 2]| p.iter().all(|v| *v > 0.0 && v.is_finite());
    let seen = |s: &Series<'_>| s.points.iter().filter(is_seen).count();
    if series.iter().all(|s| seen(s) < 2) {
        return String::new();
    }
    let seen = series.iter().flat_map(|s| s.points.iter().filter(is_seen));
    let axes = Axes::around(&seen.collect::<Vec<_>>());
    let mut svg = format!(
        "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{title}\"><text class=\"title\" \
         x=\"{LEFT}\" y=\"18\">{title}</text>",
        SIZE[0], SIZE[1]
    );
    axes.draw(&mut svg);
    let middle = 0.5 * (LEFT + SIZE[0] - RIGHT);
    let below = SIZE[1] - 8.0;
    // Writing into a string cannot fail.
    let _ = write!(
        svg,
        "<text x=\"{middle:.1}\" y=\"{below:.1}\" text-anchor=\"middle\">{along}</text>"
    );
    for (
        k,
        Series {
            name,
            color,
            points,
        },
    ) in series.iter().enumerate()
    {
        let places: Vec<_> = points
            .iter()
            .filter(is_seen)
            .map(|p| axes.place(p))
            .collect();
        let path: Vec<String> = places
            .iter()
            .map(|(x, y)| format!("{x:.1},{y:.1}"))
            .collect();
        let _ = write!(
            svg,
            "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" points=\"{}\"/>",
            path.join(" ")
        );
        for (x, y) in places {
            let _ = write!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{color}\"/>"
            );
        }
        let (x, y) = (SIZE[0] - RIGHT - 6.0, TOP + 14.0 + 15.0 * k as f64);
        let _ = write!(
            svg,
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"end\" style=\"fill:{color}\">{name}</text>"
        );
    }
    svg + "</svg>"
}
