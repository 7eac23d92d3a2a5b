//! Loading a whole archive: from its XML, while the cache is built, and from the cache.
//!
//! `cargo bench --bench archive` writes a zip in the layout of KIT-ML with 3,911 synthetic motions of six-digit numbers at
//! 100 Hz, as long as the motions of `$RPRAE_DATA/kit-ml/captions/kitml-index.tsv`, or drawn from the same range where that
//! is not set or silent. It takes about 3 GB of disk in the system's folder for temporary files.
//! `RPRAE_ARCHIVE_MOTIONS=N` makes a smaller one.

use std::error::Error;
use std::io::{Cursor, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use rayon::prelude::*;
use rprae::dataset::mmm::write_mmm;
use rprae::dataset::{Dataset, OpenOptions};
use rprae::manifest::sha256_hex;
use rprae::motion::{Body, Frame, Motion, NUM_CHANNELS};
use zip::write::SimpleFileOptions;

const NUM_MOTIONS: usize = 3911;
const RATE_HZ: f64 = 100.0;
/// Loads from the cache; the printed time is the median, beside the first and the slowest.
const ROUNDS: usize = 5;
/// Motions written to the zip at once.
const CHUNK: usize = 64;

fn main() -> Result<(), Box<dyn Error>> {
    let num_motions = match std::env::var("RPRAE_ARCHIVE_MOTIONS") {
        Ok(number) => number.parse()?,
        Err(_) => NUM_MOTIONS,
    };
    let durations = durations_secs(num_motions)?;
    let folder = tempfile::tempdir()?;
    let archive = folder.path().join("kit.zip");
    let xml_bytes = write_archive(&archive, &durations)?;
    println!(
        "{num_motions} motions, {:.2} h at {RATE_HZ} Hz, {:.2} GB of XML in a zip of {:.2} GB, {} threads",
        durations.iter().sum::<f64>() / 3600.0,
        xml_bytes as f64 / 1e9,
        std::fs::metadata(&archive)?.len() as f64 / 1e9,
        rayon::current_num_threads()
    );

    let caches = folder.path().join("caches");
    let options = OpenOptions::default();
    let open = || Dataset::open(&archive, &options);
    let (secs, frames) = timed(|| Ok(load_all(&open()?)))?;
    println!("XML, no cache              {secs:8.2} s  {:7.0} MB/s of XML", xml_bytes as f64 / 1e6 / secs);
    let (secs, _) = timed(|| Ok(open()?.cached(&archive, &caches, &|_, _| {})))?;
    let cache_bytes: u64 =
        std::fs::read_dir(&caches)?.map(|e| Ok(e?.metadata()?.len())).sum::<std::io::Result<u64>>()?;
    println!("building the cache         {secs:8.2} s  {:.2} GB", cache_bytes as f64 / 1e9);
    let mut rounds = Vec::new();
    for _ in 0..ROUNDS {
        let (secs, (from_cache, notes)) = timed(|| {
            let (dataset, notes) = open()?.cached(&archive, &caches, &|_, _| {});
            Ok((load_all(&dataset), notes))
        })?;
        if from_cache != frames || !notes.is_empty() {
            return Err(format!("{from_cache} frames from the cache, {frames} from XML; {notes:?}").into());
        }
        rounds.push(secs);
    }
    let first = rounds[0];
    rounds.sort_by(f64::total_cmp);
    println!(
        "opening and loading cached {:8.2} s  (first {first:.2}, slowest {:.2}); {frames} frames",
        rounds[ROUNDS / 2],
        rounds[ROUNDS - 1]
    );
    Ok(())
}

fn timed<T>(work: impl FnOnce() -> Result<T, Box<dyn Error>>) -> Result<(f64, T), Box<dyn Error>> {
    let start = Instant::now();
    let result = work()?;
    Ok((start.elapsed().as_secs_f64(), result))
}

/// Loads every motion on all threads, one after another each, as a preparation does; the number of frames.
fn load_all(dataset: &Dataset) -> usize {
    let num_frames = AtomicUsize::new(0);
    dataset.entries().par_iter().for_each(|entry| match dataset.load(entry) {
        Ok(sample) => {
            num_frames.fetch_add(std::hint::black_box(sample).motion.num_frames(), Ordering::Relaxed);
        }
        Err(skipped) => println!("{}: {}", skipped.id, skipped.reason),
    });
    num_frames.into_inner()
}

/// Durations of the listed motions; where one is missing, that of another, drawn by its number.
fn durations_secs(num_motions: usize) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut listed = vec![None; num_motions];
    if let Some(data) = std::env::var_os("RPRAE_DATA") {
        let table = std::fs::read_to_string(Path::new(&data).join("kit-ml/captions/kitml-index.tsv"))?;
        let mut lines = table.lines();
        let header = lines.next().ok_or("the index is empty")?;
        let column =
            header.split('\t').position(|name| name == "duration_s").ok_or("the index has no durations")?;
        for (slot, line) in listed.iter_mut().zip(lines) {
            *slot = line.split('\t').nth(column).and_then(|text| text.parse::<f64>().ok());
        }
    }
    let known: Vec<f64> = listed.iter().flatten().copied().collect();
    println!("{} of {num_motions} durations are listed, the others drawn", known.len());
    Ok(listed
        .iter()
        .enumerate()
        .map(|(number, duration)| duration.unwrap_or_else(|| drawn(number, &known)))
        .collect())
}

