"""Colours of parts that block, and back. Needs FreeCAD's window: without one, objects have no colours."""

import FreeCAD

# Red for what cannot leave, orange for what stops it; as in the page of `sbdp view`.
COLOURS = {"captive": (0.85, 0.15, 0.10), "blocks": (1.00, 0.60, 0.10)}
# Per cent, of all other parts, so that what is marked can be seen inside them. At half they hide it; at double they are hardly
# seen themselves.
_TRANSPARENCY = 70


class Marks:
    """Parts of a document that are coloured for a while; not while it is saved."""

    def __init__(self, document: "FreeCAD.Document") -> None:
        self.document = document
        self._before: list[tuple] = []
        # What is marked, and is again when the document was saved.
        self._marked: tuple[dict, dict[str, str]] | None = None
        FreeCAD.addDocumentObserver(self)

    def mark(self, parts: dict, roles: dict[str, str]) -> None:
        """Colours parts (`PartObject` by name) by what they are in `blocking()`, and makes the others transparent."""
        self.clear()
        self._marked = parts, roles
        marked = {parts[name].object.Name for name in roles}
        for name, part in parts.items():
            if name in roles:
                self._colour(part.object.ViewObject, COLOURS[roles[name]])
            elif part.object.Name not in marked:
                self._fade(part.object.ViewObject)

    def clear(self) -> None:
        """Gives all parts their colours back."""
        self._marked = None
        self._restore()

    def close(self) -> None:
        """The same, for good."""
        FreeCAD.removeDocumentObserver(self)
        self.clear()

    def slotStartSaveDocument(self, document: "FreeCAD.Document", _file: str) -> None:
        """Called by FreeCAD."""
        if document == self.document:
            self._restore()

    def slotFinishSaveDocument(self, document: "FreeCAD.Document", _file: str) -> None:
        """Called by FreeCAD."""
        if document == self.document and self._marked is not None:
            self.mark(*self._marked)

    def _restore(self) -> None:
        for view, name, value in reversed(self._before):
            try:
                setattr(view, name, value)
            except ReferenceError:
                # The object was deleted meanwhile.
                continue
        self._before.clear()

    def _set(self, view, name: str, value) -> None:
        self._before.append((view, name, getattr(view, name)))
        setattr(view, name, value)

    def _colour(self, view, colour: tuple[float, float, float]) -> None:
        if view is None:
            return
        if hasattr(view, "OverrideMaterial"):
            # A link shows the colours of its object, unless it has a material of its own.
            self._before.append((view, "ShapeMaterial", view.ShapeMaterial))
            self._set(view, "OverrideMaterial", True)
            material = view.ShapeMaterial
            material.DiffuseColor = colour
            view.ShapeMaterial = material
            return
        if hasattr(view, "DiffuseColor"):
            # Colours of single faces, which a colour of the whole replaces.
            self._before.append((view, "DiffuseColor", view.DiffuseColor))
        self._set(view, "ShapeColor", colour)

    def _fade(self, view) -> None:
        if view is not None and hasattr(view, "Transparency"):
            self._set(view, "Transparency", _TRANSPARENCY)
