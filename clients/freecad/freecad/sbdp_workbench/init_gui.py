"""What FreeCAD's window loads when it starts."""

from pathlib import Path

import FreeCAD
import FreeCADGui

ICON = str(Path(__file__).parent / "resources" / "sbdp.svg")
INSTALL = "The Python module `sbdp` is not found. Install it as clients/freecad/README.md says.\n"


class DisassemblyCommand:
    """Opens the panel."""

    def GetResources(self):
        return {"MenuText": "Disassembly …", "ToolTip": "Plan how the parts of the document come apart", "Pixmap": ICON}

    def IsActive(self):
        return FreeCAD.ActiveDocument is not None and not FreeCADGui.Control.activeDialog()

    def Activated(self):
        # Not when FreeCAD starts: other workbenches do not need it.
        try:
            import sbdp  # noqa: F401
        except ImportError as error:
            FreeCAD.Console.PrintError(f"{INSTALL}{error}\n")
            return
        from . import panel

        panel.show(FreeCAD.ActiveDocument)


class DisassemblyWorkbench(FreeCADGui.Workbench):
    """The workbench."""

    MenuText = "Disassembly"
    ToolTip = "Plans how the parts of a document come apart"
    Icon = ICON

    def Initialize(self):
        commands = ["Sbdp_Disassembly"]
        self.appendToolbar("Disassembly", commands)
        self.appendMenu("Disassembly", commands)

    def GetClassName(self):
        return "Gui::PythonWorkbench"


FreeCADGui.addCommand("Sbdp_Disassembly", DisassemblyCommand())
FreeCADGui.addWorkbench(DisassemblyWorkbench())
