"""Starting a daemon."""

import os
import shutil
import subprocess
import sysconfig
import time
from collections.abc import Sequence
from pathlib import Path

from . import _native
from .errors import NoDaemonError

# Longest time until a daemon takes clients: it reads what it remembers before. Half of this is not enough on machines that
# are busy, and twice as much keeps callers waiting for a daemon that hangs.
READY = 30.0
# Pause between two looks whether it does.
LOOK = 0.01


def program() -> str:
    """The program `sbdpd`: that of `$SBDPD`, else the one of this package, else the one on `$PATH`."""
    named = os.environ.get("SBDPD")
    if named:
        return named
    # `pip install --target FOLDER` puts programs into FOLDER/bin, and `--user` into ~/.local/bin.
    folders = [Path(__file__).parents[1] / "bin"]
    folders += [Path(sysconfig.get_path("scripts", scheme)) for scheme in (sysconfig.get_default_scheme(), "posix_user")]
    beside = (str(folder / "sbdpd") for folder in folders if os.access(folder / "sbdpd", os.X_OK))
    found = next(beside, None) or shutil.which("sbdpd")
    if not found:
        raise NoDaemonError("there is no program `sbdpd`: install it, put it on $PATH, or name it in $SBDPD")
    return found


class Daemon:
    """A daemon that this process starts, and stops at the end of a `with` block.

    `runtime_dir` is where clients find it (default: that of the user), `config` a configuration file, and `arguments` are
    passed to the program unchanged. Its log goes to stderr, unless `quiet`. Raises `NoDaemonError` if it does not become ready.
    """

    def __init__(
        self,
        runtime_dir: str | os.PathLike[str] | None = None,
        *,
        config: str | os.PathLike[str] | None = None,
        arguments: Sequence[str] = (),
        quiet: bool = False,
    ) -> None:
        command = [program()]
        if runtime_dir is not None:
            command += ["--runtime-dir", os.fspath(runtime_dir)]
        if config is not None:
            command += ["--config", os.fspath(config)]
        nowhere = subprocess.DEVNULL
        # Ctrl-C is for the caller; the daemon is stopped when it is not wanted any more. A program that reads what the caller
        # writes must not wait for the daemon's end.
        self._process = subprocess.Popen(
            [*command, *arguments],
            stdin=nowhere,
            stdout=nowhere,
            stderr=nowhere if quiet else None,
            start_new_session=True,
        )
        self._runtime_dir = runtime_dir
        try:
            self._wait_until_ready()
        except BaseException:
            self.stop()
            raise

    def _wait_until_ready(self) -> None:
        until = time.monotonic() + READY
        while True:
            try:
                with _native.Client(self._runtime_dir, reconnect=0.0) as client:
                    # Another one may have been there first: then ours leaves, and that one serves.
                    if client.pid == self.pid or self._process.poll() is not None:
                        return
            except NoDaemonError as error:
                if self._process.poll() is not None:
                    code = self._process.returncode
                    text = f"`sbdpd` ended at once, with code {code}: run it in a terminal to see why"
                    raise NoDaemonError(text) from error
            if time.monotonic() >= until:
                raise NoDaemonError(f"`sbdpd` (pid {self.pid}) does not become ready within {READY:.0f} s")
            time.sleep(LOOK)

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    def stop(self) -> None:
        """Stops it, if it is still running, and waits for its end. It answers its requests first."""
        if self._process.poll() is None:
            self._process.terminate()
        self._process.wait()

    def __enter__(self) -> "Daemon":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def leave_running(daemon: Daemon) -> None:
    """Keeps a daemon running when this process ends."""
    # `Popen` would warn of a child that still runs.
    daemon._process.returncode = 0
