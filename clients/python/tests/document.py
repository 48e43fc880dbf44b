"""Prints the document of a plan, for `.ci/documents`: document.py RUNTIME_DIR ASSEMBLY NAME UNITS FIXED..."""

import sys

import sbdp


def main(runtime, assembly, _name, _units, *fixed):
    with sbdp.connect(runtime) as client:
        sys.stdout.write(client.plan(sbdp.load(assembly), fixed=fixed).result().to_json())


main(*sys.argv[1:])
