//! A training iteration of the action autoencoder at paper size, beside `PyTorch`.
//!
//! `cargo bench --bench recurrent` alternates both programs in one run and prints medians and their ratios.
//! Both sides do forward, mean squared error over valid frames, backward and a step of Adam on 80 motions of 50 channels: LSTM
//! 50 -> 500, linear 500 -> 500, three LSTM layers 50 -> 500 -> 500 -> 500, linear 500 -> 50 with tanh. Decoders hear the true frame
//! before (teacher forcing), or their own output (a closed loop). `PyTorch`'s fused layers can only do the former, and are
//! compared with ours that does; its loop of `LSTMCell` steps does the latter, and is compared with our closed loop.
//!
//! Two workloads: all motions 100 frames long, and lengths as in the KIT Motion-Language Dataset at 10 Hz, clipped to 10..=300.
//! The lengths come from `$RPRAE_DATA/kit-ml/captions/kitml-index.tsv`; without it from a log-normal distribution with the same
//! median (56 frames) and 90th percentile (115).
//! The peer runs under `$RPRAE_PEER_PYTHON` (default `python3`) with the packages of `benches/peers/requirements.txt`.
//! `RPRAE_BENCH_ROUNDS` and `RPRAE_BENCH_VARIANTS` (comma-separated) shorten a run.
//! With `RPRAE_BENCH_DEVICE=gpu` ours runs on the graphics adapter that wgpu prefers and counts its kernel launches, and `PyTorch`
//! runs on CUDA, or on the processor where there is none; memory is then that of the processes, not of the GPU.

#[cfg(feature = "wgpu")]
#[path = "beside/launches.rs"]
mod launches;
#[path = "beside/peer.rs"]
mod peer;

use std::error::Error;
use std::path::Path;
use std::process::Stdio;
use std::time::Instant;

use burn::module::{Module, Param};
use burn::optim::{GradientsParams, ModuleOptimizer};
use burn::tensor::{Device, Distribution, Tensor, TensorData};
use rprae::model::ops::{
    Activation, Direction, LstmState, LstmWeights, lstm_closed_loop, lstm_last_state, lstm_open_loop,
};
use rprae::model::{DeviceChoice, Selected, select};
use rprae::training::Adam;
use serde_json::{Value, json};

#[cfg(feature = "wgpu")]
use launches::launches;
use peer::{Peer, median, script};

const BATCH: usize = 80;
const CHANNELS: usize = 50;
const UNITS: usize = 500;
const THREADS: usize = 2;

/// Billions of floating-point operations of an iteration over this many frames: forward once, backward twice.
fn gflop(frames: usize) -> f64 {
    let layer = |feature: usize| 2 * (feature + UNITS) * 4 * UNITS;
    let frame = 2 * layer(CHANNELS) + 2 * layer(UNITS) + 2 * UNITS * CHANNELS;
    (3 * frames * frame) as f64 / 1e9
}

#[derive(Module, Debug)]
struct Lstm {
    input: Param<Tensor<2>>,
    recurrent: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

#[derive(Module, Debug)]
struct Actions {
    encoder: Lstm,
    latent: Param<Tensor<2>>,
    latent_bias: Param<Tensor<1>>,
    decoder: Vec<Lstm>,
    output: Param<Tensor<2>>,
    output_bias: Param<Tensor<1>>,
}

fn uniform<const D: usize>(shape: [usize; D], device: &Device) -> Param<Tensor<D>> {
    let bound = 1.0 / (UNITS as f64).sqrt();
    Param::from_tensor(Tensor::random(shape, Distribution::Uniform(-bound, bound), device))
}

impl Lstm {
    fn new(feature: usize, device: &Device) -> Self {
        Self {
            input: uniform([feature, 4 * UNITS], device),
            recurrent: uniform([UNITS, 4 * UNITS], device),
            bias: uniform([4 * UNITS], device),
        }
    }

    fn weights(&self) -> LstmWeights {
        LstmWeights { input: self.input.val(), recurrent: self.recurrent.val(), bias: self.bias.val() }
    }
}

impl Actions {
    fn new(device: &Device) -> Self {
        Self {
            encoder: Lstm::new(CHANNELS, device),
            latent: uniform([UNITS, UNITS], device),
            latent_bias: uniform([UNITS], device),
            decoder: [CHANNELS, UNITS, UNITS].map(|feature| Lstm::new(feature, device)).into(),
            output: uniform([UNITS, CHANNELS], device),
            output_bias: uniform([CHANNELS], device),
        }
    }

