"""What happened to loose workpieces, and how long each round of work took."""

from __future__ import annotations

from seerob.core.snapshot import Event
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.outputs.words import said, told, word
from seerob.recording.result_log import MOST_EVENTS, ResultLog

WORDS = {
    "taken": word("taken"),
    "handed": word("handed over"),
    "torn": word("torn out"),
    "placed": word("placed"),
    "dropped": word("dropped"),
    "refused": word("not taken"),
    "round": word("round ended"),
    "filled": word("filled"),
}


def events_section(log: ResultLog) -> Html | None:
    """The report's list with times; nothing where nothing happened."""
    if not log.events:
        return None
    rounds = [event.took for event in log.events if event.what == "round" and event.took is not None]
    parts = []
    if rounds:
        mean, least, most = sum(rounds) / len(rounds), min(rounds), max(rounds)
        text = said(
            "{n} rounds: {mean} s each on average, {least} to {most} s.",
            n=len(rounds), mean=f"{mean:.2f}", least=f"{least:.2f}", most=f"{most:.2f}",
        )  # fmt: skip
        parts.append(tag("p", text))
    if filled := [event for event in log.events if event.what == "filled"]:
        parts.append(tag("p", said("{n} boxes or other places filled.", n=filled[-1].count)))
    if len(log.events) == MOST_EVENTS:
        parts.append(tag("p", said("The first {n} events; later ones are in the recording.", n=MOST_EVENTS)))
    head = [
        said(one)
        for one in ("at", word("what"), word("workpiece"), word("hand"), word("place"), word("took"))
    ]
    return joined([*parts, table(head, [_row(event) for event in log.events], class_="instants")])


def _row(event: Event) -> list[str | Html]:
    took = "–" if event.took is None else f"{event.took:.2f} s"
    what = said(WORDS.get(event.what, event.what)) + (f": {told(event.reason)}" if event.reason else "")
    return [whole(f"{event.t:.2f} s"), what, event.piece, event.by or "–", event.where or "–", took]
