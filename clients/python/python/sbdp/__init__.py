"""Plans how mechanical assemblies come apart, and go together, through the daemon `sbdpd`.

    import sbdp

    with sbdp.connect(start=True) as client:
        assembly = sbdp.load("tests/assemblies/pin-bolt-cover")
        for step in client.plan(assembly):
            print(step.parts, step.path)

Lengths and poses are in the input's units and frame; a pose is [x, y, z, qw, qx, qy, qz]. Parts go by their names.
"""

import os

from . import errors
from ._native import VERSION as __version__
from ._native import Assembly, Client, Plan, PlanStream, Session, Step, load
from .daemon import Daemon, leave_running
from .errors import *  # noqa: F403
from .errors import NoDaemonError
from .frames import path_frame, steps_frame
from .live import Change, LiveAssembly, LivePart, PlanJob
from .meshes import assembly, to_trimesh
from .motion import Motion

__all__ = [
    "Assembly",
    "Change",
    "Client",
    "Daemon",
    "LiveAssembly",
    "LivePart",
    "Motion",
    "Plan",
    "PlanJob",
    "PlanStream",
    "Session",
    "Step",
    "assembly",
    "connect",
    "errors",
    "load",
    "path_frame",
    "steps_frame",
    "to_trimesh",
]
__all__ += [name for name in vars(errors) if name.endswith("Error")] + ["Error"]


def connect(
    runtime_dir: str | os.PathLike[str] | None = None,
    *,
    start: bool = False,
    timeout: float = 10.0,
    upload_timeout: float = 300.0,
    reconnect: float = 10.0,
    busy_wait: float = 0.0,
) -> Client:
    """Connects to the daemon of this user, or of a runtime folder.

    With `start=True` a daemon is started if none is running, and left running. All times are in seconds: `timeout` for
    answers that need no planning, `upload_timeout` for checking meshes, `reconnect` for another daemon to replace one that
    went away, `busy_wait` for a daemon that answers busy.

    Raises `NoDaemonError` if none is running, `ConnectionError` for another version, and `TooManyClientsError`.
    """
    options = {
        "timeout": timeout,
        "upload_timeout": upload_timeout,
        "reconnect": reconnect,
        "busy_wait": busy_wait,
    }
    try:
        return Client(runtime_dir, **options)
    except NoDaemonError:
        if not start:
            raise
    leave_running(Daemon(runtime_dir, quiet=True))
    return Client(runtime_dir, **options)
