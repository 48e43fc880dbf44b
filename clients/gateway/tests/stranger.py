"""A client that knows nothing of the project but its proto file: stranger.py plain|tls ADDRESS CERTIFICATE ASSEMBLY PLAN. Plans
the assembly, a folder of OBJ files, and compares with the plan that the command line wrote."""

import json
import re
import struct
import sys
from pathlib import Path

import grpc
from sbdp.v1 import planner_pb2 as sbdp
from sbdp.v1 import planner_pb2_grpc


def meshes(folder):
    """Parts of OBJ files, in natural order of their names: name, rows of vertices, rows of triangles."""
    natural = lambda path: [int(t) if t.isdigit() else t for t in re.split(r"(\d+)", path.stem)]
    for path in sorted(Path(folder).glob("*.obj"), key=natural):
        lines = [line.split() for line in path.read_text().splitlines()]
        vertices = [tuple(map(float, line[1:4])) for line in lines if line[:1] == ["v"]]
        faces = [[int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[:1] == ["f"]]
        yield path.stem, vertices, [(f[0], f[n], f[n + 1]) for f in faces for n in range(1, len(f) - 1)]


def messages(folder, description):
    yield sbdp.UploadRequest(
        assembly=sbdp.Assembly(
            name=description.get("name", Path(folder).name),
            units=description.get("units"),
            fixed=description.get("fixed", []),
        )
    )
    for name, vertices, triangles in meshes(folder):
        rows = lambda code, triples: b"".join(struct.pack(f"<3{code}", *triple) for triple in triples)
        mesh = sbdp.Mesh(name=name, vertices_f64=rows("d", vertices), triangles=rows("I", triangles))
        yield sbdp.UploadRequest(mesh=mesh)


def refused(call):
    """The error of a call that must fail, and its code."""
    try:
        call()
    except grpc.RpcError as error:
        metadata = dict(error.trailing_metadata())
        return error, int(metadata["sbdp-code"])
    raise SystemExit("this was to be refused")


def main(kind, address, certificate, folder, plan):
    if kind == "tls":
        roots = grpc.ssl_channel_credentials(Path(certificate).read_bytes())
        options = [("grpc.ssl_target_name_override", "localhost")]
        channel = grpc.secure_channel(address, roots, options)
    else:
        channel = grpc.insecure_channel(address)
    planner = planner_pb2_grpc.PlannerServiceStub(channel)
    file = Path(folder) / "assembly.json"
    description = json.loads(file.read_text()) if file.exists() else {}

    handle = planner.Upload(messages(folder, description)).handle
    assert planner.Have(sbdp.HaveRequest(handle=handle)).known
    status = planner.Status(sbdp.StatusRequest())
    uploads = status.uploads
    assert planner.Upload(messages(folder, description)).handle == handle
    assert planner.Status(sbdp.StatusRequest()).uploads == uploads, "known content was sent again"

    names = [name for name, _, _ in meshes(folder)]
    fixed = sorted(names.index(name) for name in description.get("fixed", []))
    request = sbdp.PlanRequest(handle=handle, fixed=fixed, document=True)
    events = list(planner.Plan(request, timeout=30))
    steps = [event.step for event in events if event.HasField("step")]
    document = json.loads("".join(event.document for event in events if event.HasField("document")))
    end = events[-1].end
    expected = json.loads(Path(plan).read_text())
    # Only the command line knows the files.
    expected.pop("source")
    expected.pop("groups", None)
    assert list(document) == [key for key in expected], (list(document), list(expected))
    for key, value in expected.items():
        assert document[key] == value, f"{key} differs: {document[key]} and {value}"
    assert [list(step.path) for step in steps] == [sum(step["path"], []) for step in expected["steps"]]
    assert [[end.parts[part] for part in step.parts] for step in steps] == [step["parts"] for step in expected["steps"]]
    assert sbdp.PlanStatus.Name(end.status) == "PLAN_STATUS_" + expected["status"].upper()

    # A search that ends by its deadline, and one that is cancelled.
    endless = dict(handle=handle, planner=sbdp.PLANNER_RRT, max_simulations=2**63, no_cache=True)
    last = list(planner.Plan(sbdp.PlanRequest(timeout_s=0.5, **endless)))[-1].end
    assert last.status == sbdp.PLAN_STATUS_TIMEOUT
    stream = planner.Plan(sbdp.PlanRequest(cancel_key="stranger", **endless))
    next(stream)
    assert planner.Cancel(sbdp.CancelRequest(cancel_key="stranger")).found
    assert list(stream)[-1].end.status == sbdp.PLAN_STATUS_CANCELLED
    stream = planner.Plan(sbdp.PlanRequest(**endless))
    next(stream)
    stream.cancel()
    while planner.Status(sbdp.StatusRequest()).running:
        pass

    error, code = refused(lambda: list(planner.Plan(sbdp.PlanRequest(handle=bytes(32)))))
    assert (error.code(), code) == (grpc.StatusCode.NOT_FOUND, sbdp.ERROR_CODE_UNKNOWN_HANDLE)
    error, code = refused(lambda: list(planner.Plan(sbdp.PlanRequest(handle=handle, fixed=[99]))))
    assert (error.code(), code) == (grpc.StatusCode.INVALID_ARGUMENT, sbdp.ERROR_CODE_NO_SUCH_PART)
    print(f"{kind}: {len(steps)} steps of {Path(folder).name}, as the command line has them")


if __name__ == "__main__":
    main(*sys.argv[1:])
