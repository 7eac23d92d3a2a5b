//! `rprae doctor --device`: what computes here, and whether it computes the same as the processor.

use std::fmt::Write as _;

use super::super::exit::{Exit, Failure, OrExit};
use super::super::output;
use crate::manifest::VERSION;
use crate::model::{self, DeviceChoice, PARITY_TOLERANCE};

/// Version of the tensor library, as pinned in Cargo.toml.
const BURN: &str = "0.22.1";

/// Prints what there is; a device that computes something else is exit code 1.
pub(crate) fn run() -> Result<Exit, Failure> {
    let mut text =
        format!("rprae    {VERSION}, burn {BURN}, {} on {}\n", std::env::consts::ARCH, std::env::consts::OS);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    // Writing to a string cannot fail.
    let _ = writeln!(text, "threads  {threads} there, {} used", rayon::current_num_threads());
    let _ = writeln!(text, "memory   {}", memory().unwrap_or_else(|| "unknown".to_owned()));
    let (adapter, exit) = match model::adapter() {
        Err(reason) => (format!("none: {reason}"), Exit::Clean),
        Ok(adapter) => {
            let kind = if adapter.is_software {
                "software, never chosen by --device auto"
            } else {
                "graphics processor"
            };
            let (parity, exit) = parity();
            (format!("{}, {kind}\nparity   {parity}", adapter.name), exit)
        }
    };
    let _ = writeln!(text, "wgpu     {adapter}");
    let selected = model::select(DeviceChoice::Auto).or_failed()?;
    let _ = writeln!(text, "auto     {}", selected.name);
    output::print(&text).or_failed()?;
    Ok(exit)
}

/// The largest difference between wgpu and the processor, in words.
fn parity() -> (String, Exit) {
    let selected = match model::select(DeviceChoice::Wgpu) {
        Ok(selected) => selected,
        Err(error) => return (error.to_string(), Exit::Failed),
    };
    let found = model::parity(&selected.device);
    let count = found.len();
    match found.into_iter().next() {
        Some(worst) if worst.difference <= PARITY_TOLERANCE => (
            format!("{count} losses and gradients equal the processor's within {:.1e}", worst.difference),
            Exit::Clean,
        ),
        Some(worst) => {
            let message = format!(
                "FAILED: {} differs from the processor's by {:.1e} of its size, at most {PARITY_TOLERANCE:.0e} is \
                 rounding; train with --device cpu",
                worst.name, worst.difference
            );
            (message, Exit::Failed)
        }
        None => ("nothing was compared".to_owned(), Exit::Failed),
    }
}

/// Memory of the machine, where the system tells.
fn memory() -> Option<String> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let gib = |key: &str| -> Option<f64> {
        let line = text.lines().find(|line| line.starts_with(key))?;
        Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / f64::from(1 << 20))
    };
    Some(format!("{:.1} GiB, {:.1} GiB of it free", gib("MemTotal:")?, gib("MemAvailable:")?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_of_burn_is_the_pinned_one() {
        let manifest = include_str!("../../../Cargo.toml");
        assert!(manifest.contains(&format!("burn = {{ version = \"={BURN}\"")));
    }
}
