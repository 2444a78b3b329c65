"""Orders links so that each comes after its parent, depth first, as the file has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from seerob.core.errors import Problem
from seerob.description.xml_values import Reader


def in_order(reader: Reader, links: Sequence[str], parents: Mapping[str, str]) -> tuple[str, ...]:
    """Links after their parents; problems for several roots or a loop are left with the reader.

    Args:
        reader: Collects the problems.
        links: All links in the order of the file.
        parents: Child → parent.
    """
    roots = [link for link in links if link not in parents]
    children: dict[str, list[str]] = {}
    for link in links:
        if link in parents:
            children.setdefault(parents[link], []).append(link)
    if links and not roots:
        reader.problem(
            "", "every link hangs on another one: the joints form a loop", "remove the joint that closes it"
        )
    if len(roots) > 1:
        reader.problem(
            "",
            f"{len(roots)} links hang on nothing: {', '.join(roots[:6])}",
            "a robot is one tree: join them with fixed joints, or make them robots or parts of their own",
        )
    order: list[str] = []
    waiting = roots[:1]
    while waiting:
        link = waiting.pop()
        order.append(link)
        waiting += reversed(children.get(link, []))
    if len(roots) == 1 and len(order) < len(links):
        lost = [link for link in links if link not in set(order)]
        reader.problems.append(
            Problem(
                reader.file, "", f"a loop of joints through {', '.join(lost[:6])}", "loops cannot be read"
            )
        )
    return tuple(order)
