"""Prints the document of a plan through the gateway at $SBDP_GATEWAY, for `.ci/documents`: document.py RUNTIME_DIR ASSEMBLY
NAME UNITS FIXED..."""

import os
import sys

import grpc
from sbdp.v1 import planner_pb2 as sbdp
from sbdp.v1 import planner_pb2_grpc

from stranger import meshes, messages


def main(_runtime, folder, name, units, *fixed):
    planner = planner_pb2_grpc.PlannerServiceStub(grpc.insecure_channel(os.environ["SBDP_GATEWAY"]))
    handle = planner.Upload(messages(folder, {"name": name, "units": units or None, "fixed": fixed})).handle
    names = [part for part, _, _ in meshes(folder)]
    request = sbdp.PlanRequest(handle=handle, fixed=sorted(map(names.index, fixed)), document=True)
    for event in planner.Plan(request, timeout=60):
        if event.HasField("document"):
            sys.stdout.write(event.document)


main(*sys.argv[1:])
