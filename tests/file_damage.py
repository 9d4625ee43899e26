"""Damage to files that knows their structure: counts, indices, lengths, headers, references.

Random bytes are stopped by the first checksum or the first keyword. These mutations keep files whole where
that is needed to get further: chunks of a png get right checksums, a glb right lengths, and a 3mf is packed
again.
"""

from __future__ import annotations

import copy
import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from random import Random
from typing import Any

Mutation = Callable[[bytes, Random], bytes]

INTEGERS = (
    0,
    1,
    2,
    3,
    7,
    127,
    128,
    255,
    256,
    65535,
    65536,
    2**24,
    2**31 - 1,
    2**31,
    2**32 - 1,
    -1,
    -2,
    2**53,
    10**18,
)
TOKENS = (
    *(
        "0",
        "-1",
        "1",
        "2",
        "3",
        "4",
        "99999999",
        "4294967296",
        "9" * 30,
        "nan",
        "inf",
        "-inf",
        "1e39",
        "1e-46",
    ),
    *(
        "1e400",
        "0x10",
        "1/1/1",
        "1//",
        "-5//-5",
        "",
        '"',
        "\\",
        "#",
        "é",
        "../t.png",
        "/dev/zero",
        "t.png",
        "on",
    ),
)
VALUES: tuple[Any, ...] = (
    *INTEGERS,
    *(0.5, -0.5, 1e39, 1e308, float("nan"), float("inf"), "", "VEC3", "SCALAR", "MAT4", "../a.bin", "data:,"),
    *(True, None, [], {}, [0], [[0]], {"index": 0}, [1e30] * 3, [0] * 16),
)
KEYS = (
    *("count", "byteOffset", "byteLength", "byteStride", "bufferView", "componentType", "type", "children"),
    *(
        "mesh",
        "matrix",
        "indices",
        "mode",
        "sparse",
        "normalized",
        "uri",
        "extensions",
        "min",
        "max",
        "material",
    ),
)
COMPONENTS = (5120, 5121, 5122, 5123, 5125, 5126)


def mutate_tokens(data: bytes, random: Random) -> bytes:
    """Change words of a text, or drop, repeat or swap lines."""
    lines = data.decode("latin-1").split("\n")
    for _ in range(random.choice((1, 1, 2, 4))):
        at, kind = random.randrange(len(lines)), random.randrange(6)
        if kind < 3:
            words = re.split(r"(\s+)", lines[at])
            words[random.randrange(len(words))] = random.choice(TOKENS)
            lines[at] = "".join(words)
        elif kind == 3:
            del lines[at]
            lines = lines or [""]
        elif kind == 4:
            lines[at:at] = [lines[at]] * random.choice((1, 3, 50))
        else:
            other = random.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
    return "\n".join(lines).encode("latin-1", errors="replace")


def mutate_numbers(data: bytes, random: Random) -> bytes:
    """Change numbers of a text, such as those between the tags of XML."""
    text = data.decode("latin-1")
    found = list(re.finditer(r"-?\d+(\.\d+)?", text))
    for match in sorted(
        random.sample(found, min(len(found), random.choice((1, 2)))), key=lambda m: -m.start()
    ):
        text = text[: match.start()] + random.choice(TOKENS[:14]) + text[match.end() :]
    return text.encode("latin-1")


def mutate_words(data: bytes, random: Random, start: int = 0, end: int | None = None) -> bytes:
    """Change integers of 1, 2, 4 or 8 bytes between two places."""
    end = len(data) if end is None else end
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 2))):
        size, order = random.choice((1, 2, 4, 4, 8)), random.choice("<>")
        at = random.randrange(start, max(start + 1, end - size))
        value = random.choice(INTEGERS) % (1 << (8 * size))
        changed[at : at + size] = struct.pack(order + {1: "B", 2: "H", 4: "I", 8: "Q"}[size], value)
    return bytes(changed)


def mutate_png(data: bytes, random: Random) -> bytes:
    """Change fields of the header, or chunks, or the pixels; checksums are right again most of the time."""
    chunks, at = [], 8
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        chunks.append([data[at + 4 : at + 8], data[at + 8 : at + 8 + length]])
        at += 12 + length
    kind, index = random.randrange(5), random.randrange(len(chunks))
    if kind == 0:
        header = bytearray(chunks[0][1])
        if random.random() < 0.5:
            header[random.choice((0, 4)) :][:4] = b""
            struct.pack_into(">I", header, random.choice((0, 4)), random.choice(INTEGERS) % 2**32)
        else:
            header[random.randrange(8, 13)] = random.choice((0, 1, 2, 3, 4, 6, 8, 16, 255))
        chunks[0][1] = bytes(header)
    elif kind == 1:
        chunks.insert(random.randrange(len(chunks) + 1), chunks[index])
    elif kind == 2:
        del chunks[index]
    elif kind == 3:
        chunks[index][1] = mutate_words(chunks[index][1] + b"\0", random)
    else:
        raw = bytes(random.randrange(256) for _ in range(random.choice((0, 1, 50, 400))))
        raw *= random.choice((1, 1, 10_000))
        for chunk in chunks:
            if chunk[0] == b"IDAT":
                chunk[1] = zlib.compress(raw)
    out = data[:8]
    for name, content in chunks:
        length = len(content) if random.random() < 0.97 else random.choice(INTEGERS) % 2**32
        out += struct.pack(">I", length) + name + content + struct.pack(">I", zlib.crc32(name + content))
    return out


