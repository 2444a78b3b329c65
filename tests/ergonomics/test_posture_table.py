"""A company's table in a text file, a workbook or TOML: the same zones, every mistake by row and column."""

from contextlib import suppress

import numpy as np
import openpyxl
import pytest
from made_postures import PERSON

from made_cell import judged, made, state_at
from seerob.core.errors import InputError
from seerob.core.snapshot import Origin, RowState, Verdict
from seerob.criteria.scoring.spans import published
from seerob.criteria.scoring.zones import read_zones
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import JOINTS
from seerob.session.run import bind

HEAD = ["Angle", "from [deg]", "to [°]", "score", "either way", "hold s", "per_minute", "colour", "label"]
ROWS = [
    ["trunk flexion", None, 20, 0, None, None, None, "green", "fine"],
    ["trunk flexion", 20, 45, 2, None, None, None, "yellow", "bent"],
    ["trunk flexion", 45, None, 4.5, None, None, None, "red", "far bent"],
    [None] * 9,
    ["shoulder_elevation", 60, None, 3, "no", 4, 10, "red", "raised"],
    ["neck twist", 15, None, 1, "yes", None, None, "", ""],
]
TOML = """
title = "ACME"
source = "ACME works standard 7, 2026"
[[rows]]
angle = "trunk_flexion"
high_deg = 20
score = 0
label = "fine"
colour = "green"
[[rows]]
angle = "trunk_flexion"
low_deg = 20
high_deg = 45
score = 2
label = "bent"
colour = "yellow"
[[rows]]
angle = "trunk_flexion"
low_deg = 45
score = 4.5
label = "far bent"
colour = "red"
[[rows]]
angle = "shoulder_elevation"
low_deg = 60
score = 3
hold = 4
per_minute = 10
label = "raised"
colour = "red"
[[rows]]
angle = "neck_twist"
low_deg = 15
score = 1
either_way = true
"""
HUMAN = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
STILL = np.zeros(len(JOINTS))


def text(rows, delimiter=","):
    return "".join(delimiter.join("" if c is None else str(c) for c in row) + "\n" for row in rows)


def written(folder, name, rows=(HEAD, *ROWS), above=()):
    path = folder / name
    if name.endswith(".xlsx"):
        book = openpyxl.Workbook()
        for row in (*above, *rows):
            book.active.append(row)
        book.save(path)
    else:
        path.write_text(text(above) + text(rows, ";" if "semi" in name else ","), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["t.csv", "semicolons.csv", "t.xlsx"])
@pytest.mark.parametrize("above", [(), (["ACME posture rules"], [])])
def test_every_sort_of_file_holds_the_same_zones(tmp_path, name, above):
    (tmp_path / "t.toml").write_text(TOML)
    expected = read_zones(tmp_path / "t.toml", "t.toml").rows
    assert len(expected) == 5
    found = read_zones(written(tmp_path, name, above=above), name).rows
    assert found == expected


def test_a_decimal_comma_is_read(tmp_path):
    path = tmp_path / "semi.csv"
    path.write_text("angle;from_deg;score\ntrunk flexion;12,5;0,5\n")
    (row,) = read_zones(path, "semi.csv").rows
    assert (row.score, np.degrees(row.low)) == (0.5, pytest.approx(12.5))


@pytest.mark.parametrize("name", ["t.csv", "t.xlsx"])
def test_a_table_as_people_write_it(tmp_path, name):
    """Units behind numbers, points instead of a score, a column of remarks, a title above."""
    rows = [
        ["Angle", "From [°]", "To [°]", "Points", "Hold [s]", "Color", "Remark"],
        ["Trunk flexion", "20", "45°", 1, "4 s", "yellow", "ask the works council"],
        ["Trunk flexion", "45", None, 2, None, "red", None],
    ]
    row, _ = read_zones(written(tmp_path, name, rows, above=(["Our rules, 2026"], [])), name).rows
    assert (row.angle, row.score, row.hold, row.colour) == ("trunk_flexion", 1, 4, "yellow")
    assert np.degrees([row.low, row.high]) == pytest.approx([20, 45])


