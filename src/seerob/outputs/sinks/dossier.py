"""One HTML page that says what was evaluated, what came out, and what it rests on."""

from __future__ import annotations

import os
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_file
from seerob.core.samples import Sample
from seerob.core.snapshot import Basis, Finding, Scene, Snapshot
from seerob.outputs.report.report import ReportSection
from seerob.outputs.sink import AtEndWithResults, Sink
from seerob.recording.result_log import result_named

_AT_ONCE = 2
"""Pictures that are drawn side by side, of some 130 MB each while they are."""


class Dossier(Sink, frozen=True, kw_only=True):
    """Write a self-contained HTML report at the end of the run."""

    file: Annotated[
        str, Meta(pattern=r"^[^/\\]+\.(html|htm)$", description="a file name that ends in .html")
    ] = "report.html"
    """Name in the run's folder; an earlier report of that name is replaced."""
    pictures: Annotated[int, Meta(ge=0)] = 12
    """Largest number of pictures of worst instants; the worst criteria come first."""
    pdf: bool = False
    """Whether it is also printed to a PDF file beside it, by an installed Chromium, Chrome or Edge."""

    @property
    def printed(self) -> str:
        """Name of the PDF file."""
        return f"{Path(self.file).stem}.pdf"

    def open(
        self, scene: Scene, meshes: dict[str, bytes], files: dict[str, bytes], folder: Path
    ) -> DossierWriter:
        """Start to collect; nothing is written before `DossierWriter.close`.

        Raises:
            InputError: The file's name or the number of pictures is wrong, or nothing is there to print.
        """
        if self.file != Path(self.file).name or not self.file.endswith((".html", ".htm")):
            raise InputError.at(
                folder, "dossier.file", f"{self.file!r} is not a file name", "such as report.html"
            )
        if self.pictures < 0:
            raise InputError.at(folder, "dossier.pictures", f"{self.pictures} is negative", "0 or more")
        if self.pdf:
            from seerob.outputs.report.printing import browser

            browser()
        path = folder / self.file
        return DossierWriter(scene, meshes, files, path, pictures=self.pictures, pdf=self.pdf)


class DossierWriter(AtEndWithResults):
    """Collects results; keeps one snapshot per criterion, that of its worst instant.

    Of its progress every picture is a step, and so is the page.
    """

    def __init__(
        self,
        scene: Scene,
        meshes: dict[str, bytes],
        files: dict[str, bytes],
        path: Path,
        *,
        pictures: int,
        pdf: bool = False,
    ) -> None:
        """Use `Dossier.open`."""
        super().__init__(scene.criteria)
        self.path = path
        self.findings: list[Finding] = list(scene.findings)
        """What the report lists as found; the run may add to it."""
        self.sections: list[ReportSection] = []
        """What a command adds to the report, after the criteria."""
        self._scene, self._meshes, self._files, self._pictures = scene, meshes, files, pictures
        self._pdf = pdf
        self._worst: dict[str, Snapshot] = {}
        self._pool: ThreadPoolExecutor | None = None
        self._being_drawn: dict[str, Future[bytes]] = {}

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick."""
        for name in self.log.add(snapshot):
            self._worst[name] = snapshot

    def close(self) -> None:
        """Draw and write the page, whole or not at all.

        Raises:
            InputError: It cannot be written.
        """
        from seerob.outputs.report.page import page
        from seerob.outputs.report.report import Report, command, setup
        from seerob.recording.format import versions

        pictures = self._drawn()
        report = Report(
            scene=self._scene,
            log=self.log,
            files=self._files,
            bases=self._bases(),
            pictures=pictures,
            versions=versions(),
            date=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"),
            findings=tuple(self.findings),
            setup=setup(self._files),
            command=command(),
            sections=tuple(self.sections),
        )
        html, steps = page(report).encode(), len(pictures) + 1 + self._pdf
        write_whole(self.path, html)
        self._tell(len(pictures) + 1, steps)
        if self._pdf:
            from seerob.outputs.report.printing import printed

            write_whole(self.path.with_suffix(".pdf"), printed(html))
            self._tell(steps, steps)

    def begin(self) -> None:
        """Begin to draw; `close` waits for it."""
        if self._pool is not None:
            return
        from seerob.outputs.picture.picture import Stage

        # A figure without a verdict is worth a picture only when it draws something.
        chosen = []
        for series in self.log.ranked():
            snapshot = self._worst.get(series.name)
            result = None if snapshot is None else result_named(snapshot, series.name)
            if snapshot is None or result is None or not result.markers:
                continue
            chosen.append((snapshot, result))
        chosen = chosen[: self._pictures]
        stage = Stage(self._scene, self._meshes) if chosen else None
        self._pool = ThreadPoolExecutor(_AT_ONCE)  # most of a picture is drawn without the interpreter's lock
        if stage is not None:
            self.findings.extend(stage.findings)
            subjects = {info.name: info.subjects for info in self._scene.criteria}
            self._being_drawn = {
                result.name: self._pool.submit(
                    stage.picture, snapshot, result, subjects=subjects.get(result.name, ())
                )
                for snapshot, result in chosen
            }

    def abandon(self) -> None:
        """Draw no picture more."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def _drawn(self) -> dict[str, bytes]:
        self.begin()
        drawn = {}
        try:
            for name, picture in self._being_drawn.items():
                drawn[name] = picture.result()
                self._tell(len(drawn), len(self._being_drawn) + 1 + self._pdf)
        finally:
            self.abandon()
        return drawn

    def _bases(self) -> dict[str, Basis]:
        return {info.name: info.basis for info in self._scene.criteria if info.basis is not None}


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or as it was before.

    Raises:
        InputError: The folder does not exist or may not be written.
    """
    try:
        with whole_file(path) as hidden, hidden.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError.at(path, "", what, "give a folder that exists and may be written") from error
