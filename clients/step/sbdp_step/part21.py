"""The product structure of a STEP file (ISO 10303-21), from its text.

The kernel is not asked for this: it loops or leaves parts out without a word where the structure is cyclic, where
products are in other files, and where the file is truncated. Only instances of the entities below are parsed; the
geometry is skipped. A string that contains what looks like such an instance would be taken for one.
"""

import re
from dataclasses import dataclass, field

from . import Refusal

# Instances of products in all. At half nothing is known to break; it is a bound on memory: an instance takes about 1 kB
# in the converter and in sbdp, and at ten times as many a planner has long given up.
MOST_INSTANCES = 100_000
# Assemblies within assemblies. Real ones have less than 20; the kernel recurses, and Python does up to 1000.
MOST_LEVELS = 100

READ = (
    "PRODUCT|PRODUCT_DEFINITION|PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS|PRODUCT_DEFINITION_FORMATION"
    "|PRODUCT_DEFINITION_FORMATION_WITH_SPECIFIED_SOURCE|NEXT_ASSEMBLY_USAGE_OCCURRENCE|PRODUCT_DEFINITION_SHAPE"
    "|SHAPE_DEFINITION_REPRESENTATION|SHAPE_REPRESENTATION_RELATIONSHIP|[A-Z_]*SHAPE_REPRESENTATION"
    "|APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT|DOCUMENT_FILE|PROPERTY_DEFINITION|MAPPED_ITEM|REPRESENTATION_MAP"
    "|MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS|FACETED_BREP|SHELL_BASED_SURFACE_MODEL|TESSELLATED_SOLID|TESSELLATED_SHELL"
)
ITEM = re.compile(rb"#(\d+)\s*=\s*(" + READ.encode() + rb")\s*\(")
SOLIDS = {"MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "FACETED_BREP"}
# An instance of several entities at once: units and their contexts.
COMPLEX = re.compile(rb"#(\d+)\s*=\s*\(((?:'(?:[^']|'')*'|[^;'])*)\)\s*;")
TOKEN = re.compile(r"'(?:[^']|'')*'|#\d+|\$|\*|\(|\)|[^,()'#\s]+")
METRES = {"": 1.0, "EXA": 1e18, "KILO": 1e3, "CENTI": 1e-2, "DECI": 1e-1, "MILLI": 1e-3, "MICRO": 1e-6, "NANO": 1e-9}
# Names of units as sbdp writes them, by metres.
UNITS = {1.0: "m", 1e-2: "cm", 1e-3: "mm", 1e-6: "µm", 0.0254: "in", 0.3048: "ft"}


@dataclass
class Product:
    """A product definition: an assembly if it has uses, else a part."""

    name: str
    uses: list = field(default_factory=list)  # (number of the product definition, name of the instance or None)
    solids: int = 0
    voids: bool = False
    other_geometry: bool = False

    def is_empty(self):
        """Whether nothing of it is in this file."""
        return not (self.uses or self.solids or self.other_geometry)


@dataclass
class Structure:
    """What a file says of its products."""

    products: dict  # by number of the product definition
    roots: list  # those that are not used by others
    unit: str
    metres: float  # per unit
    warnings: list


def instance_name(name):
    """None for what programs write where nobody gave a name: nothing, a number, NAUO7."""
    return None if re.fullmatch(r"(NAUO|=>)?[\d\[\]:.\s]*", name) else name


def read(text):
    """The structure of a file, given its bytes.

    Raises Refusal: not a STEP file, truncated, without products, cyclic, too many instances, products in other files.
    """
    if not text.strip():
        raise Refusal("the file is empty")
    if b"ISO-10303-21" not in text[:4096]:
        raise Refusal("this is no STEP file: it does not begin with ISO-10303-21")
    if b"END-ISO-10303-21" not in text[-4096:]:
        raise Refusal("the file is truncated: it does not end with END-ISO-10303-21; export or copy it again")
    items = {}
    for match in ITEM.finditer(text):
        items[int(match[1])] = (match[2].decode(), arguments(text, match.end()))
    products, files = definitions(items)
    if not products:
        raise Refusal("there is no product in the file (only STEP files of AP203, AP214 and AP242 are read)")
    used = {child for product in products.values() for child, _ in product.uses}
    roots = [number for number in products if number not in used and is_shown(products[number], used)]
    check_tree(products, roots)
    metres, warnings = length_unit(text)
    unit = UNITS.get(metres)
    if unit is None:
        warnings.append(f"the file's unit of length is {metres} m, which has no short name; lengths are in mm")
        unit, metres = "mm", 1e-3
    structure = Structure(products, roots, unit, metres, warnings)
    refuse_other_files(structure, files)
    return structure


def is_shown(product, used):
    """Products of documents stand beside those of the assembly, without geometry."""
    return not product.is_empty() or not used


def arguments(text, start):
    """The arguments of an instance as nested lists of strings: `#12`, `'text'`, `.ENUM.`, numbers."""
    end = start
    # Semicolons may stand in strings.
    while True:
        end = text.find(b";", end)
        if end < 0:
            raise Refusal("the file is damaged: an instance does not end")
        if text.count(b"'", start, end) % 2 == 0:
            break
        end += 1
    nested = [[]]
    for token in TOKEN.findall(text[start:end].decode("utf-8", "replace")):
        if token == "(":
            nested.append([])
        elif token == ")":
            if len(nested) == 1:
                break
            last = nested.pop()
            nested[-1].append(last)
        else:
            nested[-1].append(token)
    return nested[0]


def string(token):
    """The text of a string, with the escapes of ISO 10303-21 resolved."""
    if not isinstance(token, str) or not token.startswith("'"):
        return ""
    text = token[1:-1].replace("''", "'").replace("\r", "").replace("\n", "")
    text = re.sub(r"\\X2\\((?:[0-9A-Fa-f]{4})*)\\X0\\", lambda m: bytes.fromhex(m[1]).decode("utf-16-be", "replace"), text)
    text = re.sub(r"\\X4\\((?:[0-9A-Fa-f]{8})*)\\X0\\", lambda m: bytes.fromhex(m[1]).decode("utf-32-be", "replace"), text)
    text = re.sub(r"\\X\\([0-9A-Fa-f]{2})", lambda m: bytes.fromhex(m[1]).decode("latin-1"), text)
    text = re.sub(r"\\S\\(.)", lambda m: chr((ord(m[1]) + 128) & 0xFF), text)
    return text.replace("\\\\", "\\").strip()


def reference(token):
    return int(token[1:]) if isinstance(token, str) and token.startswith("#") else None


def references(value):
    """All references in nested arguments."""
    if isinstance(value, list):
        for item in value:
            yield from references(item)
    elif (number := reference(value)) is not None:
        yield number


def of_kind(items, *kinds):
    return [(number, arguments) for number, (kind, arguments) in items.items() if kind in kinds]


def definitions(items):
    """The products by the numbers of their definitions, with their uses and geometry; the other files that are named."""
    at = lambda arguments, place: arguments[place] if place < len(arguments) else None
    names = {n: string(at(a, 1)) or string(at(a, 0)) for n, a in of_kind(items, "PRODUCT")}
    formations = {
        n: reference(at(a, 2))
        for n, a in of_kind(items, "PRODUCT_DEFINITION_FORMATION", "PRODUCT_DEFINITION_FORMATION_WITH_SPECIFIED_SOURCE")
    }
    products, documents = {}, {n: string(at(a, 0)) for n, a in of_kind(items, "DOCUMENT_FILE")}
    for _, a in of_kind(items, "APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT"):
        documents.update((n, string(at(a, 0))) for n in references(at(a, 3)) if n in documents and string(at(a, 0)))
    for number, a in of_kind(items, "PRODUCT_DEFINITION", "PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS"):
        name = names.get(formations.get(reference(at(a, 2)))) or f"product {number}"
        products[number] = Product(name)
    for _, a in of_kind(items, "NEXT_ASSEMBLY_USAGE_OCCURRENCE"):
        parent, child = reference(at(a, 3)), reference(at(a, 4))
        if parent in products and child in products:
            products[parent].uses.append((child, instance_name(string(at(a, 1)))))
    count_geometry(items, products, at)
    return products, sorted(set(documents.values()))


def count_geometry(items, products, at):
    """Adds the geometry that stands in the representations of each product."""
    shapes = {n: reference(at(a, 2)) for n, a in of_kind(items, "PRODUCT_DEFINITION_SHAPE")}
    related = {}
    for _, a in of_kind(items, "SHAPE_REPRESENTATION_RELATIONSHIP"):
        one, other = reference(at(a, 2)), reference(at(a, 3))
        related.setdefault(one, []).append(other)
        related.setdefault(other, []).append(one)
    for _, a in of_kind(items, "SHAPE_DEFINITION_REPRESENTATION"):
        product = products.get(shapes.get(reference(at(a, 0))))
        if product is None:
            continue
        pending, seen = [reference(at(a, 1))], set()
        while pending:
            number = pending.pop()
            kind, contents = items.get(number, ("", []))
            if number in seen:
                continue
            seen.add(number)
            if kind in SOLIDS:
                product.solids += 1
                product.voids |= kind == "BREP_WITH_VOIDS"
            elif kind == "MAPPED_ITEM":
                pending += references(at(contents, 1))
            elif kind == "REPRESENTATION_MAP":
                pending += references(at(contents, 1))
            elif kind.endswith("SHAPE_REPRESENTATION"):
                items_of = list(references(at(contents, 1)))
                product.other_geometry |= kind != "SHAPE_REPRESENTATION" and bool(items_of)
                pending += items_of + related.get(number, [])
            elif kind:
                product.other_geometry = True


def check_tree(products, roots):
    """Refuses cycles, depth without end, and more instances than anything could hold."""
    instances, levels, done = {}, {}, set()
    for root in list(roots) + list(products):
        pending, path = [(root, False)], []
        while pending:
            number, is_left = pending.pop()
            product = products[number]
            if is_left:
                path.pop()
                done.add(number)
                instances[number] = 1 + sum(instances[child] for child, _ in product.uses)
                levels[number] = 1 + max((levels[child] for child, _ in product.uses), default=0)
                continue
            if number in path:
                raise Refusal(f"the product `{product.name}` is a part of itself")
            if number in done:
                continue
            path.append(number)
            pending.append((number, True))
            pending += [(child, False) for child, _ in product.uses]
    count, depth = sum(instances[r] for r in roots), max((levels[r] for r in roots), default=0)
    if count > MOST_INSTANCES:
        raise Refusal(f"the file has {count} instances of products; {MOST_INSTANCES} are the most that are converted")
    if depth > MOST_LEVELS:
        raise Refusal(f"assemblies within assemblies are {depth} levels deep; {MOST_LEVELS} are the most")


def length_unit(text):
    """Metres per unit of length of most contexts, and a warning where contexts differ."""
    units, contexts, measures = {}, [], {}
    for match in COMPLEX.finditer(text):
        words = match[2].decode("utf-8", "replace")
        if "LENGTH_UNIT" in words:
            units[int(match[1])] = words
        elif found := re.search(r"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)", words):
            contexts.append([int(n) for n in re.findall(r"#(\d+)", found[1])])
    for match in re.finditer(rb"#(\d+)\s*=\s*LENGTH_MEASURE_WITH_UNIT\s*\(\s*(?:LENGTH_MEASURE\s*\()?\s*([\d.Ee+-]+)\)?\s*,\s*#(\d+)", text):
        measures[int(match[1])] = (float(match[2]), int(match[3]))

    def metres(number, depth=0):
        words = units.get(number, "")
        if found := re.search(r"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.", words):
            return METRES.get(found[1] or "")
        if (found := re.search(r"CONVERSION_BASED_UNIT\s*\(\s*'[^']*'\s*,\s*#(\d+)", words)) and depth < 4:
            factor, base = measures.get(int(found[1]), (None, None))
            base = metres(base, depth + 1) if factor else None
            return base and round(factor * base, 12)
        return None

    found = [m for context in contexts for n in context if n in units and (m := metres(n))]
    if not found:
        return 1e-3, ["the file names no unit of length; it is taken to be mm"]
    most = max(sorted(set(found)), key=found.count)
    others = sorted({UNITS.get(m, f"{m} m") for m in found if m != most})
    mixed = [f"lengths in the file are also in {', '.join(others)}; all are converted"] if others else []
    return most, mixed


def refuse_other_files(structure, files):
    """Products whose geometry is in other files cannot be converted: only one file is given to a converter."""
    products = structure.products
    reached, pending = set(), list(structure.roots)
    while pending:
        number = pending.pop()
        if number not in reached:
            reached.add(number)
            pending += [child for child, _ in products[number].uses]
    missing = sorted({products[n].name for n in reached if products[n].is_empty()})
    if missing and files:
        raise Refusal(
            f"{listed(missing)} without geometry here; it is in other files ({', '.join(files[:6])}"
            f"{', …' if len(files) > 6 else ''}): export the assembly as one file"
        )


def listed(names):
    """`a`, `b` and 3 more are / `a` is."""
    shown = ", ".join(f"`{name}`" for name in names[:6])
    more = f" and {len(names) - 6} more" if len(names) > 6 else ""
    return f"{shown}{more} {'is' if len(names) == 1 else 'are'}"
