//! The main job: motions through the simulator, scored and recorded.

fn main() -> std::process::ExitCode {
    rprae::cli::eval_sim()
}
