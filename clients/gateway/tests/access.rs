//! Who may reach the gateway: addresses, certificates.

mod common;

use std::path::Path;
use std::process::{Command, Output};

use common::{Caller, Daemon, Gateway, Lattice, request, to_end, upload};
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};
use sbdp_gateway::proto::VersionRequest;
use sbdp_gateway::proto::planner_service_client::PlannerServiceClient;
use tonic::transport::{Certificate, ClientTlsConfig, Endpoint, Identity};

#[test]
fn acts_as_the_daemon() {
    common::act_as_the_daemon();
}

struct Authority(CertifiedIssuer<'static, KeyPair>);

impl Authority {
    fn new() -> Self {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        Self(CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap())
    }

    fn certificate(&self) -> String {
        self.0.pem()
    }

    /// A certificate and its key.
    fn issue(&self, name: &str) -> (String, String) {
        let key = KeyPair::generate().unwrap();
        let params = CertificateParams::new(vec![name.to_owned()]).unwrap();
        (params.signed_by(&key, &self.0).unwrap().pem(), key.serialize_pem())
    }
}

/// A gateway with a certificate for `localhost`.
fn secured(daemon: &Daemon, folder: &Path, authority: &Authority, mutual: bool) -> Gateway {
    let (certificate, key) = authority.issue("localhost");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).unwrap();
        folder.join(name).display().to_string()
    };
    let (certificate, key) = (write("gateway.pem", &certificate), write("gateway.key", &key));
    let mut config = format!("[tls]\ncertificate = \"{certificate}\"\nkey = \"{key}\"\n");
    if mutual {
        config += &format!("client_ca = \"{}\"\n", write("ca.pem", &authority.certificate()));
    }
    Gateway::start_with(daemon, &config)
}

async fn connect(gateway: &Gateway, tls: ClientTlsConfig) -> Result<Caller, String> {
    let address = Endpoint::from_shared(gateway.address.clone()).unwrap();
    let address = address.tls_config(tls.domain_name("localhost")).map_err(|error| error.to_string())?;
    let channel = address.connect().await.map_err(|error| error.to_string())?;
    let mut caller = PlannerServiceClient::new(channel);
    // With TLS 1.3 a client learns only from the first answer that its certificate is refused.
    caller.version(VersionRequest {}).await.map_err(|error| error.to_string())?;
    Ok(caller)
}

fn trusting(authority: &Authority) -> ClientTlsConfig {
    ClientTlsConfig::new().ca_certificate(Certificate::from_pem(authority.certificate()))
}

async fn plan(caller: &mut Caller) {
    let handle = upload(caller, &Lattice::new(2).assembly()).await;
    to_end(caller.plan(request(&handle)).await.unwrap().into_inner()).await.unwrap();
}

#[tokio::test]
async fn tls_shows_callers_whom_they_talk_to() {
    let (daemon, folder) = (Daemon::start(), tempfile::tempdir().unwrap());
    let (authority, other) = (Authority::new(), Authority::new());
    let gateway = secured(&daemon, folder.path(), &authority, false);
    assert!(gateway.address.starts_with("https://"));
    plan(&mut connect(&gateway, trusting(&authority)).await.unwrap()).await;
    assert!(connect(&gateway, trusting(&other)).await.is_err(), "its certificate is of another authority");
    let plain = Endpoint::from_shared(gateway.address.replace("https", "http")).unwrap();
    if let Ok(channel) = plain.connect().await {
        assert!(PlannerServiceClient::new(channel).version(VersionRequest {}).await.is_err());
    }
    plan(&mut connect(&gateway, trusting(&authority)).await.unwrap()).await;
}

#[tokio::test]
async fn mutual_tls_refuses_callers_without_a_certificate_of_the_authority() {
    let (daemon, folder) = (Daemon::start(), tempfile::tempdir().unwrap());
    let (authority, other) = (Authority::new(), Authority::new());
    let gateway = secured(&daemon, folder.path(), &authority, true);
    let identity = |of: &Authority| {
        let (certificate, key) = of.issue("robot");
        Identity::from_pem(certificate, key)
    };
    assert!(connect(&gateway, trusting(&authority)).await.is_err(), "no certificate");
    let foreign = trusting(&authority).identity(identity(&other));
    assert!(connect(&gateway, foreign).await.is_err(), "a certificate of another authority");
    let own = trusting(&authority).identity(identity(&authority));
    plan(&mut connect(&gateway, own).await.unwrap()).await;
}

fn sbdp_gateway(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sbdp-gateway")).args(arguments).output().unwrap()
}

#[test]
fn addresses_that_other_machines_reach_need_tls_or_the_flag() {
    for address in ["0.0.0.0:0", "[::]:0"] {
        let refused = sbdp_gateway(&["--listen", address]);
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains("--allow-plaintext") && said.contains("[tls]"), "{said}");
    }
    let mut child = Command::new(env!("CARGO_BIN_EXE_sbdp-gateway"))
        .args(["--listen", "0.0.0.0:0", "--allow-plaintext"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut out = std::io::BufReader::new(child.stdout.take().unwrap());
    std::io::BufRead::read_line(&mut out, &mut line).unwrap();
    drop(common::Process(child));
    assert!(line.contains("http://0.0.0.0:"), "{line}");
}

#[test]
fn configurations_that_cannot_be_used_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gateway.toml");
    for (config, reason) in [
        ("listen = 7\n", "listen"),
        ("[limits]\nplans = 100\n", "`limits.plans` is 100"),
        ("[limits]\nspeed = 1\n", "speed"),
        ("[tls]\ncertificate = \"none.pem\"\nkey = \"none.key\"\n", "`tls.certificate`"),
        ("[log]\nfilter = \"a=b=c\"\n", "log filter"),
    ] {
        std::fs::write(&path, config).unwrap();
        let refused = sbdp_gateway(&["--config", path.to_str().unwrap()]);
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{config}: {said}");
        assert!(said.contains(reason), "{config}: {said}");
    }
    std::fs::write(folder.path().join("wrong.pem"), "no certificate").unwrap();
    std::fs::write(&path, "[tls]\ncertificate = \"wrong.pem\"\nkey = \"wrong.pem\"\n").unwrap();
    let refused = sbdp_gateway(&["--listen", "127.0.0.1:0", "--config", path.to_str().unwrap()]);
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("[tls]") && refused.stdout.is_empty(), "{said}");
}
