"""Joints that mimic joints that mimic: each is made to mimic the one that moves by itself."""

from __future__ import annotations

from dataclasses import replace

from seerob.core.errors import suggestion
from seerob.description.description import Joint, Link, Mimic
from seerob.description.xml_values import Reader


def flattened(reader: Reader, links: tuple[Link, ...]) -> tuple[Link, ...]:
    """The links with every mimic chain collapsed.

    ``q_c = m₂ q_b + o₂`` and ``q_b = m₁ q_a + o₁`` give ``q_c = m₂ m₁ q_a + m₂ o₁ + o₂``. Unknown joints and
    loops become problems.
    """
    joints = {joint.name: joint for link in links for joint in link.joints}
    return tuple(
        replace(link, joints=tuple(_resolved(reader, joint, joints) for joint in link.joints))
        for link in links
    )


def _resolved(reader: Reader, joint: Joint, joints: dict[str, Joint]) -> Joint:
    if joint.mimic is None:
        return joint
    key, seen, mimic = f"joint[{joint.name}].mimic", [joint.name], joint.mimic
    while True:
        if mimic.joint in seen:
            reader.problem(
                key, "mimics itself: " + " → ".join([*seen, mimic.joint]), "one of them moves by itself"
            )
            return joint
        if mimic.joint not in joints:
            remedy = suggestion(mimic.joint, joints)
            reader.problem(key, f"no joint named {mimic.joint!r} that moves", remedy)
            return joint
        seen.append(mimic.joint)
        further = joints[mimic.joint].mimic
        if further is None:
            break
        mimic = Mimic(
            further.joint,
            mimic.multiplier * further.multiplier,
            mimic.multiplier * further.offset + mimic.offset,
        )
    if len(seen) > 2:
        law = f"q = {mimic.multiplier:g} q[{mimic.joint}] + {mimic.offset:g}"
        text = f"mimic chain {' → '.join(seen)} collapsed: {law}"
        reader.finding("note", joint.name, text)
    return replace(joint, mimic=mimic)
