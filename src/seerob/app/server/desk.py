"""Where pages edit the workstation file together: one draft, its steps, what it says, and its saving.

Every page sees the same draft. An edit says which revision it was made of; what others did since is taken
into account, and refuses it where both are about one place. A draft that the file's checks refuse does not
come into being, so that what can be saved is a workstation that can be run.
"""

from __future__ import annotations

import asyncio
import logging
import os
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from difflib import unified_diff
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import NamedTuple, Protocol

import msgspec

from seerob.app.server.client import Client
from seerob.core.errors import InputError, Problem, SeerobError
from seerob.core.files.toml_file import parsed_toml, read_toml
from seerob.core.snapshot import (
    Change,
    Draft,
    Edit,
    Edited,
    Mistake,
)
from seerob.workstation import editing
from seerob.workstation.editing import Event, Overlap, exchanged, undone

_log = logging.getLogger(__name__)
_encode = msgspec.msgpack.Encoder().encode
MOST_BROUGHT = 8
"""CAD files whose changes wait for a page to ask for them."""
MOST_STEPS = 1000
"""That can be taken back, and revisions that an edit may be behind."""


Check = Callable[[bytes], Callable[[], None]]
"""Reads a draft as ``seerob check-file`` does, in a thread of its own, and raises `InputError` of every
mistake; what it gives makes pages see the draft, and is called in the server's loop."""


class Trying(Protocol):
    """Where drafts are tried: `seerob.app.server.trial.Trial`."""

    @property
    def running(self) -> bool:
        """Whether the draft is tried."""

    @property
    def ended(self) -> str:
        """Why the newest run ended or was not begun; empty otherwise."""

    def start(self) -> str:
        """Try the draft from its beginning; why not, empty when it is done."""

    def stop(self) -> None:
        """End the run."""


Held = Callable[[set[str]], str]
"""Says why entries may not be changed."""


def changed_entries(before: Mapping[str, object], after: Mapping[str, object]) -> set[str]:
    """Names of the entries that are others, are gone or are new in a second reading of a workstation file."""
    first, second = _entries(before), _entries(after)
    return {name for name in first.keys() | second.keys() if first.get(name) != second.get(name)}


def _entries(tables: Mapping[str, object]) -> dict[str, list[object]]:
    found: dict[str, list[object]] = {}
    for entries in tables.values():
        for entry in entries if isinstance(entries, list) else ():
            if isinstance(entry, dict) and isinstance(name := entry.get("name"), str):
                found.setdefault(name, []).append(entry)
    return found


class _Step(NamedTuple):
    """An edit that was made."""

    number: int
    """Of the revision that it made first."""
    page: Client
    before: bytes
    changes: tuple[Change, ...]
    events: tuple[Event, ...]


@dataclass
class _Redo:
    """An edit that was taken back, in places of a revision."""

    changes: tuple[Change, ...]
    revision: int


