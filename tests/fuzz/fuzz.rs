//! Looks for bytes that make a reader panic, hang or grow, on stable Rust and without instruments:
//!
//!     cargo run --release --example fuzz -- --inputs 10000000 --out /tmp/fuzz tests/assemblies ../shared/corpus
//!
//! Files below the folders given are seeds; inputs that take a reader a new way (its answer has other words,
//! numbers aside) become seeds as well. The same seed number gives the same inputs. Before it is read, an
//! input is in `OUT/current`: there it is found when the process dies. Inputs that make a reader panic or
//! take long are in `OUT/READER-panic-…` and `OUT/READER-slow-…`. What was found is kept in
//! `tests/fuzz/found`, and read by `tests/hostile_input.rs`.

#![allow(clippy::unwrap_used, reason = "a tool for developers that ends when it cannot go on")]

mod mutate;
mod seeds;

use std::collections::HashSet;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Parser;
use mutate::{Random, mutated};
use sbdp::hostile_input::Reader;

#[derive(Debug, Parser)]
struct Arguments {
    /// How many inputs, over all readers
    #[arg(long, default_value = "1000000")]
    inputs: u64,
    /// Which inputs
    #[arg(long, default_value = "1")]
    seed: u64,
    /// Where inputs go that were found
    #[arg(long)]
    out: PathBuf,
    /// Folders of seeds
    folders: Vec<PathBuf>,
}

/// An input that takes longer is reported: the readers take microseconds.
const SLOW: Duration = Duration::from_millis(500);
/// Healing and admission do more than reading: they get one input in so many.
const HEAVY_TURN: u64 = 20;
/// New seeds of one reader; more would only dilute the others.
const MOST_SEEDS: usize = 4000;
/// Ways that are told apart per reader: they are held in memory.
const MOST_WAYS: usize = 20_000;

/// One reader and its seeds.
struct Target {
    reader: Reader,
    seeds: Vec<Vec<u8>>,
    ways: HashSet<u64>,
    inputs: u64,
    time: Duration,
    slowest: Duration,
    panics: u64,
    slow: u64,
}

fn main() {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.out).unwrap();
    let current = File::create(arguments.out.join("current")).unwrap();
    let mut random = Random(arguments.seed);
    let mut targets: Vec<Target> = Reader::ALL.map(|reader| target(reader, &arguments.folders)).into();
    // A panic is told once, below.
    std::panic::set_hook(Box::new(|_| {}));
    let (started, mut told) = (Instant::now(), Instant::now());
    let mut settled = 0;
    for number in 0..arguments.inputs {
        let place = choose(&mut random, number, targets.len());
        one(&mut targets[place], &mut random, &current, &arguments.out);
        if number == arguments.inputs / 10 {
            settled = resident_kib();
        }
        if told.elapsed() > Duration::from_secs(30) {
            told = Instant::now();
            let rate = number as f64 / started.elapsed().as_secs_f64();
            println!("{number} inputs, {rate:.0} per second, {} KiB resident", resident_kib());
        }
    }
    std::process::exit(report(&targets, started.elapsed(), settled));
}

fn target(reader: Reader, folders: &[PathBuf]) -> Target {
    let seeds = seeds::seeds(reader, folders);
    Target {
        reader,
        seeds,
        ways: HashSet::new(),
        inputs: 0,
        time: Duration::ZERO,
        slowest: Duration::ZERO,
        panics: 0,
        slow: 0,
    }
}

/// All readers in turn, heavy ones more rarely.
fn choose(random: &mut Random, number: u64, count: usize) -> usize {
    loop {
        let place = random.below(count);
        let heavy = matches!(Reader::ALL[place], Reader::Healing | Reader::Admission | Reader::Plan);
        if !heavy || number.is_multiple_of(HEAVY_TURN) {
            return place;
        }
    }
}

fn one(target: &mut Target, random: &mut Random, current: &File, out: &Path) {
    // The newest seeds lead on: half of all inputs begin there.
    let newest = target.seeds.len().min(64);
    let first = if random.below(2) == 0 { target.seeds.len() - newest } else { 0 };
    let seed = &target.seeds[first + random.below(target.seeds.len() - first)];
    let other = random.of(&target.seeds);
    let input = mutated(random, seed, other);
    current.write_all_at(&(input.len() as u64).to_le_bytes(), 0).unwrap();
    current.write_all_at(&input, 8).unwrap();
    let started = Instant::now();
    let read = catch_unwind(AssertUnwindSafe(|| target.reader.read(&input)));
    let took = started.elapsed();
    target.inputs += 1;
    target.time += took;
    target.slowest = target.slowest.max(took);
    match read {
        Ok(words) => {
            let room = target.ways.len() < MOST_WAYS && target.seeds.len() < MOST_SEEDS;
            if room && target.ways.insert(way(&words)) {
                target.seeds.push(input.clone());
            }
        }
        Err(panic) => {
            target.panics += 1;
            keep(out, target.reader, "panic", target.panics, &input);
            let reason = panic.downcast_ref::<String>().cloned();
            let reason = reason.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
            eprintln!("{:?} panicked: {}", target.reader, reason.unwrap_or_default());
        }
    }
    if took > SLOW {
        target.slow += 1;
        keep(out, target.reader, "slow", target.slow, &input);
        eprintln!("{:?} took {took:?} for {} bytes", target.reader, input.len());
    }
}

/// So many of one kind are enough to look into.
const KEPT: u64 = 20;

fn keep(out: &Path, reader: Reader, what: &str, number: u64, input: &[u8]) {
    if number <= KEPT {
        std::fs::write(out.join(format!("{reader:?}-{what}-{number}")), input).unwrap();
    }
}

/// An answer's words without its numbers and names.
fn way(words: &str) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut quoted = false;
    for byte in words.bytes() {
        quoted ^= byte == b'`' || byte == b'"';
        if !quoted && byte.is_ascii_alphabetic() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    hash
}

fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).unwrap_or("0");
    line.split_whitespace().next().and_then(|n| n.parse().ok()).unwrap_or(0)
}

fn report(targets: &[Target], took: Duration, settled: u64) -> i32 {
    let inputs: u64 = targets.iter().map(|t| t.inputs).sum();
    let now = resident_kib();
    println!(
        "{inputs} inputs in {:.0} s, {:.0} per second; most resident after a tenth {settled} KiB, at the end {now} KiB",
        took.as_secs_f64(),
        inputs as f64 / took.as_secs_f64()
    );
    println!("reader        inputs     per s  slowest ms  ways  seeds  slow  panics");
    for t in targets {
        println!(
            "{:<10}{:>10}{:>10.0}{:>12.1}{:>6}{:>7}{:>6}{:>8}",
            format!("{:?}", t.reader),
            t.inputs,
            t.inputs as f64 / t.time.as_secs_f64().max(1e-9),
            t.slowest.as_secs_f64() * 1e3,
            t.ways.len(),
            t.seeds.len(),
            t.slow,
            t.panics
        );
    }
    i32::from(targets.iter().any(|t| t.panics > 0))
}