def mutate_jpeg(data: bytes, random: Random) -> bytes:
    """Change, drop or repeat segments: sizes, tables, lengths."""
    segments, at = [], 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
        length = int.from_bytes(data[at + 2 : at + 4], "big")
        segments.append(data[at : at + 2 + length])
        at += 2 + length
    index, kind = random.randrange(len(segments)), random.randrange(4)
    if kind == 0:
        frames = [i for i, each in enumerate(segments) if 0xC0 <= each[1] <= 0xC2]
        frame = bytearray(segments[frames[0]])
        place = random.choice((4, 5, 7, 9, 10, 11, 12))
        frame[place] = random.choice((0, 1, 2, 3, 4, 8, 17, 34, 68, 255))
        segments[frames[0]] = bytes(frame)
    elif kind == 1:
        segments[index] = mutate_words(segments[index], random, 2)
    elif kind == 2:
        del segments[index]
    else:
        segments.insert(random.randrange(len(segments)), segments[index])
    return data[:2] + b"".join(segments) + data[at:]


def mutate_exr(data: bytes, random: Random) -> bytes:
    """Change an attribute of the header, or sizes and offsets of the chunks after it."""
    end = data.index(b"\0\0", 8) + 2
    names = [
        *(b"dataWindow\0box2i\0", b"displayWindow\0box2i\0", b"compression\0compression\0"),
        *(b"channels\0chlist\0", b"lineOrder\0lineOrder\0", b"pixelAspectRatio\0float\0"),
    ]
    if random.random() < 0.6:
        name = random.choice(names)
        start = data.find(name) + len(name)
        return mutate_words(data, random, start, start + 24)
    return mutate_words(data, random, end, min(len(data), end + 300))


def mutate_hdr(data: bytes, random: Random) -> bytes:
    """Change the size in the header, or runs of the first rows."""
    if random.random() < 0.5:
        size = f"-Y {random.choice(INTEGERS)} +X {random.choice(INTEGERS)}\n".encode()
        return re.sub(rb"-Y \d+ \+X \d+\n", size, data, count=1)
    return mutate_words(data, random, data.index(b"\n\n"))


def mutate_npy(data: bytes, random: Random) -> bytes:
    """Change the shape or the type in the header."""
    shape = tuple(random.choice(INTEGERS) for _ in range(random.choice((1, 2, 3))))
    kind = random.choice(("<f4", "<f8", "|u1", "|O", "<i8", "<c16", "|S9"))
    buffer = io.BytesIO()
    header = repr({"descr": kind, "fortran_order": random.random() < 0.5, "shape": shape}).encode()
    buffer.write(b"\x93NUMPY\x01\0" + struct.pack("<H", len(header) + 1) + header + b"\n" + data[128:])
    return buffer.getvalue()


def mutate_json(document: Any, random: Random) -> Any:
    """Change, drop or add values anywhere in a tree of JSON."""
    document = copy.deepcopy(document)
    for _ in range(random.choice((1, 1, 2, 3))):
        places = list(_places(document))
        holder, key = random.choice(places)
        kind = random.randrange(5)
        if kind == 0 and isinstance(holder, dict):
            del holder[key]
        elif kind == 1 and isinstance(holder, dict):
            holder[random.choice(KEYS)] = random.choice((*VALUES, *COMPONENTS))
        elif kind == 2:
            other, name = random.choice(places)
            holder[key] = copy.deepcopy(other[name])
        elif isinstance(holder[key], int):
            holder[key] = random.choice(
                (*INTEGERS, *COMPONENTS, holder[key] + 1, holder[key] - 1, holder[key] * 1000)
            )
        else:
            holder[key] = random.choice(VALUES)
    return document


