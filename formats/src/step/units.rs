//! Units of length and angle, and how exact points are.

use super::products::of_representation;
use super::translator::Translator;
use super::values::{Attributes, Record, Value};
use crate::Problem;

/// What the prefixes of units are worth.
const PREFIXES: [(&[u8], f64); 16] = [
    (b"EXA", 1e18),
    (b"PETA", 1e15),
    (b"TERA", 1e12),
    (b"GIGA", 1e9),
    (b"MEGA", 1e6),
    (b"KILO", 1e3),
    (b"HECTO", 1e2),
    (b"DECA", 1e1),
    (b"DECI", 1e-1),
    (b"CENTI", 1e-2),
    (b"MILLI", 1e-3),
    (b"MICRO", 1e-6),
    (b"NANO", 1e-9),
    (b"PICO", 1e-12),
    (b"FEMTO", 1e-15),
    (b"ATTO", 1e-18),
];

/// How deep units may be made of others.
const NESTING: usize = 8;

/// The units of a representation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Units {
    pub metres: f64,
    pub radians: f64,
    /// Points no farther apart are meant to be one, in its own length; zero if nothing is said.
    pub uncertainty: f64,
}

impl Default for Units {
    /// Millimetres and radians.
    fn default() -> Self {
        Self {
            metres: 1e-3,
            radians: 1.0,
            uncertainty: 0.0,
        }
    }
}

impl Translator<'_> {
    /// The units of a representation; the usual ones where it says nothing.
    pub(super) fn units_of(&mut self, rep: u64) -> Units {
        if let Some(known) = self.units_known.get(&rep) {
            return *known;
        }
        let mut units = Units::default();
        // What is not readable leaves the usual.
        if let Err(problem) = self.read_units(rep, &mut units) {
            self.note(rep, problem);
        }
        self.units_known.insert(rep, units);
        units
    }

    fn read_units(&mut self, rep: u64, units: &mut Units) -> Result<(), Problem> {
        let record = self.exchange.get(rep)?;
        let context = self
            .exchange
            .get(of_representation(&record).reference(2)?)?;
        if let Some(at) = context.part("GLOBAL_UNIT_ASSIGNED_CONTEXT") {
            let listed = at.list(0)?.iter().filter_map(Value::reference);
            for unit in listed {
                if let Err(problem) = self.take_unit(unit, units) {
                    self.note(unit, problem);
                }
            }
        }
        if let Some(at) = context.part("GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT") {
            for measure in at.references(0)? {
                let record = self.exchange.get(measure)?;
                let at = record.attributes();
                let unit = self.exchange.get(at.reference(1)?)?;
                let value = at.number(0)?;
                if unit.part("LENGTH_UNIT").is_some() && value > 0.0 {
                    let own = value * self.unit(&unit, 0)? / units.metres;
                    units.uncertainty = units.uncertainty.max(own);
                }
            }
        }
        Ok(())
    }

    /// Takes in one of the units of a representation.
    fn take_unit(&self, id: u64, units: &mut Units) -> Result<(), Problem> {
        let record = self.exchange.get(id)?;
        if record.part("LENGTH_UNIT").is_some() {
            units.metres = self.unit(&record, 0)?;
        } else if record.part("PLANE_ANGLE_UNIT").is_some() {
            units.radians = self.unit(&record, 0)?;
        }
        Ok(())
    }

    /// How much a unit is in metres, or in radians.
    fn unit(&self, record: &Record<'_>, depth: usize) -> Result<f64, Problem> {
        let positive = |value: f64| {
            let text = format!("a unit is {value:e} of another one");
            let is_sound = value.is_normal() && value > 0.0;
            is_sound.then_some(value).ok_or(Problem::Invalid(text))
        };
        if let Some(at) = record.part("SI_UNIT") {
            let Some(Value::Word(prefix)) = at.get(at.0.len().saturating_sub(2)) else {
                return Ok(1.0);
            };
            let known = PREFIXES
                .iter()
                .find(|(name, _)| name.eq_ignore_ascii_case(prefix));
            let text = || {
                let prefix = String::from_utf8_lossy(prefix);
                Problem::Invalid(format!("{prefix} is no prefix of units"))
            };
            return known.map(|(_, value)| *value).ok_or_else(text);
        }
        if let Some(at) = record.part("CONVERSION_BASED_UNIT") {
            let measure = self.exchange.get(at.reference(1)?)?;
            let measure = measure
                .parts
                .iter()
                .find(|part| part.1.len() == 2)
                .map(|part| Attributes(&part.1))
                .ok_or_else(|| Problem::Invalid("its unit is not told".to_owned()))?;
            let base = self.exchange.get(measure.reference(1)?)?;
            if depth > NESTING {
                let text = "units are made of each other";
                return Err(Problem::Invalid(text.to_owned()));
            }
            return positive(measure.number(0)? * self.unit(&base, depth + 1)?);
        }
        Ok(1.0)
    }
}
