//! What documents say is what the program does.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

#[expect(dead_code, reason = "other tests use more of it")]
mod program;

use program::Place;

fn document(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

/// The keys that a section of the document names.
fn documented(text: &str, section: &str) -> BTreeSet<String> {
    let heading = format!("\n## {section}\n");
    let (_, text) = text.split_once(&heading).unwrap();
    let text = text.split("\n## ").next().unwrap();
    let rows = text.lines().filter(|line| line.starts_with("| `"));
    let keys = rows.flat_map(|row| row.split('|').nth(1).unwrap().split(','));
    keys.map(|key| key.trim().trim_matches('`').to_owned())
        .collect()
}

/// Collects the paths to all values; those in warnings apart.
fn collect(
    value: &Value,
    path: &str,
    keys: &mut BTreeSet<String>,
    warnings: &mut BTreeSet<String>,
) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                let dot = if path.is_empty() { "" } else { "." };
                let path = format!("{path}{dot}{key}");
                if key == "warnings" || key == "left_out" {
                    keys.insert(path);
                    let list = value.as_array().unwrap();
                    for warning in list {
                        collect(warning, "", warnings, &mut BTreeSet::new());
                    }
                } else {
                    collect(value, &path, keys, warnings);
                }
            }
        }
        Value::Array(list) if list.iter().any(Value::is_object) => {
            for value in list {
                collect(value, path, keys, warnings);
            }
        }
        _ => {
            keys.insert(path.to_owned());
        }
    }
}

/// An IGES file with its surfaces on level 7.
fn on_level(text: &str) -> String {
    let line = |line: &str| {
        if line.starts_with("     128") && line.contains("000D") {
            format!("{}       7{}\n", &line[..32], &line[40..])
        } else {
            format!("{line}\n")
        }
    };
    text.lines().map(line).collect()
}

/// Runs commands, and compares the keys of what they tell, on standard output or in a file, with those
/// of a section of the document.
#[track_caller]
fn assert_documented(
    place: &Place,
    (section, lines, input): (&str, &[String], &str),
    warnings: &mut BTreeSet<String>,
) {
    let mut keys = BTreeSet::new();
    for line in lines {
        let run = place.run_with(line, input.as_bytes());
        let text = match section.split_once(": ") {
            Some((_, file)) => fs::read_to_string(place.path("out").join(file)).unwrap(),
            None => run.stdout,
        };
        for value in serde_json::Deserializer::from_str(&text).into_iter() {
            collect(&value.unwrap(), "", &mut keys, warnings);
        }
    }
    // Objects that a sample does not have are null there.
    let is_parent = |key: &String| keys.iter().any(|k| k.starts_with(&format!("{key}.")));
    let keys: BTreeSet<_> = keys.iter().filter(|key| !is_parent(key)).cloned().collect();
    assert_eq!(
        keys,
        documented(&document("docs/json.md"), section),
        "{section}"
    );
}

#[test]
fn keys_of_json_are_documented() {
    let place = Place::new();
    let mut warnings = BTreeSet::new();
    let rays = "0,5,0.5,0,-1,0\n";
    let all = "samples/sphere_torus.x3d samples/two_surfaces.igs samples/mixed.obj \
        samples/pictures.x3dv levels.igs nothing.obj";
    let text = fs::read_to_string(place.path("samples/two_surfaces.igs")).unwrap();
    fs::write(place.path("levels.igs"), on_level(&text)).unwrap();
    for (section, lines, input) in [
        (
            "convert --json",
            vec![
                "convert samples/can.igs nothing.obj -o {stem}.glb --tolerance 1% --json"
                    .to_owned(),
                "convert samples/mixed.obj -o {stem}.igs --json".to_owned(),
            ],
            "",
        ),
        (
            "render --stats",
            vec![
                "render samples/goblet.x3d nothing.obj -o {stem}.png --size 8x6 --certify \
                 --time 1 --stats -"
                    .to_owned(),
            ],
            "",
        ),
        (
            "info --json",
            vec![
                format!("info --json {all}"),
                "info --json --measure samples/sphere_torus.x3d".to_owned(),
            ],
            "",
        ),
        (
            "volume --json",
            vec!["volume samples/sphere_torus.x3d nothing.obj --json --method midpoint".to_owned()],
            "",
        ),
        (
            "probe --rays --json",
            vec!["probe samples/teapot.obj --rays - --json".to_owned()],
            rays,
        ),
        (
            "probe --rays --certify --json",
            vec!["probe samples/teapot.obj --rays - --certify --json".to_owned()],
            rays,
        ),
        (
            "probe --uv --json",
            vec!["probe samples/teapot.obj --uv - --json".to_owned()],
            "0,0.5,0.5\n",
        ),
    ] {
        assert_documented(&place, (section, &lines[..], input), &mut warnings);
    }
    assert_eq!(warnings, documented(&document("docs/json.md"), "Warnings"));
}

