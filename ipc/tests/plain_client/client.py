"""A client in plain Python over PyPI's iceoryx2, written from PROTOCOL.md alone. All layouts, numbers, names and limits come
from its tables. It is slow and shows what the protocol asks of a client; programs use `clients/python`."""
import ctypes
import json
import os
import stat
import time
from pathlib import Path

import iceoryx2
from blake3 import blake3
from document import Document, Texts, text

TICK_S = 0.2
KINDS = {"u32": ctypes.c_uint32, "u64": ctypes.c_uint64}


class Refused(Exception):
    """The daemon answered with an error: its code, by name, and text."""


def header_type(document, name):
    """A user header as iceoryx2 has it."""
    found = document.structs[name]
    fields = []
    for _, _, kind, field in found.fields:
        element, _, count = kind.partition(" × ")
        fields.append((field, KINDS[element] * int(count) if count else KINDS[element]))
    type_name = staticmethod(lambda: found.type_name)
    made = type(name, (ctypes.Structure,), {"_fields_": fields, "type_name": type_name})
    assert (ctypes.sizeof(made), ctypes.alignment(made)) == (found.size, found.align), name
    return made


def endpoint(document, folder):
    """What `daemon.json` says, checked."""
    meta = os.lstat(folder)
    if not stat.S_ISDIR(meta.st_mode) or meta.st_uid != os.getuid() or meta.st_mode & 0o077:
        raise SystemExit(f"{folder} is no folder of this user with mode 0700")
    found = json.loads((Path(folder) / document.constants["DAEMON_FILE"]).read_text())
    versions = found["protocol"], found["iceoryx2"]
    if versions != (document.constants["PROTOCOL"], document.constants["ICEORYX2_VERSION"]):
        raise SystemExit(f"the daemon speaks protocol {versions[0]} over iceoryx2 {versions[1]}")
    return found


