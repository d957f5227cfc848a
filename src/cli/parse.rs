//! Values on the command line.

use std::ops::{Range, RangeInclusive};
use std::path::PathBuf;

use glam::DVec3;
use nurbray::METHODS;
use nurbray::kernel::linear_from_srgb;
use nurbray::methods::VARIANTS;

/// The largest picture, in pixels: the film then takes about eight gigabytes.
const MOST_PIXELS: u64 = 1 << 27;

/// The most threads that may be asked for.
const MOST_THREADS: usize = 1024;

/// A folder that is there.
pub(super) fn folder(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.is_dir() {
        return Ok(path);
    }
    Err(format!("'{text}' is no folder"))
}

/// A number of threads.
pub(super) fn threads(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| *count <= MOST_THREADS);
    count.ok_or_else(|| format!("'{text}' is not a number from 0 to {MOST_THREADS}"))
}

/// A whole number within bounds.
pub(super) fn count(
    range: RangeInclusive<u32>,
) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync + 'static {
    move |text| {
        let count = text.parse().ok().filter(|count| range.contains(count));
        count.ok_or_else(|| match (range.start(), range.end()) {
            (least, &u32::MAX) => format!("'{text}' is not a whole number from {least} on"),
            (least, most) => format!("'{text}' is not a whole number from {least} to {most}"),
        })
    }
}

/// A whole number.
pub(super) fn whole(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("'{text}' is not a whole number"))
}

/// A moment, in seconds.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|x: &f64| x.is_finite());
    seconds.ok_or_else(|| format!("'{text}' is not a number of seconds"))
}

/// `WxH`.
pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let wrong = || format!("'{text}' is not a size such as 1920x1080");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let number = |text: &str| text.trim().parse::<u32>().ok().filter(|&n| n > 0);
    let (width, height) = number(width).zip(number(height)).ok_or_else(wrong)?;
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(format!(
            "{width}x{height} is more than {MOST_PIXELS} pixels"
        ));
    }
    Ok((width, height))
}

/// `x,y,z`.
pub(super) fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite()))
        .collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("'{text}' is not three numbers such as 1,-2.5,3")),
    }
}

/// All methods and their variants, for `--help`.
pub(super) fn methods() -> String {
    let mut text = "How rays are intersected with surfaces. NAME+VARIANT departs from the \
                    method's defaults.\n"
        .to_owned();
    for method in METHODS {
        text += &format!("\n  {}: {}", method.name, method.summary);
        for &variant in method.variants {
            text += &format!("\n      +{}", VARIANTS[variant as usize].1);
        }
    }
    text += "\n";
    for (_, name, summary) in VARIANTS {
        text += &format!("\n  +{name}: {summary}");
    }
    text
}

/// A length, which may be zero.
pub(super) fn length(text: &str) -> Result<f64, String> {
    let length = text.parse().ok();
    let length = length.filter(|x: &f64| *x >= 0.0 && x.is_finite());
    length.ok_or_else(|| format!("'{text}' is not a length"))
}

/// What stands behind everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Background {
    /// Nothing: the picture is transparent there.
    None,
    /// A linear colour.
    Color(DVec3),
}

/// A range of frames such as `0..23`, both with it.
pub(super) fn frames(text: &str) -> Result<Range<u32>, String> {
    let range = text.split_once("..").and_then(|(first, last)| {
        let (first, last): (u32, u32) = (first.parse().ok()?, last.parse().ok()?);
        Some(first..last.checked_add(1)?)
    });
    let range = range.filter(|range| !range.is_empty());
    range.ok_or_else(|| format!("'{text}' is not a range of frames such as 0..23"))
}

/// `none`, `#rrggbb` or `r,g,b` from 0 to 1, as sRGB.
pub(super) fn background(text: &str) -> Result<Background, String> {
    if text == "none" {
        return Ok(Background::None);
    }
    let hex = text.strip_prefix('#').filter(|digits| digits.len() == 6);
    let srgb = match hex.and_then(|digits| u32::from_str_radix(digits, 16).ok()) {
        Some(rgb) => {
            let part = |shift: u32| f64::from(rgb >> shift & 0xff) / 255.0;
            DVec3::new(part(16), part(8), part(0))
        }
        None => vector(text)
            .ok()
            .filter(|c| c.min_element() >= 0.0 && c.max_element() <= 1.0)
            .ok_or_else(|| format!("'{text}' is not none, #rrggbb or r,g,b from 0 to 1"))?,
    };
    Ok(Background::Color(linear_from_srgb(srgb)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_colours() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert!(size("640").is_err() && size("0x5").is_err() && size("99999x99999").is_err());
        assert_eq!(background("#ffffff"), Ok(Background::Color(DVec3::ONE)));
        assert_eq!(background("0,0,0"), Ok(Background::Color(DVec3::ZERO)));
        assert_eq!((frames("0..23"), frames("7..7")), (Ok(0..24), Ok(7..8)));
        assert!(frames("3..2").is_err() && frames("3").is_err() && frames("-1..2").is_err());
        assert_eq!((threads("0"), threads("1024")), (Ok(0), Ok(1024)));
        assert!(threads("1025").is_err() && threads("-1").is_err());
        assert_eq!((count(1..=64)("64"), count(2..=3)("3")), (Ok(64), Ok(3)));
        assert!(
            count(1..=64)("1.5").is_err() && count(1..=64)("0").is_err() && whole("-1").is_err()
        );
        assert!(seconds("nan").is_err() && seconds("-1.5") == Ok(-1.5));
        assert!(background("2,0,0").is_err() && background("#fff").is_err());
    }
}
