//! The trust boundary is the Unix user: what another one can do with a running daemon.

mod common;

use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use common::{Boxes, Daemon, plan};
use sbdp_client::PlanOptions;
use sbdp_ipc::endpoint::{Endpoint, default_prefix};
use sbdp_ipc::layout::shared_memory_files;

/// Not a test of its own: other tests run this binary as a client process.
#[test]
fn acts_as_a_client_process() {
    common::act_as_client();
}

/// The user and group that own nothing, on every Linux.
const NOBODY: &str = "65534";

/// A command as another user; none where this process may not become one.
fn as_nobody(program: &Path) -> Option<Command> {
    let mut command = Command::new("setpriv");
    command.args(["--reuid", NOBODY, "--regid", NOBODY, "--clear-groups", "--"]).arg(program);
    let mut probe = Command::new("setpriv");
    probe.args(["--reuid", NOBODY, "--regid", NOBODY, "--clear-groups", "--", "true"]);
    if probe.output().is_ok_and(|o| o.status.success()) {
        return Some(command);
    }
    eprintln!("skipped: only root can become another user here");
    None
}

/// All that a daemon has: in its runtime folder, iceoryx2's folder and shared memory.
fn files_of(daemon: &Daemon) -> Vec<PathBuf> {
    let mut folders = vec![daemon.runtime_dir(), Endpoint::find(&daemon.runtime_dir()).unwrap().root];
    let mut files = shared_memory_files(&default_prefix(&daemon.runtime_dir())).unwrap();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files
}

fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn another_user_can_neither_connect_nor_read_nor_write() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    plan(&client, handle, &PlanOptions::default());
    let files = files_of(&daemon);
    let in_shared_memory = files.iter().filter(|f| f.starts_with("/dev/shm")).count();
    assert!(in_shared_memory > 5 && files.len() > in_shared_memory, "{files:?}");
    for file in &files {
        let mode = std::fs::metadata(file).unwrap().mode();
        let guarded = file.starts_with(daemon.runtime_dir());
        assert!(guarded || mode & 0o077 == 0, "{}: {:o}", file.display(), mode);
    }
    // The way to the runtime folder is open; the folder itself is not.
    let way = daemon.runtime_dir().parent().unwrap().to_owned();
    std::fs::set_permissions(&way, std::fs::Permissions::from_mode(0o755)).unwrap();
    let Some(mut reader) = as_nobody(Path::new("sh")) else { return };
    let script = "for f in \"$@\"; do (: < \"$f\") 2>/dev/null && echo read \"$f\"; \
                  (: >> \"$f\") 2>/dev/null && echo wrote \"$f\"; done; echo tried $#";
    let tried = text(&reader.args(["-c", script, "sh"]).args(&files).output().unwrap());
    assert_eq!(tried.trim(), format!("tried {}", files.len()));

    // Others may not run what lies in a home folder: a copy that they may.
    let program = way.join("client");
    std::fs::copy(std::env::current_exe().unwrap(), &program).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let connect = |command: &mut Command| {
        command.args(["--exact", "acts_as_a_client_process", "--nocapture"]);
        command.env("SBDP_TEST_ROLE", "two").env("SBDP_RUNTIME_DIR", daemon.runtime_dir());
        command.current_dir("/").output().unwrap()
    };
    let own = connect(&mut Command::new(&program));
    assert!(own.status.success() && text(&own).contains("complete after"), "{own:?}");
    let other = connect(&mut as_nobody(&program).unwrap());
    let said = text(&other);
    assert!(!other.status.success() && !said.contains("uploaded"), "{said}");
    assert!(said.contains("no sbdp daemon is running") || said.contains("not safe"), "{said}");
    client.status().unwrap();
}
