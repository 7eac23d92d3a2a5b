//! Everything else: comparing runs, viewing recordings, explaining metrics.

fn main() -> std::process::ExitCode {
    rprae::cli::rprae()
}