#[test]
fn keys_of_reports_are_documented() {
    let place = Place::new();
    let mut warnings = BTreeSet::new();
    for (section, lines) in [
        (
            "compare: report.json",
            vec![
                "compare samples/goblet.x3d -o out --size 32x24 --tolerance 2%".to_owned(),
                "compare samples/goblet.x3d out/mesh1.glb samples/mixed.obj -o out --size 32x24 \
                 --align"
                    .to_owned(),
            ],
        ),
        (
            "bench methods: results.json",
            vec![
                "bench methods samples/teapot.obj samples/sphere_torus.x3d -o out --size 8x6 \
                 --runs 1 --methods newton,gradient-map"
                    .to_owned(),
            ],
        ),
    ] {
        assert_documented(&place, (section, &lines[..], ""), &mut warnings);
    }
    assert!(warnings.is_subset(&documented(&document("docs/json.md"), "Warnings")));
}

/// Whether two texts are equal, numbers in them up to their last digits.
fn alike(a: &str, b: &str) -> bool {
    let parts = |text: &str| -> Vec<String> {
        let parts = text.split([',', '[', ']', ':', '{', '}', '\n']);
        parts.map(str::to_owned).collect()
    };
    let (a, b) = (parts(a), parts(b));
    let same = |(a, b): (&String, &String)| {
        let numbers = a.parse::<f64>().ok().zip(b.parse::<f64>().ok());
        a == b || numbers.is_some_and(|(a, b)| (a - b).abs() <= 1e-13 * a.abs().max(1.0))
    };
    a.len() == b.len() && a.iter().zip(&b).all(same)
}

#[test]
fn the_front_page_shows_what_probe_prints() {
    let place = Place::new();
    let page = document("README.md");
    let mut count = 0;
    for block in page.split("```text\n").skip(1) {
        let block = block.split("```").next().unwrap();
        let (command, expected) = block.split_once('\n').unwrap();
        let Some((input, line)) = command
            .strip_prefix("$ echo ")
            .and_then(|rest| rest.split_once(" | nurbray "))
        else {
            continue;
        };
        let run = place.run_with(line, format!("{input}\n").as_bytes());
        assert!(alike(&run.stdout, expected), "{command}\n{}", run.stdout);
        count += 1;
    }
    assert_eq!(count, 2);
}

#[test]
fn examples_that_documents_and_tools_run_are_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["docs", "tools"].map(|folder| fs::read_dir(root.join(folder)).unwrap());
    let files = folders
        .into_iter()
        .flatten()
        .map(|entry| entry.unwrap().path());
    let texts = files.filter_map(|path| fs::read_to_string(path).ok());
    let mut found = 0;
    for text in texts {
        for rest in text.split("--example ").skip(1) {
            let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let name: String = rest.chars().take_while(|c| is_name(*c)).collect();
            let [file, folder] = [format!("{name}.rs"), format!("{name}/main.rs")]
                .map(|path| root.join("examples").join(path));
            assert!(file.is_file() || folder.is_file(), "{name}");
            found += 1;
        }
    }
    assert!(found > 2, "{found}");
}
