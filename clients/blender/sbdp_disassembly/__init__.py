"""Plans how the objects of a scene come apart, and gives them keyframes."""

bl_info = {
    "name": "Disassembly (sbdp)",
    "description": "Plans how the objects of a scene come apart, and gives them keyframes",
    "author": "The authors of sbdp",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "3D View > Sidebar > Disassembly",
    "category": "Animation",
}

import bpy


def _module():
    # Without it the add-on cannot be enabled, and Blender shows this.
    try:
        import sbdp  # noqa: F401
    except ImportError as error:
        raise ImportError(
            f"the Python module `sbdp` is missing: install it as clients/blender/README.md says ({error})"
        ) from error


def register():
    _module()
    from . import operators, panel

    for kind in (*operators.CLASSES, *panel.CLASSES):
        bpy.utils.register_class(kind)
    bpy.types.Scene.sbdp = bpy.props.PointerProperty(type=panel.SBDP_settings)
    bpy.app.handlers.load_pre.append(operators.forget_all)


def unregister():
    from . import operators, panel

    operators.forget_all()
    bpy.app.handlers.load_pre.remove(operators.forget_all)
    del bpy.types.Scene.sbdp
    for kind in reversed((*operators.CLASSES, *panel.CLASSES)):
        bpy.utils.unregister_class(kind)