    /// The mean squared error of the frames a motion is rebuilt to, with a decoder that hears these frames, or itself.
    ///
    /// `targets` are the frames of `motions` without padding.
    fn loss(
        &self,
        motions: &Tensor<3>,
        heard: Option<&Tensor<3>>,
        targets: &Tensor<2>,
        lengths: &[usize],
    ) -> Tensor<1> {
        let last =
            lstm_last_state(motions.clone(), lengths, None, &self.encoder.weights(), Direction::Forward);
        let latent = last.hidden.matmul(self.latent.val()) + self.latent_bias.val().unsqueeze();
        let zeros = || Tensor::zeros([BATCH, UNITS], &motions.device());
        let mut initial = vec![LstmState { hidden: latent, cell: zeros() }];
        initial.extend((1..3).map(|_| LstmState { hidden: zeros(), cell: zeros() }));
        let layers: Vec<_> = self.decoder.iter().map(Lstm::weights).collect();
        let projection = (self.output.val(), self.output_bias.val());
        let said = if let Some(heard) = heard {
            lstm_open_loop(heard.clone(), lengths, initial, &layers, projection, Activation::Tanh)
        } else {
            let first = motions.clone().narrow(1, 0, 1).squeeze_dim(1);
            lstm_closed_loop(first, lengths, initial, &layers, projection)
        };
        (said - targets.clone()).square().mean()
    }
}

/// A process of `PyTorch`.
fn start_peer(on_gpu: bool) -> Result<Peer, Box<dyn Error>> {
    let mut command = script("training_pytorch.py");
    command.args(["--threads", &THREADS.to_string()]).stderr(Stdio::inherit());
    if on_gpu {
        command.arg("--gpu");
    }
    let (peer, ready) = Peer::start(&mut command)?;
    let ready: Value = serde_json::from_str(&ready)?;
    let text = |key: &str| ready[key].as_str().unwrap_or("?").to_owned();
    println!("peer: PyTorch {} on {}, {THREADS} threads", text("version"), text("device"));
    Ok(peer)
}

/// Where ours runs.
struct Place {
    device: Device,
    on_gpu: bool,
}

impl Place {
    fn from_env() -> Result<Self, Box<dyn Error>> {
        match std::env::var("RPRAE_BENCH_DEVICE").as_deref() {
            Ok("gpu") => {
                let Selected { device, name, .. } = select(DeviceChoice::Wgpu)?;
                println!("ours on {name}");
                Ok(Self { device, on_gpu: true })
            }
            Ok("cpu") | Err(_) => Ok(Self { device: Device::flex(), on_gpu: false }),
            Ok(other) => Err(format!("RPRAE_BENCH_DEVICE is {other}, neither cpu nor gpu").into()),
        }
    }

    /// Waits until everything that was asked of a GPU is done.
    fn wait(&self) -> Result<(), Box<dyn Error>> {
        if self.on_gpu {
            self.device.sync()?;
        }
        Ok(())
    }
}

/// Without a GPU none is launched.
#[cfg(not(feature = "wgpu"))]
fn launches<R>(work: impl FnOnce() -> R) -> (R, usize) {
    (work(), 0)
}

/// An answer of `PyTorch`.
fn ask(peer: &mut Peer, request: &Value) -> Result<Value, Box<dyn Error>> {
    Ok(serde_json::from_str(&peer.ask(&request.to_string())?)?)
}

/// Resident memory at its highest, MiB, as Linux tells it.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

/// Processor time of this process so far, seconds, as Linux tells it: unlike the time on the clock, it hardly grows when
/// other programs want the processors too.
fn cpu_secs() -> Option<f64> {
    const TICKS_PER_SEC: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name before the last bracket may hold spaces; user and system time are the 12th and 13th field after it.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / TICKS_PER_SEC)
}

/// What an iteration took.
#[derive(Default)]
struct Times {
    /// On the clock, seconds.
    wall: Vec<f64>,
    /// Of all processors together, seconds.
    cpu: Vec<f64>,
    /// Of our forward pass, backward pass and update, on the clock.
    parts: Vec<[f64; 3]>,
}

/// A program of the table, what its decoder hears and what it took.
struct Program<'a> {
    name: &'a str,
    hears_itself: bool,
    times: Times,
    /// Resident memory at its highest, MiB.
    peak: f64,
    /// Kernels launched on a GPU in the last iteration.
    launches: usize,
}

impl Program<'_> {
    fn hears(&self) -> &'static str {
        if self.hears_itself { "itself" } else { "true frames" }
    }
}