fn drawn(number: usize, known: &[f64]) -> f64 {
    let digest = sha256_hex(format!("duration {number}").as_bytes());
    let draw = usize::from_str_radix(&digest[..8], 16).unwrap_or(number);
    // Without a list: 1 to 19.7 s, the mean of KIT-ML.
    known.get(draw % known.len().max(1)).copied().unwrap_or(1.0 + (draw % 1870) as f64 * 0.01)
}

/// Returns the size of the XML.
fn write_archive(path: &Path, durations_secs: &[f64]) -> Result<u64, Box<dyn Error>> {
    let mut zip = zip::ZipWriter::new(std::io::BufWriter::new(std::fs::File::create(path)?));
    let options = SimpleFileOptions::default().compression_level(Some(1));
    let mut xml_bytes = 0;
    let numbered: Vec<(usize, f64)> = durations_secs.iter().copied().enumerate().collect();
    for chunk in numbered.chunks(CHUNK) {
        // Each motion is packed by itself on its own thread and copied as it is.
        let packed: Vec<Result<(u64, Vec<u8>), String>> = chunk
            .par_iter()
            .map(|(number, duration)| {
                let xml = xml_of(*number, *duration).map_err(|error| error.to_string())?;
                let mut small = zip::ZipWriter::new(Cursor::new(Vec::new()));
                let mut add = |name: String, bytes: &[u8]| -> Result<(), Box<dyn Error>> {
                    small.start_file(name, options)?;
                    Ok(small.write_all(bytes)?)
                };
                let id = number + 1;
                add(format!("{id:05}_mmm.xml"), xml.as_bytes())
                    .and_then(|()| add(format!("{id:05}_annotations.json"), b"[\"a person moves\"]"))
                    .map_err(|error| error.to_string())?;
                let bytes = small.finish().map_err(|error| error.to_string())?.into_inner();
                Ok((xml.len() as u64, bytes))
            })
            .collect();
        for packed in packed {
            let (size, bytes) = packed?;
            xml_bytes += size;
            zip.merge_archive(zip::ZipArchive::new(Cursor::new(bytes))?)?;
        }
    }
    zip.finish()?;
    Ok(xml_bytes)
}

/// A motion whose numbers have six digits, as those of KIT do.
fn xml_of(number: usize, duration_secs: f64) -> Result<String, Box<dyn Error>> {
    let num_frames = (duration_secs * RATE_HZ) as usize + 2;
    let six_digits = |value: f64| -> f64 {
        let scale = 10_f64.powi(5 - value.abs().max(1e-9).log10().floor() as i32);
        (value * scale).round() / scale
    };
    let frames = (0..num_frames).map(|index| {
        let time = index as f64 / RATE_HZ;
        let mut channels = [0.0; NUM_CHANNELS];
        for (channel, value) in channels.iter_mut().enumerate() {
            let phase = number as f64 + 1.7 * channel as f64;
            *value = six_digits(0.3 * (2.1 * time + phase).sin() + 0.05 * (11.3 * time + phase).sin());
        }
        for position in &mut channels[44..47] {
            *position = six_digits(1e3 * *position) * 1e-3;
        }
        Frame::from_channels(&channels)
    });
    let motion = Motion::new(Body::with_default_mass(1.75), RATE_HZ, frames.collect())?;
    Ok(write_mmm(&motion, "synthetic"))
}
