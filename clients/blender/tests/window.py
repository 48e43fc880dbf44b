"""The add-on in Blender's window: `xvfb-run blender --factory-startup --enable-event-simulate --python window.py`. A plan that is
running is cancelled with Escape, and another one gives keyframes, while the window lives. Prints `N passed, N failed, N skipped`
as `run.py`. With $SBDP_PICTURES, a folder, it saves a picture of the window."""

import os
import sys
import traceback
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))


def in_view():
    """The 3D view."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return {"window": window, "area": area, "region": region}


def disassembly_of(make):
    import support

    from sbdp_disassembly import operators
    from sbdp_disassembly.disassembly import Disassembly

    operators.forget_all()
    make()
    made = Disassembly(support.connect)
    operators._disassemblies[bpy.context.scene.name_full] = made
    return made


def plan():
    with bpy.context.temp_override(**in_view()):
        assert bpy.ops.sbdp.plan("INVOKE_DEFAULT") == {"RUNNING_MODAL"}


def escape_cancels():
    """Yields seconds to wait; the window goes on meanwhile."""
    from test_cancel import Cancelling

    disassembly = disassembly_of(Cancelling.make)
    yield 0.5
    plan()
    job = disassembly.job
    while job.progress is None and job.is_alive():
        yield 0.05
    assert job.is_alive(), job.error
    in_view()["window"].event_simulate(type="ESC", value="PRESS", x=200, y=200)
    while disassembly.job is not None:
        yield 0.1
    assert disassembly.plan.status == "cancelled", disassembly.plan.status


def a_plan_gives_keyframes():
    import support

    disassembly = disassembly_of(support.bolted)
    yield 0.5
    plan()
    while disassembly.job is not None:
        yield 0.1
    yield 0.2
    assert disassembly.plan.status == "complete"
    assert bpy.data.objects["bolt 1"].animation_data.action.name == "Disassembly bolt 1"
    bpy.context.scene.frame_set(1 + 24 * 4 + 12)
    assert bpy.data.objects["bolt 1"].location.z > 2
    yield from picture()


def picture():
    folder = os.environ.get("SBDP_PICTURES")
    if not folder:
        return
    from sbdp_disassembly import panel

    # In the tab that is on top: scripts cannot choose another.
    bpy.utils.unregister_class(panel.SBDP_PT_panel)
    panel.SBDP_PT_panel.bl_category, panel.SBDP_PT_panel.bl_order = "Tool", 0
    bpy.utils.register_class(panel.SBDP_PT_panel)
    with bpy.context.temp_override(**in_view()):
        bpy.context.space_data.show_region_ui = True
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_orbit(angle=0.6, type="ORBITRIGHT")
        bpy.ops.view3d.view_orbit(angle=0.5, type="ORBITDOWN")
        bpy.ops.view3d.view_all()
    yield 1.5
    with bpy.context.temp_override(**in_view()):
        bpy.ops.screen.screenshot(filepath=os.path.join(folder, "blender-window.png"))


TESTS = [escape_cancels, a_plan_gives_keyframes]
failed = []


def run():
    for test in TESTS:
        try:
            yield from test()
        except BaseException:  # noqa: BLE001 - nothing may be swallowed
            traceback.print_exc(file=sys.stdout)
            failed.append(test.__name__)
        print(f"{test.__name__} ... {'FAIL' if test.__name__ in failed else 'ok'}", flush=True)


def end():
    import support

    support.stop()
    print(f"{len(TESTS) - len(failed)} passed, {len(failed)} failed, 0 skipped", flush=True)
    os._exit(1 if failed else 0)


def go_on(steps):
    try:
        return next(steps)
    except StopIteration:
        end()


def main():
    import addon_utils

    bpy.context.preferences.view.show_splash = False
    if addon_utils.enable("sbdp_disassembly") is None:
        print("the add-on cannot be enabled: see above", flush=True)
        os._exit(1)
    steps = run()
    bpy.app.timers.register(lambda: go_on(steps), first_interval=0.5, persistent=True)


main()