class Client:
    def __init__(self, folder, document=None):
        self.document = document or Document()
        self.constants = self.document.constants
        found = endpoint(self.document, folder)
        self.pid = found["pid"]
        iceoryx2.set_log_level(iceoryx2.LogLevel.Fatal)
        config = iceoryx2.config.default()
        config.global_cfg.prefix = iceoryx2.FileName.new(found["prefix"])
        config.global_cfg.root_path = iceoryx2.Path.new(found["root"])
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        config.global_cfg.service.cleanup_dead_nodes_on_open = False
        builder = iceoryx2.NodeBuilder.new().config(config)
        builder = builder.signal_handling_mode(iceoryx2.SignalHandlingMode.Disabled)
        self.node = builder.create(iceoryx2.ServiceType.Ipc)
        self.RequestHeader = header_type(self.document, "RequestHeader")
        self.ResponseHeader = header_type(self.document, "ResponseHeader")
        self.plan_port = self.exchange("PLAN_SERVICE").client_builder().initial_max_slice_len(self.constants["PLAN_REQUEST"])
        self.plan_port = self.plan_port.backpressure_strategy(iceoryx2.BackpressureStrategy.DiscardData).create()
        self.geometry = self.exchange("GEOMETRY_SERVICE")
        self.notifier = self.event("WAKE_SERVER_SERVICE").notifier_builder().create()
        self.listener = self.event("WAKE_CLIENT_SERVICE").listener_builder().create()
        self.requests = 0

    def exchange(self, constant):
        """An open request-response service with the settings of the document."""
        name = self.constants[constant]
        settings = self.document.services[name]
        number = lambda setting: int(settings[setting])
        is_on = lambda setting: {"on": True, "off": False}[settings[setting]]
        alignment = iceoryx2.Alignment.new(self.constants["ALIGNMENT"])
        payload = iceoryx2.Slice[ctypes.c_uint8]
        builder = self.node.service_builder(iceoryx2.ServiceName.new(name)).request_response(payload, payload)
        builder = builder.request_header(self.RequestHeader).response_header(self.ResponseHeader)
        builder = builder.request_payload_alignment(alignment).response_payload_alignment(alignment)
        builder = builder.max_servers(number("servers")).max_clients(number("client ports")).max_nodes(number("nodes"))
        builder = builder.max_active_requests_per_client(number("active requests of a client port"))
        builder = builder.max_loaned_requests(number("loaned requests"))
        builder = builder.max_response_buffer_size(number("responses buffered for a request"))
        builder = builder.max_borrowed_responses_per_pending_response(number("responses borrowed of a request"))
        builder = builder.enable_safe_overflow_for_requests(is_on("overflow of requests"))
        builder = builder.enable_safe_overflow_for_responses(is_on("overflow of responses"))
        return builder.enable_fire_and_forget_requests(is_on("fire and forget")).open()

    def event(self, constant):
        name = self.constants[constant]
        settings = self.document.services[name]
        builder = self.node.service_builder(iceoryx2.ServiceName.new(name)).event()
        builder = builder.max_listeners(int(settings["listeners"])).max_notifiers(int(settings["notifiers"]))
        return builder.max_nodes(int(settings["nodes"])).open()

    def check_alive(self):
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            raise SystemExit(f"the daemon (pid {self.pid}) is gone") from None

    def send(self, port, kind, payload=bytes(8), **fields):
        """Sends until the daemon has it."""
        while True:
            request = port.loan_slice_uninit(len(payload))
            header = request.user_header().contents
            header.kind = self.document.enums["RequestKind"][kind]
            for name, value in fields.items():
                setattr(header, name, value)
            number = self.listener.id.value
            header.listener[0], header.listener[1] = number & (1 << 64) - 1, number >> 64
            ctypes.memmove(request.payload().as_ptr(), payload, len(payload))
            pending = request.assume_init().send()
            if pending.number_of_server_connections > 0:
                self.notifier.notify()
                return pending
            pending.delete()
            self.check_alive()
            time.sleep(0.002)

    def receive(self, pending):
        """The next response: header and a copy of its payload."""
        while True:
            connected = pending.is_connected
            response = pending.receive()
            if response is not None:
                header = self.ResponseHeader.from_buffer_copy(response.user_header().contents)
                payload = response.payload()
                data = ctypes.string_at(payload.as_ptr(), payload.len())
                response.delete()
                return header, data
            if not connected:
                raise SystemExit("the daemon let the request go")
            self.check_alive()
            self.listener.timed_wait(iceoryx2.Duration.from_millis(int(TICK_S * 1000)))

    def kind(self, header):
        return next(name for name, number in self.document.enums["ResponseKind"].items() if number == header.kind)

    def error(self, data):
        found = self.document.decode("Error", data)
        codes = {number: name for name, number in self.document.enums["ErrorCode"].items()}
        return Refused(codes.get(found["header"]["code"], "Failed"), found["text"].decode())

    def ask(self, port, kind, payload, answer):
        pending = self.send(port, kind, payload)
        header, data = self.receive(pending)
        pending.delete()
        if self.kind(header) == "Error":
            raise self.error(data)
        assert self.kind(header) == answer, self.kind(header)
        return self.document.decode(answer, data)

    def ask_geometry(self, kind, payload):
        port = self.geometry.client_builder().initial_max_slice_len(len(payload))
        port = port.backpressure_strategy(iceoryx2.BackpressureStrategy.DiscardData).create()
        answer = self.ask(port, kind, payload, "Handle")["header"]
        port.delete()
        return answer

    def have(self, handle):
        return self.ask_geometry("Have", handle)["known"] == 1

    def upload(self, name, units, parts):
        """Uploads parts (name, vertex type, vertices, triangles); returns the message and the handle."""
        payload = encode_upload(self.document, name, units, parts)
        return payload, self.ask_geometry("Upload", payload)["handle"]

    def status(self):
        found = self.ask(self.plan_port, "Status", bytes(8), "Status")
        return found["header"], text(found["texts"], found["header"]["version"])

    def plan(self, payload):
        """The messages of a plan: kind and bytes, chunks put together."""
        self.requests += 1
        number = self.requests
        pending = self.send(self.plan_port, "Plan", payload, request=number)
        control, received, granted, message = None, 0, 0, b""
        while True:
            header, data = self.receive(pending)
            assert (header.request, header.sequence) == (number, received), "chunks are in order"
            received += 1
            if received - granted >= self.constants["CREDIT_STEP"]:
                newer = self.send(self.plan_port, "Control", request=number, consumed=received)
                if control is not None:
                    control.delete()
                control, granted = newer, received
            kind = self.kind(header)
            if kind == "Error":
                raise self.error(data)
            assert header.offset == len(message)
            message += data
            if len(message) < header.total:
                continue
            yield kind, message
            message = b""
            if kind == "Summary":
                pending.delete()
                return


def encode_upload(document, name, units, parts):
    """An upload, its texts in the document's order."""
    texts, records, meshes = Texts(), [], []
    kinds = {"f64 × 3": "VERTICES_F64", "f32 × 3": "VERTICES_F32"}
    for part, kind, vertices, triangles in parts:
        records.append({
            "name": texts.add(part),
            "vertex_kind": document.constants[kinds[kind]],
            "vertices": len(vertices),
            "triangles": len(triangles),
        })
        meshes += [(kind, vertices), ("u32 × 3", triangles)]
    header = {"flags": document.constants["UPLOAD_HAS_UNITS"], "name": texts.add(name), "units": texts.add(units)}
    return document.encode("Upload", header, {"parts": records, "texts": texts.data}, meshes)


def content_handle(document, units, parts):
    """The handle of an upload without fixed parts."""
    number = lambda value: value.to_bytes(8, "little")
    shown = lambda value: number(len(value.encode())) + value.encode()
    stream = shown("sbdp-content/1") + b"\1" + shown(units) + number(0) + number(len(parts))
    for name, _, vertices, triangles in parts:
        stream += shown(name) + number(len(vertices))
        stream += b"".join(document.encode_value("f64 × 3", vertex) for vertex in vertices)
        stream += number(len(triangles))
        stream += b"".join(document.encode_value("u32 × 3", triangle) for triangle in triangles)
    return blake3(stream).digest()
