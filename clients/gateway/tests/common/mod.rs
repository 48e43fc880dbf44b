//! A daemon and a gateway of their own for each test, and callers of the gateway.

#![allow(dead_code, unreachable_pub, reason = "shared by test files; each uses its part of it")]

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use sbdp::cache::{Cache, CacheSettings};
use sbdp::config::Config;
use sbdp::exchange::wire_assembly;
use sbdp::files::load_assembly;
use sbdp::geometry::SourceAssembly;
use sbdp::service::{RECORD_KINDS, Service};
use sbdp_client::{Assembly, Client, ConnectOptions, Part, Vertices};
use sbdp_gateway::proto::plan_event::Event;
use sbdp_gateway::proto::planner_service_client::PlannerServiceClient;
use sbdp_gateway::proto::upload_request::Piece;
use sbdp_gateway::proto::{self, PlanEvent, PlanRequest, StatusReply, StatusRequest, UploadRequest};
use sbdp_ipc::endpoint::{Endpoint, default_prefix};
use sbdp_ipc::layout::shared_memory_files;
use tonic::transport::{Channel, Endpoint as Address};
use tonic::{Status, Streaming};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

pub type Caller = PlannerServiceClient<Channel>;

/// No test waits longer than this for what must happen.
pub const HANG: Duration = Duration::from_secs(120);
/// Environment variable that turns a test into a daemon, with the folder of all that it has.
const DAEMON: &str = "SBDP_TEST_DAEMON";

/// An assembly of `tests/assemblies`.
pub fn assembly(name: &str) -> SourceAssembly {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/assemblies");
    load_assembly(&folder.join(name)).unwrap()
}

/// What the test `acts_as_the_daemon` of each file does: the daemon is a program of another package, which cargo does not
/// build for these tests.
pub fn act_as_the_daemon() {
    let Some(folder) = std::env::var_os(DAEMON).map(PathBuf::from) else { return };
    let mut config = Config::default();
    config.endpoint.runtime_dir = Some(folder.join("run"));
    config.endpoint.root = Some(folder.join("iox"));
    // A plan that a test keeps busy is not to wait for others.
    config.requests.working_per_client = 2;
    let settings = CacheSettings { folder: Some(folder.join("cache")), ..CacheSettings::default() };
    let cache = Arc::new(Cache::open(&settings, &RECORD_KINDS).unwrap());
    let service = Arc::new(Service::new(cache, config.cache.memory().all));
    sbdp::daemon::run(&config, service).unwrap();
}

/// Waits for something, with a guard against hanging.
pub fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < HANG, "{what}: in vain");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A process that is killed, by its id, when dropped.
pub struct Process(pub Child);

impl Process {
    pub fn signal(&self, signal: rustix::process::Signal) {
        rustix::process::kill_process(rustix::process::Pid::from_child(&self.0), signal).unwrap();
    }

    pub fn wait(&mut self) -> ExitStatus {
        let mut status = None;
        wait_until("the end of a process", || {
            status = self.0.try_wait().unwrap();
            status.is_some()
        });
        status.unwrap()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A daemon with memory and folders of its own.
pub struct Daemon {
    process: Option<Process>,
    folder: tempfile::TempDir,
}

impl Daemon {
    pub fn start() -> Self {
        let mut daemon = Self::none();
        daemon.start_again();
        daemon
    }

    /// A place where no daemon runs yet.
    pub fn none() -> Self {
        Self { process: None, folder: tempfile::tempdir().unwrap() }
    }

    pub fn runtime_dir(&self) -> PathBuf {
        self.folder.path().join("run")
    }

    pub fn kill(&mut self) {
        self.process = None;
    }

    pub fn start_again(&mut self) {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "acts_as_the_daemon", "--nocapture"])
            .env(DAEMON, self.folder.path())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let pid = child.id();
        self.process = Some(Process(child));
        let runtime_dir = self.runtime_dir();
        wait_until("a daemon", || Endpoint::find(&runtime_dir).map(|e| e.pid).ok() == Some(pid));
    }