/// Lengths of captioned KIT motions, or of a distribution like theirs.
fn kit_lengths() -> Vec<usize> {
    let clip = |frames: f64| (frames.round() as usize).clamp(10, 300);
    let known = std::env::var("RPRAE_DATA").ok().and_then(|data| {
        let index = std::fs::read_to_string(Path::new(&data).join("kit-ml/captions/kitml-index.tsv")).ok()?;
        let durations: Vec<f64> = index
            .lines()
            .skip(1)
            .filter_map(|line| {
                let fields: Vec<&str> = line.split('\t').collect();
                (fields.get(4)?.parse::<usize>().ok()? > 0).then_some(())?;
                fields.get(5)?.parse().ok()
            })
            .collect();
        (durations.len() >= BATCH).then_some(durations)
    });
    // Every so many-th motion in the order of the golden ratio: spread over the whole list, and the same in every run.
    let place =
        |index: usize, count: usize| ((index as f64 * 0.618_033_988_75).fract() * count as f64) as usize;
    if let Some(durations) = known {
        println!("lengths: {BATCH} of {} captioned KIT motions", durations.len());
        (0..BATCH).map(|index| clip(durations[place(index, durations.len())] * 10.0)).collect()
    } else {
        println!("lengths: log-normal, since RPRAE_DATA has no kit-ml/captions/kitml-index.tsv");
        (0..BATCH)
            .map(|index| {
                let share = (index as f64 + 0.5) / BATCH as f64;
                // The logistic distribution stands in for the normal one: its quantiles have a closed form.
                clip(56.0 * ((share / (1.0 - share)).ln() * 0.327).exp())
            })
            .collect()
    }
}

/// Our matrix product: of the crate `gemm`, or of the GPU's backend.
fn own_matmul_gflops(size: usize, place: &Place) -> Result<f64, Box<dyn Error>> {
    let random = || Tensor::<2>::random([size, size], Distribution::Uniform(0.0, 1.0), &place.device);
    let (a, b) = (random(), random());
    let mut last = a.clone().matmul(b.clone());
    place.wait()?;
    let start = Instant::now();
    for _ in 0..3 {
        last = a.clone().matmul(b.clone());
    }
    place.wait()?;
    let secs = start.elapsed().as_secs_f64();
    drop(last.into_data());
    Ok(6.0 * (size as f64).powi(3) / secs / 1e9)
}

