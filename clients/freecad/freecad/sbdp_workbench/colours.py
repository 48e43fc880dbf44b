"""Colours of parts that block, and back. Needs FreeCAD's window: without one, objects have no colours."""

# Red for what cannot leave, orange for what stops it; as in the page of `sbdp view`.
COLOURS = {"captive": (0.85, 0.15, 0.10), "blocks": (1.00, 0.60, 0.10)}
# Per cent, of all other parts, so that what is marked can be seen inside them. At half they hide it; at double they are hardly
# seen themselves.
_TRANSPARENCY = 70


class Marks:
    """Parts that are coloured for a while."""

    def __init__(self) -> None:
        self._before: list[tuple] = []

    def mark(self, parts: dict, roles: dict[str, str]) -> None:
        """Colours parts (`PartObject` by name) by what they are in `blocking()`, and makes the others transparent."""
        self.clear()
        marked = {parts[name].object.Name for name in roles}
        for name, part in parts.items():
            if name in roles:
                self._colour(part.object.ViewObject, COLOURS[roles[name]])
            elif part.object.Name not in marked:
                self._fade(part.object.ViewObject)

    def clear(self) -> None:
        """Gives all parts their colours back."""
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
