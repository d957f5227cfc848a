//! The command line: arguments into plain data, one file per command.
#![allow(clippy::print_stderr, reason = "this is where the program speaks")]

mod info;
mod input;
mod parse;
mod probe;
mod render;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Turns NURBS files into exact pictures and numbers.
///
/// Reads OBJ free-form, IGES and X3D. Surfaces are intersected as they are, never as
/// triangles; what could not be used of a file is counted and named.
#[derive(Debug, Parser)]
#[command(name = "nurbray", version, max_term_width = 100, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  nurbray render samples/teapot.obj -o teapot.png
  nurbray render *.igs -o 'pictures/{stem}.exr' --size 1920x1080 --samples 4
  nurbray info samples/goblet.x3d
  echo 0,5,0,0,-1,0 | nurbray probe samples/teapot.obj --rays - --all

Exit codes: 0 done, 1 a comparison found a difference, 2 something went wrong.";

#[derive(Debug, Subcommand)]
enum Command {
    Render(Box<render::Args>),
    Info(info::Args),
    Probe(probe::Args),
}

/// Exit code when something went wrong.
const FAILED: u8 = 2;

/// Runs the program.
pub(crate) fn run() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Render(args) => render::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Probe(args) => probe::run(&args),
    };
    match result {
        Ok(0) => ExitCode::SUCCESS,
        Ok(failed) => {
            if failed > 1 {
                eprintln!("nurbray: {failed} files failed");
            }
            ExitCode::from(FAILED)
        }
        // Whoever reads our output has seen enough.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("nurbray: {error:#}");
            ExitCode::from(FAILED)
        }
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .downcast_ref::<std::io::Error>()
        .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}
