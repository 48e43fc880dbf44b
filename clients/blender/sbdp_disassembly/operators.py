"""What the buttons call."""

import bpy
import sbdp

from .disassembly import Disassembly, clear

# Seconds between two looks at a running plan. At half nothing is seen earlier; at double progress comes in jerks.
_LOOK = 0.1

# By the name of the scene. Plans are not saved.
_disassemblies: dict[str, Disassembly] = {}


def of_scene(scene: "bpy.types.Scene") -> Disassembly:
    """The plans of a scene."""
    return _disassemblies.setdefault(scene.name_full, Disassembly())


@bpy.app.handlers.persistent
def forget_all(*_: object) -> None:
    """Ends all plans, as of a file that is closed."""
    for disassembly in _disassemblies.values():
        disassembly.close()
    _disassemblies.clear()


class SBDP_OT_plan(bpy.types.Operator):
    """Plan how the objects come apart, and give them keyframes. After an edit, only what changed is sent"""

    bl_idname = "sbdp.plan"
    bl_label = "Plan Disassembly"
    bl_options = {"REGISTER", "UNDO"}

    _timer = None

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT" and of_scene(context.scene).job is None

    def execute(self, context):
        """Waits for the plan: from scripts."""
        return self._finish(context) if self._begin(context) else {"CANCELLED"}

    def invoke(self, context, _event):
        """Lets Blender go on meanwhile: Escape cancels."""
        if not self._begin(context):
            return {"CANCELLED"}
        self._timer = context.window_manager.event_timer_add(_LOOK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        job = of_scene(context.scene).job
        if job is None:
            return self._end(context, {"CANCELLED"})
        if event.type == "ESC":
            job.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            # What the objects are must not change while their plan is made.
            navigates = event.type in {"MOUSEMOVE", "MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE"}
            return {"PASS_THROUGH"} if navigates else {"RUNNING_MODAL"}
        if job.is_alive():
            context.workspace.status_text_set(f"Planning: {len(job.steps)} steps found. Escape cancels")
            return {"RUNNING_MODAL"}
        return self._end(context, self._finish(context))

    def cancel(self, context):
        job = of_scene(context.scene).job
        if job is not None:
            job.cancel()

    def _end(self, context, result):
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        return result

    def _begin(self, context) -> bool:
        try:
            of_scene(context.scene).begin(context, context.scene.sbdp.only_selected)
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return False
        return True

    def _finish(self, context):
        disassembly, settings = of_scene(context.scene), context.scene.sbdp
        try:
            plan = disassembly.finish()
            disassembly.add_keyframes(context, settings.frames_per_step)
        except sbdp.CancelledError:
            self.report({"WARNING"}, "Cancelled")
            return {"CANCELLED"}
        except Exception as error:  # noqa: BLE001 - all that can go wrong is for the person to read
            self.report({"ERROR"}, f"{type(error).__name__}: {error}")
            return {"CANCELLED"}
        for note in disassembly.notes:
            self.report({"WARNING"}, note)
        said = f"{plan.status}: {len(plan)} steps; {disassembly.change}"
        level = "INFO" if plan.status == "complete" else "WARNING"
        # The reason of a plan that was cancelled is just that.
        self.report({level}, f"{said}. {plan.reason}" if plan.reason not in (None, plan.status) else said)
        return {"FINISHED"}


class SBDP_OT_explode(bpy.types.Operator):
    """Show the parts of the last plan along their ways out. Keyframes are cleared"""

    bl_idname = "sbdp.explode"
    bl_label = "Explode"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT" and of_scene(context.scene).motion is not None

    def execute(self, context):
        return _tried(self, lambda: of_scene(context.scene).explode(context))


class SBDP_OT_keyframes(bpy.types.Operator):
    """Give the parts of the last plan keyframes"""

    bl_idname = "sbdp.keyframes"
    bl_label = "Keyframes"
    bl_options = {"REGISTER", "UNDO"}

    poll = SBDP_OT_explode.poll

    def execute(self, context):
        per_step = context.scene.sbdp.frames_per_step
        return _tried(self, lambda: of_scene(context.scene).add_keyframes(context, per_step))


class SBDP_OT_clear(bpy.types.Operator):
    """Remove the keyframes of plans and exploded views, and put all objects back. Other keyframes stay"""

    bl_idname = "sbdp.clear"
    bl_label = "Clear"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT"

    def execute(self, context):
        for note in clear(context):
            self.report({"WARNING"}, note)
        return {"FINISHED"}


class SBDP_OT_select_blocking(bpy.types.Operator):
    """Select the parts that cannot leave, and those that stop them"""

    bl_idname = "sbdp.select_blocking"
    bl_label = "Select What Blocks"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT" and bool(of_scene(context.scene).blocking())

    def execute(self, context):
        roles = of_scene(context.scene).blocking()
        for thing in context.view_layer.objects:
            thing.select_set(thing.name_full in roles)
        self.report({"INFO"}, "; ".join(f"{name}: {role}" for name, role in sorted(roles.items())))
        return {"FINISHED"}


def _tried(operator, act):
    try:
        act()
    except (ValueError, RuntimeError) as error:
        operator.report({"ERROR"}, str(error))
        return {"CANCELLED"}
    return {"FINISHED"}


CLASSES = (SBDP_OT_plan, SBDP_OT_explode, SBDP_OT_keyframes, SBDP_OT_clear, SBDP_OT_select_blocking)
