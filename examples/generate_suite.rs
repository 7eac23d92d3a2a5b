//! Writes the bundled suite: `cargo run --example generate_suite [FOLDER]`, by default into `assets`.

use std::path::PathBuf;

use anyhow::Context as _;
use rprae::synthesis::{suite, suite_files, suite_readme};

fn main() -> anyhow::Result<()> {
    let assets = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("assets"), PathBuf::from);
    let folder = assets.join("suite");
    std::fs::create_dir_all(&folder).with_context(|| format!("create {}", folder.display()))?;

    let suite = suite().context("make the suite")?;
    let files = suite_files(&suite);
    let readme = ("README.md".to_owned(), suite_readme(&suite, &files));
    let all = files.iter().map(|file| (&folder, file)).chain([(&assets, &readme)]);
    for (folder, (name, content)) in all {
        let path = folder.join(name);
        std::fs::write(&path, content).with_context(|| format!("write {}", path.display()))?;
    }
    eprintln!("wrote {} motions to {}", suite.len(), folder.display());
    Ok(())
}
