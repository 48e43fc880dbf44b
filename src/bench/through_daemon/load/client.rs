//! The process of one client under load, and of those that disturb. It talks to who started it in
//! lines: it says `ready`, waits for a line, says `done N` now and then, and ends with its figures.

use std::io::{BufRead, Write};
use std::path::PathBuf;
use std::task::Poll;
use std::time::{Duration, Instant};

use sbdp_client::{
    Assembly, Change, Client, ClientError, ConnectOptions, Event, Handle, PlanOptions, PlanStatus, Vertices,
};

use super::super::BenchError;
use super::figures::{ClientFigures, Ending};
use super::mix::{Kind, Mix, Question};
use crate::exchange::wire_assembly;
use crate::geometry::{SourceAssembly, SourceMesh};

/// What such a process is to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Asks and counts.
    Asking,
    /// Asks for a plan and is then stopped from outside.
    Stopped,
    /// Asks without ever waiting.
    Flooding,
    /// Asks for plans and never reads them.
    Deaf,
}

/// One such process.
#[derive(Debug, Clone)]
pub struct LoadClient {
    /// The daemon's.
    pub runtime_dir: PathBuf,
    /// What is planned.
    pub assembly: SourceAssembly,
    /// What it does.
    pub role: Role,
    /// How often it asks.
    pub requests: usize,
    /// Which questions.
    pub seed: u64,
    /// How many different ones of each kind.
    pub variety: u64,
}

/// Nothing that the daemon owes takes so long, however much it has to do.
const PATIENCE: Duration = Duration::from_secs(120);
/// So often in a row a daemon may be restarted between an upload and a question.
const UPLOADS_AGAIN: usize = 10;
/// So many requests are reported together.
const REPORT: usize = 10;

/// Is the process until its standard input ends.
///
/// # Errors
/// The daemon cannot be reached at all.
pub fn load_client(load: &LoadClient) -> Result<(), BenchError> {
    let options = ConnectOptions {
        runtime_dir: Some(load.runtime_dir.clone()),
        timeout: PATIENCE,
        reconnect: PATIENCE,
        ..ConnectOptions::default()
    };
    let client = connect(&options)?;
    let base = client.upload(&wire_assembly(&load.assembly)).map_err(BenchError::failed)?;
    let me = Asking { client, base, load };
    match load.role {
        Role::Asking => {
            say("ready")?;
            wait_for_line();
            let figures = me.ask_all()?;
            say(&serde_json::to_string(&figures).map_err(BenchError::failed)?)?;
            // The connection stays until all have ended, so that the daemon's figures compare.
            wait_for_line();
        }
        Role::Stopped | Role::Deaf => {
            let unread = me.client.plan(base, &unremembered()).map_err(BenchError::failed)?;
            say("ready")?;
            wait_for_line();
            drop(unread);
        }
        Role::Flooding => {
            say("ready")?;
            // Ends when it is killed.
            loop {
                drop(me.client.plan(base, &unremembered()));
            }
        }
    }
    Ok(())
}

/// Connects, also while a daemon is just being restarted.
fn connect(options: &ConnectOptions) -> Result<Client, BenchError> {
    let until = Instant::now() + PATIENCE;
    loop {
        match Client::connect_with(options.clone()) {
            Ok(client) => return Ok(client),
            Err(error) if Instant::now() >= until => return Err(BenchError::failed(error)),
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
    }
}

fn say(line: &str) -> Result<(), BenchError> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).map_err(BenchError::failed)
}

fn wait_for_line() {
    let mut line = String::new();
    // The end of the input counts as well: who started this process is gone.
    let _ = std::io::stdin().lock().read_line(&mut line);
}

fn unremembered() -> PlanOptions {
    PlanOptions { no_cache: true, ..PlanOptions::default() }
}

struct Asking<'l> {
    client: Client,
    base: Handle,
    load: &'l LoadClient,
}

