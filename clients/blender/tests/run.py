"""Runs the tests of this folder within Blender: `blender -b --factory-startup --python run.py`. Prints `N passed, N failed` at the
end, and ends with 1 unless all ran and passed: Blender itself ends with 0 whatever a script raises."""

import os
import sys
import traceback
import unittest
from pathlib import Path


def main() -> int:
    import addon_utils

    folder = Path(__file__).resolve().parent
    sys.path.insert(0, str(folder))
    if addon_utils.enable("sbdp_disassembly") is None:
        raise RuntimeError("the add-on cannot be enabled: see above")
    pattern = os.environ.get("SBDP_TESTS", "test_*.py")
    tests = unittest.defaultTestLoader.discover(str(folder), pattern=pattern)
    result = unittest.TextTestRunner(stream=sys.stdout, verbosity=2).run(tests)
    failed = len(result.failures) + len(result.errors) + len(result.unexpectedSuccesses)
    passed = result.testsRun - failed - len(result.skipped) - len(result.expectedFailures)
    if support := sys.modules.get("support"):
        support.stop()
    print(f"{passed} passed, {failed} failed, {len(result.skipped)} skipped", flush=True)
    return 0 if passed and not failed else 1


try:
    code = main()
except BaseException:  # noqa: BLE001 - nothing may be swallowed
    traceback.print_exc(file=sys.stdout)
    print("0 passed, 1 failed, 0 skipped", flush=True)
    code = 1
sys.stdout.flush()
os._exit(code)
