"""A picture as JPEG: baseline, one Huffman table each for first and for other coefficients (ITU-T T.81).

A library that writes JPEG weighs 20 MB, of which this would be all that is used. Tables of Huffman codes are
those of its annex K.3; that of quantisation is our choice.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array

Ints = NDArray[np.int64]

_U, _V = np.mgrid[:8, :8]
_COSINES = np.where(_U == 0, np.sqrt(1 / 8), 0.5) * np.cos((2 * _V + 1) * _U * np.pi / 16)
"""Rows: the 8 cosines of a discrete cosine transform, orthonormal."""
_ZIGZAG = np.lexsort((np.where((_U + _V) % 2, _U, _V).ravel(), (_U + _V).ravel()))
_STEPS = 2 + _U + _V
"""Of quantisation: fine, so that edges stay where they are."""
_FROM_RGB = np.array([[0.299, 0.587, 0.114], [-0.168736, -0.331264, 0.5], [0.5, -0.418688, -0.081312]])
"""Brightness and two colours of red, green, blue (ITU-T T.871)."""
_DC_COUNTS = bytes([0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0])
_DC_SYMBOLS = bytes(range(12))
_AC_COUNTS = bytes([0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125])
_AC_FIRST = bytes.fromhex("01020300041105122131410613516107227114328191a1082342b1c11552d1f02433627282090a")
_AC_EVERY = {16 * run + size for run in range(16) for size in range(1, 11)}
_AC_SYMBOLS = _AC_FIRST + bytes(sorted(_AC_EVERY - {*_AC_FIRST}))
_SIXTEEN_ZEROS, _NO_MORE = 0xF0, 0x00


def _codes(counts: bytes, symbols: bytes) -> tuple[Ints, Ints]:
    """Code and its length [bit] by symbol, shape (256,) each (T.81, annex C)."""
    codes, lengths = np.zeros(256, np.int64), np.zeros(256, np.int64)
    code, left = 0, iter(symbols)
    for length, count in enumerate(counts, 1):
        for _ in range(count):
            symbol = next(left)
            codes[symbol], lengths[symbol] = code, length
            code += 1
        code *= 2
    return codes, lengths


_DC, _AC = _codes(_DC_COUNTS, _DC_SYMBOLS), _codes(_AC_COUNTS, _AC_SYMBOLS)


def jpeg(pixels: NDArray[np.uint8]) -> bytes:
    """A file of a picture (height, width, 3), red, green, blue."""
    height, width = pixels.shape[:2]
    steps = _STEPS.ravel()[_ZIGZAG]
    head = b"\xff\xd8" + _segment(0xDB, b"\0" + steps.astype(np.uint8).tobytes())
    head += _segment(0xC0, struct.pack(">BHHB", 8, height, width, 3) + b"\1\x11\0\2\x11\0\3\x11\0")
    head += _segment(0xC4, b"\x00" + _DC_COUNTS + _DC_SYMBOLS)
    head += _segment(0xC4, b"\x10" + _AC_COUNTS + _AC_SYMBOLS)
    head += _segment(0xDA, b"\3\1\0\2\0\3\0\0\x3f\0")
    return head + _coded(_quantised(pixels, steps)) + b"\xff\xd9"


def _segment(kind: int, data: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, kind, len(data) + 2) + data


def _quantised(pixels: NDArray[np.uint8], steps: Array) -> Ints:
    """Coefficients of every 8 × 8 block of every component, in zigzag order, shape (n, 3, 64)."""
    down, across = -pixels.shape[0] % 8, -pixels.shape[1] % 8
    whole = np.pad(pixels, ((0, down), (0, across), (0, 0)), mode="edge").astype(np.float32)
    parts = whole @ _FROM_RGB.T.astype(np.float32)
    parts[..., 0] -= 128
    rows, columns = whole.shape[0] // 8, whole.shape[1] // 8
    blocks = parts.reshape(rows, 8, columns, 8, 3).transpose(0, 2, 4, 1, 3).reshape(-1, 3, 8, 8)
    cosines = _COSINES.astype(np.float32)
    found = (cosines @ blocks @ cosines.T).reshape(-1, 3, 64)[..., _ZIGZAG]
    return np.asarray(np.rint(found / steps.astype(np.float32)), np.int64)


def _coded(found: Ints) -> bytes:
    """Coefficients (n, 3, 64) as Huffman codes, with what keeps them from looking like markers."""
    first = np.diff(found[..., 0], axis=0, prepend=0).ravel()
    rows = found.reshape(-1, 64)
    block, k = np.nonzero(rows[:, 1:])
    k = k + 1
    begins = np.ones(len(k), bool)
    begins[1:] = block[1:] != block[:-1]
    run = k - 1 - np.where(begins, 0, np.concatenate([[0], k[:-1]])[: len(k)])
    zeros = np.repeat(np.arange(len(k)), run // 16)
    last = np.zeros(len(rows), np.int64)
    np.maximum.at(last, block, k)
    ended = np.flatnonzero(last < 63)
    value = rows[block, k]
    parts = [
        (128 * np.arange(len(rows)), *_with_bits(_DC, _sizes(first), first)),
        (128 * block[zeros] + 2 * k[zeros] - 1, *_alone(_SIXTEEN_ZEROS, len(zeros))),
        (128 * block + 2 * k, *_with_bits(_AC, 16 * (run % 16) + _sizes(value), value)),
        (128 * ended + 127, *_alone(_NO_MORE, len(ended))),
    ]
    places, codes, lengths = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(places, kind="stable")
    codes, lengths = codes[order], lengths[order]
    ends = np.cumsum(lengths)
    left = np.repeat(ends, lengths) - 1 - np.arange(ends[-1])
    bits = (np.repeat(codes, lengths) >> left & 1).astype(np.uint8)
    filled = np.concatenate([bits, np.ones(-len(bits) % 8, np.uint8)])
    return np.packbits(filled).tobytes().replace(b"\xff", b"\xff\0")


def _sizes(values: Ints) -> Ints:
    """How many bits the magnitudes of values have."""
    return np.asarray(np.ceil(np.log2(np.abs(values) + 1)), np.int64)


def _with_bits(table: tuple[Ints, Ints], symbols: Ints, values: Ints) -> tuple[Ints, Ints]:
    """Codes of symbols followed by the bits of values, a negative one as its complement; and lengths."""
    sizes = symbols % 16
    bits = np.where(values < 0, values + (1 << sizes) - 1, values)
    return table[0][symbols] << sizes | bits, table[1][symbols] + sizes


def _alone(symbol: int, n: int) -> tuple[Ints, Ints]:
    return np.full(n, _AC[0][symbol]), np.full(n, _AC[1][symbol])
