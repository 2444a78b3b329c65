"""The rules on the twin: sides, verdicts, what is not assessed, phases, accuracy, what drives a score."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from made_postures import PERSON

from made_cell import TWO_R, heard, judged, made, results_at, state_at, two_r
from seerob.core.errors import InputError
from seerob.core.snapshot import Origin, RowState, Verdict
from seerob.criteria.ergonomics import reba, rula
from seerob.criteria.ergonomics.owas import Legs
from seerob.criteria.scoring.rule import bind_posture
from seerob.criteria.scoring.score_rows import aspects
from seerob.description.humans.angles import SIDED, Angles, angles
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import JOINTS, bone_poses, mirrored
from seerob.session.run import Judge, bind
from seerob.twin.engine import Engine

STILL = np.zeros(len(JOINTS))
HUMAN = """
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
posture = "{posture}"
"""
KNOWN = {
    "rula": 'load = 0, muscle_arms = false, muscle_body = false, supported_arms = "none", '
    'back_supported = false, legs = "posture"',
    "reba": 'load = 0, supported_arms = "none", legs = "posture", '
    "static = false, repeated = false, rapid = false",
    "owas": 'load = 0, legs = "posture"',
}
RULES = tuple(KNOWN)
LIMIT = {"rula": "action_level", "reba": "action_level", "owas": "action_category"}


def table(kind, *, phases=None, more="", name=None):
    entered = KNOWN[kind] if phases is None else phases
    text = f"[{entered}]" if entered.startswith("{") or not entered else f"[{{ {entered} }}]"
    return (
        f'[[ergonomics]]\nkind = "{kind}"\nname = "{name or kind}"\nhuman = "op"\nphases = {text}\n{more}\n'
    )


def station(folder, tables, pose="standing"):
    return made(folder, HUMAN.format(posture=pose) + tables)


def all_rules(folder, pose="standing", **options):
    return station(folder, "".join(table(kind, **options) for kind in RULES), pose)


def at(stage, q):
    return results_at(stage, op=(q, STILL))


def parts(result):
    return {part.name: part for part in result.parts}


def test_somebody_who_stands_scores_least_but_for_the_straight_elbows(tmp_path):
    found = results_at(all_rules(tmp_path))
    assert {name: r.value for name, r in found.items()} == {"rula": 2.0, "reba": 1.0, "owas": 1.0}
    assert {r.verdict for r in found.values()} == {None}
    assert parts(found["rula"])["right lower arm"].value == 2
    assert found["rula"].reason == (
        "both sides: lower arm 2; action level 1: acceptable if not maintained or repeated for long periods"
    )


@pytest.mark.parametrize("kind", ["rula", "reba"])
def test_a_mirrored_posture_swaps_the_sides(tmp_path, kind):
    stage = station(tmp_path, table(kind))
    q = posture(PERSON, "reach_high")
    one, other = (at(stage, values)[kind] for values in (q, mirrored(q)))
    a, b = parts(one), parts(other)
    assert a["right"].value > a["left"].value
    assert (a["right"].value, a["left"].value) == (b["left"].value, b["right"].value)
    assert one.value == other.value == a["right"].value
    assert a["right upper arm"].value == b["left upper arm"].value
    swapped = {m.body.replace("right", "left") for m in one.markers}
    assert {m.body for m in other.markers} == swapped
    assert "op/left_upper_arm" in swapped


@pytest.mark.parametrize("kind", RULES)
def test_nothing_entered_is_not_assessed_and_never_the_least_score(tmp_path, kind):
    for more in ("", f"{LIMIT[kind]} = 3"):
        result = results_at(station(tmp_path, table(kind, phases="", more=more)))[kind]
        assert result.value is None
        assert result.verdict is Verdict.UNDECIDED
        assert result.reason.startswith("not assessed: ")
        assert result.interval[0] < result.interval[1]
        assert parts(result)["legs"].verdict is Verdict.UNDECIDED


@pytest.mark.parametrize(
    ("kind", "bone", "part"),
    [
        ("rula", "right_hand", "right wrist"),
        ("rula", "left_clavicle", "left upper arm"),
        ("reba", "head", "neck"),
        ("reba", "left_thigh", "legs"),
        ("owas", "pelvis", "back"),
        ("owas", "right_forearm", "arms"),
    ],
)
def test_a_bone_that_is_not_measured_leaves_its_part_undecided(tmp_path, kind, bone, part):
    more = f'unmeasured = ["{bone}"]\n{LIMIT[kind]} = 4'
    result = results_at(station(tmp_path, table(kind, more=more)))[kind]
    assert parts(result)[part].value is None
    assert parts(result)[part].verdict is Verdict.UNDECIDED
    assert result.verdict is Verdict.UNDECIDED
    assert "not assessed" in result.reason


def test_what_exceeds_at_its_best_is_exceeded_whatever_is_missing(tmp_path):
    found = results_at(station(tmp_path, table("rula", phases="", more="action_level = 1"), "reach_high"))
    assert found["rula"].verdict is Verdict.EXCEEDED
    assert found["rula"].value is None
    assert found["rula"].interval[0] > 2


@pytest.mark.parametrize("kind", RULES)
@pytest.mark.parametrize("pose", ["standing", "reach_high", "bend_forward", "squatting"])
def test_the_verdict_is_of_the_value_against_the_level(tmp_path, kind, pose):
    tops = {
        "rula": {1: 2, 2: 4, 3: 6, 4: 7},
        "reba": {0: 1, 1: 3, 2: 7, 3: 10, 4: 15},
        "owas": {1: 1, 2: 2, 3: 3, 4: 4},
    }
    tables = "".join(
        table(kind, more=f"{LIMIT[kind]} = {level}", name=f"level {level}") for level in tops[kind]
    )
    found = results_at(station(tmp_path, tables, pose))
    for level, top in tops[kind].items():
        result = found[f"level {level}"]
        assert result.limit == top
        # A limit that nothing can exceed has to be confirmed.
        vacuous = level == max(tops[kind])
        assert result.verdict == ("undecided" if vacuous else "within" if result.value <= top else "exceeded")


def test_phases_follow_each_other_and_before_the_first_nothing_is_known(tmp_path):
    entered = KNOWN["reba"].replace("load = 0", 'load = {}, shock = false, coupling = "good"')
    light = "{ start = 1, " + entered.format(1) + " }"
    heavy = "{ start = 2, " + entered.format(12) + " }"
    stage = station(tmp_path, table("reba", phases=f"{light}, {heavy}"))
    state = state_at(stage)
    found = {}
    for t in (0.5, 1.0, 1.99, 2.0, 50.0):
        state.t = t
        found[t] = judged(stage.bound, state)[0]
    assert found[0.5].verdict is Verdict.UNDECIDED
    assert [found[t].value for t in (1.0, 1.99, 2.0, 50.0)] == [1.0, 1.0, 2.0, 2.0]
    assert parts(found[2.0])["load"].value == 2


def test_phases_in_the_wrong_order_are_a_mistake(tmp_path):
    with pytest.raises(InputError, match="start after the one before"):
        station(tmp_path, table("owas", phases="{ start = 2 }, { start = 1 }"))


def test_the_accuracy_opens_what_lies_at_an_edge(tmp_path):
    """Trunk at 19°: with ± 3° it may be 2 or 3, and a limit between the two scores is undecided."""
    q = posture(PERSON, {"pelvis_tilt_forward": np.radians(19), "both_elbow_flexion": np.radians(80)})
    values = {}
    for degrees in (0.5, 3):
        more = f"accuracy_deg = {degrees}\naction_level = 1"
        result = at(station(tmp_path, table("rula", more=more)), q)["rula"]
        values[degrees] = result
        assert parts(result)["trunk"].value == 2
    assert parts(values[0.5])["trunk"].interval == (2, 2)
    assert values[0.5].verdict is Verdict.WITHIN
    assert parts(values[3])["trunk"].interval == (2, 3)
    assert values[3].interval == (2, 3)
    assert values[3].verdict is Verdict.UNDECIDED
    assert values[3].reason.startswith("the accuracy leaves it open: the score lies between 2 and 3; ")


def test_the_part_that_drives_the_score_is_named_and_coloured(tmp_path):
    q = posture(PERSON, {"pelvis_tilt_forward": np.radians(65), "both_elbow_flexion": np.radians(80)})
    result = at(station(tmp_path, table("reba", more="action_level = 0")), q)["reba"]
    assert "trunk 4" in result.reason
    assert {m.body for m in result.markers} == {"op/lumbar", "op/thorax"}
    assert {m.verdict for m in result.markers} == {Verdict.EXCEEDED}


def test_a_load_in_one_hand_counts_for_that_arm_and_for_the_body(tmp_path):
    entered = KNOWN["rula"].replace("load = 0", 'load = 5, load_use = "static", hand = "left"')
    found = parts(results_at(station(tmp_path, table("rula", phases=entered)))["rula"])
    assert [found[f"{own} force of the arms"].value for own in ("right", "left")] == [0, 2]
    assert found["force of the body"].value == 2


def test_the_profile_decides_above_ten_kilograms(tmp_path):
    entered = KNOWN["rula"].replace("load = 0", 'load = 12, load_use = "intermittent"')
    tables = "".join(
        table("rula", phases=entered, more=f'profile = "{p}"', name=p) for p in ("original1993", "worksheet")
    )
    stage = station(tmp_path, tables)
    found = results_at(stage)
    force = [parts(found[p])["force of the body"].value for p in ("original1993", "worksheet")]
    assert force == [2, 3]
    _, worksheet = stage.bound
    assert {i.name: i.value for i in worksheet.basis.inputs}["profile"] == "worksheet"


def test_a_person_who_is_not_heard_is_not_scored(tmp_path):
    (tmp_path / "m.toml").write_text(
        '[[keyframes]]\nt = 0\nposture = "standing"\n[[keyframes]]\nt = 1\nposture = "t_pose"\n'
    )
    driven = '[[sources]]\nkind = "keyframes"\nhuman = "op"\nfile = "m.toml"\n'
    stage = station(tmp_path, driven + "".join(map(table, RULES)))
    engine = Engine(stage.model, driven={"op": 0.2})
    state = engine.start()
    assert {r.verdict for r in judged(stage.bound, state)} == {Verdict.UNDECIDED}
    assert {r.reason for r in judged(stage.bound, state)} == {"op: nothing heard yet"}
    engine = Engine(stage.model, driven={"op": 0.2})
    engine.take([heard("op", 0.0, posture(PERSON, "standing"))])
    assert {r.verdict for r in Judge(stage.bound)(engine.start())} == {None}


@pytest.mark.parametrize("kind", RULES)
def test_every_threshold_stands_in_the_basis_with_its_origin(tmp_path, kind):
    key = "bent_deg = 25" if kind == "owas" else "trunk_twist_deg = 25"
    stage = station(tmp_path, table(kind, more=f"thresholds = {{ {key} }}\nunmeasured = ['head']"))
    criterion, inputs = stage.bound[0].criterion, stage.bound[0].basis.inputs
    named = {i.name: i for i in inputs}
    thresholds = [f.replace("_", " ") for f in criterion.thresholds.__struct_fields__]
    assert {f"threshold {name}" for name in thresholds} <= set(named)
    changed = named["threshold bent" if kind == "owas" else "threshold trunk twist"]
    assert (changed.value, changed.unit, changed.origin) == (25.0, "deg", Origin.GIVEN)
    others = {i.origin for i in inputs if i.name.startswith("threshold") and i is not changed}
    assert others == {Origin.CHOICE}
    assert named["head"].origin is Origin.MISSING
    assert named["accuracy of the angles"].origin is Origin.MISSING


def test_what_was_not_entered_stands_in_the_basis_as_missing(tmp_path):
    stage = station(tmp_path, table("reba", phases="load = 3"))
    named = {i.name: i for i in stage.bound[0].basis.inputs}
    assert (named["entered load"].value, named["entered load"].unit, named["entered load"].origin) == (
        3.0,
        "kg",
        Origin.GIVEN,
    )
    assert {named[f"entered {k}"].origin for k in ("coupling", "legs", "static", "shock")} == {Origin.MISSING}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('unmeasured = ["right_fist"]', "no bone named 'right_fist'"),
        ("action_level = 5", "action_level"),
        ("accuracy_deg = -1", "accuracy"),
        ("thresholds = { trunk_twist_deg = 400 }", "trunk_twist"),
        ("thresholds = { trunk_twisted = 1 }", "unknown key"),
    ],
)
def test_mistakes_are_named(tmp_path, more, message):
    with pytest.raises(InputError, match=message):
        bind(station(tmp_path, table("rula", more=more)).model)


@pytest.mark.parametrize("kind", ["rula", "reba"])
def test_the_least_posture_is_the_least_of_every_component_and_nothing_drives_it(tmp_path, kind):
    method = {"rula": rula.METHOD, "reba": reba.METHOD}[kind]
    q = posture(PERSON, {"both_elbow_flexion": np.radians(80), "both_elbow_pronation": np.radians(90)})
    result = at(station(tmp_path, table(kind, more="accuracy_deg = 1")), q)[kind]
    assert result.value == 1
    assert result.markers == ()
    assert result.reason == method.level(1)
    for name, part in parts(result).items():
        key = name.removeprefix("right ").removeprefix("left ")
        assert part.value == method.least.get(key, 1)
        assert part.interval == (part.value, part.value)
    assert set(method.least) <= {n.removeprefix("right ").removeprefix("left ") for n in parts(result)}


def test_action_levels_change_where_the_methods_say():
    def levels(method, most):
        return [int(method.level(score).split()[2].rstrip(":")) for score in range(1, most + 1)]

    assert levels(rula.METHOD, 7) == [1, 1, 2, 2, 3, 3, 4]
    assert levels(reba.METHOD, 15) == [0, 1, 1, *[2] * 4, *[3] * 3, *[4] * 5]


def test_owas_names_what_drives_the_category(tmp_path):
    """Code 2 3 4 1 is category 3; upright it would be 2, with the arms down 3, with straight knees 2."""
    q = posture(PERSON, "squatting", joints={"both_shoulder_flexion": np.radians(180)})
    result = at(station(tmp_path, table("owas", more="action_category = 2")), q)["owas"]
    assert [p.value for p in result.parts] == [2, 3, 4, 1]
    assert result.value == 3
    assert result.reason.startswith("back 2, legs 4; action category 3")
    assert {m.body.split("/")[1] for m in result.markers} >= {"thorax", "right_thigh", "left_shank"}
    assert not any("arm" in m.body for m in result.markers)


@pytest.mark.parametrize(
    ("kind", "legs", "expected"),
    [
        ("rula", "balanced", 1),
        ("rula", "unbalanced", 2),
        ("reba", "bilateral", 2),
        ("reba", "unilateral", 3),
        ("reba", "sitting", 1),
        ("reba", "posture", 2),
        *(("owas", name, code) for code, name in enumerate(list(Legs)[:7], 1)),
    ],
)
def test_how_the_legs_are_used_is_entered(tmp_path, kind, legs, expected):
    """With knees at 45°, which REBA counts unless somebody sits."""
    q = posture(PERSON, {"both_knee_flexion": np.radians(45), "both_hip_flexion": np.radians(45)})
    entered = KNOWN[kind].replace('legs = "posture"', f'legs = "{legs}"')
    assert parts(at(station(tmp_path, table(kind, phases=entered)), q)[kind])["legs"].value == expected


def test_the_twin_is_asked_for_the_angles_that_its_joints_have(tmp_path):
    stage = station(tmp_path, "")
    q = posture(PERSON, "reach_low", heading=1.2)
    found = bind_posture(stage.model, "op")(state_at(stage, op=(q, STILL)))
    expected = angles(*bone_poses(PERSON, q))
    for field in fields(Angles):
        assert getattr(found, field.name) == pytest.approx(getattr(expected, field.name), abs=1e-9)


@pytest.mark.parametrize("kind", ["rula", "reba"])
def test_rows_say_what_the_parts_say_with_bands_and_bones(tmp_path, kind):
    method = {"rula": rula.METHOD, "reba": reba.METHOD}[kind]
    more = 'action_level = 2\naccuracy_deg = 2\nunmeasured = ["left_hand"]'
    result = at(station(tmp_path, table(kind, more=more)), posture(PERSON, "reach_high"))[kind]
    named = {(row.side, row.name): row for row in result.rows}
    assert {name for _, name in named} == {"score", *method.least}
    for (side, name), row in named.items():
        if name == "score":
            continue
        part = parts(result)[f"{side} {name}".strip()]
        assert (row.value, row.interval) == (part.value, part.interval)
        assert row.scale == (method.least[name], method.most[name])
        if row.value is not None:
            assert row.scale[0] <= row.interval[0] <= row.value <= row.interval[1] <= row.scale[1]
    totals = [named[side, "score"] for side in ("right", "left", "")]
    assert [r.scale for r in totals] == [(1, method.levels[-1])] * 3
    assert totals[2].verdict is result.verdict
    wrist = named["left", "wrist"]
    assert (wrist.state, wrist.value) == (RowState.NOT_ASSESSED, None)
    assert all(aspect.value is None and not aspect.band for aspect in wrist.aspects)
    arm = named["right", "upper arm"]
    assert arm.bones == ("op/right_upper_arm",)
    flexion = arm.aspects[0]
    assert (flexion.name, flexion.unit) == ("shoulder flexion", "rad")
    assert flexion.band == ("beyond 90°" if flexion.value >= np.pi / 2 else "45° to 90°")


@pytest.mark.parametrize("kind", RULES)
def test_rows_of_nobody_entered_anything_are_not_assessed(tmp_path, kind):
    result = results_at(station(tmp_path, table(kind, phases="")))[kind]
    assert {r.name for r in result.rows if r.state is RowState.NOT_ASSESSED} >= {"score", "legs"}
    for row in result.rows:
        assert (row.value is None) == (row.state is RowState.NOT_ASSESSED)


def test_a_joint_with_an_accuracy_of_its_own_opens_only_its_components(tmp_path):
    q = posture(PERSON, {"both_elbow_flexion": np.radians(80), "both_elbow_pronation": np.radians(90)})
    more = "accuracy_deg = 0\njoint_accuracy = { wrist_deg = 20 }"
    result = at(station(tmp_path, table("rula", more=more)), q)["rula"]
    open_parts = {name for name, part in parts(result).items() if part.interval[0] != part.interval[1]}
    assert {"right wrist", "left wrist"} <= open_parts <= {"right wrist", "left wrist", "right", "left"}
    assert parts(result)["right wrist"].interval == (1, 4)
    named = {i.name: i.value for i in station(tmp_path, table("rula", more=more)).bound[0].basis.inputs}
    assert named["accuracy of the wrist"] == 20


@pytest.mark.parametrize(
    ("angle", "edges", "expected"),
    [
        (-30, (-20, 20, 45), "below −20°"),
        (20, (-20, 20, 45), "20° to 45°"),
        (19, (-20, 20, 45), "−20° to 20°"),
        (50, (-20, 20, 45), "beyond 45°"),
        (np.nan, (20,), ""),
        (5, (), ""),
    ],
)
def test_bands_are_named(angle, edges, expected):
    bent = Angles(
        **{
            field.name: np.full((2,), np.nan) if field.name in SIDED else np.array(np.nan)
            for field in fields(Angles)
        }
    )
    bent.trunk_flexion[...] = np.radians(angle)
    (found,) = aspects(bent, ["trunk_flexion"], None, {"trunk_flexion": np.radians(edges).tolist()})
    assert found.band == expected


def test_every_action_level_is_announced_with_its_highest_score(tmp_path):
    infos = {info.name: info for info in all_rules(tmp_path).scene().criteria}
    assert [level.up_to for level in infos["rula"].levels] == [2, 4, 6, 7]
    assert [level.name for level in infos["reba"].levels] == [f"action level {k}" for k in range(5)]
    assert [level.up_to for level in infos["owas"].levels] == [1, 2, 3, 4]


PHASE = """
[[phases]]
load = 0
supported_arms = "none"
back_supported = false
legs = "standing"
balanced = true
rapid = false
{}
"""
HELD_RULES = {
    "iso_11226": "limit = 1\nfrom_rest = true",
    "rula": "action_level = 2\ndetect = { from_rest = true }",  # 4, and 5 once it is static
    "posture_table": 'table = "held.csv"\nlimit = 4\nfrom_rest = true',
    "acme.bending": "limit = 10",
}
HELD_TABLE = "angle,from_deg,to_deg,score,hold_s\ntrunk flexion,,20,0,\ntrunk flexion,20,,1,\n" + (
    "trunk flexion,45,,6,4\n"
)


@pytest.mark.parametrize("kind", HELD_RULES)
@pytest.mark.parametrize(
    ("bent", "more", "verdict"),
    [
        ("lumbar_flexion = 40, thorax_flexion = 30, neck_flexion = 30", "", Verdict.UNDECIDED),
        ("", "", Verdict.WITHIN),
        ("", "end = 20", Verdict.WITHIN),
    ],
)
@pytest.mark.parametrize("moves", [False, True])
def test_how_long_a_posture_is_held_that_nothing_moves_nobody_knows(
    tmp_path, monkeypatch, kind, bent, more, verdict, moves
):
    """One instant is all of a run in which nobody moves; a robot beside them that moves changes nothing."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples"))
    cell = HUMAN.format(posture="standing") + f"joints_deg = {{ {bent} }}\n" + PHASE.format(more)
    cell += f'[[ergonomics]]\nkind = "{kind}"\nhuman = "op"\n{HELD_RULES[kind]}\n'
    if moves:
        cell += TWO_R + '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'
        cell = cell.replace(
            "[[ergonomics]]\n", '[[ergonomics]]\nbetween_samples = "accepted: nobody moves"\n'
        )
    station = made(
        tmp_path,
        cell,
        {"held.csv": HELD_TABLE, "m.csv": "t [s],J1 [rad],J2 [rad]\n0,0,0\n0.05,0,0\n", "arm.urdf": two_r()},
    )
    (column,) = station.batch(threads=1).values()
    assert (station.run().verdict, column.verdict) == (verdict, verdict)
