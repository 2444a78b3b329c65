"""Where the chunks of an MCAP file are, also of one whose end is missing or damaged.

Only record headers are read. Nothing in the file is trusted: every length is checked against the
file's real size before it is used, and sizes after decompression are bounded.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, NamedTuple

from seerob.core.errors import InputError

MAGIC = b"\x89MCAP0\r\n"
MAX_CHUNK = 256 * 2**20
"""Largest decompressed chunk that is read [bytes]."""
MAX_TEXT = 2**20
"""Longest name or metadata record that is read [bytes]."""

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX = 0x03, 0x04, 0x05, 0x06, 0x07
_ATTACHMENT, _METADATA, _DATA_END = 0x09, 0x0C, 0x0F


class Damaged(Exception):
    """A record that cannot be read; the message says why."""


class ChunkPlace(NamedTuple):
    """One chunk; times are the log times of its messages [ns]."""

    start: int
    end: int
    offset: int
    """Offset of the compressed data in the file."""
    length: int
    size: int
    """Decompressed [bytes]."""
    crc: int
    compression: str
    channels: list[int]
    """Channels that its message indexes name, as far as they were written; no checksum covers them."""


class Attachment(NamedTuple):
    """A file inside the file."""

    name: str
    offset: int
    length: int
    crc: int
    crc_start: int


class Message(NamedTuple):
    """One message of a chunk."""

    channel: int
    time: int
    data: bytes


@dataclass
class McapIndex:
    """What a scan of record headers found."""

    chunks: list[ChunkPlace] = field(default_factory=list)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    finished: bool = False
    """Whether the writer came to write the end mark."""
    unread: int = 0
    """Bytes at the end that hold no whole record."""


def scan(path: Path) -> McapIndex:
    """Find chunks, attachments and metadata.

    Raises:
        InputError: The file cannot be opened or is not MCAP.
    """
    index = McapIndex()
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(0)
            if file.read(8) != MAGIC:
                raise InputError.at(path, "", "is not an MCAP file", "give a recording made by seerob")
            position = 8
            while not index.finished:
                header = file.read(9)
                if len(header) < 9:
                    break
                opcode, length = struct.unpack("<BQ", header)
                if length > size - position - 9:
                    break
                try:
                    _record(index, file, opcode, position + 9, length)
                except (Damaged, struct.error, UnicodeDecodeError):
                    break
                position += 9 + length
                file.seek(position)
            index.unread = 0 if index.finished else size - position
            if index.chunks and not index.finished:
                # Its message indexes may have been cut off halfway.
                index.chunks[-1].channels.clear()
    except OSError as error:
        what = f"cannot be read: {error.strerror}"
        raise InputError.at(path, "", what, "check path and permission") from error
    return index


def _record(index: McapIndex, file: BinaryIO, opcode: int, start: int, length: int) -> None:
    if opcode == _CHUNK:
        t0, t1, size, crc = struct.unpack("<QQQI", file.read(28))
        compression = _text(file, 64)
        (stored,) = struct.unpack("<Q", file.read(8))
        if file.tell() + stored > start + length:
            raise Damaged("chunk is longer than its record")
        index.chunks.append(ChunkPlace(t0, t1, file.tell(), stored, size, crc, compression, []))
    elif opcode == _MESSAGE_INDEX and index.chunks:
        index.chunks[-1].channels.append(struct.unpack("<H", file.read(2))[0])
    elif opcode == _ATTACHMENT:
        file.seek(16, 1)
        name = _text(file, MAX_TEXT)
        _text(file, MAX_TEXT)
        (stored,) = struct.unpack("<Q", file.read(8))
        place = file.tell()
        if place + stored + 4 != start + length:
            raise Damaged("attachment does not fill its record")
        file.seek(stored, 1)
        (crc,) = struct.unpack("<I", file.read(4))
        index.attachments[name] = Attachment(name, place, stored, crc, start)
    elif opcode == _METADATA:
        if length > MAX_TEXT:
            raise Damaged("metadata is too long")
        name = _text(file, MAX_TEXT)
        (stored,) = struct.unpack("<I", file.read(4))
        end = file.tell() + stored
        if end > start + length:
            raise Damaged("metadata is longer than its record")
        entries = {}
        while file.tell() < end:
            key = _text(file, MAX_TEXT)
            entries[key] = _text(file, MAX_TEXT)
        index.metadata[name] = entries
    elif opcode == _DATA_END:
        index.finished = True


def _text(file: BinaryIO, limit: int) -> str:
    (length,) = struct.unpack("<I", file.read(4))
    if length > limit:
        raise Damaged("text is too long")
    data = file.read(length)
    if len(data) != length:
        raise Damaged("text is cut off")
    return data.decode()


def read_attachment(path: Path, attachment: Attachment) -> bytes:
    """Content of an attachment.

    Raises:
        Damaged: Its checksum does not fit.
    """
    with path.open("rb") as file:
        file.seek(attachment.crc_start)
        record = file.read(attachment.offset - attachment.crc_start + attachment.length)
    if attachment.crc and zlib.crc32(record) != attachment.crc:
        raise Damaged(f"attachment {attachment.name!r} has a wrong checksum")
    return record[attachment.offset - attachment.crc_start :]


def read_chunk(path: Path, chunk: ChunkPlace) -> tuple[dict[int, str], list[Message]]:
    """Topics by channel id that the chunk defines, and its messages in order.

    Raises:
        Damaged: Too large, wrong checksum, unknown compression, or not what it says it is.
    """
    if chunk.size > MAX_CHUNK:
        raise Damaged(f"chunk of {chunk.size} bytes, more than the {MAX_CHUNK} that are read")
    with path.open("rb") as file:
        file.seek(chunk.offset)
        data = _decompress(file.read(chunk.length), chunk)
    if len(data) != chunk.size or (chunk.crc and zlib.crc32(data) != chunk.crc):
        raise Damaged("chunk has a wrong checksum")
    topics: dict[int, str] = {}
    messages: list[Message] = []
    position = 0
    try:
        while position < len(data):
            opcode, length = struct.unpack_from("<BQ", data, position)
            position += 9
            if length > len(data) - position:
                raise Damaged("record is longer than its chunk")
            if opcode == _MESSAGE:
                channel, _, time, _ = struct.unpack_from("<HIQQ", data, position)
                messages.append(Message(channel, time, data[position + 22 : position + length]))
            elif opcode == _CHANNEL:
                channel, _, n = struct.unpack_from("<HHI", data, position)
                topics[channel] = data[position + 8 : position + 8 + n].decode()
            position += length
    except (struct.error, UnicodeDecodeError) as error:
        raise Damaged(f"chunk holds a broken record: {error}") from error
    return topics, messages


def _decompress(data: bytes, chunk: ChunkPlace) -> bytes:
    if chunk.compression == "":
        return data
    if chunk.compression != "zstd":
        raise Damaged(f"compression {chunk.compression!r} is not one that seerob writes")
    import zstandard

    try:
        # The frame's own size wins over max_output_size, so it is compared first.
        declared = zstandard.frame_content_size(data)
        if declared not in (-1, chunk.size):
            raise Damaged("chunk and compressed frame disagree about the size")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=max(chunk.size, 1))
    except zstandard.ZstdError as error:
        raise Damaged(f"chunk cannot be decompressed: {error}") from error
