"""Hand-made motions: through their keys, within the limits, feet on the floor; wrong files say so."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seerob.core.errors import InputError
from seerob.description.humans import keyframes, manikin
from seerob.description.humans.keyframes import Motion, Travel, interpolated, sample
from seerob.description.humans.posture import HEIGHT, lowest_sole, posture, sole_corners
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses

PERSON = manikin.build(name="p", stature=1.75, mass=75, sex="male")
LOW = np.array([-np.inf if j.lower is None else j.lower for j in PERSON.joints()])
HIGH = np.array([np.inf if j.upper is None else j.upper for j in PERSON.joints()])
ELBOW = JOINTS.index("right_elbow_flexion")


def parse(text: str) -> Motion:
    return keyframes.parse(text.encode(), PERSON, file="m.toml")


@pytest.mark.parametrize("name", keyframes.library())
def test_library_stays_on_the_floor_and_within_the_limits(name):
    played = keyframes.read(f"library:{name}", PERSON)
    t, q, qd = sample(played, PERSON, 60.0)
    assert q.shape == qd.shape == (len(t), 53)
    assert lowest_sole(PERSON, q) == pytest.approx(0, abs=1e-12)
    assert (q >= LOW).all()
    assert (q <= HIGH).all()
    assert np.isfinite(qd).all()
    assert "schematic" in played.note


@pytest.mark.parametrize("name", keyframes.library())
@pytest.mark.parametrize(("stature", "mass", "sex"), [(1.5, 50, "female"), (1.95, 110, "male")])
def test_library_fits_everybody(name, stature, mass, sex):
    other = manikin.build(name="o", stature=stature, mass=mass, sex=sex, lengths="deleva")
    _, q, _ = sample(keyframes.read(f"library:{name}", other), other, 30.0)
    assert lowest_sole(other, q) == pytest.approx(0, abs=1e-12)


@settings(max_examples=50, deadline=None)
@given(st.integers(2, 8), st.integers(0, 2**32 - 1))
def test_interpolation_passes_its_keys_and_never_leaves_them(count, seed):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.05, 1, count))
    q = rng.normal(size=(count, 3)) * rng.choice([0, 1], (count, 1))
    at_keys, speed = interpolated(t, q, t)
    assert at_keys == pytest.approx(q, abs=1e-13)
    assert speed[[0, -1]] == pytest.approx(0, abs=1e-12)
    fine = np.linspace(t[0], t[-1], 501)
    values, _ = interpolated(t, q, fine)
    for i in range(count - 1):
        part = values[(fine >= t[i]) & (fine <= t[i + 1])]
        assert (part >= np.minimum(q[i], q[i + 1])).all()
        assert (part <= np.maximum(q[i], q[i + 1])).all()


def test_velocity_is_the_derivative_and_continuous():
    t = np.array([0, 0.7, 1.0, 2.0])
    q = np.array([[0.0], [1.0], [1.5], [-1.0]])
    at = np.concatenate([np.linspace(0.01, 1.99, 200), t[1:-1]])
    step = 1e-6
    _, speed = interpolated(t, q, at)
    central = (interpolated(t, q, at + step)[0] - interpolated(t, q, at - step)[0]) / (2 * step)
    assert speed == pytest.approx(central, abs=1e-4)


def test_sampled_velocity_is_the_derivative_of_the_sampled_position():
    t, q, qd = sample(keyframes.read("library:reach_into_cell", PERSON), PERSON, 500.0)
    central = (q[2:] - q[:-2]) / (t[2] - t[0])
    assert np.abs(central - qd[1:-1]).max() < 5e-3 * np.abs(qd).max()


def test_a_bent_pose_between_straight_ones_keeps_the_feet_down():
    played = parse(
        """
        [[keyframes]]
        t = 0
        posture = "standing"
        [[keyframes]]
        t = 1
        posture = "squatting"
        """
    )
    _, q, qd = sample(played, PERSON, 50.0)
    assert lowest_sole(PERSON, q) == pytest.approx(0, abs=1e-12)
    assert q[-1] == pytest.approx(posture(PERSON, "squatting"), abs=1e-12)
    assert qd[25, HEIGHT] < -0.3


def test_walking_does_not_slide_and_gets_on():
    """No point of a sole that touches the floor moves over it; the gait makes about 0.85 m/s."""
    t, q, _ = sample(keyframes.read("library:walk", PERSON), PERSON, 500.0)
    rotations, positions = bone_poses(PERSON, q)
    touching, centers, owners = sole_corners(PERSON, rotations, positions)
    rows = np.arange(len(t) - 1)
    which = touching[..., 2].argmin(1)[:-1]
    bone = owners[which]
    turn = rotations[rows + 1, bone] @ np.swapaxes(rotations[rows, bone], -1, -2)
    arm = touching[rows, which] - centers[rows, which]
    slip = centers[rows + 1, which] + (turn @ arm[..., None])[..., 0] - touching[rows, which]
    assert np.linalg.norm(slip[:, :2], axis=1).sum() < 0.01 * q[-1, 0]
    assert q[-1, 0] / t[-1] == pytest.approx(0.85, abs=0.05)
    assert np.abs(q[:, 1]).max() < 1e-9


def test_left_and_right_steps_mirror_each_other():
    """Half a cycle later the other leg does the same."""
    keys = keyframes.read("library:walk", PERSON).q
    right = [i for i, n in enumerate(JOINTS) if n.startswith("right_")]
    left = [JOINTS.index(JOINTS[i].replace("right_", "left_")) for i in right if "flexion" in JOINTS[i]]
    right = [i for i in right if "flexion" in JOINTS[i]]
    assert keys[5, right] == pytest.approx(keys[15, left], abs=1e-12)


def test_a_key_goes_on_from_the_one_before():
    played = parse(
        """
        [[keyframes]]
        t = 0.0
        posture = "standing"
        position = [1.0, 0.5]
        heading_deg = 90
        [[keyframes]]
        t = 1.0
        joints_deg = { right_elbow_flexion = 45 }
        [[keyframes]]
        t = 2.0
        joints = { left_elbow_flexion = 0.5 }
        [[keyframes]]
        t = 3.0
        posture = "t_pose"
        """
    )
    assert played.q[2, ELBOW] == pytest.approx(math.radians(45))
    assert played.q[2, JOINTS.index("left_elbow_flexion")] == 0.5
    assert played.q[3, ELBOW] == 0
    assert played.q[3, :2] == pytest.approx([1.0, 0.5])
    assert played.q[3, JOINTS.index("pelvis_turn_left")] == pytest.approx(math.pi / 2)


def test_repeating_goes_on_from_where_it_stands():
    text = """
        repeat = 3
        [[keyframes]]
        t = 0.5
        posture = "standing"
        [[keyframes]]
        t = 1.0
        posture = "reach_forward"
        [[keyframes]]
        t = 1.5
        posture = "standing"
        position = [0.4, 0.0]
        """
    played = parse(text)
    assert played.t == pytest.approx([0.5, 1, 1.5, 2, 2.5, 3, 3.5])
    assert played.q[[0, 2, 4, 6], 0] == pytest.approx([0, 0.4, 0.8, 1.2])
    assert sample(played, PERSON, 10).t[-1] == pytest.approx(3.0)
    with pytest.raises(InputError, match="end a repeated motion as it began"):
        parse(text.replace('t = 1.5\n        posture = "standing"', "t = 1.5"))


def test_one_key_is_a_standing_person():
    t, q, qd = sample(parse('[[keyframes]]\nt = 0\nposture = "standing"'), PERSON, 60.0)
    assert t.tolist() == [0.0]
    assert q[0] == pytest.approx(posture(PERSON, "standing"), abs=1e-15)
    assert not qd.any()


def test_without_floor_the_height_is_a_joint_like_any_other():
    text = 'floor = false\n[[keyframes]]\nt = 0\nposture = "standing"\njoints = { pelvis_z = 0.25 }'
    _, q, _ = sample(parse(text), PERSON, 60.0)
    assert q[0, HEIGHT] == 0.25


def test_last_sample_covers_the_last_key():
    played = parse('[[keyframes]]\nt = 0\nposture = "standing"\n[[keyframes]]\nt = 1.01\nposture = "t_pose"')
    for rate in (7.0, 60.0, 100.0, 1000.0):
        t, q, _ = sample(played, PERSON, rate)
        assert 1.01 - 1e-9 <= t[-1] < 1.01 + 1 / rate
        assert q[-1] == pytest.approx(posture(PERSON, "t_pose"), abs=1e-12)


GOOD = '[[keyframes]]\nt = 0\nposture = "standing"\n'


@pytest.mark.parametrize(
    ("text", "key", "said"),
    [
        ("t = [", "", "is not TOML"),
        ("", "keyframes", "no .*keyframes"),
        ("keyframes = 3", "keyframes", "not a list"),
        ("keyframes = [3]", "keyframes[0]", "not a table"),
        ("[[keyframes]]\nt = 0", "keyframes[0].posture", "is missing"),
        ('[[keyframes]]\nposture = "standing"', "keyframes[0].t", "t is missing"),
        ('[[keyframes]]\nt = nan\nposture = "standing"', "keyframes[0].t", "nan"),
        ('[[keyframes]]\nt = -1\nposture = "standing"', "keyframes[0].t", "-1"),
        (GOOD + "[[keyframes]]\nt = 0", "keyframes[1].t", "not after"),
        ('[[keyframes]]\nt = 0\nposture = "standng"', "keyframes[0].posture", "did you mean 'standing'"),
        (GOOD + "joint = { a = 1 }", "keyframes[0].joint", "did you mean 'joints'"),
        (GOOD + "joints = { elbow = 1 }", "keyframes[0].joints", "no joint named 'elbow'"),
        (
            GOOD + "joints_deg = { right_elbow_flexion = 200 }",
            "keyframes[0].joints.right_elbow_flexion_deg",
            "150",
        ),
        (GOOD + "joints = 3", "keyframes[0].joints", "not a table"),
        (GOOD + "position = [1]", "keyframes[0].position", "not two numbers"),
        (GOOD + "position = [1, inf]", "keyframes[0].position", "not two numbers"),
        (GOOD + 'heading = "left"', "keyframes[0].heading", "not a number"),
        (GOOD + "heading = 1\nheading_deg = 1", "keyframes[0].heading", "given twice"),
        ("loop = true\n" + GOOD, "loop", "not known"),
        ("repeat = 0\n" + GOOD, "repeat", "not a count"),
        ('floor = "yes"\n' + GOOD, "floor", "true or false"),
        ('travel = "fly"\n' + GOOD, "travel", "keys"),
        ("title = 3\n" + GOOD, "title", "not a text"),
        (GOOD + '[[keyframes]]\nt = 1e5\nposture = "standing"', "keyframes", "longer than 3600 s"),
        (f"repeat = {'9' * 18}\n" + GOOD, "repeat", "not a count"),
        (f"repeat = {'9' * 300}\n" + GOOD, "", "a whole number of 997 bits"),
        (f"repeat = {'9' * 9000}\n" + GOOD, "", "is not TOML"),
        ("a = " + "[" * 20000, "", "is not TOML"),
    ],
)
def test_wrong_files_say_where_and_what(text, key, said):
    with pytest.raises(InputError, match=said) as caught:
        parse(text)
    assert key in [p.key for p in caught.value.problems]
    assert all(p.file == "m.toml" for p in caught.value.problems)


def test_every_mistake_of_a_file_at_once():
    with pytest.raises(InputError) as caught:
        parse(GOOD + 'x = 1\nposition = 3\n[[keyframes]]\nt = 0\nposture = "y"\nheading = "z"')
    assert len(caught.value.problems) == 5


def test_missing_and_unknown_motions(tmp_path):
    with pytest.raises(InputError, match="did you mean 'walk'"):
        keyframes.read("library:wlak", PERSON)
    with pytest.raises(InputError, match=r"gone.toml: cannot be read"):
        keyframes.read("gone.toml", PERSON, folder=tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is not TOML"):
        keyframes.read("binary.toml", PERSON, folder=tmp_path)
    (tmp_path / "long.toml").write_bytes(b"#" * (keyframes.MAX_BYTES + 1))
    with pytest.raises(InputError, match="split the motion"):
        keyframes.read("long.toml", PERSON, folder=tmp_path)


def test_feet_travel_is_on_top_of_the_keys_positions():
    played = keyframes.read("library:walk", PERSON)
    moved = played.q.copy()
    moved[:, JOINTS.index("pelvis_y")] += 2.0
    there = Motion(played.title, played.note, played.t, moved, travel=Travel.FEET)
    _, a, _ = keyframes.sample(played, PERSON, 30.0)
    _, b, _ = keyframes.sample(there, PERSON, 30.0)
    assert b[:, 0] == pytest.approx(a[:, 0], abs=1e-12)
    assert b[:, 1] == pytest.approx(a[:, 1] + 2.0, abs=1e-12)


def test_reach_into_a_cell_reaches_far():
    """Both wrists more than 0.75 m in front of the ankles at the deepest."""
    _, q, _ = sample(keyframes.read("library:reach_into_cell", PERSON), PERSON, 60.0)
    _, positions = bone_poses(PERSON, q)
    for side in ("right", "left"):
        assert positions[:, BONES.index(f"{side}_hand"), 0].max() > 0.75
