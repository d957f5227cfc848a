//! The command line: arguments into plain data, one file per command.
#![allow(clippy::print_stderr, reason = "this is where the program speaks")]

mod batch;
mod bench;
mod claims;
mod compare;
mod convert;
mod info;
mod input;
mod mesh;
mod model;
mod parse;
mod probe;
mod render;
mod say;
mod sheet;
mod shot;
mod sizes;
mod stop;
mod volume;

use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use self::say::say;

/// Turns NURBS files into exact pictures and numbers, and into each other.
///
/// Reads STEP, IGES, OBJ free-form, X3D and VRML 97. Surfaces are intersected as they are, never as
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
  nurbray convert samples/goblet.x3d -o goblet.igs
  nurbray compare samples/teapot.obj -o report
  nurbray info samples/goblet.x3d
  nurbray model scan.dcm -o scan.glb
  nurbray volume samples/sphere_torus.x3d
  echo 0,5,0,0,-1,0 | nurbray probe samples/teapot.obj --rays - --all

Exit codes: 0 done, 1 a comparison is not within its limit, 2 something went wrong,
3 some files were converted and others were not, or a signal stopped the program between them.";

#[derive(Debug, Subcommand)]
enum Command {
    Render(Box<render::Args>),
    Convert(convert::Args),
    Compare(compare::Args),
    Info(info::Args),
    Probe(probe::Args),
    Bench(bench::Args),
    Model(Box<model::Args>),
    Volume(volume::Args),
}

/// Exit code when a comparison found more than was allowed.
const DIFFERENT: u8 = 1;

/// Exit code when something went wrong.
const FAILED: u8 = 2;

/// Exit code when some files of a batch were converted and others were not.
const PARTLY: u8 = 3;

/// How many files a command failed on, and its exit code.
struct Failures {
    count: usize,
    code: u8,
}

impl From<usize> for Failures {
    fn from(count: usize) -> Self {
        let code = if count > 0 { FAILED } else { 0 };
        Self { count, code }
    }
}

/// What the command line says. Numbers below zero are values, so that their options say what is right.
fn parsed() -> Cli {
    let command = Cli::command().mut_subcommands(|command| {
        command.mut_args(|arg| {
            let is_option = arg.get_action().takes_values() && !arg.is_positional();
            arg.allow_negative_numbers(is_option)
        })
    });
    let found = Cli::from_arg_matches(&command.get_matches());
    found.unwrap_or_else(|error| error.exit())
}

/// Runs the program.
pub(crate) fn run() -> ExitCode {
    #[cfg(unix)]
    if let Err(error) = stop::outlive_large_files() {
        say!("nurbray: {error}");
    }
    let result = match parsed().command {
        Command::Render(args) => render::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Info(args) => info::run(&args).map(Failures::from),
        Command::Probe(args) => probe::run(&args).map(Failures::from),
        Command::Bench(args) => bench::run(&args),
        Command::Model(args) => model::run(&args).map(Failures::from),
        Command::Volume(args) => volume::run(&args).map(Failures::from),
    };
    match result {
        Ok(Failures { count, code }) => {
            if count > 1 {
                say!("nurbray: {count} files failed");
            }
            ExitCode::from(code)
        }
        // Whoever reads our output has seen enough.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            say!("nurbray: {error:#}");
            ExitCode::from(FAILED)
        }
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .downcast_ref::<std::io::Error>()
        .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}