WELL = "trunk flexion,20,60,1,\ntrunk flexion,60,,2,\n"


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (WELL, None),
        (WELL.replace("60,,2", "60,90,2"), "points from 60° to 90°, and no row from 90° to 180°"),
        (WELL.replace("60,,2", "80,,2"), "points from 20° to 60°, and no row from 60° to 80°"),
        (WELL + "trunk flexion,-20,-5,1,\n", "points from -20° to -5°, and no row from -180° to -20°"),
        ("elbow flexion,,60,1,\nelbow flexion,100,,1,\n", None),
        ("elbow flexion,20,60,1,\nelbow flexion,100,,1,\n", "no row from -180° to 20°"),
        ("neck twist,10,30,1,yes\n", "no row from 30° to 180°"),
        ("neck twist,10,30,1,yes\nneck twist,30,,0,yes\n", None),
        ("trunk flexion,,20,0,\ntrunk flexion,200,,1,\n", "trunk_flexion never is 200°"),
    ],
)
def test_beyond_a_row_with_points_no_angle_scores_nothing_because_nobody_wrote_a_row(tmp_path, rows, words):
    (tmp_path / "t.csv").write_text("angle,from_deg,to_deg,score,either_way\n" + rows)
    if words is None:
        assert read_zones(tmp_path / "t.csv", "t.csv").rows
        return
    with pytest.raises(InputError, match=words):
        read_zones(tmp_path / "t.csv", "t.csv")


@pytest.mark.parametrize(
    ("kind", "more", "most"),
    [
        ("posture_table", 'table = "t.csv"\n', 2),
        ("posture_table", 'table = "t.csv"\ncombine = "sum"\n', 5),
        ("iso_11226", "", 2),
        ("en_1005_4", "", 2),
    ],
)
def test_a_limit_that_no_posture_exceeds_is_refused(tmp_path, kind, more, most):
    twist = "neck twist,10,,3,yes\n" if "sum" in more else ""
    (tmp_path / "t.csv").write_text("angle,from_deg,to_deg,score,either_way\n" + WELL + twist)
    assert bind(station(tmp_path, f"{more}limit = {most - 1}", kind).model)
    with pytest.raises(InputError, match=f"no posture scores more than {most} by this table"):
        bind(station(tmp_path, f"{more}limit = {most}", kind).model)


@pytest.mark.parametrize("name", ["t.csv", "t.xlsx"])
def test_every_mistake_is_named_by_row_and_column(tmp_path, name):
    rows = [
        ["angle", "from_deg", "to_deg", "score", "side", "colr"],
        ["trunk flexion", 20, 10, 1, None, None],
        ["trunk flexing", 20, 30, 1, None, None],
        ["shoulder elevation", "steep", 30, 1, "port", None],
        ["shoulder elevation", 20, 30, None, "left", None],
        ["shoulder elevation", 20, 30, -1, "left", None],
        ["trunk twist", 20, 30, 1, "left", None],
    ]
    with pytest.raises(InputError) as error:
        read_zones(written(tmp_path, name, rows), name)
    places = [(p.key.split("row ")[1], p.what) for p in error.value.problems]
    assert [place for place, _ in places] == [
        "1 column 'colr'",
        "2 column 'to_deg'",
        "3 column 'angle'",
        "4 column 'from_deg'",
        "5 column 'score'",
        "6 column 'score'",
        "7 column 'side'",
    ]
    assert "did you mean 'trunk_flexion'" in places[2][1]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "empty"),
        ("a,b\n1,2\n", "no row with the columns angle and score"),
        (
            "angle,from_deg,to_deg\ntrunk_flexion,1,2\n",
            "row 1: the header has no column score; head the table",
        ),
        ("angle,score\n", "no row below the header"),
        ("angle,score,score\ntrunk_flexion,1,2\n", "two columns give 'score'"),
        ("angle,score,hold_s\ntrunk_flexion,1,-3\n", "row 2 column 'hold_s'"),
        ("angle,score,side\nelbow_flexion,1,middle\n", "row 2 column 'side'"),
        ("angle,score,either_way\ntrunk_twist,1,perhaps\n", "write yes or no"),
        ("angle,score\ntrunk_flexion,inf\n", "row 2 column 'score'"),
        ("angle,score,from_deg\ntrunk_flexion,1,4000\n", "row 2 column 'from_deg'"),
        ("angle,score\n" + "trunk_flexion,1\n" * 2001, "more than 2000 rows"),
    ],
)
def test_what_is_no_table(tmp_path, content, message):
    path = tmp_path / "t.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        read_zones(path, "t.csv")


