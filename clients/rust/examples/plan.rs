//! Two boxes, one on the other: uploads them to a running `sbdpd` and prints the plan.
use sbdp_client::{Assembly, Client, ClientError, Event, Part, PlanOptions, Vertices};

fn main() -> Result<(), ClientError> {
    let (low, high) = (cuboid(0.0), cuboid(1.0));
    let part = |name, v| Part { name, vertices: Vertices::F64(v), triangles: &TRIANGLES };
    let parts = vec![part("low", &low), part("high", &high)];
    let assembly = Assembly { units: Some("mm"), parts, ..Assembly::default() };

    let client = Client::connect()?;
    let handle = client.upload(&assembly)?;
    let mut stream = client.plan(handle, &PlanOptions::default())?;
    while let Some(event) = stream.next_event()? {
        match event {
            Event::Progress(progress) => eprintln!("{progress:?}"),
            Event::Step(step) => println!("{:?} leave along {:?}", step.view().parts, step.view().path),
            Event::Trace(lines) => print!("{lines}"),
            Event::Restarted => println!("the daemon was restarted: from the beginning"),
            Event::Done(summary) => println!("{}: {} steps", summary.status.name(), summary.steps),
        }
    }
    Ok(())
}
#[rustfmt::skip]
const TRIANGLES: [[u32; 3]; 12] = [
    [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
    [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5],
];
fn cuboid(z: f64) -> Vec<[f64; 3]> {
    (0..8).map(|i| [f64::from(i & 1), f64::from((i >> 1) & 1), f64::from(i >> 2) + z]).collect()
}
