//! What `nurbray bench` tells: a table, JSON, CSV and a page with pictures.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use anyhow::Context as _;
use nurbray::html::{address, escaped};
use nurbray::output::replace_file;
use serde_json::{Value, json};

use super::super::say::visible;
use super::{Measured, MethodArgs, Row};

/// A column of table and CSV.
struct Column {
    name: &'static str,
    /// Decimals in the table.
    decimals: usize,
    value: fn(&Measured, &Context) -> f64,
}

/// What columns need besides the row itself.
struct Context {
    pixels: f64,
    /// Milliseconds of the first method on the same scene, all together and tracing.
    reference: Option<[f64; 2]>,
}

const COLUMNS: &[Column] = &[
    Column {
        name: "build ms",
        decimals: 2,
        value: |m, _| milliseconds(m.times.build),
    },
    Column {
        name: "map ms",
        decimals: 2,
        value: |m, _| milliseconds(m.times.map),
    },
    Column {
        name: "trace ms",
        decimals: 2,
        value: |m, _| milliseconds(m.times.trace),
    },
    Column {
        name: "all ms",
        decimals: 2,
        value: |m, _| all(m),
    },
    Column {
        name: "x trace",
        decimals: 1,
        value: |m, c| c.reference.map_or(f64::NAN, |r| view(m) / r[1]),
    },
    Column {
        name: "x all",
        decimals: 1,
        value: |m, c| c.reference.map_or(f64::NAN, |r| all(m) / r[0]),
    },
    Column {
        name: "values/ray",
        decimals: 2,
        value: |m, c| m.counts.values as f64 / c.pixels,
    },
    Column {
        name: "derivs/ray",
        decimals: 2,
        value: |m, c| m.counts.derivatives as f64 / c.pixels,
    },
    Column {
        name: "steps/ray",
        decimals: 2,
        value: |m, c| m.counts.iterations as f64 / c.pixels,
    },
    Column {
        name: "cuts/ray",
        decimals: 2,
        value: |m, c| m.counts.cuts as f64 / c.pixels,
    },
    Column {
        name: "wrong",
        decimals: 0,
        value: |m, _| m.judgement.counts[1] as f64,
    },
    Column {
        name: "lost",
        decimals: 0,
        value: |m, _| m.judgement.counts[2] as f64,
    },
    Column {
        name: "invented",
        decimals: 0,
        value: |m, _| m.judgement.counts[3] as f64,
    },
    Column {
        name: "open",
        decimals: 0,
        value: |m, _| m.judgement.counts[4] as f64,
    },
    Column {
        name: "mean px",
        decimals: 5,
        value: |m, _| m.judgement.error[0],
    },
    Column {
        name: "max px",
        decimals: 5,
        value: |m, _| m.judgement.error[1],
    },
];

fn milliseconds(time: std::time::Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Everything that depends on the camera: the map and the rays.
fn view(measured: &Measured) -> f64 {
    milliseconds(measured.times.map + measured.times.trace)
}

fn all(measured: &Measured) -> f64 {
    milliseconds(measured.times.build) + view(measured)
}

/// Rows, each with what its columns need.
fn pairs<'a>(args: &MethodArgs, rows: &'a [Row]) -> Vec<(&'a Row, Context)> {
    let pair = |row| (row, context(args, rows, row));
    rows.iter().map(pair).collect()
}

/// Writes all reports into the folder.
pub(super) fn write(args: &MethodArgs, rows: &[Row]) -> anyhow::Result<()> {
    let pairs = pairs(args, rows);
    let list: Vec<_> = pairs.iter().map(|(row, c)| value(row, c)).collect();
    let report = json!({
        "width": args.size.0,
        "height": args.size.1,
        "runs": args.runs,
        "threads": 1,
        "rows": list,
    });
    save(&args.output.join("results.json"), &format!("{report:#}\n"))?;
    save(&args.output.join("results.csv"), &csv(&pairs))?;
    save(&args.output.join("index.html"), &page(args, &pairs))
}

/// Prints the table to standard output.
pub(super) fn print(args: &MethodArgs, rows: &[Row]) -> anyhow::Result<()> {
    std::io::stdout().write_all(table(&pairs(args, rows)).as_bytes())?;
    Ok(())
}

fn context(args: &MethodArgs, rows: &[Row], row: &Row) -> Context {
    let first = args.methods[0].to_string();
    let reference = rows
        .iter()
        .find(|other| other.scene == row.scene && other.method == first)
        .and_then(|other| other.outcome.as_ref().ok());
    Context {
        pixels: f64::from(args.size.0) * f64::from(args.size.1),
        reference: reference.map(|m| [all(m), view(m)]),
    }
}

