"""The panel in the sidebar of the 3D view."""

import bpy

from .operators import of_scene

# Of the list of steps in the panel; longer ones would fill the sidebar.
_SHOWN = 12


class SBDP_settings(bpy.types.PropertyGroup):
    """What is kept with a scene."""

    only_selected: bpy.props.BoolProperty(
        name="Only Selected", description="Plan the selected objects alone; others are not there for the planner"
    )
    frames_per_step: bpy.props.IntProperty(
        name="Frames per Step", description="How many frames each step of the plan takes", default=24, min=1, soft_max=250
    )


class SBDP_PT_panel(bpy.types.Panel):
    """Buttons, and the steps with their frames."""

    bl_label = "Disassembly"
    bl_idname = "SBDP_PT_panel"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Disassembly"

    def draw(self, context):
        layout, settings, disassembly = self.layout, context.scene.sbdp, of_scene(context.scene)
        layout.prop(settings, "only_selected")
        layout.prop(settings, "frames_per_step")
        layout.operator("sbdp.plan", icon="PLAY")
        row = layout.row(align=True)
        row.operator("sbdp.keyframes", icon="KEYFRAME")
        row.operator("sbdp.explode", icon="MOD_EXPLODE")
        layout.operator("sbdp.select_blocking", icon="RESTRICT_SELECT_OFF")
        layout.operator("sbdp.clear", icon="X")
        if disassembly.plan is None:
            return
        box = layout.box().column(align=True)
        box.label(text=f"{disassembly.plan.status}, {len(disassembly.plan)} steps")
        for step in disassembly.plan.steps[:_SHOWN]:
            first, last = disassembly.frames(context.scene, step.number, settings.frames_per_step)
            box.label(text=f"{step.number + 1}. {', '.join(step.parts)} (frames {first}–{last})")
        if len(disassembly.plan) > _SHOWN:
            box.label(text=f"and {len(disassembly.plan) - _SHOWN} more")


CLASSES = (SBDP_settings, SBDP_PT_panel)
