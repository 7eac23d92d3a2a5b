//! Options that would change nothing are refused: who gives one believes that it does.

use anyhow::bail;

use super::{Choose, TranslateArgs};

/// Refuses the first option that has no effect on what is asked for.
pub(super) fn check(args: &TranslateArgs) -> anyhow::Result<()> {
    let describes = args.motions.is_some();
    let makes = args.has_sentence() || args.captions.is_some();
    let draws = args.choose() == Choose::SampledConsensus;
    if args.length_norm.is_some() && args.choose() != Choose::Probable {
        bail!("use --length-norm: it is of the most probable sentence, and --choose asks for a consensus");
    }
    if describes {
        let of_made = [
            ("--length", args.length.is_some()),
            ("--length-of", args.length_of.is_some()),
            ("--settle", args.settle.is_some()),
            ("--round-trip", args.round_trip),
            ("--perform", args.perform),
            ("--vectors", args.vectors.is_some()),
            ("--noise", args.noise.is_some()),
            ("--seed", args.seed.is_some() && !draws),
            ("--out-rate", args.out_rate.is_some()),
        ];
        if let Some((flag, _)) = of_made.into_iter().find(|(_, is_given)| *is_given) {
            bail!("use {flag}: it is of motions that are made, and --motions describes some that are there");
        }
        return Ok(());
    }
    let performs = args.performs();
    let varied = args.noise.is_some() || args.seed.is_some() && !draws;
    if varied && args.n_best == 1 {
        let flag = if args.noise.is_some() { "--noise" } else { "--seed" };
        bail!("use {flag}: it acts from the second motion of a sentence on; ask for several with --n-best N");
    }
    if args.n_best > 1 && args.noise == Some(0.0) {
        bail!(
            "use --noise 0: all motions of --n-best would be the same; give more noise, or leave out --n-best"
        );
    }
    if !makes {
        // Lines may be sentences or motions.
        return Ok(());
    }
    let of_search = [
        ("--choose", args.choose.is_some()),
        ("--beam", args.beam.is_some()),
        ("--length-norm", args.length_norm.is_some()),
    ];
    let searched = of_search.into_iter().find(|(_, is_given)| *is_given);
    if let Some((flag, _)) = searched.filter(|_| !args.round_trip && !performs) {
        bail!("use {flag}: no sentence is looked for; --round-trip or --perform reads motions back");
    }
    if args.rate.is_some() && args.length_of.is_none() {
        bail!("use --rate: no number table is read; it is of --motions, or of --length-of");
    }
    if args.out_rate.is_some() && args.out.is_empty() && !performs {
        bail!("use --out-rate: no motion is written or performed; give --out or --perform");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(change: impl FnOnce(&mut TranslateArgs)) -> Option<String> {
        let mut args = TranslateArgs { n_best: 1, ..TranslateArgs::default() };
        change(&mut args);
        check(&args).err().map(|error| error.to_string())
    }

    #[test]
    fn options_without_effect_are_named() {
        type Change = fn(&mut TranslateArgs);
        let bad: [(&str, Change); 12] = [
            ("--perform", |args| (args.motions, args.perform) = (Some("a".into()), true)),
            ("--round-trip", |args| (args.motions, args.round_trip) = (Some("a".into()), true)),
            ("--length", |args| (args.motions, args.length) = (Some("a".into()), Some(2.0))),
            ("--vectors", |args| (args.motions, args.vectors) = (Some("a".into()), Some("v".into()))),
            ("--noise", |args| (args.sentence, args.noise) = (Some("walk".to_owned()), Some(0.5))),
            ("--noise 0", |args| {
                (args.sentence, args.noise, args.n_best) = (Some("walk".to_owned()), Some(0.0), 2);
            }),
            ("--beam", |args| (args.captions, args.beam) = (Some("a.txt".into()), Some(3))),
            ("--choose", |args| {
                (args.captions, args.choose) = (Some("a.txt".into()), Some(Choose::Consensus));
            }),
            ("--length-norm", |args| (args.choose, args.length_norm) = (Some(Choose::Consensus), Some(0.5))),
            ("--seed", |args| (args.motions, args.seed) = (Some("a".into()), Some(1))),
            ("--rate", |args| (args.sentence, args.rate) = (Some("walk".to_owned()), Some(20.0))),
            ("--out-rate", |args| (args.sentence, args.out_rate) = (Some("walk".to_owned()), Some(50.0))),
        ];
        for (flag, change) in bad {
            let message = refused(change);
            assert!(message.as_ref().is_some_and(|message| message.contains(flag)), "{flag}: {message:?}");
        }
    }

    #[test]
    fn options_with_effect_pass() {
        let passes = |change: fn(&mut TranslateArgs)| assert_eq!(refused(change), None);
        passes(|args| (args.motions, args.beam, args.n_best) = (Some("a".into()), Some(3), 4));
        passes(|args| {
            (args.motions, args.seed) = (Some("a".into()), Some(1));
            args.choose = Some(Choose::SampledConsensus);
        });
        passes(|args| (args.sentence, args.seed, args.n_best) = (Some("walk".to_owned()), Some(7), 2));
        passes(|args| {
            (args.sentence, args.beam) = (Some("walk".to_owned()), Some(1));
            args.out = vec!["walk.mcap".into()];
        });
        passes(|args| {
            (args.sentence, args.rate) = (Some("walk".to_owned()), Some(20.0));
            args.length_of = Some("a.npy".into());
        });
        // What comes line by line may be both.
        passes(|args| (args.beam, args.settle, args.vectors) = (Some(3), Some(0.2), Some("v".into())));
    }
}
