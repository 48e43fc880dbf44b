"""Runs the tests of this folder within FreeCAD: `freecadcmd run.py`, or those without a name in $SBDP_TESTS. Prints `N passed,
N failed` at the end, and ends with 1 unless all ran and passed: FreeCAD itself ends with 0 whatever a script raises."""

import os
import sys
import traceback
import unittest
from pathlib import Path


def main() -> int:
    folder = Path(__file__).resolve().parent
    sys.path.insert(0, str(folder))
    pattern = os.environ.get("SBDP_TESTS", "test_*.py")
    tests = unittest.defaultTestLoader.discover(str(folder), pattern=pattern)
    # What a button raises gets no further than Qt.
    raised = []
    sys.excepthook = lambda *error: (raised.append(error), traceback.print_exception(*error, file=sys.stdout))
    result = unittest.TextTestRunner(stream=sys.stdout, verbosity=2).run(tests)
    failed = len(result.failures) + len(result.errors) + len(result.unexpectedSuccesses) + len(raised)
    passed = max(0, result.testsRun - failed - len(result.skipped) - len(result.expectedFailures))
    print(f"{passed} passed, {failed} failed, {len(result.skipped)} skipped", flush=True)
    if support := sys.modules.get("support"):
        support.stop()
    return 0 if passed and not failed else 1


try:
    code = main()
except BaseException:  # noqa: BLE001 - nothing may be swallowed
    traceback.print_exc(file=sys.stdout)
    print("0 passed, 1 failed, 0 skipped", flush=True)
    code = 1
sys.stdout.flush()
# Without the program's own end, which would ask for what to do with the documents.
os._exit(code)
