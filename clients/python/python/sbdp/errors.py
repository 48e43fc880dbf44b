"""Errors, a class for each reason. Their messages say what to do."""


class Error(Exception):
    """The daemon, or the connection to it, refused a request. `code` is the daemon's stable number, if it answered."""

    code: int | None = None


class MalformedError(Error):
    """The request cannot be read: use matching versions."""

    code = 1


class UnknownHandleError(Error):
    """The daemon does not know the assembly: upload it (again)."""

    code = 2


class BusyError(Error):
    """The daemon's queue is full: try again after `retry_after` seconds."""

    code = 3
    retry_after: float = 0.0


class ExpiredError(Error):
    """The deadline passed before planning began."""

    code = 4


class GeometryError(Error):
    """A file or a mesh is refused; the message names the part and the reason."""

    code = 5


class NoSuchPartError(Error):
    """The assembly has no part of this name."""

    code = 6


class UnsupportedError(Error):
    """The request needs something that this daemon does not offer."""

    code = 7


class FailedError(Error):
    """The daemon failed; its log says more."""

    code = 8


class SlowReaderError(Error):
    """The stream was not read for too long, and was ended."""

    code = 9


class ShuttingDownError(Error):
    """The daemon is shutting down."""

    code = 10


class TooLargeError(Error):
    """The message exceeds a limit of the daemon, or the memory that is left."""

    code = 11


class CancelledError(Error):
    """The request was cancelled before planning began."""

    code = 12


class NoDaemonError(Error):
    """No daemon is running, or it went away before it answered."""


class TimeoutError(Error, TimeoutError):
    """The daemon gave no answer in time: it is overloaded or stopped."""


class StreamOpenError(Error):
    """This client is already receiving a plan: finish or close that stream, or connect another client."""


class ForkedError(Error):
    """The client belongs to the process that this one was forked from: connect again here."""


class TooManyClientsError(Error):
    """The daemon has as many clients as it can serve."""


class SharedMemoryError(Error):
    """/dev/shm has too little space for the meshes."""


class ConnectionError(Error, ConnectionError):
    """The daemon cannot be reached or understood: it is of another version, or its folder is not safe."""
