"""The document shows a plan: parts stand where they are at a moment of it, or in an exploded view, and get back to where they
were. Needs no window."""

import FreeCAD
import numpy
from sbdp.motion import is_rigid, pose

from .document import Parts, as_matrix, as_placement

# What the entry in the list of undo steps says.
_TRANSACTION = "Show disassembly"


class Display:
    """Moves the parts of a document, and remembers where they belong.

    All movements until `reset` are one step of undo. A part whose placement somebody else sets meanwhile stays there: that is
    where it belongs from then on, and `edited` has its name. While the document is saved, the parts are where they belong.
    """

    def __init__(self, document: "FreeCAD.Document", parts: Parts) -> None:
        self.document, self.parts = document, parts.parts
        #: Names of parts that somebody else moved since `reset`.
        self.edited: set[str] = set()
        self._home = {name: part.placement for name, part in self.parts.items()}
        # What was set last; none where a part is at home.
        self._shown: dict[str, FreeCAD.Placement] = {}
        self._untouched: set[str] = set()
        self._saving: dict[str, FreeCAD.Placement] | None = None
        FreeCAD.addDocumentObserver(self)
        self._closed = False

    def show(self, transforms: "dict[str, numpy.ndarray]") -> None:
        """Puts parts where rigid transforms bring them, from where they belong, in the frame of the document; all others to
        where they belong. Raises ValueError for one that is in a container that is scaled."""
        targets = {name: self._target(name, transform) for name, transform in transforms.items() if self._is_there(name)}
        self._keep_edits()
        for name in self.parts:
            if self._is_there(name):
                self._put(name, targets.get(name))

    def reset(self) -> None:
        """Puts all parts to where they belong, if the document is open."""
        if not is_open(self.document):
            return
        self._keep_edits()
        for name in self.parts:
            if self._is_there(name):
                self._put(name, None)
        self._commit()

    def close(self) -> None:
        """Resets, and looks at the document no more."""
        if self._closed:
            return
        self._closed = True
        FreeCAD.removeDocumentObserver(self)
        self.reset()

    @property
    def is_home(self) -> bool:
        """Whether all parts stand where they belong."""
        return not self._shown

    def _target(self, name: str, transform: "numpy.ndarray") -> "FreeCAD.Placement | None":
        if name in self.edited or numpy.array_equal(transform, numpy.eye(4)):
            return None
        outer = self.parts[name].outer
        if not is_rigid(as_matrix(outer), 1e-6):
            raise ValueError(f"`{name}` is in a container that is scaled: it cannot be moved there")
        return outer.inverse() * as_placement(pose(transform)) * outer * self._home[name]

    def _put(self, name: str, target: "FreeCAD.Placement | None") -> None:
        if target is None and name not in self._shown:
            return
        part = self.parts[name]
        if not self.document.HasPendingTransaction:
            self.document.openTransaction(_TRANSACTION)
        if name not in self._shown and "Touched" not in part.object.State:
            self._untouched.add(name)
        part.placement = self._home[name] if target is None else target
        if target is None:
            del self._shown[name]
            if name in self._untouched:
                # It is as it was: there is nothing to compute again.
                self._untouched.discard(name)
                part.object.purgeTouched()
        else:
            # As the document has it, which rounds it.
            self._shown[name] = part.placement

    def _keep_edits(self) -> None:
        """Finds parts that somebody else moved."""
        for name, part in self.parts.items():
            if not self._is_there(name):
                self._shown.pop(name, None)
                continue
            now, expected = part.placement, self._shown.get(name, self._home[name])
            if _same(now, expected):
                continue
            # By undo it came home.
            if not _same(now, self._home[name]):
                self._home[name] = now
                self.edited.add(name)
            self._shown.pop(name, None)
            self._untouched.discard(name)

    def _commit(self) -> None:
        self._untouched.clear()
        if self.document.HasPendingTransaction:
            self.document.commitTransaction()

    def _is_there(self, name: str) -> bool:
        part = self.parts[name]
        try:
            there = part.object.Document is not None and part.object.Name is not None
        except ReferenceError:
            return False
        return there and (part.element is None or part.element < part.object.ElementCount)

    # What FreeCAD calls.

    def slotStartSaveDocument(self, document: "FreeCAD.Document", _file: str) -> None:
        if document == self.document and self._shown:
            self._keep_edits()
            self._saving = dict(self._shown)
            for name in self._saving:
                self._put(name, None)

    def slotFinishSaveDocument(self, document: "FreeCAD.Document", _file: str) -> None:
        if document == self.document and self._saving is not None:
            shown, self._saving = self._saving, None
            for name, placement in shown.items():
                self._put(name, placement)

    def slotDeletedDocument(self, document: "FreeCAD.Document") -> None:
        if document == self.document:
            self._closed = True
            FreeCAD.removeDocumentObserver(self)


def is_open(document: "FreeCAD.Document") -> bool:
    """Whether a document was not closed."""
    try:
        return document.Name in FreeCAD.listDocuments()
    except ReferenceError:
        return False


def _same(one: "FreeCAD.Placement", other: "FreeCAD.Placement") -> bool:
    return one.Base == other.Base and one.Rotation.Q == other.Rotation.Q
