"""Reads the interface files with rosbags, and reads and writes CDR, for the tests in this folder.

The sections of a service or an action count as messages of their own, such as QueryStatus_Request.

Usage:
    interfaces.py definitions [TYPE...]          prints one JSON object: what rosbags understands of each file
    interfaces.py produce SEED COUNT [TYPE...]   prints COUNT random values of each type, one JSON object a line
    interfaces.py consume                        reads lines of {type, bytes}, prints {value, bytes} for each

TYPE names types that come with ROS 2 itself, such as std_msgs/msg/Header, to be taken instead of this package's.
"""

import dataclasses
import json
import pathlib
import random
import struct
import sys

import numpy
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

PACKAGE = "formation_msgs"
FOLDER = pathlib.Path(__file__).resolve().parent.parent

# The sections of a file, by the end of its name.
SECTIONS = {"msg": [""], "srv": ["_Request", "_Response"], "action": ["_Goal", "_Result", "_Feedback"]}

INTEGERS = {
    "int8": (8, True),
    "uint8": (8, False),
    "int16": (16, True),
    "uint16": (16, False),
    "int32": (32, True),
    "uint32": (32, False),
    "int64": (64, True),
    "uint64": (64, False),
}
FLOATS = [0.0, -0.0, 1.0, -1.5, 0.1, 1e6, -1e6, 5e-324, 1.7976931348623157e308]
ALPHABET = "ab \N{GREEK SMALL LETTER ALPHA}\N{EURO SIGN}\N{SNAKE}\""


def load():
    """The types of this package as rosbags parses them, and a type store that knows them."""
    ours = {}
    for kind, sections in SECTIONS.items():
        for path in sorted((FOLDER / kind).glob(f"*.{kind}")):
            texts = path.read_text().split("\n---\n")
            for section, text in zip(sections, texts, strict=True):
                ours.update(get_types_from_msg(text, f"{PACKAGE}/msg/{path.stem}{section}"))
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(ours)
    return ours, store


def describe(node):
    """A field's type as [name, bound of the list or null, bound of the string or null]."""
    kind, content = node
    if kind.name == "BASE":
        name, bound = content
        return [name, None, bound or None]
    if kind.name == "NAME":
        return [content, None, None]
    if kind.name == "SEQUENCE":
        element, bound = content
        name, list_bound, string_bound = describe(element)
        if list_bound is not None:
            raise ValueError("a list of lists is no ROS 2 type")
        return [name + "[]", bound or None, string_bound]
    if kind.name == "ARRAY":
        element, length = content
        return [f"{describe(element)[0]}[{length}]", None, None]
    raise ValueError(f"unexpected kind of field: {kind.name}")


def print_definitions(ours):
    definitions = {
        name: {
            "constants": {constant: value for constant, _, value in constants},
            "fields": [[field, *describe(node)] for field, node in fields],
        }
        for name, (constants, fields) in ours.items()
    }
    json.dump(definitions, sys.stdout)


def random_base(name, bound, source):
    if name == "bool":
        return source.random() < 0.5
    if name == "string":
        text = "".join(source.choice(ALPHABET) for _ in range(source.randrange(9)))
        return text[:bound] if bound else text
    if name == "float32":
        return float(numpy.float32(source.choice([0.0, 1.0, 0.1, source.uniform(-1e6, 1e6)])))
    if name == "float64":
        return source.choice([*FLOATS, source.uniform(-1e6, 1e6)])
    bits, signed = INTEGERS[name]
    low = -(1 << (bits - 1)) if signed else 0
    high = low + (1 << bits) - 1
    return source.choice([low, high, low + 1, high - 1, source.randint(low, high)])


def random_value(node, store, source, longest):
    kind, content = node
    if kind.name == "BASE":
        return random_base(*content, source)
    if kind.name == "NAME":
        return random_message(content, store, source, longest)
    element, bound = content
    if kind.name == "ARRAY":
        length = bound
    else:
        length = source.randint(0, min(longest, bound or longest))
    values = [random_value(element, store, source, longest) for _ in range(length)]
    if element[0].name == "BASE" and element[1][0] != "string":
        return numpy.array(values, dtype=element[1][0])
    return values


def random_message(name, store, source, longest):
    _, fields = store.fielddefs[name]
    return store.types[name](
        **{field: random_value(node, store, source, longest) for field, node in fields}
    )


def plain(value, store):
    """The value in terms of JSON."""
    if dataclasses.is_dataclass(value):
        _, fields = store.fielddefs[value.__msgtype__]
        return {field: plain(getattr(value, field), store) for field, _ in fields}
    if isinstance(value, numpy.ndarray):
        return value.tolist()
    if isinstance(value, list):
        return [plain(entry, store) for entry in value]
    return value


def print_line(**content):
    print(json.dumps(content))


def produce(ours, store, seed, count):
    source = random.Random(seed)
    for name in ours:
        for index in range(count):
            # The first value has only empty lists, every other one lists of up to three entries.
            message = random_message(name, store, source, 0 if index == 0 else 3)
            for little_endian in (True, False):
                content = store.serialize_cdr(message, name, little_endian=little_endian)
                print_line(
                    type=name, value=plain(message, store), bytes=bytes(content).hex()
                )


def consume(store):
    for line in sys.stdin:
        request = json.loads(line)
        content = bytes.fromhex(request["bytes"])
        little_endian = struct.unpack_from(">H", content)[0] == 1
        message = store.deserialize_cdr(content, request["type"])
        again = store.serialize_cdr(message, request["type"], little_endian=little_endian)
        print_line(value=plain(message, store), bytes=bytes(again).hex())


def main(arguments):
    ours, store = load()

    def chosen(names):
        return {name: store.fielddefs[name] for name in names} if names else ours

    match arguments:
        case ["definitions", *names]:
            print_definitions(chosen(names))
        case ["produce", seed, count, *names]:
            produce(chosen(names), store, int(seed), int(count))
        case ["consume"]:
            consume(store)
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
