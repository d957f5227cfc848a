//! One IGES file in many spellings: whatever the cards look like, the scene is the same.
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests, too")]

use std::cell::RefCell;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use kernel::Scene;
use nurbray_formats::{Limits, NoFiles, ReadOptions};

/// Larger files of the corpus are passed over, for the sake of time.
const MOST: u64 = 100_000;

fn read(bytes: &[u8]) -> Option<Scene> {
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let import = nurbray_formats::read(bytes, Some("igs"), &options);
    import.ok().map(|import| import.scene)
}

/// The files of our own, and those of others if they are there.
fn files() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folders = ["samples", "../shared/corpus/iges"].map(|f| root.join(f));
    let entries = folders.iter().filter_map(|f| f.read_dir().ok()).flatten();
    let paths = entries.map(|entry| entry.unwrap().path());
    let is_wanted = |path: &PathBuf| {
        let ending = path.extension().unwrap_or_default();
        (ending == "igs" || ending == "iges") && path.metadata().unwrap().len() <= MOST
    };
    paths.filter(is_wanted).collect()
}

/// The cards of a file, filled up to 80 columns.
fn cards(bytes: &[u8]) -> Vec<String> {
    // One character for each byte.
    let text: String = bytes.iter().map(|&b| char::from(b.min(127))).collect();
    text.lines().map(|line| format!("{line:<80}")).collect()
}

fn letter(card: &str) -> u8 {
    card.as_bytes()[72]
}

/// The same in compressed form.
fn compressed(cards: &[String]) -> String {
    let of = |section: u8| cards.iter().filter(move |card| letter(card) == section);
    let mut text = format!("{:<72}C\n", "");
    for card in of(b'S').chain(of(b'G')) {
        let _ = writeln!(text, "{card}");
    }
    let data: Vec<_> = of(b'P').collect();
    let mut before: [&str; 20] = [""; 20];
    for (index, pair) in of(b'D').collect::<Vec<_>>().chunks(2).enumerate() {
        let fields: Vec<&str> = pair
            .iter()
            .flat_map(|card| (0..10).map(move |k| card[8 * k..8 * k + 8].trim()))
            .collect();
        let _ = write!(text, "D{}", 2 * index + 1);
        let mut column = 9;
        for k in [1, 3, 4, 5, 6, 7, 8, 9, 12, 13, 14, 15, 16, 17, 18, 19] {
            if index == 0 || fields[k - 1] != before[k - 1] {
                let field = format!("@{k}_{}", fields[k - 1]);
                column += field.len();
                if column > 70 {
                    column = field.len();
                    text += "\n";
                }
                text += &field;
            }
        }
        text += ";\n";
        before.copy_from_slice(&fields);
        let first: usize = fields[1].parse().unwrap_or(0);
        let count: usize = fields[13].parse().unwrap_or(0);
        let record = || data.iter().skip(first.wrapping_sub(1));
        // Some files have no count for what stands there.
        let owner = (2 * index + 1).to_string();
        let owned = record().take_while(|card| card[64..72].trim() == owner);
        let count = count.max(owned.count());
        for card in record().take(count) {
            let _ = writeln!(text, "{}", card[..64].trim_end());
        }
    }
    for card in of(b'T') {
        let _ = writeln!(text, "{card}");
    }
    text
}

