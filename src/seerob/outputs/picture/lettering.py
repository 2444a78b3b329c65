"""Words in a picture: outlines of the TrueType font beside this file, filled.

A library that draws text and writes PNG weighs 20 MB, of which this was all that was used.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array

RIM = 3
"""Width of the light rim around letters [px]."""
_FINE = 4
"""Samples per pixel each way."""
_STEPS = 4
"""Straight lines for each curve of an outline."""


class Font:
    """A TrueType font: its outlines in units of its grid, y up."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        (count,) = struct.unpack_from(">H", data, 4)
        entries = (struct.unpack_from(">4s4xII", data, 12 + 16 * k) for k in range(count))
        self._tables = {tag: data[start : start + size] for tag, start, size in entries}
        head, hhea = self._tables[b"head"], self._tables[b"hhea"]
        self.em: int = struct.unpack_from(">H", head, 18)[0]
        self.ascent, self.descent = struct.unpack_from(">hh", hhea, 4)
        long = struct.unpack_from(">h", head, 50)[0] == 1
        loca = np.frombuffer(self._tables[b"loca"], ">u4" if long else ">u2").astype(int)
        self._places = loca if long else 2 * loca
        (metrics,) = struct.unpack_from(">H", hhea, 34)
        self._advances = np.frombuffer(self._tables[b"hmtx"], ">u2", 2 * metrics)[::2].astype(int)
        self._glyphs = self._characters()
        self._known: dict[int, Array] = {}

    def _characters(self) -> dict[int, int]:
        """Glyph of each character that the font has: the tables of format 4, and 12 beyond 16 bits."""
        cmap = self._tables[b"cmap"]
        (count,) = struct.unpack_from(">H", cmap, 2)
        starts = [struct.unpack_from(">I", cmap, 8 + 8 * k)[0] for k in range(count)]
        found: dict[int, int] = {}
        for at in starts:
            if cmap[at : at + 2] == b"\x00\x0c":
                (groups,) = struct.unpack_from(">I", cmap, at + 12)
                for k in range(groups):
                    first, last, glyph = struct.unpack_from(">III", cmap, at + 16 + 12 * k)
                    found |= {code: glyph + code - first for code in range(first, last + 1)}
        at = next(s for s in starts if cmap[s : s + 2] == b"\x00\x04")
        (double,) = struct.unpack_from(">H", cmap, at + 6)
        n = double // 2
        ends, firsts, deltas, ranges = (
            np.frombuffer(cmap, ">u2", n, at + 14 + extra).astype(int)
            for extra in (0, double + 2, 2 * double + 2, 3 * double + 2)
        )
        for k in range(n):
            for code in range(firsts[k], ends[k] + 1):
                glyph = code
                if ranges[k]:
                    place = at + 16 + 3 * double + 2 * k + ranges[k] + 2 * (code - firsts[k])
                    glyph = struct.unpack_from(">H", cmap, place)[0]
                    if not glyph:
                        continue
                found[code] = int(glyph + deltas[k]) & 0xFFFF
        return found

    def glyph(self, character: str) -> int:
        """Number of the glyph of a character; 0, a box, where the font has none."""
        return self._glyphs.get(ord(character), 0)

    def advance(self, glyph: int) -> int:
        """From one letter to the next."""
        return int(self._advances[min(glyph, len(self._advances) - 1)])

    def outline(self, glyph: int) -> Array:
        """Lines around a glyph, shape (n, 2, 2)."""
        if glyph not in self._known:
            contours = self._contours(glyph)
            self._known[glyph] = np.concatenate([np.zeros((0, 2, 2)), *map(_lines, contours)])
        return self._known[glyph]

    def _contours(self, glyph: int) -> list[tuple[Array, NDArray[np.bool_]]]:
        """Points of each contour (n, 2), and which of them lie on it."""
        data = self._tables[b"glyf"][self._places[glyph] : self._places[glyph + 1]]
        if not data:
            return []
        (count,) = struct.unpack_from(">h", data)
        return self._simple(data, count) if count >= 0 else self._composed(data)

    def _simple(self, data: bytes, count: int) -> list[tuple[Array, NDArray[np.bool_]]]:
        ends = np.frombuffer(data, ">u2", count, 10).astype(int) + 1
        total = int(ends[-1]) if count else 0
        at = 12 + 2 * count + struct.unpack_from(">H", data, 10 + 2 * count)[0]
        flags: list[int] = []
        while len(flags) < total:
            repeat = 1
            if data[at] & 8:
                repeat += data[at + 1]
            flags += [data[at]] * repeat
            at += 2 if data[at] & 8 else 1
        points = np.zeros((total, 2))
        for axis, (short, same) in enumerate(((2, 16), (4, 32))):
            value = 0
            for k, flag in enumerate(flags):
                if flag & short:
                    value += data[at] if flag & same else -data[at]
                    at += 1
                elif not flag & same:
                    value += struct.unpack_from(">h", data, at)[0]
                    at += 2
                points[k, axis] = value
        on = np.array(flags, int) & 1 == 1
        cuts = ends[:-1]
        return list(zip(np.split(points, cuts), np.split(on, cuts), strict=True))

    def _composed(self, data: bytes) -> list[tuple[Array, NDArray[np.bool_]]]:
        found = []
        at, more = 10, True
        while more:
            flags, part = struct.unpack_from(">HH", data, at)
            at += 4
            wide = flags & 1
            offset = np.array(struct.unpack_from(">hh" if wide else ">bb", data, at), float)
            at += 4 if wide else 2
            numbers = 4 if flags & 0x80 else 2 if flags & 0x40 else 1 if flags & 8 else 0
            given = [x / 16384 for x in struct.unpack_from(f">{numbers}h", data, at)]
            at += 2 * numbers
            turn = np.eye(2)
            if numbers:
                turn = np.reshape(given, (2, 2)) if numbers == 4 else np.diag((2 * given)[:2])
            found += [(points @ turn + offset, on) for points, on in self._contours(part)]
            more = bool(flags & 0x20)
        return found


