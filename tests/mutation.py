"""Damage to files, as bad disks, wrong programs and enemies do it."""

import gzip
import io
import random
import re
import struct
import zipfile
import zlib

# What a parser may take for a number, a structure or an end.
TOKENS = [
    *(b"nan", b"-nan", b"inf", b"-inf", b"Infinity", b"NaN", b"1e999", b"1e-999", b"1e308", b"-0", b"0x10", b"1_0"),
    *(
        b"9" * 25,
        b"9" * 5000,
        b"0x" + b"f" * 5000,
        b"1e" + b"9" * 400,
        b"-1",
        b"0",
        b"1",
        b"2147483648",
        b"1000000000000",
    ),
    *(
        b"9223372036854775808",
        b"18446744073709551616",
        b"\x00",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        "١".encode(),
        "𝟗".encode(),
    ),
    *(
        b"\r\n",
        b"\r",
        b"\n\n",
        b"\t",
        b"\x0b",
        b"\x1c",
        b"\xe2\x80\xa8",
        b"",
        b" ",
        b"'",
        b'"',
        b'"""',
        b"#",
        b"\\",
        b"%n",
    ),
    *(
        b"[",
        b"]",
        b"{",
        b"}",
        b",",
        b"=",
        b"[" * 3000,
        b"{a=" * 2000,
        b'{"a":' * 2000,
        b"a." * 2000,
        b"(" * 300,
        b"null",
    ),
    *(
        b"true",
        b"none",
        b"[]",
        b"{}",
        b"../../x",
        b"/etc/passwd",
        b"x" * 15_000,
        b"<b>",
        b"VERTEX_SE2",
        b"EDGE3",
        b"FIX",
    ),
    *(b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"1979-05-27T07:32:00", b"__class__", b"lambda: 0", b"-9999999999", b"0.5"),
]
_WORD = re.compile(rb"[^\s,\[\]{}=:]+")
_NUMBERS = (b"0", b"-1", b"1", b"255", b"65536", b"1000000000000", b"-9223372036854775808")


def mutated(seed: bytes, other: bytes, container: str, rng: random.Random) -> bytes:
    """A damaged copy of a file; `other` is a second one to take parts from."""
    if container == "npz" and rng.random() < 0.9:
        return _npz(seed, rng)
    if container == "tar.gz" and rng.random() < 0.95:
        return _tar_gz(seed, rng)
    return damaged(seed, other, rng)


def damaged(data: bytes, other: bytes, rng: random.Random) -> bytes:
    """Bytes with one to six damages."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        data = rng.choice(_DAMAGES)(data, other, rng)
    return data


def _flip(data: bytes, other: bytes, rng: random.Random) -> bytes:
    if not data:
        return data
    place = rng.randrange(len(data))
    return data[:place] + bytes([data[place] ^ (1 << rng.randrange(8))]) + data[place + 1 :]


def _insert(data: bytes, other: bytes, rng: random.Random) -> bytes:
    place = rng.randint(0, len(data))
    filling = rng.randbytes(rng.randint(1, 8)) if rng.random() < 0.3 else rng.choice(TOKENS)
    return data[:place] + filling + data[place:]


def _delete(data: bytes, other: bytes, rng: random.Random) -> bytes:
    start = rng.randint(0, len(data))
    return data[:start] + data[start + int(rng.paretovariate(0.7)) :]


def _cut(data: bytes, other: bytes, rng: random.Random) -> bytes:
    return data[: rng.randint(0, len(data))]


def _replace_word(data: bytes, other: bytes, rng: random.Random) -> bytes:
    words = list(_WORD.finditer(data))
    if not words:
        return data
    word = rng.choice(words)
    return data[: word.start()] + rng.choice(TOKENS) + data[word.end() :]


def _swap_words(data: bytes, other: bytes, rng: random.Random) -> bytes:
    words = list(_WORD.finditer(data))
    if len(words) < 2:
        return data
    a, b = sorted(rng.sample(words, 2), key=lambda word: word.start())
    return data[: a.start()] + b[0] + data[a.end() : b.start()] + a[0] + data[b.end() :]


def _change_lines(data: bytes, other: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    k = rng.randrange(len(lines))
    line = rng.choice((lines, other.split(b"\n")))
    lines.insert(k, rng.choice(line))
    if rng.random() < 0.5:
        del lines[rng.randrange(len(lines))]
    return b"\n".join(lines)


def _splice(data: bytes, other: bytes, rng: random.Random) -> bytes:
    return data[: rng.randint(0, len(data))] + other[rng.randint(0, len(other)) :]


def _repeat(data: bytes, other: bytes, rng: random.Random) -> bytes:
    start = rng.randint(0, len(data))
    stop = min(len(data), start + rng.randint(1, 40))
    return data[:stop] + data[start:stop] * rng.choice((1, 2, 50)) + data[stop:]


_DAMAGES = (
    _flip,
    _insert,
    _delete,
    _cut,
    _replace_word,
    _replace_word,
    _replace_word,
    _swap_words,
    _change_lines,
    _splice,
    _repeat,
)

_SHAPES = (
    "()",
    "(0,)",
    "(1000000000000,)",
    "(-1, 3)",
    "(5, 2)",
    "(5, 3, 3)",
    "(4, 3, 3)",
    "(2, 4, 3, 3)",
    "(1,) * 9",
    "None",
)
_DTYPES = (
    "'<f8'",
    "'>f8'",
    "'<f4'",
    "'<f2'",
    "'<i8'",
    "'<u8'",
    "'|b1'",
    "'<c16'",
    "'|O'",
    "'<U7'",
    "'|V0'",
    "[('a', '<f8')]",
)


def _npz(data: bytes, rng: random.Random) -> bytes:
    """A NumPy archive whose members are damaged, with checksums that fit, and whose directory may lie."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(list(members))
        content = members[name]
        change = rng.randrange(7)
        if change == 0:
            members[name] = damaged(content, content, rng)
        elif change == 1:
            members[name] = _header(content, "shape", rng.choice(_SHAPES))
        elif change == 2:
            members[name] = _header(content, "descr", rng.choice(_DTYPES))
        elif change == 3 and len(members) > 1:
            del members[name]
        elif change == 4:
            members[name] = rng.choice(list(members.values()))
        elif change == 5:
            members[rng.choice(("n.npy", "../../x.npy", "edges", "weights.npy", "truth.npy"))] = content
        else:
            values = bytearray(content)
            place = 128 + 8 * rng.randrange(max(1, (len(values) - 128) // 8))
            values[place : place + 8] = rng.choice(_VALUES)
            members[name] = bytes(values)
    file = io.BytesIO()
    with zipfile.ZipFile(
        file, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2))
    ) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    packed = file.getvalue()
    return packed if rng.random() < 0.9 else _lying_directory(packed, rng)


