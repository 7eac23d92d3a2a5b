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

use clap::{Parser, Subcommand};

const EXIT_CODES: &str = "\
Exit codes:
  0  clean
  1  the run failed, or a case did: a rollout ended non-finite or quarantined, or a result could not be written
  2  wrong usage, or a dataset, baseline or results file that cannot be read
  3  finished, but inputs were skipped
  4  regression
When several apply: 2, then 1, then 4, then 3. A fall and a bad score are results, not failures.";

/// Drives a simulated humanoid with recorded or generated motions and scores how physically plausible they are.
///
/// Without arguments it runs the bundled suite and writes everything to results/bundled-NNN.
#[derive(Debug, Parser)]
#[command(name = "eval-sim", version, after_help = EXIT_CODES)]
struct EvalSim {
    #[command(flatten)]
    sim: sim::SimArgs,
}

/// Evaluation of language <-> whole-body motion models with a simulator in the loop.
#[derive(Debug, Parser)]
#[command(name = "rprae", version, after_help = EXIT_CODES)]
struct Rprae {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run motions through the simulator and score them; the same as `eval-sim`
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
    let EvalSim { sim } = EvalSim::parse();
    finish(sim::run(&sim))
}

/// Runs `rprae` with the arguments of the process.
#[must_use]
pub fn rprae() -> ExitCode {
    let Rprae { verb } = Rprae::parse();
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

fn finish(outcome: Result<Exit, exit::Failure>) -> ExitCode {
    let exit = outcome.unwrap_or_else(|failure| {
        eprintln!("error: failed to {}", message(&failure.error));
        failure.exit
    });
    ExitCode::from(exit.code())
}

/// An error with its causes, leaving out a cause that the text before it already ends with.
fn message(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1) {
        let cause = cause.to_string();
        if !text.ends_with(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_lines_are_sound() {
        EvalSim::command().debug_assert();
        Rprae::command().debug_assert();
    }

    #[test]
    fn causes_are_told_once() {
        let error =
            anyhow::anyhow!("no such file").context("read a.xml: no such file").context("open the suite");
        assert_eq!(message(&error), "open the suite: read a.xml: no such file");
    }

    #[test]
    fn help_tells_every_exit_code() {
        let mut help = Vec::new();
        EvalSim::command().write_long_help(&mut help).unwrap();
        let help = String::from_utf8(help).unwrap();
        for exit in [Exit::Clean, Exit::Failed, Exit::Usage, Exit::Skipped, Exit::Regressed] {
            assert!(help.contains(&format!("\n  {}  ", exit.code())), "{exit:?}");
        }
    }
}