def _places(tree: Any) -> list[tuple[Any, Any]]:
    """Return every (container, key) of a tree."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    found = [(tree, key) for key, _ in items]
    for holder, key in list(found):
        found += _places(holder[key])
    return found


def mutate_gltf(data: bytes, random: Random) -> bytes:
    """Change the JSON."""
    return json.dumps(mutate_json(json.loads(data), random)).encode()


def mutate_glb(data: bytes, random: Random) -> bytes:
    """Change the JSON and pack it again, or change the lengths of chunks, or the numbers of the buffer."""
    length = int.from_bytes(data[12:16], "little")
    text, rest = data[20 : 20 + length], data[20 + length :]
    kind = random.randrange(6)
    if kind == 0:
        return mutate_words(data, random, 4, 20)
    if kind == 1:
        return mutate_words(data, random, 20 + length, 20 + length + 8)
    if kind == 2:
        return mutate_words(data, random, 20 + length + 8)
    text = mutate_gltf(text, random)
    text += b" " * (-len(text) % 4)
    head = (
        b"glTF"
        + struct.pack("<II", 2, 20 + len(text) + len(rest))
        + struct.pack("<I", len(text))
        + data[16:20]
    )
    return head + text + rest


def mutate_ply(data: bytes, random: Random) -> bytes:
    """Change the header, or the lengths and indices after it."""
    end = data.index(b"end_header") + len(b"end_header")
    kind = random.randrange(4)
    if kind < 2:
        return mutate_tokens(data[:end], random) + data[end:]
    if kind == 2 and b"format ascii" in data[:end]:
        return data[:end] + mutate_tokens(data[end:], random)
    if kind == 2:
        types = (
            b"char",
            b"uchar",
            b"short",
            b"int",
            b"uint",
            b"float",
            b"double",
            b"list uchar int",
            b"int64",
        )
        names = re.findall(rb"property (\w+) ", data[:end])
        return data[:end].replace(random.choice(names), random.choice(types), 1) + data[end:]
    return data[: end + 1] + mutate_words(data[end + 1 :], random)


def mutate_stl(data: bytes, random: Random) -> bytes:
    """Change the count, or a number of a facet, or cut whole facets off."""
    kind = random.randrange(3)
    if kind == 0:
        return data[:80] + struct.pack("<I", random.choice(INTEGERS) % 2**32) + data[84:]
    if kind == 1:
        at = 84 + 4 * random.randrange((len(data) - 84) // 4)
        return (
            data[:at]
            + random.choice((b"\0\0\xc0\x7f", b"\0\0\x80\xff", b"\xff\xff\x7f\x7f", b"\1\0\0\0"))
            + data[at + 4 :]
        )
    facets = random.randrange((len(data) - 84) // 50)
    return data[:80] + struct.pack("<I", facets) + data[84 : 84 + 50 * facets]


def mutate_3mf(data: bytes, random: Random) -> bytes:
    """Change the numbers of the model, or the members of the archive, and pack it again."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name.endswith(".model"):
                content = random.choice((mutate_numbers, mutate_numbers, mutate_tokens))(content, random)
            if random.random() < 0.05:
                continue
            new.writestr(name if random.random() < 0.97 else "../" + name, content)
    packed = out.getvalue()
    return packed if random.random() < 0.8 else mutate_words(packed, random)


def mutate_npz(data: bytes, random: Random) -> bytes:
    """Change the arrays, or the members of the archive, and pack it again."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            if random.random() < 0.3:
                content = random.choice((mutate_npy, mutate_words))(content, random)
            if random.random() < 0.95:
                new.writestr(name, content)
    packed = out.getvalue()
    return packed if random.random() < 0.8 else mutate_words(packed, random)


def mutate_dae(data: bytes, random: Random) -> bytes:
    """Change numbers or words."""
    return random.choice((mutate_numbers, mutate_tokens))(data, random)


def mutate_usdc(data: bytes, random: Random) -> bytes:
    """Change counts and offsets in the header, in the table of contents at its end, or anywhere."""
    kind = random.randrange(3)
    if kind == 0:
        return mutate_words(data, random, 8, 88)
    return mutate_words(data, random, len(data) - 400 if kind == 1 else 88)


MUTATIONS: dict[str, Mutation] = {
    "obj": mutate_tokens,
    "mtl": mutate_tokens,
    "off": mutate_tokens,
    "pbrt": mutate_tokens,
    "ply": mutate_ply,
    "stl": mutate_stl,
    "gltf": mutate_gltf,
    "glb": mutate_glb,
    "dae": mutate_dae,
    "xml": mutate_dae,
    "3mf": mutate_3mf,
    "png": mutate_png,
    "jpg": mutate_jpeg,
    "exr": mutate_exr,
    "hdr": mutate_hdr,
    "npy": mutate_npy,
    "npz": mutate_npz,
    **dict.fromkeys(("ies", "csv", "epw", "usda", "nrrd"), mutate_tokens),
    "mtlx": mutate_dae,
    "usdc": mutate_usdc,
    "usdz": mutate_words,
    "vol": mutate_words,
    **dict.fromkeys(("tga", "tif", "tiff", "webp", "gif", "ppm", "pfm"), mutate_words),
}


def mutate(name: str, data: bytes, random: Random) -> bytes:
    """Return a damaged version of a sound file, by the extension of its name."""
    if name.startswith("text.") or name.endswith(".serialized"):
        return mutate_tokens(data, random)
    return MUTATIONS[name.rpartition(".")[2]](data, random)
