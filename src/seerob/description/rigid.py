"""Which links move as one."""

from __future__ import annotations

from collections.abc import Sequence

from seerob.description.description import Link


def groups(links: Sequence[Link]) -> tuple[tuple[Link, ...], ...]:
    """Links that no joint moves relative to each other; the first of each is the one its joint moves."""
    head: dict[str, str] = {}
    found: dict[str, list[Link]] = {}
    for link in links:
        head[link.name] = link.name if link.parent is None or link.joints else head[link.parent]
        found.setdefault(head[link.name], []).append(link)
    return tuple(map(tuple, found.values()))