fn save(path: &Path, text: &str) -> anyhow::Result<()> {
    replace_file(path, |file| file.write_all(text.as_bytes()))
        .with_context(|| path.display().to_string())
}

fn value(row: &Row, context: &Context) -> Value {
    let mut value = json!({ "scene": row.scene, "method": row.method });
    match &row.outcome {
        Ok(measured) => {
            for column in COLUMNS {
                let name = column.name.replace(' ', "_");
                value[name] = (column.value)(measured, context).into();
            }
            value["seen"] = measured.judgement.seen.into();
            value["starts"] = measured.counts.starts.into();
            value["converged"] = measured.counts.converged.into();
            value["capped"] = measured.counts.capped.into();
            value["stalled"] = measured.counts.stalled.into();
        }
        Err(refusal) => value["cannot"] = refusal.as_str().into(),
    }
    value
}

/// A text as a field of CSV.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

fn csv(pairs: &[(&Row, Context)]) -> String {
    let mut text = "scene,method".to_owned();
    for column in COLUMNS {
        text += &format!(",{}", column.name);
    }
    text += ",cannot\n";
    for (row, context) in pairs {
        text += &format!("{},{}", quoted(&row.scene), row.method);
        match &row.outcome {
            Ok(measured) => {
                for column in COLUMNS {
                    text += &format!(",{}", (column.value)(measured, context));
                }
                text += ",\n";
            }
            Err(refusal) => {
                text += &",".repeat(COLUMNS.len() + 1);
                text += &quoted(refusal);
                text += "\n";
            }
        }
    }
    text
}

fn cell(column: &Column, measured: &Measured, context: &Context) -> String {
    format!("{:.*}", column.decimals, (column.value)(measured, context))
}

fn table(pairs: &[(&Row, Context)]) -> String {
    let mut text = format!("{:24}", "");
    for column in COLUMNS {
        let _ = write!(text, "{:>11}", column.name);
    }
    let mut scene = "";
    for (row, context) in pairs {
        if row.scene != scene {
            scene = &row.scene;
            let _ = write!(text, "\n{}", visible(scene));
        }
        let _ = write!(text, "\n  {:22}", row.method);
        match &row.outcome {
            Ok(measured) => {
                for column in COLUMNS {
                    let _ = write!(text, "{:>11}", cell(column, measured, context));
                }
            }
            Err(refusal) => text += refusal,
        }
    }
    text + "\n"
}

const STYLE: &str = "body{font:14px sans-serif;margin:2em;color:#222}\
table{border-collapse:collapse}td,th{padding:2px 8px;text-align:right}\
td:first-child,th:first-child{text-align:left}tr:nth-child(even){background:#f2f2f2}\
figure{display:inline-block;margin:4px}img{width:256px}figcaption{font-size:12px}";

fn page(args: &MethodArgs, pairs: &[(&Row, Context)]) -> String {
    let mut text = format!(
        "<!DOCTYPE html><html lang=en><meta charset=utf-8><title>nurbray bench methods</title>\
         <style>{STYLE}</style><h1>Methods side by side</h1>\
         <p>{} x {} pixels, one ray each, one thread, medians of {}. Effort: black over blue, \
         cyan, green, yellow and red to white, each step four times as many steps and cuts. \
         Verdicts: grey right, magenta wrong, red lost, blue invented, yellow not proven.</p>\n",
        args.size.0, args.size.1, args.runs
    );
    let mut scenes: Vec<&str> = pairs.iter().map(|(row, _)| row.scene.as_str()).collect();
    scenes.dedup();
    for scene in scenes {
        let of_scene = pairs.iter().filter(|(row, _)| row.scene == scene);
        let _ = write!(text, "<h2>{}</h2><table><tr><th>method", escaped(scene));
        for column in COLUMNS {
            let _ = write!(text, "<th>{}", column.name);
        }
        let mut figures = String::new();
        for (row, context) in of_scene {
            let method = escaped(&row.method);
            let _ = write!(text, "<tr><td>{method}");
            match &row.outcome {
                Ok(measured) => {
                    for column in COLUMNS {
                        let _ = write!(text, "<td>{}", cell(column, measured, context));
                    }
                    for (kind, caption) in
                        [("", ""), ("_effort", " effort"), ("_verdict", " verdict")]
                    {
                        let picture = address(&format!("{scene}_{}{kind}.png", row.method));
                        let _ = write!(
                            figures,
                            "<figure><img src=\"{picture}\" alt=\"\">\
                             <figcaption>{method}{caption}</figcaption></figure>"
                        );
                    }
                    figures += "<br>\n";
                }
                Err(refusal) => {
                    let _ = write!(text, "<td colspan={}>{}", COLUMNS.len(), escaped(refusal));
                }
            }
        }
        let _ = write!(text, "</table>\n{figures}");
    }
    text
}
