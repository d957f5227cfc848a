//! Addresses of files that are named inside a file.
//!
//! They are URLs, in which a space is `%20`; but many programs write plain names, in which a
//! percent sign is one. So a name is looked for as it stands there first, then decoded.

use super::File;

/// Characters that mean something else in an address, or must not stand there.
const RESERVED: &[char] = &[
    ' ', '"', '#', '%', ':', '<', '>', '?', '[', ']', '^', '`', '{', '|', '}',
];

/// Where a file is that is named inside another one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Address {
    /// The address in messages.
    pub(super) shown: String,
    /// The names that the file may have, the first choice first; none if it is not local.
    pub(super) names: Vec<String>,
    /// What is wanted of the file, or all of it.
    pub(super) fragment: Option<String>,
}

impl File {
    /// An address in this file, of a whole file.
    pub(super) fn address(&self, text: &str) -> Address {
        let mut names = Vec::new();
        if let Some(path) = local(text) {
            names = vec![self.beside(path), self.beside(&decoded(path))];
            names.dedup();
        }
        Address {
            shown: names.last().map_or(text, String::as_str).to_owned(),
            names,
            fragment: None,
        }
    }

    /// An address in this file, which may lead to a part of a file.
    pub(super) fn address_of_part(&self, text: &str) -> Address {
        let Some((file, fragment)) = text.split_once('#') else {
            return self.address(text);
        };
        let whole = self.address(file);
        Address {
            shown: format!("{}#{fragment}", whole.shown),
            fragment: Some(decoded(fragment)),
            ..whole
        }
    }

    /// The name of a file that is named in this one, from the folder of the first.
    fn beside(&self, path: &str) -> String {
        let here = &self.name;
        let folder = here.rfind('/').map_or("", |end| &here[..=end]);
        if path.starts_with(['/', '\\']) || has_drive(path) {
            return path.to_owned();
        }
        let joined = format!("{folder}{path}").replace('\\', "/");
        let root = if joined.starts_with('/') { "/" } else { "" };
        let mut parts: Vec<&str> = Vec::new();
        for part in joined.split('/') {
            match (part, parts.last()) {
                ("." | "", _) => {}
                ("..", Some(&last)) if last != ".." => drop(parts.pop()),
                _ => parts.push(part),
            }
        }
        format!("{root}{}", parts.join("/"))
    }
}

/// The path of an address, if it is one of this machine.
fn local(address: &str) -> Option<&str> {
    let Some((scheme, rest)) = address.split_once(':').filter(|(s, _)| !s.contains('/')) else {
        return Some(address);
    };
    if !scheme.eq_ignore_ascii_case("file") {
        return None;
    }
    let path = match rest.strip_prefix("//") {
        Some(rest) => {
            let (host, path) = rest.split_at(rest.find('/')?);
            let is_here = host.is_empty() || host.eq_ignore_ascii_case("localhost");
            is_here.then_some(path)?
        }
        None => rest,
    };
    Some(
        path.strip_prefix('/')
            .filter(|p| has_drive(p))
            .unwrap_or(path),
    )
}

/// Whether a path begins as those of Windows do.
fn has_drive(path: &str) -> bool {
    matches!(path.as_bytes(), [letter, b':', b'/' | b'\\', ..] if letter.is_ascii_alphabetic())
}

/// What stands in an address, with `%20` and the like decoded; as it is if that is no text.
pub fn decoded(text: &str) -> String {
    let (mut bytes, mut rest) = (Vec::new(), text.as_bytes());
    while let [first, tail @ ..] = rest {
        let digit = |at: usize| char::from(*tail.get(at)?).to_digit(16);
        let code = digit(0).zip(digit(1)).filter(|_| *first == b'%');
        match code.and_then(|(high, low)| u8::try_from(16 * high + low).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            None => {
                bytes.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8(bytes).unwrap_or_else(|_| text.to_owned())
}

/// The address of a file with this name.
pub(super) fn encoded(name: &str) -> String {
    let mut address = String::new();
    for c in name.chars() {
        match c {
            '\\' => address.push('/'),
            c if RESERVED.contains(&c) || c.is_ascii_control() => {
                address += &format!("%{:02X}", u32::from(c));
            }
            c => address.push(c),
        }
    }
    address
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(address: &str) -> Vec<String> {
        let name = "a b%20/here.wrl".to_owned();
        let file = File {
            name,
            ..File::default()
        };
        file.address(address).names
    }

    #[test]
    fn addresses_are_names_as_they_stand_and_decoded() {
        assert_eq!(names("c.png"), ["a b%20/c.png"]);
        assert_eq!(names("./d/../c.png"), ["a b%20/c.png"]);
        assert_eq!(
            names("c%20d%c3%A9.png"),
            ["a b%20/c%20d%c3%A9.png", "a b%20/c dé.png"]
        );
        // Neither a code, nor text when decoded.
        for plain in ["50%.png", "%+5.png", "%2", "%ff.png", "a/b:c.png"] {
            assert_eq!(names(plain), [format!("a b%20/{plain}")]);
        }
        let up = "%2e%2e/%2E%2e%2Fc.png";
        assert_eq!(names(up).last().unwrap(), "../c.png");
    }

    #[test]
    fn addresses_of_this_machine_are_paths() {
        for (address, path) in [
            ("file:c.png", "a b%20/c.png"),
            ("FILE:///d/c.png", "/d/c.png"),
            ("file://localhost/d/c.png", "/d/c.png"),
            ("file:/d/c.png", "/d/c.png"),
            ("file:///C:/c.png", "C:/c.png"),
        ] {
            assert_eq!(names(address), [path], "{address}");
        }
        for address in ["http://a/c.png", "file://a/c.png", "file://c.png", "data:,"] {
            assert_eq!(names(address), [""; 0], "{address}");
        }
    }

    #[test]
    fn names_come_back_from_their_addresses() {
        for name in ["a b/50%20.png", "#1 \"é\".png", "a:b?.png", "plain-1_2.png"] {
            let address = encoded(name);
            assert!(!address.contains([' ', '"', '#', '?', ':']), "{address}");
            assert_eq!(decoded(&address), name);
        }
        assert_eq!(encoded("a\\b c.png"), "a/b%20c.png");
    }
}