def _lines(contour: tuple[Array, NDArray[np.bool_]]) -> Array:
    """A contour of lines and quadratic curves as lines (n, 2, 2)."""
    points, on = contour
    if len(points) < 2:
        return np.zeros((0, 2, 2))
    # Between two points that are not on it there is one in the middle that is.
    pairs = zip(points, on, np.roll(points, -1, axis=0), np.roll(on, -1), strict=True)
    path: list[tuple[Array, bool]] = []
    for here, here_on, there, there_on in pairs:
        path.append((here, bool(here_on)))
        if not here_on and not there_on:
            path.append(((here + there) / 2, True))
    first = next(k for k, (_, is_on) in enumerate(path) if is_on)
    path = [*path[first:], *path[: first + 1]]
    t = np.arange(1, _STEPS + 1)[:, None] / _STEPS
    made = [path[0][0][None]]
    for k in range(1, len(path)):
        here, is_on = path[k]
        if is_on and path[k - 1][1]:
            made.append(here[None])
        elif not is_on:
            start, end = path[k - 1][0], path[k + 1][0]
            made.append((1 - t) ** 2 * start + 2 * t * (1 - t) * here + t**2 * end)
    corners = np.concatenate(made)
    return np.stack([corners[:-1], corners[1:]], axis=1)


@cache
def font() -> Font:
    """A font that has ✓, ✕ and ↔: DejaVu Sans, whose licence lies beside it."""
    return Font(gzip.decompress(Path(__file__).with_name("DejaVuSans-Bold.ttf.gz").read_bytes()))


def width(text: str, size: int) -> float:
    """Width of a text [px] whose letters are ``size`` [px] high."""
    face = font()
    return float(sum(face.advance(face.glyph(c)) for c in text)) * size / float(face.em)


