"""The task panel."""

import FreeCAD
import FreeCADGui
import sbdp
from PySide2 import QtCore, QtWidgets

from .colours import Marks
from .disassembly import Disassembly
from .document import DEFLECTION

# Positions of the slider for each step. At half the motion of long ways is jerky; at double a slider of 300 steps has more
# positions than it can be wide.
PER_STEP = 100
# Milliseconds between two looks at a running plan. At half nothing is seen earlier; at double progress comes in jerks.
_LOOK = 100
_STATUS = {
    "complete": "Complete: the parts come apart.",
    "partial": "Partial: the limit was reached first.",
    "infeasible": "Infeasible.",
    "exhausted": "Exhausted: nothing more was found to try.",
    "timeout": "The time was over.",
    "cancelled": "Cancelled.",
}


class Panel:
    """Plans the active document, and shows the plan in it. FreeCAD calls `accept` and `reject`."""

    def __init__(self, document: "FreeCAD.Document", connect=None) -> None:
        self.disassembly = Disassembly(document, connect)
        self.marks = Marks(document)
        self._closed = False
        self.form = QtWidgets.QWidget()
        self.form.setWindowTitle("Disassembly")
        self._build()
        self._timer = QtCore.QTimer()
        self._timer.setInterval(_LOOK)
        self._timer.timeout.connect(self._look)
        self._playing = QtCore.QTimer()
        self._playing.setInterval(40)
        self._playing.timeout.connect(self._play_on)
        self._say("Choose what to plan.")
        self._enable()

    def _build(self) -> None:
        self.whole = QtWidgets.QRadioButton("Whole document")
        self.selected = QtWidgets.QRadioButton("Selected parts")
        (self.selected if FreeCADGui.Selection.getSelectionEx("", 0) else self.whole).setChecked(True)
        self.deflection = QtWidgets.QDoubleSpinBox()
        self.deflection.setDecimals(3)
        self.deflection.setRange(0.001, 10.0)
        self.deflection.setSingleStep(0.01)
        self.deflection.setValue(DEFLECTION)
        self.deflection.setSuffix(" mm")
        self.deflection.setToolTip("How far the triangles of meshes may be from the surfaces")
        self.plan = self._button("Plan", self._plan, "Plan how the parts come apart; all meshes are sent")
        self.replan = self._button("Replan", self._replan, "Plan again after an edit; only what changed is sent")
        self.cancel = self._button("Cancel", self._cancel, "End the running plan")
        self.play = self._button("Play", self._play, "Play the motion from here")
        self.slider = QtWidgets.QSlider(QtCore.Qt.Horizontal)
        self.slider.valueChanged.connect(self._scrub)
        self.steps = QtWidgets.QListWidget()
        self.steps.setMinimumHeight(150)
        self.steps.currentRowChanged.connect(self._go_to)
        # Also where the row is the current one already.
        self.steps.itemClicked.connect(lambda item: self._go_to(self.steps.row(item)))
        self.exploded = QtWidgets.QCheckBox("Exploded view")
        self.exploded.toggled.connect(self._explode)
        self.blocking = QtWidgets.QCheckBox("Mark what blocks")
        self.blocking.toggled.connect(self._mark)
        self.reset = self._button("Reset", self._reset, "Bring all parts and colours back")
        self.status = QtWidgets.QLabel()
        self.status.setWordWrap(True)
        self.status.setTextInteractionFlags(QtCore.Qt.TextSelectableByMouse)

        layout = QtWidgets.QVBoxLayout(self.form)
        for widgets in (
            (self.whole,),
            (self.selected,),
            (QtWidgets.QLabel("Deflection"), self.deflection),
            (self.plan, self.replan, self.cancel),
            (self.steps,),
            (self.slider, self.play),
            (self.exploded,),
            (self.blocking,),
            (self.reset,),
            (self.status,),
        ):
            row = QtWidgets.QHBoxLayout()
            for widget in widgets:
                row.addWidget(widget)
            layout.addLayout(row)
        layout.addStretch()

    def _button(self, text, clicked, tip):
        button = QtWidgets.QPushButton(text)
        button.setToolTip(tip)
        # The task panel is narrow at first: three buttons go beside each other.
        button.setMinimumWidth(40)
        button.clicked.connect(clicked)
        return button

    # Planning.

    def _plan(self) -> None:
        if self.disassembly.job is None:
            self.disassembly.forget()
            self._begin()

    def _replan(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self._reset()
        try:
            self.disassembly.begin(self._selection(), self.deflection.value())
        except (ValueError, RuntimeError) as error:
            self._say(_words(error), error=True)
            return
        finally:
            self._list_steps()
        self._say("Planning …")
        self._enable()
        self._timer.start()

    def _selection(self):
        if self.whole.isChecked():
            return None
        paths = []
        for chosen in FreeCADGui.Selection.getSelectionEx(self.disassembly.document.Name, 0):
            for below in chosen.SubElementNames or ("",):
                # Objects end with a dot; what is behind the last one is a face, edge or vertex.
                paths.append((chosen.Object.Name, *below.split(".")[:-1]))
        return paths

    def _cancel(self) -> None:
        if self.disassembly.job is not None:
            self.disassembly.job.cancel()
            self._say("Cancelling …")

    def _look(self) -> None:
        job = self.disassembly.job
        if job is None:
            self._timer.stop()
        elif job.is_alive():
            found, progress = len(job.steps), job.progress
            simulations = f", {progress['simulations']} simulations" if progress else ""
            self._say(f"Planning … {found} steps found{simulations}")
        else:
            self._timer.stop()
            self._finish()

    def _finish(self) -> None:
        try:
            plan = self.disassembly.finish()
        except sbdp.CancelledError:
            self._say("Cancelled.")
        except Exception as error:  # noqa: BLE001 - all that can go wrong is for the person to read
            self._say(_words(error), error=True)
        else:
            lines = [_STATUS.get(plan.status, plan.status)]
            # The reason of a plan that was cancelled is just that.
            lines += [plan.reason] if plan.reason not in (None, plan.status) else []
            lines += [f"{len(plan)} steps; {self.disassembly.change}.", *self.disassembly.notes]
            self._say("\n".join(lines), error=plan.status in ("infeasible", "exhausted"))
        self._list_steps()
        self._enable()

    # Showing.

    def _list_steps(self) -> None:
        plan = self.disassembly.plan
        for widget in (self.steps, self.slider):
            widget.blockSignals(True)
        self.steps.clear()
        for step in plan.steps if plan else ():
            aside = " (aside)" if step.ends == "aside" else ""
            inside = "    " if step.of is not None else ""
            self.steps.addItem(f"{inside}{step.number + 1}. {', '.join(step.parts)}{aside}")
        self.slider.setRange(0, PER_STEP * len(plan) if plan else 0)
        self.slider.setValue(0)
        for widget in (self.steps, self.slider):
            widget.blockSignals(False)

    def _show(self, show) -> None:
        try:
            show()
        except ValueError as error:
            self._stop_playing()
            self._say(_words(error), error=True)
        FreeCADGui.updateGui()

    def _scrub(self, value: int) -> None:
        if self.disassembly.motion is None:
            return
        self._uncheck(self.exploded)
        self._show(lambda: self.disassembly.show(value / PER_STEP))
        self.steps.blockSignals(True)
        # The step that is under way, or has just ended.
        self.steps.setCurrentRow((value - 1) // PER_STEP)
        self.steps.blockSignals(False)

    def _go_to(self, row: int) -> None:
        self.slider.setValue((row + 1) * PER_STEP)

    def _play(self) -> None:
        if self._playing.isActive():
            self._stop_playing()
            return
        if self.slider.value() == self.slider.maximum():
            self.slider.setValue(0)
        self.play.setText("Pause")
        self._playing.start()

    def _play_on(self) -> None:
        # A step takes a second.
        self.slider.setValue(self.slider.value() + PER_STEP * self._playing.interval() // 1000)
        if self.slider.value() >= self.slider.maximum():
            self._stop_playing()

    def _stop_playing(self) -> None:
        self._playing.stop()
        self.play.setText("Play")

    def _explode(self, on: bool) -> None:
        self._stop_playing()
        if self.disassembly.motion is None:
            return
        if on:
            self._show(self.disassembly.explode)
        else:
            self._scrub(self.slider.value())

    def _mark(self, on: bool) -> None:
        roles = self.disassembly.blocking() if on else {}
        self.marks.clear()
        if roles:
            self.marks.mark(self.disassembly.display.parts, roles)
        elif on:
            self._say("Nothing blocks: the plan is complete." if self.disassembly.plan else "There is no plan yet.")

    def _reset(self) -> None:
        self._stop_playing()
        self._uncheck(self.exploded, self.blocking)
        self.marks.clear()
        self.slider.blockSignals(True)
        self.slider.setValue(0)
        self.slider.blockSignals(False)
        self.disassembly.reset()

    def _uncheck(self, *boxes) -> None:
        for box in boxes:
            box.blockSignals(True)
            box.setChecked(False)
            box.blockSignals(False)

    def _enable(self) -> None:
        running, planned = self.disassembly.job is not None, self.disassembly.plan is not None
        for widget in (self.plan, self.whole, self.selected, self.deflection):
            widget.setEnabled(not running)
        self.replan.setEnabled(not running and self.disassembly.was_sent)
        self.cancel.setEnabled(running)
        moves = planned and len(self.disassembly.plan) > 0
        for widget in (self.slider, self.play, self.steps, self.exploded):
            widget.setEnabled(bool(moves))
        self.blocking.setEnabled(planned)
        self.reset.setEnabled(planned)

    def _say(self, text: str, error: bool = False) -> None:
        self.status.setStyleSheet("color: #c03020" if error else "")
        self.status.setText(text)

    # What FreeCAD calls.

    def getStandardButtons(self) -> int:
        return int(QtWidgets.QDialogButtonBox.Close)

    def reject(self) -> bool:
        """Closes: a running plan is cancelled, and the document is as it was."""
        if not self._closed:
            self._closed = True
            self._timer.stop()
            self._playing.stop()
            self.marks.close()
            self.disassembly.close()
            FreeCADGui.Control.closeDialog()
        return True

    accept = reject


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, (ValueError, RuntimeError)) else f"{type(error).__name__}: {error}"


def show(document: "FreeCAD.Document", connect=None) -> Panel:
    """Opens the panel."""
    panel = Panel(document, connect)
    FreeCADGui.Control.showDialog(panel)
    return panel