fn compare(name: &str, lengths: &[usize], rounds: usize, place: &Place) -> Result<(), Box<dyn Error>> {
    let frames: usize = lengths.iter().sum();
    let width = lengths.iter().copied().max().unwrap_or(0);
    let variants = std::env::var("RPRAE_BENCH_VARIANTS").unwrap_or_else(|_| {
        if lengths.iter().all(|&length| length == width) {
            "padded,loop"
        } else {
            "padded,packed,bucketed,loop"
        }
        .to_owned()
    });
    let variants: Vec<&str> = variants.split(',').collect();
    let device = place.device.clone().autodiff();
    let mut values = vec![0.0_f32; BATCH * width * CHANNELS];
    let mut valid = Vec::with_capacity(frames * CHANNELS);
    for (sequence, &length) in lengths.iter().enumerate() {
        for (place, value) in
            values[sequence * width * CHANNELS..][..length * CHANNELS].iter_mut().enumerate()
        {
            *value = ((place * (sequence + 7)) as f32 * 0.37).sin();
            valid.push(*value);
        }
    }
    let motions = Tensor::<3>::from_data(TensorData::new(values, [BATCH, width, CHANNELS]), &device);
    let targets = Tensor::<2>::from_data(TensorData::new(valid, [frames, CHANNELS]), &device);
    let mut model = Actions::new(&device);
    let mut optimiser = ModuleOptimizer::from(Adam::new(0.9, 0.999, 1e-8));
    // The frame before each one; the first one hears itself.
    let before = motions.clone().narrow(1, 0, width - 1);
    let before = Tensor::cat(vec![motions.clone().narrow(1, 0, 1), before], 1);
    let program =
        |name, hears_itself| Program { name, hears_itself, times: Times::default(), peak: 0.0, launches: 0 };
    let mut ours = [program("rprae", false), program("rprae", true)];
    // Each variant has a process of its own, as in a training run: what others left in its memory would change its time.
    let mut theirs = Vec::new();
    for &name in &variants {
        theirs.push((start_peer(place.on_gpu)?, program(name, name == "loop")));
    }
    let mut peaks: Vec<Vec<f64>> = vec![Vec::new(); 2];
    // The first round warms both sides up.
    for round in 0..=rounds {
        peaks[0].push(own_matmul_gflops(2000, place)?);
        for Program { hears_itself, times, launches: launched, .. } in &mut ours {
            let heard = (!*hears_itself).then_some(&before);
            let (start, cpu) = (Instant::now(), cpu_secs());
            let (result, count) = launches(|| -> Result<_, Box<dyn Error>> {
                let loss = model.loss(&motions, heard, &targets, lengths);
                place.wait()?;
                let forward = start.elapsed().as_secs_f64();
                let gradients = GradientsParams::from_grads(loss.backward(), &model);
                place.wait()?;
                let backward = start.elapsed().as_secs_f64();
                let model = optimiser.step(1e-3, model, gradients);
                place.wait()?;
                Ok((model, [forward, backward, start.elapsed().as_secs_f64()]))
            });
            let (updated, [forward, backward, all]) = result?;
            model = updated;
            *launched = count;
            if round > 0 {
                times.wall.push(all);
                times.cpu.extend(cpu_secs().zip(cpu).map(|(after, before)| after - before));
                times.parts.push([forward, backward - forward, all - backward]);
            }
        }
        for (index, (peer, Program { name, times, peak, .. })) in theirs.iter_mut().enumerate() {
            if index == 0 {
                let answer = ask(peer, &json!({"variant": "matmul", "size": 2000}))?;
                peaks[1].push(answer["gflops"].as_f64().ok_or("no speed")?);
            }
            let answer = ask(peer, &json!({"variant": name, "lengths": lengths, "width": width}))?;
            *peak = answer["peak_mib"].as_f64().ok_or("no memory")?;
            if round > 0 {
                times.wall.push(answer["secs"].as_f64().ok_or("no time")?);
                times.cpu.push(answer["cpu_secs"].as_f64().ok_or("no processor time")?);
            }
        }
    }
    for ours in &mut ours {
        ours.peak = peak_mib().unwrap_or(0.0);
    }
    println!(
        "\n{name}: {frames} frames, longest {width}, {:.1} GFLOP; matmul 2000^3: torch {:.0}, ours {:.0} GFLOP/s",
        gflop(frames),
        median(&mut peaks[1]),
        median(&mut peaks[0]),
    );
    println!(
        "| program | hears | s an iteration | useful GFLOP/s | ratio to ours that hears the same (lowest..highest) \
         | processor s | ratio | ratio to our closed loop | peak MiB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let own = ours.each_mut().map(|ours| (median(&mut ours.times.wall), median(&mut ours.times.cpu)));
    let (closed_loop, _) = own[1];
    let theirs = theirs.iter_mut().map(|(_, program)| program);
    for program in ours.iter_mut().chain(theirs) {
        let hears = program.hears();
        let Program { name, hears_itself, times, peak, .. } = program;
        let (time, cpu) = (median(&mut times.wall), median(&mut times.cpu));
        let (own, own_cpu) = own[usize::from(*hears_itself)];
        println!(
            "| {}{name} | {} | {time:.2} | {:.1} | {:.2} ({:.2}..{:.2}) | {cpu:.2} | {:.2} | {:.2} | {:.0} |",
            if *name == "rprae" { "" } else { "PyTorch " },
            hears,
            gflop(frames) / time,
            time / own,
            times.wall[0] / own,
            times.wall[times.wall.len() - 1] / own,
            cpu / own_cpu,
            time / closed_loop,
            peak,
        );
    }
    for program in &ours {
        let parts = &program.times.parts;
        let mean = |part: usize| parts.iter().map(|parts| parts[part]).sum::<f64>() / rounds as f64;
        println!(
            "ours, hearing {}: forward {:.2} s, backward {:.2} s, Adam {:.2} s{}",
            program.hears(),
            mean(0),
            mean(1),
            mean(2),
            if place.on_gpu { format!(", {} launches", program.launches) } else { String::new() },
        );
    }
    println!();
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let rounds = match std::env::var("RPRAE_BENCH_ROUNDS") {
        Ok(rounds) => rounds.parse()?,
        Err(_) => 5,
    };
    rayon::ThreadPoolBuilder::new().num_threads(THREADS).build_global()?;
    println!("instructions: {}", rprae_recurrent::Instructions::best().name());
    let place = Place::from_env()?;
    compare("100 frames each", &[100; BATCH], rounds, &place)?;
    compare("KIT lengths", &kit_lengths(), rounds, &place)
}
