//! The command lines of `eval-sim` and `rprae`.
//!
//! In: arguments. Out: tables and paths on standard output, progress and complaints on standard error, and an [`Exit`].
//! Arguments become typed settings once, here; everything below takes values, not strings.

mod bundled;
mod canaries;
mod choose;
mod curve;
mod doctor;
mod encoders;
mod evaluate;
mod exit;
mod language;
mod lint;
mod metrics;
mod motions;
mod number;
mod output;
mod prepare;
mod progress;
mod regress;
mod residuals;
mod resolve;
mod retarget;
mod sim;
mod summary;
mod tables;
mod train;
mod translate;
mod urdf;
mod view;

pub use exit::Exit;

use std::process::ExitCode;

use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};

const EXIT_CODES: &str = "\
Exit codes:
  0  clean
  1  the run failed, or a case did: a rollout ended non-finite or quarantined, or a result could not be written
  2  wrong usage, or a dataset, baseline or results file that cannot be read, or no input that can be used
  3  finished, but some inputs were skipped
  4  regression
When several apply: 2, then 1, then 4, then 3. A fall and a bad score are results, not failures.";

/// Drives a simulated humanoid with recorded or generated motions and scores how physically plausible they are.
///
/// Without arguments it runs the bundled suite and writes everything to results/bundled-NNN.
#[derive(Debug, Parser)]
#[command(name = "eval-sim", version)]
struct EvalSim {
    #[command(flatten)]
    sim: sim::SimArgs,
}

/// Evaluation of language <-> whole-body motion models with a simulator in the loop.
#[derive(Debug, Parser)]
#[command(name = "rprae", version)]
struct Rprae {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run motions through the simulator and score them; the same as eval-sim
    Sim(Box<sim::SimArgs>),
    /// Train a model that translates between descriptions and motions
    Train(Box<train::TrainArgs>),
    /// Turn sentences into motions and motions into sentences
    Translate(Box<translate::TranslateArgs>),
    /// Train and score a grid of models, and print the tables of the paper beside its numbers
    Tables(Box<tables::TablesArgs>),
    /// Turn motions, captions and word vectors into the folder that training reads
    Prepare(Box<prepare::PrepareArgs>),
    /// Check motions in milliseconds: units, axes, limits, jumps, sides, floor
    Lint(lint::LintArgs),
    /// Make motions of the humanoid from motion capture: BVH, ASF/AMC, joint positions
    Retarget(retarget::RetargetArgs),
    /// Run motions under one condition made harder and harder: less assist, pushes, friction, mass, latency
    Curve(Box<curve::CurveArgs>),
    /// Compare a run with an accepted one; exit code 4 on a regression
    Regress(regress::RegressArgs),
    /// Score sentences against reference sentences: BLEU, ROUGE-L, CIDEr, BERTScore, sentence cosine
    Evaluate(Box<evaluate::EvaluateArgs>),
    /// Say how to get sentence encoders, or check the folder of one
    Encoders(encoders::EncodersArgs),
    /// Print the commands that open the recordings of a run
    View(view::ViewArgs),
    /// Write the URDF of the humanoid for a height and mass
    Urdf(urdf::UrdfArgs),
    /// Examine this machine and build: versions, memory, graphics adapters, and whether they compute the same
    Doctor(doctor::DoctorArgs),
    /// List the metrics, or explain one, or print all of one name side by side for motions
    Metrics(metrics::MetricsArgs),
    /// Print the distribution of what inverse dynamics cannot explain in a run, with reasons for the worst motions
    Residuals(residuals::ResidualsArgs),
    /// Put faults into clean motions and see which metric sees which; exit code 1 when a required answer is missing
    Canaries(canaries::CanariesArgs),
}

/// Runs `eval-sim` with the arguments of the process.
#[must_use]
pub fn eval_sim() -> ExitCode {
    let EvalSim { sim } = parse();
    finish(sim::run(&sim))
}

