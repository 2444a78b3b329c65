"""Axes that parts of an assembly can move about or along, from shapes that fit: proposals with reasons.

A shaft of one part in a hole of another, with a common axis and nearly one radius, turns; one part between
planes of another, or on two shafts that are parallel, slides. Nothing is decided here: a user accepts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from seerob.core.shapes import Solid
from seerob.core.transforms import Array, rotation_from_axis_angle, transform
from seerob.description.cad.assembly import Assembly, Moving, Shape
from seerob.description.cad.names import told_apart
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, rigid
from seerob.description.shapes.detail import manifold
from seerob.description.shapes.mesh_bodies import joined

ANGLE = 2e-3
"""Axes and normals that differ by less are parallel [rad]."""
ASIDE = 2e-4
"""Axes that are apart by less are one [m]."""
CLEARANCE = 5e-4, 0.03
"""Of a hole over its shaft: so much [m], or this share of the radius, whichever is more."""
RUNNING = 1e-5
"""A hole that is wider than its shaft by more is made to run [m]."""
FASTENERS = 3
"""So many parts that are alike, in one part and parallel, are taken for screws."""
GAP = 3e-4
"""Planes that are apart by less touch [m], as do parts."""
LEAST = 1e-3
"""Surfaces that lie beside each other for less are no fit [m]."""
GOES_ON = 4.0
"""A shaft or its hole that is so many times as long as what fits of it is a way rather than a bearing."""
MOST_PAIRS = 20_000
"""Pairs of parts near each other that are looked at."""
STEPS = 72
"""Steps of a whole turn, or of the longest way, in which contact is looked for."""
TURN = math.tau


@dataclass(frozen=True, eq=False)
class Round:
    """A shaft or a hole in the world."""

    point: Array
    """Middle of it on its axis, shape (3,) [m]."""
    axis: Array
    radius: float
    slope: float
    shaft: bool
    half: float
    """Half of its length [m]."""
    covered: float
    """Angle that it covers [rad]."""


@dataclass(frozen=True, eq=False)
class Flat:
    """A plane face in the world."""

    normal: Array
    offset: float
    corners: Array


@dataclass(frozen=True, eq=False)
class Proposal:
    """One degree of freedom between two parts."""

    kind: JointKind
    a: int
    """Number of the instance that carries it."""
    b: int
    """Number of the instance that moves."""
    point: Array
    """Of the axis in the world, shape (3,) [m]."""
    axis: Array
    """Unit, in the world, shape (3,)."""
    score: float
    """Greater is likelier."""
    reason: str


def proposals(assembly: Assembly) -> list[Proposal]:
    """All that shapes speak for, the likeliest first."""
    parts = [_placed(assembly, number) for number in range(len(assembly.instances))]
    found: list[Proposal] = []
    for a, b in _near(assembly):
        found += _turning(a, b, parts[a][0], parts[b][0], parts[a][1], parts[b][1])
        found += _sliding(a, b, parts[a][1], parts[b][1], parts[a][0], parts[b][0])
    sizes = [_size(assembly, number) for number in range(len(assembly.instances))]
    # The larger part carries the smaller one, until the chain from the ground says otherwise.
    turned = [p if sizes[p.a] >= sizes[p.b] else _swapped(p) for p in found]
    return sorted(_patterns(turned, sizes), key=lambda p: -p.score)


def _patterns(found: list[Proposal], sizes: Sequence[float]) -> Iterator[Proposal]:
    """Axes of several parts that are alike and parallel in one are more likely those of screws."""
    for p in found:
        alike = {
            other.b
            for other in found
            if other.kind is p.kind is JointKind.REVOLUTE
            and other.a == p.a
            and abs(sizes[other.b] / sizes[p.b] - 1) < 1e-6
            and np.linalg.norm(np.cross(other.axis, p.axis)) < ANGLE
        }
        if len(alike) < FASTENERS:
            yield p
        else:
            reason = f"{p.reason}; but it is one of {len(alike)} alike beside each other, as screws are"
            yield replace(p, score=0.3 * p.score, reason=reason)


def _swapped(p: Proposal) -> Proposal:
    return Proposal(p.kind, p.b, p.a, p.point, -p.axis, p.score, p.reason)


def _size(assembly: Assembly, number: int) -> float:
    low, high = _box(assembly, number)
    return float(np.prod(np.maximum(high - low, 1e-6)))


def _box(assembly: Assembly, number: int) -> tuple[Array, Array]:
    instance = assembly.instances[number]
    shape = assembly.shapes[instance.shape]
    moved = np.vstack([mesh.moved(instance.world_from_shape).vertices for mesh in shape.pieces])
    return moved.min(axis=0), moved.max(axis=0)


def _near(assembly: Assembly) -> Iterator[tuple[int, int]]:
    """Pairs of instances whose boxes touch, swept along x."""
    boxes = [_box(assembly, number) for number in range(len(assembly.instances))]
    order = sorted(range(len(boxes)), key=lambda i: boxes[i][0][0])
    active: list[int] = []
    count = 0
    for i in order:
        low, high = boxes[i]
        active = [j for j in active if boxes[j][1][0] >= low[0] - GAP]
        for j in active:
            if (boxes[j][0] <= high + GAP).all() and (boxes[j][1] >= low - GAP).all():
                count += 1
                if count > MOST_PAIRS:
                    return
                yield min(i, j), max(i, j)
        active.append(i)


def _placed(assembly: Assembly, number: int) -> tuple[list[Round], list[Flat]]:
    instance = assembly.instances[number]
    world = instance.world_from_shape
    rounds, flats = [], []
    for surface in assembly.shapes[instance.shape].surfaces:
        axis = world[:3, :3] @ surface.axis
        if surface.kind == "plane":
            corners = surface.corners @ world[:3, :3].T + world[:3, 3]
            if len(corners) >= 3:
                flats.append(Flat(axis, float(axis @ corners[0]), corners))
            continue
        radius, slope, shaft, low, high, covered = surface.round
        middle = (low + high) / 2
        point = (world @ [*(surface.point + middle * surface.axis), 1.0])[:3]
        at = radius + slope * middle
        rounds.append(Round(point, axis, at, slope, bool(shaft), (high - low) / 2, covered))
    return _merged(rounds), flats


def _merged(rounds: list[Round]) -> list[Round]:
    """Halves of one cylinder as one, as many programs write it in two faces."""
    found: list[Round] = []
    for one in rounds:
        for k, other in enumerate(found):
            if (
                one.shaft == other.shaft
                and abs(one.radius - other.radius) < 1e-6
                and abs(one.slope - other.slope) < 1e-9
                and abs(one.half - other.half) < 1e-6
                and np.linalg.norm(one.point - other.point) < 1e-6
                and abs(one.axis @ other.axis) > 1 - 1e-9
            ):
                covered = min(one.covered + other.covered, TURN)
                found[k] = Round(
                    other.point, other.axis, other.radius, other.slope, other.shaft, other.half, covered
                )
                break
        else:
            found.append(one)
    return found


@dataclass(frozen=True, eq=False)
class _Fit:
    point: Array
    axis: Array
    length: float
    radius: float
    gap: float
    covered: float
    cone: bool
    longer: float
    """Length of the shaft or of the hole, whichever is more [m]."""


def _fits(a: Sequence[Round], b: Sequence[Round]) -> list[_Fit]:
    """Shafts of one part in holes of the other, longest first."""
    found = []
    for one in a:
        for other in b:
            if one.shaft == other.shaft or np.linalg.norm(np.cross(one.axis, other.axis)) > ANGLE:
                continue
            shaft, hole = (one, other) if one.shaft else (other, one)
            between = other.point - one.point
            along = float(between @ one.axis)
            if np.linalg.norm(between - along * one.axis) > ASIDE:
                continue
            length = min(one.half, along + other.half) - max(-one.half, along - other.half)
            at = shaft.radius + shaft.slope * float((hole.point - shaft.point) @ shaft.axis)
            gap = hole.radius - at
            if length < LEAST or not -1e-6 <= gap <= max(CLEARANCE[0], CLEARANCE[1] * hole.radius):
                continue
            middle = (max(-one.half, along - other.half) + min(one.half, along + other.half)) / 2
            covered = min(one.covered, other.covered)
            cone = bool(abs(one.slope) > 1e-6)
            point, longer = one.point + middle * one.axis, 2 * max(one.half, other.half)
            found.append(_Fit(point, one.axis, length, at, gap, covered, cone, longer))
    return sorted(found, key=lambda fit: -fit.length * fit.covered)


def _axes_of(fits: Sequence[_Fit]) -> list[list[_Fit]]:
    """Fits by their common axis."""
    groups: list[list[_Fit]] = []
    for fit in fits:
        for group in groups:
            first = group[0]
            between = fit.point - first.point
            aside = np.linalg.norm(between - (between @ first.axis) * first.axis)
            if np.linalg.norm(np.cross(fit.axis, first.axis)) < ANGLE and aside < ASIDE:
                group.append(fit)
                break
        else:
            groups.append([fit])
    return groups


def _turning(
    a: int,
    b: int,
    of_a: Sequence[Round],
    of_b: Sequence[Round],
    flat_a: Sequence[Flat],
    flat_b: Sequence[Flat],
) -> Iterator[Proposal]:
    groups = _axes_of(_fits(of_a, of_b))
    parallel = {
        i
        for (i, one), (j, other) in combinations(enumerate(groups), 2)
        if np.linalg.norm(np.cross(one[0].axis, other[0].axis)) < ANGLE
        for i in (i, j)
    }
    touching = _touching(flat_a, flat_b)
    for number, group in enumerate(groups):
        best = group[0]
        length = sum(fit.length for fit in group)
        whole = max(fit.covered for fit in group)
        shoulders = sum(abs(float(n @ best.axis)) > 1 - ANGLE for n, _ in touching)
        # Flats beside the axis that touch keep it from turning; so does a second axis.
        blocked = sum(abs(float(n @ best.axis)) < ANGLE for n, _ in touching)
        score = min(whole / TURN, 1.0) * (1.0 + min(length / (4 * best.radius), 1.0))
        score += 0.3 * min(len(group) - 1, 3) + 0.4 * min(shoulders, 2) + 0.2 * best.cone
        score -= 0.5 * min(blocked, 2)
        score += 0.4 * (best.gap > RUNNING)
        if number in parallel:
            score *= 0.3
        several = "shafts in holes" if len(group) > 1 else "shaft in a hole"
        told = [
            f"{len(group)} {several} on one axis, radius {best.radius * 1e3:.4g} mm, "
            f"gap {max(best.gap, 0) * 1e3:.2g} mm, {length * 1e3:.3g} mm long"
        ]
        if best.gap <= RUNNING:
            told.append("without clearance, as a press fit")
        if shoulders:
            told.append(f"{shoulders} shoulder{'s' if shoulders > 1 else ''} that touch")
        if number in parallel:
            told.append("but another axis beside it holds both")
        elif blocked:
            told.append("but flat faces beside it touch")
        yield Proposal(JointKind.REVOLUTE, a, b, best.point, best.axis, score, "; ".join(told))
        if number not in parallel and not shoulders:
            told = [told[0], "nothing holds it along the axis"]
            goes_on = min(fit.longer for fit in group) / length
            share = 0.6
            if goes_on >= GOES_ON:
                share = 1.1
                told.append(f"shaft or hole go on {goes_on:.2g} times as long")
            yield Proposal(JointKind.PRISMATIC, a, b, best.point, best.axis, score * share, "; ".join(told))


def _touching(a: Sequence[Flat], b: Sequence[Flat]) -> list[tuple[Array, Array]]:
    """Normals of planes of one part that lie against planes of the other, and where."""
    found: list[tuple[Array, Array]] = []
    for one in a:
        for other in b:
            if float(one.normal @ other.normal) > -1 + ANGLE**2:
                continue
            gap = float(one.normal @ other.corners[0]) - one.offset
            if abs(gap) > GAP:
                continue
            u = np.cross(one.normal, np.eye(3)[int(np.abs(one.normal).argmin())])
            u /= np.linalg.norm(u)
            v = np.cross(one.normal, u)
            spans = []
            for axis in (u, v):
                first, second = one.corners @ axis, other.corners @ axis
                spans.append((max(first.min(), second.min()), min(first.max(), second.max())))
            if min(high - low for low, high in spans) < LEAST:
                continue
            (u0, u1), (v0, v1) = spans
            point = one.offset * one.normal + u * (u0 + u1) / 2 + v * (v0 + v1) / 2
            found.append((one.normal, point))
    return found


def _sliding(
    a: int,
    b: int,
    flat_a: Sequence[Flat],
    flat_b: Sequence[Flat],
    of_a: Sequence[Round],
    of_b: Sequence[Round],
) -> Iterator[Proposal]:
    touching = _touching(flat_a, flat_b)
    groups = _axes_of(_fits(of_a, of_b))
    for one, other in combinations(groups, 2):
        if np.linalg.norm(np.cross(one[0].axis, other[0].axis)) > ANGLE:
            continue
        stopped = sum(abs(float(n @ one[0].axis)) > 1 - ANGLE for n, _ in touching)
        length = min(sum(fit.length for fit in group) for group in (one, other))
        score = 2.2 + min(length / (4 * one[0].radius), 1.0) - 1.2 * min(stopped, 2)
        between = other[0].point - one[0].point
        apart = float(np.linalg.norm(between - (between @ one[0].axis) * one[0].axis))
        reason = f"two shafts in holes, parallel and {apart * 1e3:.4g} mm apart, {length * 1e3:.3g} mm long"
        if stopped:
            reason += "; but flat faces across them touch, as of a screwed flange"
        middle = (one[0].point + other[0].point) / 2
        yield Proposal(JointKind.PRISMATIC, a, b, middle, one[0].axis, score, reason)
        break
    normals: list[Array] = []
    for normal, _ in touching:
        if all(abs(float(normal @ n)) < 1 - ANGLE for n in normals):
            normals.append(normal)
    for one_, other_ in combinations(normals, 2):
        along = np.cross(one_, other_)
        if np.linalg.norm(along) < 0.1:
            continue
        along /= np.linalg.norm(along)
        stopped = sum(abs(float(n @ along)) > 0.1 for n, _ in touching)
        both = 0
        for axis in (one_, other_):
            signs = {round(float(n @ axis)) for n, _ in touching if abs(float(n @ axis)) > 1 - ANGLE}
            both += len(signs) == 2
        if not both:
            continue
        fitting = [g for g in groups if abs(float(g[0].axis @ along)) < 1 - ANGLE]
        score = 1.0 + 0.8 * both - 0.8 * min(stopped, 2) - 0.5 * len(fitting)
        middle = np.mean([point for _, point in touching], axis=0)
        reason = (
            f"{len(touching)} plane faces touch, in {both} direction{'s' if both > 1 else ''} on both sides"
        )
        if stopped:
            reason += "; but some across the way"
        yield Proposal(JointKind.PRISMATIC, a, b, middle, along, score, reason)


# -- what moves with what, and how far -------------------------------------------------------


def accepted(
    assembly: Assembly,
    chosen: Sequence[Proposal],
    name: str,
    ground: int | None = None,
    weighed: Callable[[Shape], Inertial | None] = lambda _: None,
) -> tuple[Assembly, list[str]]:
    """The assembly with accepted axes as a mechanism; what moves is no part any more.

    Args:
        assembly: With rigid places.
        chosen: Axes that the user accepted.
        name: Of the mechanism.
        ground: Number of the instance that stands; of the lowest ones the largest when not given.
        weighed: Mass properties of a shape in its own frame, None where nobody knows them: a link with such
            a part has none.

    Returns:
        The assembly, and one sentence for each joint.

    Raises:
        ValueError: An axis moves nothing against what stands.
    """
    count = len(assembly.instances)
    if ground is None:
        bottoms = [float(_box(assembly, i)[0][2]) for i in range(count)]
        lowest = [i for i in range(count) if bottoms[i] < min(bottoms) + 1e-3]
        ground = max(lowest, key=lambda i: _size(assembly, i))
    cut = {frozenset((p.a, p.b)) for p in chosen}
    solids = {i: solids_of(assembly, [i]) for i in range(count)}
    beside: dict[int, set[int]] = {i: set() for i in range(count)}
    for a, b in _near(assembly):
        if frozenset((a, b)) not in cut and _touch(solids[a], solids[b]):
            beside[a].add(b)
            beside[b].add(a)
    group = list(range(count))
    for i in range(count):
        waiting = [i] if group[i] == i else []
        while waiting:
            for j in beside[waiting.pop()]:
                if group[j] != i and group[j] == j and j > i:
                    group[j] = i
                    waiting.append(j)
    members: dict[int, list[int]] = {}
    for i in range(count):
        members.setdefault(group[i], []).append(i)
    base = group[ground]
    edges = [(group[p.a], group[p.b], p) for p in chosen]
    names = assembly.names()
    links = [Link("base", None, np.eye(4))]
    placed: dict[int, Array] = {base: np.eye(4)}
    label = {base: "base"}
    told: list[str] = []
    order: list[tuple[int, Proposal]] = []
    while True:
        ready = [(a, b, p) for a, b, p in edges if (a in placed) != (b in placed)]
        if not ready:
            break
        a, b, p = ready[0]
        child, axis = (b, p.axis) if a in placed else (a, -p.axis)
        parent = a if a in placed else b
        placed[child] = transform(position=p.point)
        stem = names[min(members[child], key=lambda i: -_size(assembly, i))].rpartition("/")[2]
        label[child] = told_apart([*label.values(), stem])[-1]
        order.append((child, Proposal(p.kind, p.a, p.b, p.point, axis, p.score, p.reason)))
        at = np.linalg.inv(placed[parent]) @ placed[child]
        meshes = [
            mesh.moved(np.linalg.inv(placed[child]) @ assembly.instances[i].world_from_shape)
            for i in members[child]
            for mesh in assembly.shapes[assembly.instances[i].shape].pieces
        ]
        deviation = max(assembly.shapes[assembly.instances[i].shape].deviation for i in members[child])
        solid = Solid(mesh=joined(meshes)[0], deviation=deviation)
        known = [
            (one, np.linalg.inv(placed[child]) @ assembly.instances[i].world_from_shape)
            for i in members[child]
            if (one := weighed(assembly.shapes[assembly.instances[i].shape])) is not None
            and np.isfinite(one.spread_error)
        ]
        inertial = rigid(known) if len(known) == len(members[child]) else None
        kind = "turn" if p.kind is JointKind.REVOLUTE else "slide"
        joint = Joint(f"{kind}_{label[child]}", p.kind, axis)
        links.append(
            Link(label[child], label[parent], at, (joint,), inertial, visual=tuple(meshes), solids=(solid,))
        )
        edges = [edge for edge in edges if edge[2] is not p]
    if edges or not order:
        odd = edges[0][2] if edges else chosen[0]
        raise ValueError(
            f"the axis between {names[odd.a]} and {names[odd.b]} moves nothing: other parts hold them"
        )
    below: dict[int, set[int]] = {}
    for child, _ in reversed(order):
        own = {child}
        for other, _ in order:
            if links[1 + [c for c, _ in order].index(other)].parent == label[child]:
                own |= below.get(other, {other})
        below[child] = own
    for number, (child, p) in enumerate(order):
        moves = [i for g in below[child] for i in members[g]]
        stands = [i for i in range(count) if i not in moves]
        used = [assembly.shapes[assembly.instances[i].shape] for i in moves]
        lower, upper = limits(p, solids_of(assembly, moves), solids_of(assembly, stands), used)
        link = links[1 + number]
        joint = link.joints[0]
        if lower is not None or upper is not None or p.kind is JointKind.PRISMATIC:
            far = 2 * max(float(np.ptp(m.vertices, axis=0).max()) for s in used for m in s.pieces)
            most = math.pi if p.kind is JointKind.REVOLUTE else far
            joint = replace(
                joint, lower=-most if lower is None else lower, upper=most if upper is None else upper
            )
            links[1 + number] = replace(link, joints=(joint,))
        ends = "no contact ends it" if joint.lower is None else f"{joint.lower:.4g} to {joint.upper:.4g}"
        unit = "" if joint.lower is None else " rad" if p.kind is JointKind.REVOLUTE else " m"
        told.append(f"{joint.name}: {p.reason}; {ends}{unit}")
    moved = {i for child, _ in order for i in members[child]}
    kept = tuple(one for i, one in enumerate(assembly.instances) if i not in moved)
    made = Description(name, tuple(links), links[-1].name, "axes from shapes")
    return (
        replace(assembly, instances=kept, mechanisms=(*assembly.mechanisms, Moving(made, np.eye(4)))),
        told,
    )


def _touch(a: Sequence[Any], b: Sequence[Any]) -> bool:
    return any(float(one.min_gap(other, 2 * GAP)) < GAP for one in a for other in b)


def solids_of(assembly: Assembly, numbers: Sequence[int]) -> list[Any]:
    """Closed bodies of instances in the world, as `manifold3d.Manifold`; those that are open are left out."""
    found = []
    for number in numbers:
        instance = assembly.instances[number]
        mesh = joined(assembly.shapes[instance.shape].pieces)[0].moved(instance.world_from_shape)
        solid = manifold(mesh)
        if solid is not None:
            found.append(solid)
    return found


def limits(
    proposal: Proposal, moving: Sequence[Any], standing: Sequence[Any], shapes: Sequence[Shape]
) -> tuple[float | None, float | None]:
    """Lower and upper end [rad or m] at which what moves meets what stands; None where it never does.

    Args:
        proposal: The axis.
        moving: Solids that move, from `solids_of`.
        standing: Solids that do not.
        shapes: Shapes of all of them, whose size bounds the way.
    """
    turns = proposal.kind is JointKind.REVOLUTE
    size = max((float(np.ptp(m.vertices, axis=0).max()) for s in shapes for m in s.pieces), default=0.1)
    step = TURN / STEPS if turns else 2 * size / STEPS

    def met(q: float) -> float:
        """Volume that both take [m³]."""
        if turns:
            R = rotation_from_axis_angle(proposal.axis, q)
            at = transform(R, proposal.point - R @ proposal.point)
        else:
            at = transform(position=proposal.axis * q)
        placed = [solid.transform(at[:3]) for solid in moving]
        return sum(float((one ^ other).volume()) for one in placed for other in standing)

    ends: list[float | None] = []
    rest = met(0.0)
    # Triangles of a shaft in its hole cut each other a little as they turn.
    free = rest + 1e-9 + 2e-3 * sum(float(solid.volume()) for solid in moving)
    most = math.pi if turns else 2 * size
    for sign in (-1.0, 1.0):
        q, end = 0.0, None
        while q + step <= most + 1e-9:
            if met(sign * (q + step)) > free:
                low, high = q, q + step
                for _ in range(10):
                    middle = (low + high) / 2
                    low, high = (low, middle) if met(sign * middle) > free else (middle, high)
                end = sign * low
                break
            q += step
        ends.append(end)
    return ends[0], ends[1]
