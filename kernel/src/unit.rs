//! Units of length.

/// Lengths that differ by no more than this share are the same unit.
const SAME: f64 = 1e-12;

/// A unit of length.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// The name, such as `mm`.
    pub name: String,
    /// Length of one unit in metres.
    pub metres: f64,
}

impl Unit {
    /// The units that are known by name, each with its length in metres.
    pub const KNOWN: [(&'static str, f64); 11] = [
        ("um", 1e-6),
        ("mm", 1e-3),
        ("cm", 1e-2),
        ("m", 1.0),
        ("km", 1e3),
        ("uin", 2.54e-8),
        ("mil", 2.54e-5),
        ("in", 0.0254),
        ("ft", 0.3048),
        ("yd", 0.9144),
        ("mi", 1609.344),
    ];

    /// The known unit of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let (name, metres) = Self::KNOWN.into_iter().find(|(known, _)| *known == name)?;
        let name = name.to_owned();
        Some(Self { name, metres })
    }

    /// The unit of this length: the known one, or else one that is called by its length.
    ///
    /// ```
    /// use nurbray_kernel::Unit;
    ///
    /// assert_eq!(Unit::of_length(0.0254).name, "in");
    /// assert_eq!(Unit::of_length(0.5).name, "0.5 m");
    /// ```
    #[must_use]
    pub fn of_length(metres: f64) -> Self {
        let same = |known: f64| (known - metres).abs() <= known * SAME;
        let known = Self::KNOWN.into_iter().find(|(_, known)| same(*known));
        let name = known.map_or_else(|| format!("{metres} m"), |(name, _)| name.to_owned());
        Self { name, metres }
    }
}
