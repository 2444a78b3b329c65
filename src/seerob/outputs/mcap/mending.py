"""Copies what is whole of a recording that was cut off, with an end and an index."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer


def mend(source: Path, to: Path) -> int:
    """Copy every record up to the first that is not whole.

    Args:
        source: The recording; it is only read.
        to: The copy, which must not exist.

    Returns:
        How many messages were copied.

    Raises:
        OSError: One cannot be read, or the other not written.
    """
    schemas, channels, messages = {0: 0}, {}, 0
    with source.open("rb") as cut, to.open("xb") as whole:
        writer: Any = Writer(whole, enable_crcs=True)
        with suppress(McapError, EOFError):  # here it was cut off
            for record in StreamReader(cut, validate_crcs=True).records:
                if isinstance(record, Header):
                    writer.start(profile=record.profile, library=record.library)
                elif isinstance(record, Schema) and record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, Channel) and record.id not in channels:
                    schema = schemas[record.schema_id]
                    channels[record.id] = writer.register_channel(
                        record.topic, record.message_encoding, schema, record.metadata
                    )
                elif isinstance(record, Message):
                    writer.add_message(
                        channels[record.channel_id],
                        record.log_time,
                        record.data,
                        record.publish_time,
                        record.sequence,
                    )
                    messages += 1
                elif isinstance(record, Attachment):
                    writer.add_attachment(
                        record.create_time, record.log_time, record.name, record.media_type, record.data
                    )
                elif isinstance(record, Metadata):
                    writer.add_metadata(record.name, record.metadata)
        writer.finish()
    return messages