impl Asking<'_> {
    fn ask_all(&self) -> Result<ClientFigures, BenchError> {
        let mut figures = ClientFigures::default();
        let mut mix = Mix::new(self.load.seed, self.load.variety);
        for number in 1..=self.load.requests {
            let question = mix.next();
            let started = Instant::now();
            let ending = self.ask_known(question, &mut figures);
            figures.add(question.kind, ending, started.elapsed().as_secs_f64() * 1e6);
            if number % REPORT == 0 {
                say(&format!("done {REPORT}"))?;
            }
        }
        Ok(figures)
    }

    /// Asks, after another upload if the daemon was restarted and does not know the assembly any more.
    fn ask_known(&self, question: Question, figures: &mut ClientFigures) -> Ending {
        for _ in 0..UPLOADS_AGAIN {
            match self.ask(question, figures) {
                Ending::Refused(code) if code == "UnknownHandle" => {}
                ending => return ending,
            }
            if let Err(error) = self.client.upload(&wire_assembly(&self.load.assembly)) {
                return Ending::Lost(format!("upload: {error}"));
            }
        }
        Ending::Lost("the assembly is forgotten again and again".to_owned())
    }

    fn ask(&self, question: Question, figures: &mut ClientFigures) -> Ending {
        let ended = match question.kind {
            Kind::Upload => self.upload(question.variant),
            Kind::Revise => self.revise(question.variant),
            Kind::BadUpload => self.bad_upload(),
            Kind::Drop => self.client.plan(self.base, &self.options(question)).map(|_| Ending::Dropped),
            _ => self.plan(question, figures),
        };
        ended.unwrap_or_else(|error| match error {
            ClientError::Refused(error) => Ending::Refused(format!("{:?}", error.code)),
            other => Ending::Lost(format!("{:?}: {other}", question.kind)),
        })
    }

    fn options(&self, question: Question) -> PlanOptions {
        let parts = self.load.assembly.parts.len() as u64;
        let (part, round) = (question.variant % parts, question.variant / parts);
        let options = PlanOptions { no_cache: question.no_cache, ..PlanOptions::default() };
        match question.kind {
            Kind::Removed => {
                PlanOptions { removed: vec![part as u32, ((part + round + 1) % parts) as u32], ..options }
            }
            Kind::Moved => {
                let way = [0.0, 0.0, 0.125 * (round + 1) as f64, 1.0, 0.0, 0.0, 0.0];
                PlanOptions { moved: vec![(part as u32, way)], ..options }
            }
            Kind::Locked => PlanOptions { fixed: vec![part as u32], ..options },
            Kind::Deadline => PlanOptions { timeout: Some(Duration::from_millis(1)), ..options },
            _ => options,
        }
    }

    fn plan(&self, question: Question, figures: &mut ClientFigures) -> Result<Ending, ClientError> {
        let mut stream = self.client.plan(self.base, &self.options(question))?;
        if question.kind == Kind::Cancel {
            stream.cancel();
        }
        let mut hasher = blake3::Hasher::new();
        let started = Instant::now();
        loop {
            let Poll::Ready(event) = stream.poll_event(PATIENCE.saturating_sub(started.elapsed()))? else {
                return Ok(Ending::Lost(format!("no answer within {PATIENCE:?}")));
            };
            let Some(event) = event else {
                return Ok(Ending::Lost("a stream ended without its summary".to_owned()));
            };
            match event {
                Event::Progress(_) | Event::Trace(_) => {}
                Event::Restarted => {
                    hasher.reset();
                }
                Event::Step(step) => {
                    let step = step.view();
                    for number in step.parts.iter().chain(&step.of) {
                        hasher.update(&number.to_le_bytes());
                    }
                    for x in step.path.iter().flatten() {
                        hasher.update(&x.to_le_bytes());
                    }
                }
                Event::Done(summary) => {
                    // Those that the clock or the client ended may differ.
                    if !matches!(summary.status, PlanStatus::Timeout | PlanStatus::Cancelled) {
                        let asked = PlanOptions { no_cache: false, timeout: None, ..self.options(question) };
                        figures.plan(format!("{asked:?}"), hasher.finalize().to_hex().to_string());
                    }
                    return Ok(Ending::Answered);
                }
            }
        }
    }

    /// The first parts, in another size.
    fn upload(&self, variant: u64) -> Result<Ending, ClientError> {
        let mut source = self.load.assembly.clone();
        source.parts.truncate(3);
        source.fixed.clear();
        let scale = 1.0 + 1e-3 * (variant + 1) as f64;
        let vertices = source.parts.iter_mut().flat_map(|part| &mut part.mesh.vertices);
        vertices.for_each(|v| *v = v.map(|x| x * scale));
        self.client.upload(&wire_assembly(&source)).map(|_| Ending::Answered)
    }

    /// A part, a little smaller.
    fn revise(&self, variant: u64) -> Result<Ending, ClientError> {
        let part = (variant % self.load.assembly.parts.len() as u64) as usize;
        let scale = 1.0 - 1e-4 * (variant + 1) as f64;
        let mesh = &self.load.assembly.parts[part].mesh;
        let smaller = SourceMesh {
            vertices: mesh.vertices.iter().map(|v| v.map(|x| x * scale)).collect(),
            triangles: mesh.triangles.clone(),
        };
        let mut with = wire_assembly(&self.load.assembly).parts[part];
        with.vertices = Vertices::F64(&smaller.vertices);
        with.triangles = &smaller.triangles;
        let change = Change { replaced: vec![(part as u32, with)], ..Change::default() };
        self.client.revise(self.base, &change).map(|_| Ending::Answered)
    }

    /// Some hundred kilobytes that have to be read before they are refused.
    fn bad_upload(&self) -> Result<Ending, ClientError> {
        let mut vertices = vec![[0.5, 0.25, 0.125]; 4096];
        vertices[4000] = [f64::NAN; 3];
        let part =
            sbdp_client::Part { name: "bad", vertices: Vertices::F64(&vertices), triangles: &[[0, 1, 4000]] };
        let assembly = Assembly { parts: vec![part], ..Assembly::default() };
        self.client.upload(&assembly).map(|_| Ending::Lost("a mesh of NaN was taken".to_owned()))
    }
}
