//! `rprae doctor --physics`: the self-test of the physics engine, number by number.

use anyhow::Context;
use clap::Args;

use super::super::exit::{Exit, Failure, OrExit};
use super::super::{number, output, resolve};
use crate::harness::SettingsProblem;
use crate::report::{Align, Column, Table};
use crate::simulation::{Check, JointForm, SimulationSettings, self_test};

#[derive(Debug, Args)]
pub(crate) struct PhysicsArgs {
    /// Length of a simulation step in seconds, also as a fraction [default: 1/480]
    #[arg(long, value_name = "SECONDS", value_parser = number::fraction)]
    pub dt: Option<f64>,
    /// How joints are represented: balls or multibody [default: balls]
    #[arg(long, value_name = "FORM", value_parser = resolve::joint_form)]
    pub joint_form: Option<JointForm>,
}

/// Runs every check anew and prints it; a failed one is exit code 1.
pub(crate) fn run(args: &PhysicsArgs) -> Result<Exit, Failure> {
    let default = SimulationSettings::default();
    let settings = SimulationSettings {
        dt_secs: args.dt.unwrap_or(default.dt_secs),
        joint_form: args.joint_form.unwrap_or(default.joint_form),
        ..default
    };
    settings.check().map_err(SettingsProblem::from).or_usage()?;
    let checks = self_test(&settings).context("test the physics engine").or_failed()?;
    output::print(&table(&checks).render(output::table_width())).or_failed()?;
    Ok(if checks.iter().all(Check::passed) { Exit::Clean } else { Exit::Failed })
}

fn table(checks: &[Check]) -> Table {
    let column = |heading: &str, align, cell: &dyn Fn(&Check) -> String| Column {
        heading: vec![heading.to_owned()],
        align,
        min_width: None,
        cells: checks.iter().map(cell).collect(),
    };
    let number = |heading: &str, value: fn(&Check) -> f64| {
        column(heading, Align::Right, &|check| format!("{:.4}", value(check)))
    };
    let columns = vec![
        column("check", Align::Left, &|check| check.name.clone()),
        number("measured", |check| check.measured),
        number("expected", |check| check.expected),
        number("tolerance", |check| check.tolerance),
        column("unit", Align::Left, &|check| check.unit.clone()),
        column("", Align::Left, &|check| if check.passed() { "passed" } else { "FAILED" }.to_owned()),
        column("how", Align::Left, &|check| check.how.clone()),
    ];
    Table { columns }
}
