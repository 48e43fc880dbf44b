//! The real daemon, isolated by prefix, root and runtime folder, and clients for it.

#![allow(dead_code, unreachable_pub, reason = "shared by test files; each uses its part of it")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::task::Poll;
use std::time::{Duration, Instant};

use sbdp::files::load_assembly;
use sbdp::geometry::SourceAssembly;
use sbdp_client::{
    Assembly, Client, ClientError, ConnectOptions, Event, Handle, Meshes, Part, PlanOptions, PlanStream,
    Summary, Vertices,
};
use sbdp_ipc::endpoint::{Endpoint, default_prefix};
use sbdp_ipc::layout::shared_memory_files;

/// No test waits longer than this for what must happen.
pub const HANG: Duration = Duration::from_secs(120);
/// Environment variable that turns a test into a client process.
const ROLE: &str = "SBDP_TEST_ROLE";

/// An assembly of `tests/assemblies`.
pub fn assembly(name: &str) -> SourceAssembly {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies");
    load_assembly(&folder.join(name)).unwrap()
}

/// A daemon of its own, killed (by its id) and cleaned up after when dropped.
pub struct Daemon {
    child: Child,
    folder: tempfile::TempDir,
}

impl Daemon {
    pub fn start() -> Self {
        Self::start_in(tempfile::tempdir().unwrap(), "")
    }

    pub fn start_with(config: &str) -> Self {
        Self::start_in(tempfile::tempdir().unwrap(), config)
    }

    fn start_in(folder: tempfile::TempDir, config: &str) -> Self {
        std::fs::write(folder.path().join("config.toml"), config).unwrap();
        let child = spawn_daemon(folder.path());
        let mut daemon = Self { child, folder };
        daemon.wait_until_ready();
        daemon
    }

    fn wait_until_ready(&mut self) {
        let start = Instant::now();
        while Endpoint::find(&self.runtime_dir()).map(|e| e.pid).ok() != Some(self.child.id()) {
            assert!(start.elapsed() < HANG, "the daemon does not become ready");
            assert!(self.child.try_wait().unwrap().is_none(), "the daemon ended at once");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    pub fn runtime_dir(&self) -> PathBuf {
        runtime_dir(self.folder.path())
    }

    /// The folder of its cache.
    pub fn cache_dir(&self) -> PathBuf {
        self.folder.path().join("cache")
    }

    /// A second daemon at the same place; it is expected to leave at once.
    pub fn rival(&self) -> std::process::Output {
        sbdpd(self.folder.path()).output().unwrap()
    }

    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Writes another configuration; it is read at the next start, or at SIGHUP.
    pub fn configure(&self, config: &str) {
        std::fs::write(self.folder.path().join("config.toml"), config).unwrap();
    }

    pub fn connect(&self) -> Client {
        connect(&self.runtime_dir())
    }

    pub fn signal(&self, signal: rustix::process::Signal) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, signal).unwrap();
    }

    pub fn wait(&mut self) -> ExitStatus {
        wait(&mut self.child)
    }

    /// SIGKILL, and a new daemon at the same place.
    pub fn kill_and_restart(&mut self) {
        self.kill_and_restart_after(|_| {});
    }

    /// The same, after something was done to the folder of iceoryx2's files.
    pub fn kill_and_restart_after(&mut self, between: impl FnOnce(&Path)) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        between(&self.folder.path().join("iox"));
        self.child = spawn_daemon(self.folder.path());
        self.wait_until_ready();
    }

    /// A process of its own that plays a client's role; see [`act_as_client`].
    pub fn client_process(&self, role: &str) -> Child {
        Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "acts_as_a_client_process", "--nocapture"])
            .env(ROLE, role)
            .env("SBDP_RUNTIME_DIR", self.runtime_dir())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap()
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        for path in shared_memory_files(&default_prefix(&self.runtime_dir())).unwrap_or_default() {
            let _ = std::fs::remove_file(path);
        }
    }
}

fn runtime_dir(folder: &Path) -> PathBuf {
    folder.join("run")
}

