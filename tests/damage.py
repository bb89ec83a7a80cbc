"""Damage to files, as bad disks, wrong programs and enemies do it."""

import gzip
import io
import random
import re
import struct
import tarfile
import zipfile
from collections.abc import Sequence

# What a parser may take for a number, a structure or an end.
_NUMBERS = "nan -nan inf -Infinity 1e999 1e-999 1e308 -0 0x10 1_0 -1 0 1 0.5 2147483648 -9999999999 1000000000000"
_WORDS = "null true none [] {} ../../x /etc/passwd <b> VERTEX_SE2 EDGE3 FIX __class__ 1979-05-27T07:32:00 ١ 𝟗"
_SIGNS = ["\r\n", "\r", "\n", "\n\n", "\t", "\v", "\x1c", "\u2028", " ", "\0", "'", '"', '"""', "#", "\\", *"[]{},="]
_MUCH = [str(2**63), str(2**64), "9" * 25, "9" * 5000, "0x" + "f" * 5000, "1e" + "9" * 400, "x" * 15_000]
_DEEP = ["[" * 3000, "{a=" * 2000, '{"a":' * 2000, "a." * 2000, "(" * 300]
_NO_TEXT = [b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xf4\x90\x80\x80"]
TOKENS = [text.encode() for text in (*_NUMBERS.split(), *_WORDS.split(), *_SIGNS, *_MUCH, *_DEEP)] + _NO_TEXT
_UNITS = (rb"(?s).", *3 * (rb"[^\s,\[\]{}=:]+",), rb"[^\n]*\n?")  # bytes, words, lines

_SIZES = (-1, 0, 1, 99, 2**31, 2**32 - 2, 2**40, 2**62)
_SHAPES = ("()", "(0,)", "(1000000000000,)", "(-1, 3)", "(5, 2)", "(5, 3, 3)", "(2, 4, 3, 3)", "(1,) * 9", "None")
_TYPES = ("'>f8'", "'<f2'", "'<i8'", "'<u8'", "'|b1'", "'<c16'", "'|O'", "'<U7'", "'|V0'", "[('a', '<f8')]")
_VALUES = [struct.pack("<d", value) for value in (float("nan"), float("inf"), 1e308, -1.0)]
_VALUES += [struct.pack("<q", value) for value in (-1, 7, 2**31, 10**12, 2**62)]
_ARRAYS = ("n.npy", "../../x.npy", "edges", "weights.npy", "truth.npy")
_COMPRESSIONS = [*3 * (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED), zipfile.ZIP_BZIP2]
_PATHS = [
    *("x/Alamo/EGs.txt", "x/datasets/Alamo/cc.txt", "EGs.txt", "./EGs.txt", "x/./EGs.txt", "x//EGs.txt", "x/.."),
    *("../../evil/EGs.txt", "/tmp/evil/EGs.txt", "a/../../b/cc.txt", "..\\x\\EGs.txt", "C:\\x\\EGs.txt"),
    *("x/manifest.json/EGs.txt", "\udcff/EGs.txt", "a\nb/EGs.txt"),
]
_MEMBER_TYPES = [*9 * (tarfile.REGTYPE,), *(bytes([kind]) for kind in b"0123456789LKxgXSDMVN\x00 ")]


def damaged(seeds: Sequence[bytes], container: str, rng: random.Random) -> bytes:
    """A damaged copy of one of some files: inside its packing, if it has one, so that checksums still fit."""
    seed = rng.choice(seeds)
    if container == "plain" or rng.random() < 0.1:
        return edited(seed, rng.choice(seeds), rng)
    return _npz(seed, rng) if container == "npz" else _tar_gz(rng)


def edited(data: bytes, other: bytes, rng: random.Random) -> bytes:
    """Bytes of which one to six runs of bytes, words or lines are removed, repeated, replaced or added to."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        spans = [match.span() for match in re.finditer(rng.choice(_UNITS), data)] or [(0, 0)]
        first = rng.randrange(len(spans))
        last = min(first + rng.choice((0, 0, 0, 0, 1, 4, 40, len(data))), len(spans) - 1)
        start, stop = spans[first][0], spans[last][1]
        run, place = data[start:stop], rng.randrange(len(other) + 1)
        taken = other[place : place + max(1, stop - start)]
        token = rng.choice(TOKENS)
        noise = rng.randbytes(rng.randint(1, 8))
        new = rng.choice((token, token, token, run + token, noise, b"", rng.choice((2 * run, 50 * run[:40])), taken))
        data = data[:start] + new + data[stop:]
    return data


def _npz(seed: bytes, rng: random.Random) -> bytes:
    """A NumPy archive with other arrays, or with headers and a directory that lie about them."""
    with zipfile.ZipFile(io.BytesIO(seed)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(list(members))
        content = members.pop(name)
        change = rng.randrange(7)
        if change == 0:
            content = edited(content, content, rng)
        elif change == 1:
            content = _relabelled(content, "shape", rng.choice(_SHAPES))
        elif change == 2:
            content = _relabelled(content, "descr", rng.choice(_TYPES))
        elif change == 3:
            name = rng.choice(_ARRAYS)
        elif change == 4 and members:
            content = rng.choice(list(members.values()))
        elif change == 5 and members:
            continue
        else:
            place = len(content) - 8 * rng.randint(1, max(1, (len(content) - 128) // 8))
            content = content[:place] + rng.choice(_VALUES) + content[place + 8 :]
        members[name] = content
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", rng.choice(_COMPRESSIONS)) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    packed = file.getvalue()
    entries = [match.start() for match in re.finditer(b"PK\x01\x02", packed)]
    if entries and rng.random() < 0.1:
        entry = rng.choice(entries)
        place = entry + rng.choice((8, 10, 16, 20, 24, 28, 42))
        packed = packed[:place] + struct.pack("<I", rng.choice(_SIZES) % 2**32) + packed[place + 4 :]
    return packed


def _relabelled(content: bytes, key: str, value: str) -> bytes:
    """An array whose header says something else than what it holds."""
    length = int.from_bytes(content[8:10], "little")
    header = re.sub(rf"('{key}': )(\([^)]*\)|'[^']*')".encode(), rb"\g<1>" + value.encode(), content[10 : 10 + length])
    return content[:8] + struct.pack("<H", len(header)) + header + content[10 + length :]


def _tar_gz(rng: random.Random) -> bytes:
    """An archive whose members have any name, type and size, under headers with checksums that fit."""
    tar = b""
    for _ in range(rng.randint(1, 4)):
        member, content = tarfile.TarInfo(rng.choice(_PATHS)), rng.randbytes(rng.randrange(40))
        member.size = rng.choice((*4 * (len(content),), *_SIZES))
        member.type = rng.choice(_MEMBER_TYPES)
        member.linkname = rng.choice(_PATHS)
        form = rng.choice((tarfile.GNU_FORMAT, tarfile.PAX_FORMAT))
        tar += member.tobuf(form, errors="surrogateescape") + content.ljust(-(-len(content) // 512) * 512, b"\0")
    if rng.random() < 0.25:
        tar = edited(tar, tar, rng)
    return gzip.compress(tar + bytes(rng.choice((0, 1024, 1024))), 1)