/// The same with other delimiters than the usual ones, if it has these.
fn delimited(cards: &[String]) -> Option<String> {
    let first = cards.iter().position(|card| letter(card) == b'G')?;
    if !cards[first].starts_with("1H,,1H;,") {
        return None;
    }
    let mut text = String::new();
    // What is left of a counted string, and its count.
    let (mut string, mut count) = (0, None);
    for (index, card) in cards.iter().enumerate() {
        let mut line = card.clone().into_bytes();
        let mut columns = match letter(card) {
            b'G' => 0..72,
            b'P' => 0..64,
            _ => 0..0,
        };
        if index == first {
            line[..8].copy_from_slice(b"1H||1H~|");
            columns.start = 8;
        }
        for byte in &mut line[columns] {
            if string > 0 {
                string -= 1;
                continue;
            }
            count = match (*byte, count) {
                (b'H' | b'h', Some(length)) => {
                    string = length;
                    None
                }
                (digit @ b'0'..=b'9', count) => {
                    Some(count.unwrap_or(0) * 10 + usize::from(digit - b'0'))
                }
                _ => None,
            };
            match *byte {
                b',' => *byte = b'|',
                b';' => {
                    *byte = b'~';
                    break;
                }
                _ => {}
            }
        }
        text += &String::from_utf8(line).ok()?;
        text += "\n";
    }
    Some(text)
}

/// With each card changed, or left out.
fn changed(cards: &[String], change: impl Fn(&str) -> Option<String>) -> String {
    let lines: Vec<String> = cards.iter().filter_map(|card| change(card)).collect();
    lines.join("\n") + "\n"
}

/// Numbers of the parameters with other letters: exponents have them, strings are left alone.
fn other_exponents(card: &str) -> String {
    let mut text = card.to_owned();
    if letter(card) == b'P' && !card[..64].contains(['H', 'h']) {
        text.replace_range(..64, &card[..64].replace(['E', 'D'], "d"));
    }
    text
}

#[test]
fn spellings_do_not_matter() {
    let mut compared = 0;
    let bad = RefCell::new(Vec::new());
    for path in files() {
        let bytes = std::fs::read(&path).unwrap();
        let cards = cards(&bytes);
        let is_sound = cards.iter().all(|card| card.len() == 80);
        let Some(wanted) = read(&bytes).filter(|_| is_sound) else {
            continue;
        };
        let same = |what: &str, text: &str| {
            let found = read(text.as_bytes());
            let is_same = found.as_ref() == Some(&wanted);
            bad.borrow_mut()
                .extend((!is_same).then(|| format!("{} {what}", path.display())));
        };
        let lines = |end: &str| cards.join(end) + end;
        same("with CR LF", &lines("\r\n"));
        same("with CR", &lines("\r"));
        same("without line ends", &lines(""));
        same(
            "behind a byte order mark",
            &("\u{feff}".to_owned() + &lines("\n")),
        );
        let stripped = changed(&cards, |card| Some(card.trim_end().to_owned()));
        same("without blanks at the ends", &stripped);
        let unended = changed(&cards, |card| {
            Some(card.to_owned()).filter(|c| letter(c) != b'T')
        });
        same("without its end", &unended);
        let wrong_end = changed(&cards, |card| {
            let end = format!("{:<72}T      1", "S9999999G      0D     17P");
            Some(if letter(card) == b'T' {
                end
            } else {
                card.to_owned()
            })
        });
        same("with wrong counts", &wrong_end);
        let unowned = changed(&cards, |card| {
            let is_data = letter(card) == b'P';
            let unowned = format!("{}{:>8}{}", &card[..64], 77, &card[72..]);
            Some(if is_data { unowned } else { card.to_owned() })
        });
        same("with wrong owners", &unowned);
        if let Some(text) = delimited(&cards) {
            same("with other delimiters", &text);
        }
        let exponents = changed(&cards, |card| Some(other_exponents(card)));
        same("with exponents in lower case", &exponents);
        // There are files with half an entry, and such that are cut short.
        let is_whole = cards.iter().filter(|card| letter(card) == b'D').count() % 2 == 0
            && cards.iter().any(|card| letter(card) == b'T');
        if is_whole {
            same("in compressed form", &compressed(&cards));
            let unnumbered = changed(&cards, |card| Some(format!("{}      0", &card[..73])));
            same("without card numbers", &unnumbered);
        }
        compared += 1;
    }
    assert_eq!(bad.into_inner(), [""; 0]);
    assert!(compared >= 2, "{compared}");
}
