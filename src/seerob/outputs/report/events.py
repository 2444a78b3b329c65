"""What happened to loose workpieces, and how long each round of work took."""

from __future__ import annotations

from seerob.core.snapshot import Event
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.recording.result_log import MOST_EVENTS, ResultLog

WORDS = {
    "taken": "taken",
    "handed": "handed over",
    "torn": "torn out of the hand",
    "placed": "placed",
    "dropped": "dropped",
    "refused": "not taken",
    "round": "round ended",
}


def events_section(log: ResultLog) -> Html | None:
    """The report's list with times; nothing where nothing happened."""
    if not log.events:
        return None
    rounds = [event.took for event in log.events if event.what == "round" and event.took is not None]
    parts = []
    if rounds:
        mean, least, most = sum(rounds) / len(rounds), min(rounds), max(rounds)
        text = f"{len(rounds)} rounds: {mean:.2f} s each on average, {least:.2f} to {most:.2f} s."
        parts.append(tag("p", text))
    if len(log.events) == MOST_EVENTS:
        parts.append(tag("p", f"The first {MOST_EVENTS} events; later ones are in the recording."))
    head = ["at", "what", "workpiece", "hand", "place", "took"]
    return joined([*parts, table(head, [_row(event) for event in log.events], class_="instants")])


def _row(event: Event) -> list[str | Html]:
    took = "–" if event.took is None else f"{event.took:.2f} s"
    what = WORDS.get(event.what, event.what) + (f": {event.reason}" if event.reason else "")
    return [whole(f"{event.t:.2f} s"), what, event.piece, event.by or "–", event.where or "–", took]