def ink(text: str, size: int) -> Array:
    """How much of each pixel letters cover, 0…1, with `RIM` free pixels around them, shape (h, w)."""
    face = font()
    scale = size / face.em
    pen, lines = 0, []
    for character in text:
        glyph = face.glyph(character)
        lines.append(face.outline(glyph) + np.array([pen, 0]))
        pen += face.advance(glyph)
    across = int(np.ceil(pen * scale)) + 2 * RIM
    down = int(np.ceil((face.ascent - face.descent) * scale)) + 2 * RIM
    every = np.concatenate([np.zeros((0, 2, 2)), *lines]) * [1, -1] + [0, face.ascent]
    return _filled((every * scale + RIM) * _FINE, down, across)


def _filled(lines: Array, down: int, across: int) -> Array:
    """What closed outlines enclose, where they wind around it; lines (n, 2, 2) in samples."""
    (x0, y0), (x1, y1) = lines[:, 0].T, lines[:, 1].T
    low, high = np.minimum(y0, y1), np.maximum(y0, y1)
    first = np.clip(np.ceil(low - 0.5), 0, _FINE * down).astype(int)
    count = np.clip(np.ceil(high - 0.5), 0, _FINE * down).astype(int) - first
    which = np.repeat(np.arange(len(lines)), count)
    row = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + first[which]
    slope = (x1 - x0)[which] / (y1 - y0)[which]
    x = x0[which] + (row + 0.5 - y0[which]) * slope
    columns = _FINE * across + 1
    column = np.clip(np.ceil(x - 0.5), 0, columns - 1).astype(int)
    sign = np.where(y1 > y0, 1.0, -1.0)[which]
    turns = np.bincount(row * columns + column, sign, _FINE * down * columns)
    inside = np.cumsum(turns.reshape(-1, columns), axis=1)[:, :-1] != 0
    return np.asarray(inside.reshape(down, _FINE, across, _FINE).mean(axis=(1, 3)))


def write(
    pixels: NDArray[np.uint8],
    at: tuple[float, float],
    text: str,
    color: tuple[float, float, float],
    size: int,
) -> None:
    """Write a text into a picture (height, width, 3), centred at a pixel, with a light rim around it.

    The rim keeps it readable on anything. What lies beyond the picture is cut off.
    """
    letters = ink(text, size)
    down, across = letters.shape
    rim = letters.copy()
    for dy in range(-RIM, RIM + 1):
        for dx in range(-RIM, RIM + 1):
            if 0 < dx * dx + dy * dy <= (RIM + 0.3) ** 2:
                rim = np.maximum(rim, np.roll(letters, (dy, dx), axis=(0, 1)))
    left, top = round(at[0] - across / 2), round(at[1] - down / 2)
    here = (
        slice(max(top, 0), max(min(top + down, pixels.shape[0]), 0)),
        slice(max(left, 0), max(min(left + across, pixels.shape[1]), 0)),
    )
    there = (
        slice(here[0].start - top, max(here[0].stop - top, 0)),
        slice(here[1].start - left, max(here[1].stop - left, 0)),
    )
    shown = pixels[here].astype(float)
    for cover, paint in ((rim, (1.0, 1.0, 1.0)), (letters, color)):
        part = cover[there][..., None]
        shown += part * (255 * np.array(paint) - shown)
    pixels[here] = np.round(shown).astype(np.uint8)


def _size(rows: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Sum of the sizes of differences modulo 256, by row."""
    return np.asarray(np.minimum(rows, -rows).sum(axis=1, dtype=np.int64))


def png(pixels: NDArray[np.uint8]) -> bytes:
    """PNG of an image (height, width, 3)."""
    height, width, _ = pixels.shape
    rows = np.empty((height, 1 + 3 * width), np.uint8)
    # Each pixel less the one to its left, or above it: for each row what gives the smaller numbers.
    flat = np.ascontiguousarray(pixels, np.uint8).reshape(height, -1)
    beside, below = flat.copy(), flat.copy()
    beside[:, 3:] -= flat[:, :-3]
    below[1:] -= flat[:-1]
    vertical = _size(below) < _size(beside)
    rows[:, 0] = np.where(vertical, 2, 1)
    rows[:, 1:] = np.where(vertical[:, None], below, beside)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    blocks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 6)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))
        for tag, data in blocks
    )
