//! The global section: delimiters, unit and scale.

use kernel::Unit;

use super::parameters::{Delimiters, Parameters};
use crate::Problem;

/// What the global section says, as far as it is used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Global {
    /// How records are written.
    pub delimiters: Delimiters,
    /// Length in the model space of this file for one of the real thing.
    pub scale: f64,
    /// The unit of length.
    pub unit: Option<Unit>,
    /// Points no farther apart are meant to be one; zero if nothing is said.
    pub resolution: f64,
}

/// The flags of units with their names, of which the first is the usual one.
const UNITS: [(i64, &[&str]); 10] = [
    (1, &["in", "inch", "inches"]),
    (2, &["mm", "millimeter", "millimetre"]),
    (4, &["ft", "foot", "feet"]),
    (5, &["mi", "mile"]),
    (6, &["m", "meter", "metre"]),
    (7, &["km", "kilometer", "kilometre"]),
    (8, &["mil"]),
    (9, &["um", "micron", "micrometer", "micrometre"]),
    (10, &["cm", "centimeter", "centimetre"]),
    (11, &["uin", "microinch", "microinches"]),
];

/// Reads the global section; what is odd goes to `problems`.
pub(super) fn read(section: &[u8], problems: &mut Vec<Problem>) -> Global {
    let (delimiters, rest) = delimiters(section, problems);
    let mut global = Global {
        delimiters,
        scale: 1.0,
        unit: None,
        resolution: 0.0,
    };
    let mut parameters = Parameters::new(rest, delimiters, 3);
    if let Err(problem) = fill(&mut global, &mut parameters, problems) {
        problems.push(problem);
    }
    global
}

/// Reads parameters 3 and following.
fn fill(
    global: &mut Global,
    parameters: &mut Parameters<'_>,
    problems: &mut Vec<Problem>,
) -> Result<(), Problem> {
    for _ in 3..13 {
        parameters.text();
    }
    let scale = parameters.real_or(1.0)?;
    let flag = parameters.integer_or(1);
    let name = parameters.text();
    global.unit = unit(flag?, &name);
    for _ in 16..19 {
        parameters.text();
    }
    global.resolution = parameters.real_or(0.0).unwrap_or_default().max(0.0);
    if global.unit.is_none() {
        problems.push(Problem::Invalid(format!(
            "the unit of length \"{name}\" is not known"
        )));
    }
    if scale > 0.0 {
        global.scale = scale;
    } else {
        problems.push(Problem::Invalid(format!(
            "the model space scale is {scale}; it must be positive, 1 is used"
        )));
    }
    Ok(())
}

/// The flag and name of a unit with this length in metres.
pub(super) fn flag(metres: f64) -> Option<(usize, &'static str)> {
    let unit = Unit::of_length(metres);
    let (flag, names) = UNITS.iter().find(|(_, names)| names[0] == unit.name)?;
    Some((usize::try_from(*flag).ok()?, names[0]))
}

/// The unit of a flag; flags without a meaning of their own leave it to the name, which may be a
/// plural.
fn unit(flag: i64, name: &str) -> Option<Unit> {
    let lower = name.to_lowercase();
    let one = lower.strip_suffix('s').unwrap_or(&lower);
    let by_flag = UNITS.iter().find(|(known, ..)| *known == flag);
    let (_, names) = by_flag.or_else(|| {
        let is_named = |names: &[&str]| names.contains(&lower.as_str()) || names.contains(&one);
        UNITS.iter().find(|(_, names)| is_named(names))
    })?;
    Unit::named(names[0])
}

/// The delimiters, and what follows their declaration.
///
/// The legal beginnings are `1H,,1H;,` with any two characters, and the same with either
/// declaration left out.
fn delimiters<'a>(section: &'a [u8], problems: &mut Vec<Problem>) -> (Delimiters, &'a [u8]) {
    let mut found = Delimiters::default();
    let start = section.trim_ascii_start();
    let (declared, rest) = declaration(start);
    found.parameter = declared.unwrap_or(found.parameter);
    let rest = rest.strip_prefix(&[found.parameter]);
    let second = rest.map(|rest| declaration(rest.trim_ascii_start()));
    found.record = second
        .and_then(|(declared, _)| declared)
        .unwrap_or(found.record);
    let usable = |c: u8| c.is_ascii_graphic() && !b"+-.DEHdeh0123456789".contains(&c);
    let sound = usable(found.parameter) && usable(found.record) && found.parameter != found.record;
    match second.filter(|_| sound).map(|(_, rest)| rest) {
        Some([c, rest @ ..]) if *c == found.parameter => (found, rest),
        Some([c, ..]) if *c == found.record => (found, b""),
        _ => {
            let text = "the delimiters are not declared as in 1H,,1H;, and are taken to be these";
            problems.push(Problem::Invalid(text.to_owned()));
            (Delimiters::default(), b"")
        }
    }
}

/// A character declared as `1Hx`, and what follows.
fn declaration(text: &[u8]) -> (Option<u8>, &[u8]) {
    match text {
        [b'1', b'H' | b'h', c, rest @ ..] => (Some(*c), rest),
        _ => (None, text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn global(text: &str) -> (Global, Vec<String>) {
        let mut problems = Vec::new();
        let global = read(text.as_bytes(), &mut problems);
        (global, problems.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn all_beginnings_are_understood() {
        let tail = "1Ha,1Hb,1Hc,1Hd,32,38,6,308,15,1He,2.,2,2HMM,1,0.1,,0.25;";
        for (head, [parameter, record]) in [
            ("1H,,1H;,", [b',', b';']),
            (",1H/,", [b',', b'/']),
            ("1H|||", [b'|', b';']),
            (",,", [b',', b';']),
        ] {
            let separator = char::from(parameter).to_string();
            let tail = tail.replace(',', &separator);
            let tail = tail.replace(';', &char::from(record).to_string());
            let (global, problems) = global(&format!("{head}{tail}"));
            assert_eq!(problems, [""; 0], "{head}");
            assert_eq!(global.delimiters, Delimiters { parameter, record });
            assert_eq!(global.scale.to_bits(), 2.0_f64.to_bits(), "{head}");
            let unit = global.unit.unwrap();
            assert_eq!((unit.name.as_str(), unit.metres), ("mm", 1e-3));
            assert_eq!(global.resolution.to_bits(), 0.25_f64.to_bits(), "{head}");
        }
    }

    #[test]
    fn units_by_flag_and_by_name() {
        let name = |flag, name| unit(flag, name).map(|unit| unit.name);
        assert_eq!(name(2, "INCH"), Some("mm".to_owned()));
        assert_eq!(name(3, "CM"), Some("cm".to_owned()));
        assert_eq!(name(0, "INCH"), Some("in".to_owned()));
        for (full, short) in [
            ("MILLIMETERS", "mm"),
            ("METER", "m"),
            ("FEET", "ft"),
            ("INCHES", "in"),
            ("Micrometres", "um"),
        ] {
            assert_eq!(name(3, full), Some(short.to_owned()));
            assert_eq!(name(0, full), Some(short.to_owned()));
        }
        assert_eq!(name(3, "furlong"), None);
        // Nothing said means inches.
        assert_eq!(global(",,;").0.unit.unwrap().name, "in");
    }

    #[test]
    fn odd_sections_are_told() {
        assert_eq!(global("").1.len(), 1);
        assert_eq!(global("garbage").1.len(), 1);
        let (zero, problems) = global(",,,,,,,,,,,,0.;");
        assert_eq!(zero.scale.to_bits(), 1.0_f64.to_bits());
        assert_eq!(problems.len(), 1);
    }
}
