"""The exchange of PROTOCOL.md, read by nothing but the tables of PROTOCOL.md."""
import json
import unittest

from document import Document

LONGEST = 32


def lines_of_value(document, name, kind, data, at):
    """The lines of a value as the document shows them: where, bytes, name, value."""
    element, _, count = kind.partition(" × ")
    if element in document.structs:
        for offset, _, of, field in document.structs[element].fields:
            yield from lines_of_value(document, f"{name}.{field}" if name else field, of, data, at + offset)
        return
    size = document.size(kind)
    if count and size > LONGEST:
        for i in range(int(count)):
            yield from lines_of_value(document, f"{name}[{i}]", element, data, at + i * size // int(count))
        return
    value = document.decode_value(kind, data, at)
    yield at, data[at : at + size], name, value.hex() if isinstance(value, bytes) else value


def lines_of_message(document, message, data):
    end = 0
    for name, kind, count, at in document.sections(message, data):
        if end < at:
            yield end, data[end:at], "padding", None
        size = document.size(kind)
        end = at + size * (1 if count is None else count)
        if kind == "u8":
            for start in range(at, end, LONGEST):
                piece = data[start : min(start + LONGEST, end)]
                yield start, piece, name, piece.decode()
            continue
        for i in range(1 if count is None else count):
            yield from lines_of_value(document, name if count is None else f"{name}[{i}]", kind, data, at + i * size)
    if end < len(data):
        yield end, data[end:], "padding", None


def read(line):
    at, data, what = line.split(maxsplit=2)
    name, equals, value = what.partition(" = ")
    return int(at), bytes.fromhex(data), name, json.loads(value) if equals else None


class ExchangeIsOfTheTables(unittest.TestCase):
    def test_every_byte_is_what_the_tables_say(self):
        document = Document()
        names = [name for _, name, _ in document.exchange]
        expected = "RequestHeader Upload ResponseHeader Handle RequestHeader Plan ResponseHeader Steps ResponseHeader Summary"
        self.assertEqual(names, expected.split())
        for kind, name, lines in document.exchange:
            with self.subTest(name):
                shown = [read(line) for line in lines]
                data = b"".join(piece for _, piece, _, _ in shown)
                if kind == "User header":
                    self.assertEqual(len(data), document.structs[name].size)
                    found = list(lines_of_value(document, "", name, data, 0))
                else:
                    found = list(lines_of_message(document, name, data))
                self.assertEqual(found, shown)

    def test_structs_have_no_padding(self):
        document = Document()
        self.assertGreater(len(document.structs), 20)
        for name, found in document.structs.items():
            end = 0
            for offset, size, kind, field in found.fields:
                self.assertEqual((offset, size), (end, document.size(kind)), f"{name}.{field}")
                end += size
            self.assertEqual(end, found.size, name)


if __name__ == "__main__":
    unittest.main()