_VALUES = [
    *(struct.pack("<d", value) for value in (float("nan"), float("inf"), 1e308, -1.0, 1e-320)),
    *(struct.pack("<q", value) for value in (-1, 2**62, 10**12, 2**31, 7)),
]


def _header(content: bytes, key: str, value: str) -> bytes:
    """An array whose header says something else than what it holds."""
    pattern = {"shape": rb"'shape': \([^)]*\)", "descr": rb"'descr': '[^']*'"}[key]
    length = int.from_bytes(content[8:10], "little") if len(content) > 10 else 0
    header = re.sub(pattern, f"'{key}': {value}".encode(), content[10 : 10 + length])
    return content[:8] + struct.pack("<H", len(header)) + header + content[10 + length :]


def _lying_directory(packed: bytes, rng: random.Random) -> bytes:
    """A zip whose directory gives other sizes or another place for a member than there are."""
    places = [match.start() for match in re.finditer(b"PK\x01\x02", packed)]
    if not places:
        return packed
    place = rng.choice(places) + rng.choice((8, 10, 16, 20, 24, 28, 42))
    return packed[:place] + struct.pack("<I", rng.choice((0, 1, 99, 2**31, 2**32 - 2))) + packed[place + 4 :]


def _tar_gz(data: bytes, rng: random.Random) -> bytes:
    """An archive with damaged headers and members, packed with a checksum that fits."""
    try:
        tar = bytearray(gzip.decompress(data))
    except (OSError, EOFError, zlib.error):
        return data
    for _ in range(rng.choice((1, 1, 2, 3))):
        block = 512 * rng.randrange(max(1, len(tar) // 512))
        change = rng.randrange(6)
        if change == 0:
            tar = bytearray(damaged(bytes(tar), bytes(tar), rng))
        elif change == 1:
            tar[block + 156 : block + 157] = bytes([rng.choice(b"0123456789LKxgXSDMVN\x00 ")])
        elif change == 2:
            size = rng.choice(
                (b"77777777777\x00", b"00000000000\x00", b"-0000000001\x00", b"\x80" + b"\xff" * 11, b"\xff" * 12)
            )
            tar[block + 124 : block + 136] = size
        elif change == 3:
            name = rng.choice(_NAMES)
            tar[block : block + 100] = name.ljust(100, b"\x00")
        elif change == 4:
            tar[block + 257 : block + 265] = rng.choice((b"ustar\x0000", b"ustar  \x00", b"\x00" * 8))
        else:
            tar += tar[block : block + 512 * rng.randint(1, 3)]
        if len(tar) >= block + 512:
            _checksum(tar, block)
    return gzip.compress(bytes(tar), 1)


_NAMES = [
    *(
        b"../../evil/EGs.txt",
        b"/tmp/evil/EGs.txt",
        b"a/../../b/cc.txt",
        b"..\\x\\EGs.txt",
        b"C:\\x\\EGs.txt",
        b"EGs.txt",
    ),
    *(
        b"x/manifest.json/EGs.txt",
        b"x/./EGs.txt",
        b"x//EGs.txt",
        b"\xff/EGs.txt",
        b"a\nb/EGs.txt",
        b"./EGs.txt",
        b"x/..",
    ),
]


def _checksum(tar: bytearray, block: int) -> None:
    tar[block + 148 : block + 156] = b" " * 8
    total = sum(tar[block : block + 512])
    tar[block + 148 : block + 156] = f"{total:06o}\0 ".encode()