def test_damaged_files_are_refused_or_read(tmp_path):
    rng = np.random.default_rng(0)
    whole = text([HEAD, *ROWS]).encode()
    path = tmp_path / "t.csv"
    read = 0
    for _ in range(60):
        raw = bytearray(whole)
        # Mostly what stands in such files: of any bytes nothing but text that is none comes.
        for at in rng.integers(len(raw), size=rng.integers(1, 4)):
            raw[at] = rng.choice(list(b'0123456789.,-\neinf"\xff\0'))
        path.write_bytes(bytes(raw))
        with suppress(InputError):
            assert read_zones(path, "t.csv").rows
            read += 1
    assert 3 < read < 57


def station(folder, more, kind="posture_table"):
    return made(folder, HUMAN + f'[[ergonomics]]\nkind = "{kind}"\nname = "own"\nhuman = "op"\n{more}\n')


def said(stage, **joints):
    q = posture(PERSON, {k: np.radians(v) for k, v in joints.items()})
    return judged(stage.bound, state_at(stage, op=(q, STILL)))[0]


def test_the_table_judges_the_twin(tmp_path):
    (tmp_path / "rules.toml").write_text(TOML)
    stage = station(tmp_path, 'table = "rules.toml"\nlimit = 2\nfrom_rest = true')
    bent = said(stage, pelvis_tilt_forward=30, head_turn_left=20)
    assert (bent.value, bent.verdict) == (2, Verdict.WITHIN)
    assert bent.reason == "trunk flexion 30°: 2 (bent)"
    assert {m.body for m in bent.markers} == {"op/thorax"}
    far = said(stage, pelvis_tilt_forward=50)
    assert (far.value, far.verdict) == (4.5, Verdict.EXCEEDED)
    total, trunk, *_ = far.rows
    assert (total.name, total.scale, total.limit, total.verdict) == ("score", (0, 4.5), 2, "exceeded")
    assert (trunk.name, trunk.value, trunk.bones) == ("trunk flexion", 4.5, ("op/thorax",))
    assert trunk.aspects[0].value == pytest.approx(np.radians(50), abs=1e-6)
    basis = stage.bound[0].basis
    assert basis.source == "ACME works standard 7, 2026"
    assert {i.origin for i in basis.inputs if i.name.startswith("trunk flexion")} == {Origin.GIVEN}
    assert "rules.toml" in stage.files


def test_points_of_several_angles_are_summed_on_the_worse_side(tmp_path):
    (tmp_path / "rules.toml").write_text(TOML.replace("hold = 4\nper_minute = 10\n", ""))
    stage = station(tmp_path, 'table = "rules.toml"\ncombine = "sum"')
    found = said(stage, pelvis_tilt_forward=30, head_turn_left=20, left_shoulder_flexion=80)
    assert found.value == 2 + 3 + 1
    assert found.rows[0].scale == (0, 4.5 + 3 + 1)


@pytest.mark.parametrize("kind", ["posture_table", "iso_11226", "en_1005_4"])
def test_an_angle_that_nobody_measures_is_not_assessed(tmp_path, kind):
    (tmp_path / "rules.toml").write_text(TOML)
    named = 'table = "rules.toml"\n' if kind == "posture_table" else ""
    stage = station(tmp_path, named + 'limit = 1\nunmeasured = ["thorax"]\nfrom_rest = true', kind)
    found = said(stage)
    assert found.value is None
    assert found.verdict is Verdict.UNDECIDED
    assert found.reason.startswith("not assessed: trunk ")
    assert {r.state for r in found.rows if r.name == "trunk flexion"} == {RowState.NOT_ASSESSED}