fn sbdpd(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdpd"));
    command.arg("--config").arg(folder.join("config.toml"));
    command.arg("--runtime-dir").arg(runtime_dir(folder));
    command.arg("--root").arg(folder.join("iox"));
    command.env("SBDP_CACHE_DIR", folder.join("cache"));
    command
}

fn spawn_daemon(folder: &Path) -> Child {
    sbdpd(folder).spawn().unwrap()
}

/// Waits for a process, with a guard against hanging.
pub fn wait(child: &mut Child) -> ExitStatus {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if start.elapsed() > HANG {
            let _ = child.kill();
            panic!("process {} does not end", child.id());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A client that tells at once when its daemon is gone.
pub fn options(runtime_dir: &Path) -> ConnectOptions {
    let runtime_dir = Some(runtime_dir.to_owned());
    ConnectOptions { runtime_dir, reconnect: Duration::ZERO, ..ConnectOptions::default() }
}

pub fn connect(runtime_dir: &Path) -> Client {
    Client::connect_with(options(runtime_dir)).unwrap()
}

/// Boxes in a lattice, each touching its neighbours.
pub struct Boxes {
    names: Vec<String>,
    vertices: Vec<Vec<[f64; 3]>>,
}

const TRIANGLES: [[u32; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
];

impl Boxes {
    /// `n` × `n` × `n` boxes.
    pub fn lattice(n: u32) -> Self {
        Self::grid(n, n, n)
    }

    /// One box on the other.
    pub fn two() -> Self {
        Self::grid(1, 1, 2)
    }

    fn grid(nx: u32, ny: u32, nz: u32) -> Self {
        let cells = (0..nx).flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])));
        let corner = |cell: [u32; 3], i: u32| {
            [f64::from(cell[0] + (i & 1)), f64::from(cell[1] + (i >> 1 & 1)), f64::from(cell[2] + (i >> 2))]
        };
        let vertices: Vec<Vec<[f64; 3]>> =
            cells.map(|cell| (0..8).map(|i| corner(cell, i)).collect()).collect();
        Self { names: (0..vertices.len()).map(|i| i.to_string()).collect(), vertices }
    }

    pub fn assembly(&self) -> Assembly<'_> {
        let parts = self.names.iter().zip(&self.vertices).map(|(name, vertices)| Part {
            name,
            vertices: Vertices::F64(vertices),
            triangles: &TRIANGLES,
        });
        Assembly { units: Some("mm"), parts: parts.collect(), ..Assembly::default() }
    }
}

impl Meshes for Boxes {
    fn assembly(&self) -> Assembly<'_> {
        Boxes::assembly(self)
    }
}

/// A link of a chain along x as an OBJ file: a torus, flat or upright by turns. It is cut open, by less
/// than it is thick: then nothing but a long search shows that the chain does not come apart.
pub fn ring(link: u32) -> String {
    const AROUND: u32 = 24;
    const ACROSS: u32 = 12;
    let angle = |k: u32, of: u32| std::f64::consts::TAU * f64::from(k) / f64::from(of);
    let mut text = String::new();
    for (i, j) in (0..AROUND).flat_map(|i| (0..ACROSS).map(move |j| (i, j))) {
        let (turn, roll) = (angle(i, AROUND), angle(j, ACROSS));
        let r = 5.0 + 1.5 * roll.cos();
        let (x, across, off) = (r * turn.cos() + 6.75 * f64::from(link), r * turn.sin(), 1.5 * roll.sin());
        let (y, z) = if link.is_multiple_of(2) { (across, off) } else { (-off, across) };
        text += &format!("v {x} {y} {z}\n");
    }
    for (i, j) in (0..AROUND - 1).flat_map(|i| (0..ACROSS).map(move |j| (i, j))) {
        let vertex = |i: u32, j: u32| 1 + (i % AROUND) * ACROSS + j % ACROSS;
        let (a, b, c, d) = (vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1));
        text += &format!("f {a} {b} {c} {d}\n");
    }
    let end = |i: u32| (1..=ACROSS).map(move |j| (i * ACROSS + j).to_string());
    let (first, last) = (end(0).rev().collect::<Vec<_>>(), end(AROUND - 1).collect::<Vec<_>>());
    text + &format!("f {}\nf {}\n", first.join(" "), last.join(" "))
}

