//! The shape of the source: who may import whom, and how long files may be.
//!
//! Data flows down the ranks only, so a module can be read and tested with nothing above it in mind.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::fs;
use std::path::{Path, PathBuf};

/// Top-level modules by rank; a module imports lower ranks only, never its own rank or above.
const RANKS: [&[&str]; 15] = [
    &["motion", "manifest", "mocap"],
    &["kinematics"],
    &["robot"],
    &["humanoid"],
    &["dynamics", "retarget"],
    &["dataset"],
    &["synthesis", "features", "lint"],
    &["simulation", "model"],
    &["plausibility", "training"],
    &["canaries", "translation", "recording", "report"],
    &["evaluation"],
    &["harness"],
    &["experiments"],
    &["cli"],
    &["bin"],
];

const MAX_BINARY_LINES: usize = 40;
const MAX_LINES: usize = 600;

fn rank(module: &str) -> Option<usize> {
    RANKS.iter().position(|modules| modules.contains(&module))
}

/// A source file: its path below `src`, its top-level module, and its text.
struct Source {
    path: String,
    module: String,
    text: String,
}

impl Source {
    /// Code without comments and without unit tests, which may import anything.
    ///
    /// A test module is taken to run from its `#[cfg(test)]` to the end of the item, as rustfmt lays it out.
    fn code(&self) -> String {
        let mut code = String::new();
        let mut lines = self.text.lines();
        while let Some(line) = lines.next() {
            if line.trim() == "#[cfg(test)]" {
                let indent = line.len() - line.trim_start().len();
                for skipped in lines.by_ref() {
                    let same_depth = skipped.len() - skipped.trim_start().len() == indent;
                    let ends = skipped.trim_end();
                    if same_depth && (ends.trim_start().starts_with('}') || ends.ends_with(';')) {
                        break;
                    }
                }
                continue;
            }
            if !line.trim_start().starts_with("//") {
                code.push_str(line);
                code.push('\n');
            }
        }
        code
    }
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    collect(&root, &mut files);
    files.sort();
    files
        .into_iter()
        .map(|file| {
            let path = file.strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/");
            let module = path.split(['/', '.']).next().unwrap().to_owned();
            Source { path, module, text: fs::read_to_string(&file).unwrap() }
        })
        .collect()
}

/// Names of the top-level modules that follow `prefix` in some code, braces included: `crate::{a, b::c}`.
fn imported(code: &str, prefix: &str) -> Vec<String> {
    let mut names = Vec::new();
    for (start, _) in code.match_indices(prefix) {
        let before = code[..start].chars().next_back();
        if before.is_some_and(|symbol| symbol.is_alphanumeric() || symbol == '_') {
            continue;
        }
        let rest = &code[start + prefix.len()..];
        let Some(group) = rest.strip_prefix('{') else {
            names.push(identifier(rest));
            continue;
        };
        // Split the group at the commas of its own depth.
        let (mut depth, mut at_start) = (0, true);
        for (index, symbol) in group.char_indices() {
            match symbol {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => at_start = true,
                _ if symbol.is_whitespace() => {}
                _ if at_start && depth == 0 => {
                    names.push(identifier(&group[index..]));
                    at_start = false;
                }
                _ => {}
            }
        }
    }
    names
}

fn identifier(text: &str) -> String {
    text.chars().take_while(|symbol| symbol.is_alphanumeric() || *symbol == '_').collect()
}

/// Everything that `source` imports and should not.
fn violations(source: &Source) -> Vec<String> {
    if source.module == "lib" {
        return Vec::new();
    }
    let Some(own) = rank(&source.module) else {
        return vec![format!("{}: the module {} has no rank", source.path, source.module)];
    };
    let prefix = if source.module == "bin" { "rprae::" } else { "crate::" };
    imported(&source.code(), prefix)
        .into_iter()
        .filter(|module| *module != source.module)
        .filter_map(|module| match rank(&module) {
            None => Some(format!("{}: {module} has no rank", source.path)),
            Some(other) if other >= own => {
                Some(format!("{}: rank {own} imports {module} of rank {other}", source.path))
            }
            Some(_) => None,
        })
        .collect()
}

#[test]
fn modules_import_lower_ranks_only() {
    let found: Vec<String> = sources().iter().flat_map(violations).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn an_upward_import_is_found() {
    let source = |module: &str, text: &str| Source {
        path: format!("{module}/mod.rs"),
        module: module.to_owned(),
        text: text.to_owned(),
    };
    let count = |module, text| violations(&source(module, text)).len();
    assert_eq!(count("motion", "use crate::dataset::Sample;"), 1);
    assert_eq!(count("dataset", "use crate::{\n    motion::Motion,\n    cli::{a, b},\n    report,\n};"), 2);
    assert_eq!(count("report", "fn f() { crate::recording::f() }"), 1);
    assert_eq!(count("report", "// crate::recording is beside us\nuse crate::plausibility::Metric;"), 0);
    let test_only = "#[cfg(test)]\nmod tests {\n    use crate::cli::x;\n}\nuse crate::harness::run;";
    assert_eq!(count("report", test_only), 1);
    assert_eq!(count("unheard_of", ""), 1);
    assert_eq!(count("bin", "fn main() { rprae::cli::eval_sim() }"), 0);
}

/// Files outside `module` whose code contains `word`.
fn users_of(word: &str, module: &str) -> Vec<String> {
    sources()
        .into_iter()
        .filter(|source| source.module != module && source.code().contains(word))
        .map(|source| source.path)
        .collect()
}

#[test]
fn the_engine_stays_inside_simulation() {
    assert_eq!(users_of("rapier3d", "simulation"), Vec::<String>::new());
}

#[test]
fn the_command_line_library_stays_inside_cli() {
    assert_eq!(users_of("clap::", "cli"), Vec::<String>::new());
}

#[test]
fn binaries_are_short() {
    for source in sources().iter().filter(|source| source.module == "bin") {
        let num_lines = source.text.lines().count();
        assert!(num_lines <= MAX_BINARY_LINES, "{} has {num_lines} lines", source.path);
    }
}

#[test]
fn long_files_say_why() {
    for source in sources() {
        let num_lines = source.text.lines().count();
        let defended = source.text.lines().any(|line| line.starts_with("// long: "));
        assert!(
            num_lines <= MAX_LINES || defended,
            "{} has {num_lines} lines and no `// long: reason`",
            source.path
        );
    }
}

#[test]
fn grab_bag_modules_do_not_exist() {
    for source in sources() {
        for name in ["utils", "helpers", "common", "manager", "core", "types"] {
            let is_named = source.path.split(['/', '.']).any(|part| part == name);
            assert!(!is_named, "{} says nothing about its content", source.path);
        }
    }
}