def test_the_accuracy_opens_the_verdict(tmp_path):
    (tmp_path / "rules.toml").write_text(TOML)
    for accuracy, verdict in ((1, Verdict.WITHIN), (5, Verdict.UNDECIDED)):
        more = f'table = "rules.toml"\nlimit = 2\nfrom_rest = true\naccuracy_deg = {accuracy}'
        found = said(station(tmp_path, more), pelvis_tilt_forward=42)
        assert found.verdict is verdict
        assert found.interval == ((2, 2) if accuracy == 1 else (2, 4.5))


def test_joints_may_have_an_accuracy_of_their_own(tmp_path):
    (tmp_path / "rules.toml").write_text(TOML)
    for joint, ends in (("trunk", (2, 4.5)), ("neck", (2, 2))):
        more = f'table = "rules.toml"\naccuracy_deg = 0\njoint_accuracy = {{ {joint}_deg = 5 }}'
        assert said(station(tmp_path, more), pelvis_tilt_forward=42).interval == ends
    with pytest.raises(InputError, match="nothing is said of neck, clavicle"):
        station(tmp_path, 'table = "rules.toml"\njoint_accuracy = { trunk_deg = 5 }')


def test_a_mistake_in_the_table_names_the_rule_and_the_row(tmp_path):
    (tmp_path / "rules.csv").write_text("angle,score\ntrunk,1\n")
    with pytest.raises(InputError, match=r"\(own\).*rules.csv: row 2 column 'angle'"):
        bind(station(tmp_path, 'table = "rules.csv"').model)
    with pytest.raises(InputError, match="no such file"):
        bind(station(tmp_path, 'table = "none.csv"').model)


@pytest.mark.parametrize("kind", ["iso_11226", "en_1005_4"])
def test_the_norms_figures_show_their_confidence_and_can_be_replaced(tmp_path, kind):
    stage = station(tmp_path, "limit = 1", kind)
    basis = stage.bound[0].basis
    rows = [i for i in basis.inputs if i.source.endswith("]")]
    assert len(rows) == len(published(kind)["rows"])
    # What is quoted from memory is stated by nobody.
    expected = {"[1]": Origin.STATED, "[M]": Origin.ESTIMATED}
    assert all(i.origin is expected[i.source[-3:]] for i in rows)
    assert "M)" in basis.source
    (tmp_path / "rules.toml").write_text(TOML)
    own = station(tmp_path, 'table = "rules.toml"\nfrom_rest = true', kind)
    assert own.bound[0].basis.source == "ACME works standard 7, 2026"
    assert said(own, pelvis_tilt_forward=30).value == 2


@pytest.mark.parametrize(
    ("kind", "joints", "verdict", "remembered"),
    [
        ("iso_11226", {}, Verdict.WITHIN, True),
        ("en_1005_4", {}, Verdict.WITHIN, True),
        ("en_1005_4", {"pelvis_tilt_forward": 70}, Verdict.EXCEEDED, True),
        ("en_1005_4", {"lumbar_turn_left": 5, "thorax_turn_left": 15}, Verdict.EXCEEDED, False),
    ],
)
def test_a_verdict_says_when_it_rests_on_memory(tmp_path, kind, joints, verdict, remembered):
    """Twist has a public source, the trunk's flexion has none; what is within is so by every row."""
    more = 'limit = 0\nfrom_rest = true\nphases = [{ supported_arms = "none", back_supported = false }]'
    found = said(station(tmp_path, more, kind), **joints)
    assert found.verdict is verdict
    assert ("from memory" in found.reason) == remembered


def test_standing_upright_is_acceptable_by_both_norms_and_a_deep_bend_is_not(tmp_path):
    for kind, bent in (("iso_11226", 0), ("en_1005_4", 1)):
        support = 'from_rest = true\nphases = [{ supported_arms = "none", back_supported = false }]'
        stage = station(tmp_path, f"limit = 0\n{support}", kind)
        assert said(stage).value == 0
        # Nothing is static at its first instant; EN 1005-4 also asks of what is not.
        assert said(stage, pelvis_tilt_forward=70).value == bent
