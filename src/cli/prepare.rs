//! `rprae prepare`: sources of motions and captions to the folder that training reads.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;

use super::exit::{Exit, Failure, OrExit};
use super::progress::Counter;
use super::{number, output};
use crate::dataset::{Dataset, OpenOptions, default_cache_folder};
use crate::features::prepare::{
    CaptionSource, MotionSource, PrepareError, PrepareSettings, SplitLists, Step, prepare,
};
use crate::features::{PreparedError, SET_FILE};
use crate::manifest::write_file;
use crate::report::shorten;

/// Smallest dataset that is cached without being asked; a smaller one is read faster than it is explained.
const MIN_CACHED_MOTIONS: usize = 100;

/// Skipped inputs and warnings shown; the manifest has all.
const MAX_SHOWN: usize = 10;

/// Arguments of a preparation. What is not given comes from `--config`, and from the paper where that is silent.
#[derive(Debug, Default, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag")]
pub(super) struct PrepareArgs {
    /// Motions: a folder or zip in the KIT-ML layout, a manifest or a file; may be given several times
    #[arg(long, value_name = "PATH")]
    pub motions: Vec<PathBuf>,
    /// Captions apart from motions (.jsonl, .tsv, .json, .txt, each also .gz, or a folder or zip); they join the motions
    /// of their ids, the rest is learned from without motions; may be given several times
    #[arg(long, value_name = "PATH")]
    pub captions: Vec<PathBuf>,
    /// Pretrained word vectors: word2vec .bin, GloVe or fastText text, also .gz
    #[arg(long, value_name = "FILE")]
    pub vectors: Option<PathBuf>,
    /// Folder to write
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Settings file (TOML) with [[motions]] and [[captions]] sources; flags override or add to it, unknown keys are
    /// refused
    #[arg(long, value_name = "TOML")]
    pub config: Option<PathBuf>,
    /// Seed of the split and of the draws [default: 0]
    #[arg(long, value_name = "N", value_parser = number::seed)]
    pub seed: Option<u64>,
    /// Pairs for stage 2, drawn from those of stage 1 [default: all]
    #[arg(long, value_name = "N", value_parser = number::whole)]
    pub paired: Option<usize>,
    /// Pairs that stage 1 sees, unpaired [default: all of the training split]
    #[arg(long, value_name = "N", value_parser = number::whole)]
    pub non_paired: Option<usize>,
    /// File of the motion ids to learn from, one a line, instead of a split by seed
    #[arg(long, value_name = "FILE", requires_all = ["split_validation", "split_test"])]
    pub split_train: Option<PathBuf>,
    /// File of the motion ids to validate with
    #[arg(long, value_name = "FILE", requires = "split_train")]
    pub split_validation: Option<PathBuf>,
    /// File of the motion ids to test with
    #[arg(long, value_name = "FILE", requires = "split_train")]
    pub split_test: Option<PathBuf>,
    /// Keep captions with words that have no pretrained vector; theirs are trained
    #[arg(long)]
    pub keep_all_captions: bool,
    /// Leave motions without captions and captions without motions out, as the paper does
    #[arg(long)]
    pub no_extras: bool,
    /// Folder for the motion cache [default: rprae in the user's cache folder, for 100 motions or more]
    #[arg(long, value_name = "DIR", conflicts_with = "no_cache")]
    pub cache: Option<PathBuf>,
    /// Read every motion from its source
    #[arg(long)]
    pub no_cache: bool,
    /// Replace the set that --out holds
    #[arg(long)]
    pub overwrite: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

pub(super) fn run(args: &PrepareArgs) -> Result<Exit, Failure> {
    let settings = settings(args)?;
    if args.out.join(SET_FILE).exists() && !args.overwrite {
        let reason = "it holds a prepared set already; choose another folder or pass --overwrite";
        return Err(anyhow!("write {}: {reason}", args.out.display())).or_usage();
    }

    let counter = Counter::new(args.quiet);
    let open = |source: &MotionSource, options: &OpenOptions| open(args, &counter, source, options);
    let prepared = prepare(&settings, &open, &|step| match step {
        Step::Motions { source, done, total } => counter.show(&format!("reading {source}"), done, total),
        Step::Vectors { share } => counter.show("reading word vectors", (100.0 * share) as usize, 100),
    });
    counter.finish();
    let (set, account) = prepared.or_usage()?;

    let saved = set.save(&args.out).map_err(PrepareError::from);
    match saved {
        Err(error @ PrepareError::Set(PreparedError::Unsound(_))) => return Err(error).or_failed(),
        other => other.or_failed()?,
    }
    let text = account.text();
    account.save(&args.out).or_failed()?;
    write_file(&args.out.join("report.txt"), text.as_bytes()).or_failed()?;
    if !args.quiet {
        for skipped in account.skipped.iter().take(MAX_SHOWN) {
            eprintln!("skipped {}: {}", shorten(&skipped.source, 80), shorten(&skipped.reason, 400));
        }
        for warning in account.warnings.iter().take(MAX_SHOWN) {
            eprintln!("note: {}", shorten(warning, 400));
        }
        let more = account.skipped.len().saturating_sub(MAX_SHOWN)
            + account.warnings.len().saturating_sub(MAX_SHOWN);
        if more > 0 {
            eprintln!("{more} more in {}", args.out.join("manifest.json").display());
        }
        output::print(&format!("{text}Written: {}\n", args.out.display())).or_failed()?;
    }
    Ok(if account.skipped.is_empty() { Exit::Clean } else { Exit::Skipped })
}

/// Defaults, then the settings file, then flags.
fn settings(args: &PrepareArgs) -> Result<PrepareSettings, Failure> {
    let mut settings = match &args.config {
        Some(path) => PrepareSettings::read(path).or_usage()?,
        None => PrepareSettings::default(),
    };
    let motions =
        args.motions.iter().map(|path| MotionSource { path: path.clone(), ..MotionSource::default() });
    settings.motions.extend(motions);
    let captions = args.captions.iter().map(|path| CaptionSource { path: path.clone(), motions: None });
    settings.captions.extend(captions);
    settings.vectors = args.vectors.clone().or(settings.vectors);
    settings.seed = args.seed.unwrap_or(settings.seed);
    settings.paired = args.paired.or(settings.paired);
    settings.non_paired = args.non_paired.or(settings.non_paired);
    settings.keep_all_captions |= args.keep_all_captions;
    settings.extras &= !args.no_extras;
    if args.split_train.is_some() {
        settings.split = SplitLists {
            train: args.split_train.clone(),
            validation: args.split_validation.clone(),
            test: args.split_test.clone(),
        };
    }
    settings.check().or_usage()?;
    Ok(settings)
}

fn open(
    args: &PrepareArgs,
    counter: &Counter,
    source: &MotionSource,
    options: &OpenOptions,
) -> Result<(Dataset, Vec<String>), PrepareError> {
    let dataset = Dataset::open(&source.path, options)?;
    let Some(folder) = cache_folder(args, dataset.entries().len()) else { return Ok((dataset, Vec::new())) };
    let name = source.path.display().to_string();
    Ok(dataset.cached(&source.path, &folder, &|done, total| {
        counter.show(&format!("caching {name}"), done, total);
    }))
}

fn cache_folder(args: &PrepareArgs, num_motions: usize) -> Option<PathBuf> {
    match &args.cache {
        _ if args.no_cache => None,
        Some(folder) => Some(folder.clone()),
        None if num_motions >= MIN_CACHED_MOTIONS => default_cache_folder(),
        None => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn flags_add_to_the_file_and_override_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("prepare.toml");
        let text = "seed = 3\npaired = 7\nextras = true\n[tokens]\npunctuation = false\n[[motions]]\npath = \"kit.zip\"\nname = \"kit\"\n";
        std::fs::write(&path, text).unwrap();
        let args = PrepareArgs {
            config: Some(path.clone()),
            motions: vec!["cmu".into()],
            captions: vec!["more.txt".into()],
            paired: Some(5),
            no_extras: true,
            ..PrepareArgs::default()
        };
        let settings = settings(&args).map_err(|failure| failure.error).unwrap();
        assert_eq!((settings.seed, settings.paired, settings.extras), (3, Some(5), false));
        assert_eq!(settings.source_names(), ["kit", "cmu"]);
        assert!(!settings.tokens.punctuation && settings.tokens.lower_case);

        let refused = |text: &str| {
            std::fs::write(&path, text).unwrap();
            let args = PrepareArgs { config: Some(path.clone()), ..PrepareArgs::default() };
            super::settings(&args).unwrap_err().error.to_string()
        };
        assert!(refused("sede = 3").contains("line 1"));
        assert!(refused("seed = 3").contains("no source of motions or captions"));
        let twice = "[[motions]]\npath = \"a/x\"\n[[motions]]\npath = \"b/x\"";
        assert!(refused(twice).contains("two sources are called \"x\""));
        assert!(refused("rate_hz = 0\n[[motions]]\npath = \"x\"").contains("rate_hz"));
        assert!(refused("[[captions]]\npath = \"x\"\nmotions = \"y\"").contains("\"y\""));
    }

    #[test]
    fn small_datasets_are_cached_only_when_asked() {
        let args = PrepareArgs::default();
        assert_eq!(cache_folder(&args, 7), None);
        assert_eq!(cache_folder(&args, 100), default_cache_folder());
        let asked = PrepareArgs { cache: Some("here".into()), ..PrepareArgs::default() };
        assert_eq!(cache_folder(&asked, 7).as_deref(), Some(Path::new("here")));
        assert_eq!(cache_folder(&PrepareArgs { no_cache: true, ..PrepareArgs::default() }, 7000), None);
    }
}
