"""The tables of PROTOCOL.md, and messages taken apart and put together as they say. Knows no layout by itself."""
import re
import struct
from pathlib import Path
from types import SimpleNamespace

PROTOCOL = Path(__file__).resolve().parents[2] / "PROTOCOL.md"
NUMBERS = {"u8": "B", "u32": "I", "u64": "Q", "f32": "f", "f64": "d"}


def rows(table):
    """The cells of a table's rows, without its head."""
    lines = [line for line in table.splitlines() if line.startswith("|")]
    return [[cell.strip().strip("`") for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines[2:]]


class Document:
    def __init__(self, path=PROTOCOL):
        self.structs, self.messages, self.constants = {}, {}, {}
        self.names, self.enums, self.services, self.exchange = {}, {}, {}, []
        for name, body in re.findall(r"<!-- generated: (.*?) -->\n(.*?)<!-- end -->", path.read_text(), re.DOTALL):
            what, _, of = name.partition(" ")
            if what == "struct":
                self.structs[of] = self.struct(of, body)
            elif what == "message":
                self.messages[of] = rows(body)
            elif what == "names" and of.isupper():
                self.names[of] = [name for _, name in rows(body)]
            elif what == "enum":
                self.enums[of] = {variant: int(number) for number, variant, *_ in rows(body)}
            elif what == "services":
                for table in body.strip().split("\n\n"):
                    service = re.match(r"\| `(.*?)`", table)[1]
                    self.services[service] = {setting: value for setting, value in rows(table)}
            elif what == "exchange":
                parts = re.findall(r"(User header|Payload) `(\w+)`:\n\n```text\n(.*?)```", body, re.DOTALL)
                self.exchange = [(kind, of, lines.splitlines()) for kind, of, lines in parts]
            else:
                for constant, value, *_ in rows(body):
                    self.constants[constant] = int(value) if value.isdecimal() else value

    @staticmethod
    def struct(name, body):
        title = re.match(r"`(\w+)`: (\d+) bytes, aligned to (\d+)(?:, for iceoryx2 the type `(.*?)`)?", body)
        assert title[1] == name, name
        fields = [(int(offset), int(size), kind, field) for offset, size, kind, field, *_ in rows(body)]
        return SimpleNamespace(size=int(title[2]), align=int(title[3]), type_name=title[4], fields=fields)

    def size(self, kind):
        kind, _, count = kind.partition(" × ")
        one = struct.calcsize(NUMBERS[kind]) if kind in NUMBERS else self.structs[kind].size
        return one * int(count or 1)

    def decode_value(self, kind, data, at=0):
        """A number, bytes, a list, or a dict."""
        element, _, count = kind.partition(" × ")
        if element in self.structs:
            return {name: self.decode_value(of, data, at + offset) for offset, _, of, name in self.structs[element].fields}
        if element == "u8" and count:
            return bytes(data[at : at + int(count)])
        values = struct.unpack_from(f"<{count}{NUMBERS[element]}", data, at)
        return list(values) if count else values[0]

    def encode_value(self, kind, value):
        """Fields that are not given are 0."""
        element, _, count = kind.partition(" × ")
        if element in self.structs:
            out = bytearray(self.structs[element].size)
            known = {name for _, _, _, name in self.structs[element].fields}
            assert value.keys() <= known, (element, value.keys() - known)
            for offset, size, of, name in self.structs[element].fields:
                if name in value:
                    out[offset : offset + size] = self.encode_value(of, value[name])
            return bytes(out)
        if element == "u8" and count:
            return bytes(value)
        return struct.pack(f"<{count}{NUMBERS[element]}", *(value if count else [value]))

    def sections(self, message, data):
        """Where the sections of a message stand: name, type, number of elements (none: one by definition), first byte."""
        at, found, before = 0, [], None
        header = None

        def take(name, kind, count):
            nonlocal at
            found.append((name, kind, count, at))
            end = at + self.size(kind) * (1 if count is None else count)
            assert end <= len(data), f"{message}: `{name}` ends at byte {end} of {len(data)}"
            values = [self.decode_value(kind, data, at + i * self.size(kind)) for i in range(1 if count is None else count)]
            at = min(end + -end % 8, len(data))
            return values

        sections = iter(self.messages[message])
        for name, kind, count in sections:
            kind = kind.replace("`", "")
            if name.endswith(" of the first part"):
                records = next(values for (of, *_), values in before if of == "parts")
                for part, record in enumerate(records):
                    vertex = "f32 × 3" if record["vertex_kind"] == self.constants["VERTICES_F32"] else "f64 × 3"
                    take(f"vertices of part {part}", vertex, record["vertices"])
                    take(f"triangles of part {part}", "u32 × 3", record["triangles"])
                break
            if count == "1":
                values = take(name, kind, None)
                header = values[0]
            elif count.startswith("the sum"):
                values = take(name, kind, sum(before[-1][1]))
            elif count.startswith("all bytes"):
                values = take(name, kind, len(data))
            else:
                values = take(name, kind, header[count])
            before = (before or []) + [(found[-1], values)]
        assert at == len(data), f"{message}: {len(data) - at} bytes are left"
        return found

    def decode(self, message, data):
        """The sections of a message by name."""
        out = {}
        for name, kind, count, at in self.sections(message, data):
            if kind == "u8":
                out[name] = bytes(data[at : at + count])
            else:
                size = self.size(kind)
                values = [self.decode_value(kind, data, at + i * size) for i in range(1 if count is None else count)]
                out[name] = values[0] if count is None else values
        return out

    def encode(self, message, header, sections, meshes=()):
        """A message; the counts in its header are those of the sections. Meshes: a type and rows, twice per part."""
        header, out = dict(header), b""
        for name, _, count in self.messages[message]:
            if name in sections and not count.startswith("the sum"):
                header[count] = len(sections[name])
        for name, kind, count in self.messages[message]:
            kind = kind.replace("`", "")
            if name.endswith(" of the first part"):
                break
            values = [header] if count == "1" else sections.get(name, [])
            section = bytes(values) if kind == "u8" else b"".join(self.encode_value(kind, value) for value in values)
            out += section + bytes(-len(section) % 8)
        for kind, values in meshes:
            section = b"".join(self.encode_value(kind, value) for value in values)
            out += section + bytes(-len(section) % 8)
        return out


def text(texts, place):
    """The text of a `Text`."""
    return texts[place["offset"] : place["offset"] + place["length"]].decode()


class Texts:
    """A text section that is being written."""

    def __init__(self):
        self.data = b""

    def add(self, value):
        place = {"offset": len(self.data), "length": len(value.encode())}
        self.data += value.encode()
        return place
