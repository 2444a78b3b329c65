"""A workbook file written by XlsxWriter: a row in memory at a time, and the same bytes for the same cells."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, TYPE_CHECKING

from seerob.core.files.whole_file import hidden_folder

if TYPE_CHECKING:
    from xlsxwriter import Workbook

_CREATED = datetime(1980, 1, 1, tzinfo=UTC)
"""What every file says, so that the same cells are the same bytes."""


@contextmanager
def book(file: IO[bytes] | Path) -> Iterator[Workbook]:
    """A workbook to add sheets to, written when the block ends; what an error leaves is no workbook.

    Sheets wait in temporary files, beside the file if it has a path.

    Args:
        file: Where to, open for writing bytes, or its path.

    Raises:
        OSError: The disk refuses.
    """
    if isinstance(file, Path):
        with hidden_folder(file) as beside, file.open("wb") as out:
            yield from _written(out, str(beside))
    else:
        with TemporaryDirectory() as folder:
            yield from _written(file, folder)


def _written(file: IO[bytes], folder: str) -> Iterator[Workbook]:
    from xlsxwriter import Workbook
    from xlsxwriter.exceptions import FileCreateError

    out = _Output(file)
    made = Workbook(
        out,
        {
            "constant_memory": True,
            "tmpdir": folder,
            "strings_to_formulas": False,
            "strings_to_urls": False,
            "strings_to_numbers": False,
        },
    )
    made.set_properties({"created": _CREATED})
    try:
        yield made
        made.close()
    except FileCreateError as error:
        raise error.args[0] from error
    finally:
        for sheet in made.worksheets():
            with suppress(OSError):  # of a full disk, once more; the file is closed all the same
                sheet.row_data_fh.close()
        out.over = True
    if out.refused is not None:
        raise out.refused


class _Output:
    """What the archive is written to: it takes everything, and remembers that the disk did not.

    An archive that fails half-way would try again when it is forgotten, where nobody hears its error.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.refused: OSError | None = None
        """Why the disk took no more."""
        self.over = False
        """The file is no longer ours."""
        self._at = file.tell()

    def write(self, data: bytes) -> int:
        """Write, or drop what comes after an error."""
        if self.refused is None and not self.over:
            try:
                self._file.write(data)
            except OSError as error:
                self.refused = error
        self._at += len(data)
        return len(data)

    def tell(self) -> int:
        return self._at

    def seek(self, at: int, whence: int = 0) -> int:
        """To a place that is counted from the begin: an archive asks for no other."""
        if whence:
            raise ValueError(f"seek from {whence}, not from the begin")
        if self.refused is None and not self.over:
            self._file.seek(at)
        self._at = at
        return at

    def flush(self) -> None:
        """The file is flushed when it is closed."""
