"""Files broken in every way: bytes, numbers, and what is packed inside a container."""

import gzip
import io
import random
import re
import zipfile
import zlib

from seerob.protocols import ProtocolError

PIECE = re.compile(rb"(?<=[\n>,;])")
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
NASTY = (
    *(b"nan", b"inf", b"-inf", b"1e309", b"-1e308", b"1e-320", b"0", b"-0", b"-1", b"0.5", b"2147483648"),
    *(b"99999999999999999999", b"1" * 5000, b"", b"true", b"null", b'"', b"[", b"{", b"}", b"<", b"]]>"),
    *(b"&x;", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\n", b"\r", b",", b";", b"\t", b"=", b"#", b"1,5"),
    *(
        b"0x10",
        b"\xb2",
        b"1e308",
        b"5e-324",
        b"[" * 2000,
        b"<a>" * 2000,
        b"{a=" * 2000,
        b"../../x",
        b"\x1b[2J",
    ),
)
"""What stands where a number was."""


def mutated(data, rng):
    """``data`` with one or more bytes changed, moved, cut out, doubled, or lengths blown up."""
    out = bytearray(data or b" ")
    for _ in range(rng.choice((1, 1, 2, 8))):
        at, size = rng.randrange(len(out)), rng.choice((1, 4, 8, 64, 1000))
        match rng.randrange(7):
            case 0:
                out[at] ^= 1 << rng.randrange(8)
            case 1:
                out[at : at + size] = rng.randbytes(size)
            case 2:
                del out[at : at + size]
            case 3:
                out[at:at] = out[at : at + size]
            case 4:
                out[at : at + 8] = rng.choice((0, 2**31, 2**40, 2**63, 2**64 - 1)).to_bytes(8, "little")
            case 5:
                del out[max(1, at) :]
            case 6:
                other = rng.randrange(len(out))
                out[at : at + size] = out[other : other + size]
        if len(out) < 2:
            break
    return bytes(out)


def refusals(read, whole, *, seed, count, refusal=ProtocolError):
    """How many of ``count`` mutated messages a decoder refuses; any other error of it is not caught."""
    read(whole)
    rng, refused = random.Random(seed), 0
    for _ in range(count):
        try:
            read(mutated(whole, rng))
        except refusal:
            refused += 1
    return refused


def mutated_text(data, rng):
    """``data`` with numbers that are none, pieces elsewhere, or mutated as bytes."""
    kind = rng.random()
    if kind < 0.3:
        return mutated(data, rng)
    if kind < 0.5:
        return _rearranged(data, rng)
    places = [match.span() for match in NUMBER.finditer(data)]
    out = bytearray(data)
    for begin, end in sorted(rng.sample(places, min(len(places), rng.choice((1, 1, 2, 5)))), reverse=True):
        out[begin:end] = rng.choice(NASTY)
    return bytes(out)


def _rearranged(data, rng):
    """Lines, elements or cells left out, doubled, exchanged or moved."""
    pieces = PIECE.split(data)
    for _ in range(rng.choice((1, 1, 3))):
        at, other = (rng.randrange(len(pieces)) for _ in range(2))
        some = slice(at, at + rng.choice((1, 1, 2, 10)))
        match rng.randrange(4):
            case 0:
                del pieces[some]
            case 1:
                pieces[at:at] = pieces[some] * rng.choice((1, 2, 50))
            case 2:
                pieces[at], pieces[other] = pieces[other], pieces[at]
            case 3:
                pieces[other:other] = [pieces.pop(at)]
        pieces = pieces or [b""]
    return b"".join(pieces)


def mutated_zip(data, rng):
    """A container whose members are mutated and packed again, or mutated as bytes."""
    if rng.random() < 0.3:
        return mutated(data, rng)
    try:
        return _repacked(data, rng)
    except Exception:  # it is no container any more
        return mutated(data, rng)


def _repacked(data, rng):
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as whole, zipfile.ZipFile(packed, "w") as broken:
        names = whole.namelist()
        victim = rng.choice([name for name in names if "sheet" in name.lower()] * 3 + names)
        for name in names:
            content = whole.read(name)
            broken.writestr(name, mutated_text(content, rng) if name == victim else content)
    return packed.getvalue()


def mutated_gzip(data, rng):
    """The same of one packed file."""
    if rng.random() < 0.3:
        return mutated(data, rng)
    try:
        return gzip.compress(mutated_text(gzip.decompress(data), rng), 1)
    except (OSError, EOFError, zlib.error):  # it is none any more
        return mutated(data, rng)