/// Runs `rprae` with the arguments of the process.
#[must_use]
pub fn rprae() -> ExitCode {
    let Rprae { verb } = parse();
    finish(match verb {
        Verb::Sim(args) => sim::run(&args),
        Verb::Train(args) => train::run(&args),
        Verb::Translate(args) => translate::run(&args),
        Verb::Tables(args) => tables::run(&args),
        Verb::Doctor(args) => doctor::run(&args),
        Verb::Prepare(args) => prepare::run(&args),
        Verb::Lint(args) => lint::run(&args),
        Verb::Retarget(args) => retarget::run(&args),
        Verb::Curve(args) => curve::run(&args),
        Verb::Regress(args) => regress::run(&args),
        Verb::Evaluate(args) => evaluate::run(&args),
        Verb::Encoders(args) => encoders::run(&args),
        Verb::View(args) => view::run(&args),
        Verb::Urdf(args) => urdf::run(&args),
        Verb::Metrics(args) => metrics::run(&args),
        Verb::Residuals(args) => residuals::run(&args),
        Verb::Canaries(args) => canaries::run(&args),
    })
}

/// The arguments of the process; help, or wrong usage, ends it here.
fn parse<T: CommandFactory + FromArgMatches>() -> T {
    let mut command = complete(T::command());
    let matches = command.get_matches_mut();
    T::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit())
}

/// What holds for every argument and subcommand alike.
///
/// - A negative number is a value, to be refused by its range, and not an unknown option.
/// - `--help` tells the exit codes, after what it has to tell besides.
fn complete(command: Command) -> Command {
    let own = command.get_after_help().map(|text| format!("{text}\n\n")).unwrap_or_default();
    command
        .after_long_help(format!("{own}{EXIT_CODES}"))
        .mut_args(|arg| if arg.get_action().takes_values() { arg.allow_negative_numbers(true) } else { arg })
        .mut_subcommands(complete)
}

fn finish(outcome: Result<Exit, exit::Failure>) -> ExitCode {
    let exit = outcome.unwrap_or_else(|failure| {
        eprintln!("error: failed to {}", exit::message(&failure.error));
        failure.exit
    });
    ExitCode::from(exit.code())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both programs and all subcommands.
    fn commands() -> Vec<Command> {
        let programs = [complete(EvalSim::command()), complete(Rprae::command())];
        let subcommands: Vec<Command> = programs.iter().flat_map(Command::get_subcommands).cloned().collect();
        programs.into_iter().chain(subcommands).collect()
    }

    #[test]
    fn the_command_lines_are_sound() {
        for command in commands() {
            command.debug_assert();
        }
    }

    #[test]
    fn help_is_plain_text_and_tells_every_exit_code() {
        for mut command in commands() {
            let help = command.render_long_help().to_string();
            assert!(!help.contains('`'), "{help}");
            for exit in [Exit::Clean, Exit::Failed, Exit::Usage, Exit::Skipped, Exit::Regressed] {
                assert!(help.contains(&format!("\n  {}  ", exit.code())), "{exit:?}: {help}");
            }
        }
    }

    #[test]
    fn a_negative_number_is_a_value_that_is_refused_by_its_range() {
        for (line, part) in [
            ("rprae sim --seed -1", "from 0 to 9223372036854775807"),
            ("rprae sim --limit -1", "at least 1"),
            ("rprae sim --threads -1", "-1 is not in 1..=1024"),
            ("rprae translate walk --n-best -2", "-2 is not in 1..=1000"),
            ("rprae train --out a --stage1-iterations -5", "at least 0"),
        ] {
            let refused = complete(Rprae::command()).try_get_matches_from(line.split(' ')).unwrap_err();
            assert!(refused.to_string().contains(part), "{refused}");
        }
        for line in [
            "rprae sim --mass -3 --dt -1/480 --assist-limit -20%",
            "rprae urdf --height -1",
            "rprae curve push --points -5,10",
        ] {
            complete(Rprae::command()).try_get_matches_from(line.split(' ')).unwrap();
        }
    }
}
