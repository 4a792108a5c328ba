"""What rosbags says.

    witness.py messages TYPE COUNT     random messages in both byte orders, one a line, hexadecimal
    witness.py definition TYPE         compares a definition on stdin with its own and prints the hash
"""

import random
import struct
import sys

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore, get_types_from_msg

store = get_typestore(Stores.ROS2_JAZZY)
chance = random.Random(1)
SIZES = {"int8": 1, "uint8": 1, "uint16": 2, "int32": 4, "uint32": 4, "float64": 8}


def primitive(name):
    if name == "string":
        return "".join(chance.choice("abc/_ äö漢") for _ in range(chance.randrange(12)))
    if name == "float64":
        # Any bits that are a number: signed zeros, subnormal ones and infinities among them.
        number = struct.unpack("<d", chance.randbytes(8))[0]
        return chance.choice([0.0, -0.0, float("inf"), 5e-324, number if number == number else 1.0])
    return int.from_bytes(chance.randbytes(SIZES[name]), "little", signed=name.startswith("int"))


def value(description):
    kind, detail = description
    if kind == Nodetype.BASE:
        return primitive(detail[0])
    if kind == Nodetype.NAME:
        return message(detail)
    inner, count = detail
    elements = [value(inner) for _ in range(count or chance.randrange(5))]
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        return numpy.array(elements, dtype=inner[1][0])
    return elements


def message(name):
    return store.types[name](**{field: value(description) for field, description in store.fielddefs[name][1]})


what, name = sys.argv[1:3]
if what == "messages":
    for _ in range(int(sys.argv[3])):
        built = message(name)
        print(*(bytes(store.serialize_cdr(built, name, little_endian=little)).hex() for little in (True, False)))
else:
    told = get_typestore(Stores.EMPTY)
    told.register(get_types_from_msg(sys.stdin.read(), name))
    for known in told.fielddefs:
        assert told.fielddefs[known] == store.fielddefs[known], (told.fielddefs[known], store.fielddefs[known])
    print(told.hash_rihs01(name))