class Desk:
    """The draft of one workstation file; all but ``check`` runs in the server's loop.

    Args:
        file: The workstation file.
        check: Says what is wrong with a draft.
        schema: JSON schema of the workstation file, for forms.
        trial: Where drafts are tried; None where none is.

    Raises:
        InputError: The file cannot be read.
    """

    def __init__(self, file: Path, check: Check, schema: bytes = b"", trial: Trying | None = None) -> None:
        self.schema, self._trial = schema, trial
        self._file, self._check = file, check
        self._tables, self._raw = read_toml(file)
        self._saved, self._saved_steps = self._raw, tuple[_Step, ...]()
        self._steps: tuple[_Step, ...] = ()
        self._done: deque[tuple[int, tuple[Event, ...]]] = deque(maxlen=MOST_STEPS)
        self._redo: dict[Client, list[_Redo]] = {}
        self._revision = 1
        self._diff = ""
        self._lock = asyncio.Lock()
        self._held: Held = lambda _: ""
        self._brought: dict[int, tuple[tuple[Change, ...], int]] = {}
        self._last_brought = 0

    @property
    def file(self) -> Path:
        """The workstation file."""
        return self._file

    @property
    def newest(self) -> tuple[bytes, int]:
        """The draft, and which revision it is."""
        return self._raw, self._revision

    def keep(self, changes: tuple[Change, ...], revision: int) -> int:
        """Keep changes that are too many for a message, until a page asks for them by the number given.

        Args:
            changes: What a CAD file makes of a draft.
            revision: Of that draft.
        """
        self._last_brought += 1
        self._brought[self._last_brought] = changes, revision
        while len(self._brought) > MOST_BROUGHT:
            del self._brought[next(iter(self._brought))]
        return self._last_brought

    @property
    def unsaved(self) -> bool:
        """Whether the draft is another than the file."""
        return self._raw != self._saved

    def come(self, page: Client) -> None:
        """A page that may edit is there."""
        self._redo[page] = []
        page.offer("Draft", _encode(self._draft(page)))

    def gone(self, page: Client) -> None:
        """A page has left; what it did is anybody's to take back."""
        self._redo.pop(page, None)

    async def take(self, page: Client, edit: Edit, held: Held = lambda _: "") -> Edited:
        """Do what a page asks, all of it or nothing.

        Args:
            page: It.
            edit: What it asks.
            held: Why entries of these names may not be changed, as somebody else holds one; else empty.
        """
        mistakes: tuple[Mistake, ...] = ()
        async with self._lock:
            self._held = held
            try:
                await self._take(page, edit)
            except InputError as error:
                mistakes = tuple(Mistake(key=p.key, what=p.what, remedy=p.remedy) for p in error.problems)
            except (SeerobError, OSError) as error:
                mistakes = (Mistake(key="", what=str(error)),)
            except Exception as error:  # of a plug-in, perhaps; the file is as it was
                _log.exception("an edit failed")
                mistakes = (Mistake(key="", what=f"a fault of the program or of a plug-in: {error!r}"),)
        return Edited(id=edit.id, accepted=not mistakes, revision=self._revision, mistakes=mistakes)

    async def _take(self, page: Client, edit: Edit) -> None:
        match edit.action:
            case "change" if edit.brought:
                if edit.changes or edit.brought not in self._brought:
                    raise self._refusal("what was brought is not kept here any more", "bring the file again")
                await self._change(page, *self._brought[edit.brought])
                del self._brought[edit.brought]
                self._redo.get(page, []).clear()
            case "change":
                await self._change(page, edit.changes, edit.revision)
                self._redo.get(page, []).clear()
            case "undo":
                await self._undo(page)
            case "redo":
                redo = self._redo.get(page, [])
                if not redo:
                    raise self._refusal("nothing was taken back here")
                await self._change(page, redo[-1].changes, redo[-1].revision)
                redo.pop()
            case "save" | "discard" if edit.revision != self._revision:
                raise self._refusal("was changed since you looked at it", "look at what is new, then again")
            case "save":
                await asyncio.to_thread(self._save)
                self._saved, self._saved_steps = self._raw, self._steps
                self._diff = ""
            case "discard":
                await self._discard(page)
            case "run" if self._trial is not None:
                if refusal := self._trial.start():
                    raise self._refusal(refusal)
            case "stop" if self._trial is not None:
                self._trial.stop()
            case "run" | "stop":
                raise self._refusal("nothing is run here")
            case _:
                raise self._refusal(
                    f"{edit.action!r} is no action", "change, undo, redo, save, discard, run or stop"
                )
        self.tell()

    def tell(self) -> None:
        """Tell every page of the draft."""
        for other in tuple(self._redo):
            other.offer("Draft", _encode(self._draft(other)))

    # -- changes --------------------------------------------------------------------------------

    async def _change(self, page: Client, changes: Sequence[Change], revision: int) -> None:
        oldest = self._done[0][0] - 1 if self._done else self._revision
        if not oldest <= revision <= self._revision:
            raise self._refusal(f"revision {revision} is not known here any more", "reload the page")
        since = [event for number, events in self._done if number > revision for event in events]
        try:
            now, _ = exchanged(changes, since)
        except Overlap as overlap:
            raise self._overlap(overlap) from None
        raw, events = await asyncio.to_thread(editing.changed, self._raw, now, str(self._file))
        step = _Step(self._revision + 1, page, self._raw, tuple(now), tuple(events))
        await self._become(raw, (*self._steps, step), events)

    async def _undo(self, page: Client) -> None:
        at = next((k for k in reversed(range(len(self._steps))) if self._own(self._steps[k], page)), None)
        if at is None:
            raise self._refusal("nothing of this page is left to take back")
        raw, later, back, again = await asyncio.to_thread(self._without, at)
        await self._become(raw, (*self._steps[:at], *later), back)
        self._redo[page].append(_Redo(again, self._revision))

    def _without(self, at: int) -> tuple[bytes, list[_Step], list[Event], tuple[Change, ...]]:
        """The draft without one step, the steps behind it, what leaving it out does, what makes it again."""
        step = self._steps[at]
        raw, later, back = step.before, list[_Step](), undone(step.events)
        try:
            for other in self._steps[at + 1 :]:
                changes, back = exchanged(other.changes, back)
                new, events = editing.changed(raw, changes, str(self._file))
                later.append(other._replace(before=raw, changes=tuple(changes), events=tuple(events)))
                raw = new
            again, _ = exchanged(step.changes, [event for other in later for event in other.events])
        except Overlap as overlap:
            raise self._overlap(overlap) from None
        return raw, later, back, tuple(again)

    async def _discard(self, page: Client) -> None:
        if (
            await asyncio.to_thread(self._on_disk) != self._saved
        ):  # by an editor: nothing here is of that file
            self._tables, raw = read_toml(self._file)
            await self._become(raw, (), [Event("wrote", ())], saved=raw)
            self._saved, self._saved_steps, self._diff = raw, (), ""
            return
        kept = {step.number for step in self._saved_steps}
        new = [step for step in self._steps if step.number not in kept]
        left = {step.number for step in self._steps}
        gone = [step for step in self._saved_steps if step.number not in left]
        if all(self._own(step, page) for step in (*new, *gone)):
            await self._become(self._saved, self._saved_steps, [Event("wrote", ())])
            return
        for _ in [step for step in new if self._own(step, page)]:
            await self._undo(page)

    async def _become(
        self, raw: bytes, steps: tuple[_Step, ...], events: Sequence[Event], saved: bytes | None = None
    ) -> None:
        """Make a draft the one that pages see, if it is right."""
        show, tables, diff = await asyncio.to_thread(
            self._looked_at, raw, self._saved if saved is None else saved
        )
        if saved is None and (why := self._held(changed_entries(self._tables, tables))):
            raise self._refusal(why, "wait until they let go of it")
        self._raw, self._steps, self._tables, self._diff = raw, steps[-MOST_STEPS:], tables, diff
        self._revision += 1
        self._done.append((self._revision, tuple(events)))
        show()

    def _looked_at(self, raw: bytes, saved: bytes) -> tuple[Callable[[], None], dict[str, object], str]:
        show = self._check(raw)
        before, after = (text.decode("utf-8-sig").splitlines() for text in (saved, raw))
        diff = "\n".join(unified_diff(before, after, self._file.name, self._file.name, n=2, lineterm=""))
        return show, parsed_toml(raw, self._file), diff

    def _own(self, step: _Step, page: Client) -> bool:
        return step.page is page or step.page not in self._redo

    # -- the file -------------------------------------------------------------------------------

    def _on_disk(self) -> bytes:
        return self._file.read_bytes()

    def _save(self) -> None:
        """Put the draft in place of the file, all of it or nothing.

        Raises:
            InputError: The file is another than was read.
        """
        if self._on_disk() != self._saved:
            what = "another program has changed the file since it was read here"
            raise self._refusal(what, "discard, which reads it again; what was edited here is lost then")
        file = self._file.resolve()
        with NamedTemporaryFile(dir=file.parent, prefix=f".{file.name}.", delete=False) as new:
            try:
                new.write(self._raw)
                new.flush()
                os.fsync(new.fileno())
                os.chmod(new.name, file.stat().st_mode & 0o7777)
                new.close()
                os.replace(new.name, file)
            except BaseException:
                with suppress(OSError):
                    os.unlink(new.name)
                raise

    # -- words ----------------------------------------------------------------------------------

    def _draft(self, page: Client) -> Draft:
        return Draft(
            file=self._file.name,
            revision=self._revision,
            diff=self._diff,
            tables=self._tables,
            undo=any(self._own(step, page) for step in self._steps),
            redo=bool(self._redo.get(page)),
            runs=self._trial is not None and self._trial.running,
            ended="" if self._trial is None else self._trial.ended,
        )

    def _refusal(self, what: str, remedy: str = "") -> InputError:
        return InputError(Problem(str(self._file), "", what, remedy))

    def _overlap(self, overlap: Overlap) -> InputError:
        value = editing.value_at(self._tables, overlap.path)
        text = "" if value is None else editing.literal(value)
        what = f"changed meanwhile by another page, and is now {text}" if 0 < len(text) < 200 else ""
        what = what or (
            "changed meanwhile by another page" if text else "taken away meanwhile by another page"
        )
        return InputError(Problem(str(self._file), str(overlap), what, "look at it, then change it again"))