/// The next event of a stream, with a guard against hanging.
pub fn next_event(stream: &mut PlanStream) -> Result<Option<Event>, ClientError> {
    match stream.poll_event(HANG)? {
        Poll::Ready(event) => Ok(event),
        Poll::Pending => panic!("nothing comes"),
    }
}

/// Plans to the end; the steps' parts and the summary.
pub fn plan(client: &Client, handle: Handle, options: &PlanOptions) -> (Vec<u32>, Summary) {
    let mut stream = client.plan(handle, options).unwrap();
    let (mut steps, mut parts) = (0, Vec::new());
    loop {
        match next_event(&mut stream).unwrap() {
            Some(Event::Step(step)) => {
                let step = step.view();
                assert!(!step.path.is_empty());
                assert_eq!(step.number as usize, steps);
                steps += 1;
                parts.extend(step.parts);
            }
            Some(Event::Progress(_) | Event::Trace(_)) => {}
            Some(Event::Restarted) => (steps, parts) = (0, Vec::new()),
            Some(Event::Done(summary)) => {
                assert_eq!(summary.steps as usize, steps);
                return (parts, summary);
            }
            None => panic!("a stream ends with `Done`"),
        }
    }
}

/// Plays the role that the environment names; without one, does nothing.
pub fn act_as_client() {
    let Ok(role) = std::env::var(ROLE) else { return };
    let client = Client::connect().unwrap();
    match role.as_str() {
        "uploading" => upload_for_ever(&client),
        "holding" => hold_for_ever(&client),
        "too-large" => return upload_too_much(&client),
        _ => {}
    }
    let assembly = match role.as_str() {
        "two" => Boxes::two(),
        "small-lattice" => Boxes::lattice(3),
        _ => Boxes::lattice(5),
    };
    let handle = client.upload(&assembly.assembly()).unwrap();
    println!("uploaded");
    let (parts, summary) = plan(&client, handle, &PlanOptions::default());
    println!("{} after {} steps", summary.status.name(), parts.len());
}

/// Uploads ten megabytes again and again, as changes of a part, which are always sent.
fn upload_for_ever(client: &Client) -> ! {
    let boxes = Boxes::two();
    let base = client.upload(&boxes.assembly()).unwrap();
    let mut vertices = vec![[0.5; 3]; 400_000];
    vertices[..8].copy_from_slice(&boxes.vertices[0]);
    let part = Part { name: "0", vertices: Vertices::F64(&vertices), triangles: &TRIANGLES };
    loop {
        let change = sbdp_client::Change { replaced: vec![(0, part)], ..sbdp_client::Change::default() };
        client.revise(base, &change).unwrap();
    }
}

/// Holds a response of a plan that goes on.
fn hold_for_ever(client: &Client) -> ! {
    let handle = client.upload(&Boxes::lattice(5).assembly()).unwrap();
    let options = PlanOptions { no_cache: true, ..PlanOptions::default() };
    let mut stream = client.plan(handle, &options).unwrap();
    while !matches!(stream.next_event().unwrap(), Some(Event::Step(_))) {}
    loop {
        std::thread::park();
    }
}

/// Uploads more than there is room for, then something small.
fn upload_too_much(client: &Client) {
    let vertices = vec![[0.5; 3]; 2_000_000];
    let part = Part { name: "0", vertices: Vertices::F64(&vertices), triangles: &TRIANGLES };
    let error = client.upload(&Assembly { parts: vec![part], ..Assembly::default() }).unwrap_err();
    println!("refused: {error}");
    let handle = client.upload(&Boxes::lattice(2).assembly()).unwrap();
    let (parts, _) = plan(client, handle, &PlanOptions::default());
    println!("then planned {}", parts.len());
}