    /// A client of this machine.
    pub fn connect(&self) -> Client {
        let runtime_dir = Some(self.runtime_dir());
        Client::connect_with(ConnectOptions { runtime_dir, ..ConnectOptions::default() }).unwrap()
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        self.kill();
        for path in shared_memory_files(&default_prefix(&self.runtime_dir())).unwrap_or_default() {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// A gateway at a port of its own.
pub struct Gateway {
    pub process: Process,
    pub address: String,
    _folder: tempfile::TempDir,
}

impl Gateway {
    pub fn start(daemon: &Daemon) -> Self {
        Self::start_with(daemon, "")
    }

    pub fn start_with(daemon: &Daemon, config: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("gateway.toml");
        std::fs::write(&file, config).unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_sbdp-gateway"))
            .args(["--listen", "127.0.0.1:0", "--config"])
            .arg(&file)
            .arg("--runtime-dir")
            .arg(daemon.runtime_dir())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("sbdp-gateway: serving on ").unwrap().to_owned();
        Self { process: Process(child), address, _folder: folder }
    }

    async fn channel(&self) -> Channel {
        Address::from_shared(self.address.clone()).unwrap().connect().await.unwrap()
    }

    pub async fn connect(&self) -> Caller {
        PlannerServiceClient::new(self.channel().await)
    }

    /// A caller for whom hardly anything waits on its own side: what it does not read waits in the gateway.
    pub async fn connect_narrowly(&self) -> Caller {
        let address = Address::from_shared(self.address.clone()).unwrap();
        PlannerServiceClient::new(address.initial_stream_window_size(1024).connect().await.unwrap())
    }

    pub async fn health(&self) -> Health {
        Health(HealthClient::new(self.channel().await))
    }

    /// What a call to a service that is not there gives.
    pub async fn call_unknown_service(&self) -> Status {
        let mut grpc = tonic::client::Grpc::new(self.channel().await);
        grpc.ready().await.unwrap();
        let codec = tonic_prost::ProstCodec::<StatusRequest, StatusReply>::default();
        let path = "/sbdp.v10.PlannerService/Status".parse().unwrap();
        grpc.unary(tonic::Request::new(StatusRequest {}), path, codec).await.unwrap_err()
    }
}

/// The health service of a gateway.
pub struct Health(HealthClient<Channel>);

impl Health {
    /// Waits until a service serves, or does not.
    pub async fn serves(&self, service: &str, wanted: bool) -> bool {
        let (mut client, start) = (self.0.clone(), Instant::now());
        loop {
            let request = HealthCheckRequest { service: service.to_owned() };
            let status = client.check(request).await.map(|answer| answer.into_inner().status());
            let serves = matches!(status, Ok(ServingStatus::Serving));
            if status.is_ok() && serves == wanted || start.elapsed() > HANG {
                return serves;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

/// The messages that upload an assembly, with meshes in pieces of `rows` rows.
pub fn pieces(assembly: &Assembly<'_>, rows: usize) -> Vec<UploadRequest> {
    let first = proto::Assembly {
        name: assembly.name.to_owned(),
        units: assembly.units.map(str::to_owned),
        fixed: assembly.fixed.iter().map(|name| (*name).to_owned()).collect(),
    };
    let mut messages = vec![UploadRequest { piece: Some(Piece::Assembly(first)) }];
    for part in &assembly.parts {
        let Vertices::F64(vertices) = part.vertices else { panic!("these tests have f64") };
        let empty = || proto::Mesh { name: part.name.to_owned(), ..proto::Mesh::default() };
        let wide =
            |row: &[[f64; 3]]| row.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        let corners =
            |row: &[[u32; 3]]| row.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        // Triangles may come before their vertices.
        let triangles = part
            .triangles
            .chunks(rows)
            .map(|rows| proto::Mesh { triangles: corners(rows).into(), ..empty() });
        let vertices =
            vertices.chunks(rows).map(|rows| proto::Mesh { vertices_f64: wide(rows).into(), ..empty() });
        messages
            .extend(triangles.chain(vertices).map(|mesh| UploadRequest { piece: Some(Piece::Mesh(mesh)) }));
    }
    messages
}

pub async fn upload(caller: &mut Caller, assembly: &Assembly<'_>) -> Vec<u8> {
    let messages = pieces(assembly, 1000);
    caller.upload(tokio_stream::iter(messages)).await.unwrap().into_inner().handle.to_vec()
}

pub async fn upload_source(caller: &mut Caller, assembly: &SourceAssembly) -> Vec<u8> {
    upload(caller, &wire_assembly(assembly)).await
}

pub fn request(handle: &[u8]) -> PlanRequest {
    PlanRequest { handle: handle.to_vec().into(), ..PlanRequest::default() }
}

pub async fn next_event(events: &mut Streaming<PlanEvent>) -> Result<Option<Event>, tonic::Status> {
    let next = tokio::time::timeout(HANG, events.message()).await.expect("an event");
    Ok(next?.map(|event| event.event.expect("an event that this version knows")))
}

/// All events to the end of the stream.
pub async fn to_end(mut events: Streaming<PlanEvent>) -> Result<Vec<Event>, tonic::Status> {
    let mut all = Vec::new();
    while let Some(event) = next_event(&mut events).await? {
        all.push(event);
    }
    Ok(all)
}

/// What ends a plan.
pub fn end_of(events: &[Event]) -> &proto::Summary {
    match events.last() {
        Some(Event::End(summary)) => summary,
        other => panic!("a plan ends with its summary, not {other:?}"),
    }
}

pub async fn status(caller: &mut Caller) -> StatusReply {
    caller.status(StatusRequest {}).await.unwrap().into_inner()
}

/// The number of the error's code.
pub fn code(status: &tonic::Status) -> i32 {
    let code = status.metadata().get("sbdp-code").unwrap_or_else(|| panic!("{status} has no code"));
    code.to_str().unwrap().parse().unwrap()
}

/// Boxes that are made here.
pub struct Lattice {
    names: Vec<String>,
    vertices: Vec<Vec<[f64; 3]>>,
}

const BOX: [[u32; 3]; 12] = [
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

impl Lattice {
    /// `n` × `n` × `n` boxes, each touching its neighbours.
    pub fn new(n: u32) -> Self {
        let cells = (0..n * n * n).map(|cell| [cell / (n * n), cell / n % n, cell % n]);
        let corner = |[x, y, z]: [u32; 3], i: u32| {
            [f64::from(x + (i & 1)), f64::from(y + (i >> 1 & 1)), f64::from(z + (i >> 2))]
        };
        let vertices: Vec<Vec<[f64; 3]>> =
            cells.map(|cell| (0..8).map(|i| corner(cell, i)).collect()).collect();
        Self { names: (0..vertices.len()).map(|number| number.to_string()).collect(), vertices }
    }

    pub fn assembly(&self) -> Assembly<'_> {
        let parts = self.names.iter().zip(&self.vertices).map(|(name, vertices)| Part {
            name,
            vertices: Vertices::F64(vertices),
            triangles: &BOX,
        });
        Assembly { units: Some("mm"), parts: parts.collect(), ..Assembly::default() }
    }
}
