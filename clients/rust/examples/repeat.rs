//! How long a plan takes that the daemon remembers: `repeat RUNTIME_DIR HANDLE ROUNDS` prints the median in microseconds.
//! Benchmarks of clients in other languages run it beside themselves.
use std::time::Instant;

use sbdp_client::{Client, ConnectOptions, Handle, PlanOptions};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [runtime_dir, handle, rounds] = &arguments[..] else {
        return Err("usage: repeat RUNTIME_DIR HANDLE ROUNDS".into());
    };
    let mut bytes = [0; 32];
    for (byte, digits) in bytes.iter_mut().zip(handle.as_bytes().chunks_exact(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(digits)?, 16)?;
    }
    let options = ConnectOptions { runtime_dir: Some(runtime_dir.into()), ..ConnectOptions::default() };
    let client = Client::connect_with(options)?;
    let mut times = Vec::new();
    for _ in 0..rounds.parse::<usize>()?.max(1) {
        let started = Instant::now();
        let plan = client.plan(Handle(bytes), &PlanOptions::default())?.plan_to_end()?;
        times.push(started.elapsed());
        if plan.summary.stats.plan_hit == 0 {
            return Err("the plan is not remembered: plan it once before".into());
        }
    }
    times.sort_unstable();
    println!("{:.2}", times[times.len() / 2].as_secs_f64() * 1e6);
    Ok(())
}
