"""Names of every device lead to bones of ours, whichever way they are spelled."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import PERSON, TABLE

from seerob.core.errors import InputError, UnknownName
from seerob.core.samples import BodyPoint
from seerob.core.transforms import rotation_from_wxyz
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.description.capture.mapping import Place, choose, conventions, places, plain, read_conventions
from seerob.description.capture.observing import bind, stature
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.capture.options import observer
from seerob.devices.sources.bvh import Bvh

XSENS = (
    "Pelvis",
    "L5",
    "L3",
    "T12",
    "T8",
    "Neck",
    "Head",
    "RightShoulder",
    "RightUpperArm",
    "RightForeArm",
    "RightHand",
    "LeftShoulder",
    "LeftUpperArm",
    "LeftForeArm",
    "LeftHand",
    "RightUpperLeg",
    "RightLowerLeg",
    "RightFoot",
    "RightToe",
    "LeftUpperLeg",
    "LeftLowerLeg",
    "LeftFoot",
    "LeftToe",
)
SMPL = (
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hand",
    "right_hand",
)
CMU = (
    "root",
    "lhipjoint",
    "lfemur",
    "ltibia",
    "lfoot",
    "ltoes",
    "rhipjoint",
    "rfemur",
    "rtibia",
    "rfoot",
    "rtoes",
    "lowerback",
    "upperback",
    "thorax",
    "lowerneck",
    "upperneck",
    "head",
    "lclavicle",
    "lhumerus",
    "lradius",
    "lwrist",
    "lhand",
    "lfingers",
    "lthumb",
    "rclavicle",
    "rhumerus",
    "rradius",
    "rwrist",
    "rhand",
    "rfingers",
    "rthumb",
)
MIXAMO = [
    f"mixamorig:{name}"
    for name in ["Hips", "Spine", "Spine1", "Neck", "Head"]
    + [
        f"{s}{n}"
        for s in ("Left", "Right")
        for n in ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase")
    ]
]
KINECT = (
    "PELVIS",
    "SPINE_NAVEL",
    "SPINE_CHEST",
    "NECK",
    "CLAVICLE_LEFT",
    "SHOULDER_LEFT",
    "ELBOW_LEFT",
    "WRIST_LEFT",
    "HAND_LEFT",
    "HANDTIP_LEFT",
    "THUMB_LEFT",
    "CLAVICLE_RIGHT",
    "SHOULDER_RIGHT",
    "ELBOW_RIGHT",
    "WRIST_RIGHT",
    "HAND_RIGHT",
    "HANDTIP_RIGHT",
    "THUMB_RIGHT",
    "HIP_LEFT",
    "KNEE_LEFT",
    "ANKLE_LEFT",
    "FOOT_LEFT",
    "HIP_RIGHT",
    "KNEE_RIGHT",
    "ANKLE_RIGHT",
    "FOOT_RIGHT",
    "HEAD",
    "NOSE",
    "EYE_LEFT",
    "EAR_LEFT",
    "EYE_RIGHT",
    "EAR_RIGHT",
)
MARKERS = [
    "LASI",
    "RASI",
    "LPSI",
    "RPSI",
    "C7",
    "T10",
    "CLAV",
    "STRN",
    "LSHO",
    "RSHO",
    "LELB",
    "RELB",
    "LWRA",
    "RWRA",
    "LKNE",
    "RKNE",
    "LANK",
    "RANK",
    "LHEE",
    "RHEE",
]


@pytest.mark.parametrize(
    ("names", "whose"),
    [
        (XSENS, "xsens"),
        (SMPL, "smpl"),
        (CMU, "cmu"),
        (MIXAMO, "mixamo"),
        (KINECT, "azure_kinect"),
        (MARKERS, "markers"),
        (BONES, "seerob"),
    ],
)
def test_names_tell_whose_they_are_and_sides_keep_apart(names, whose):
    layout = Layout(Seen.JOINTS, tuple(names))
    convention, findings = choose(layout, "p")
    assert convention is not None
    assert convention.name == whose
    assert findings[0].level == "assumed"
    found = places(layout, convention, {}, file="x")
    bones = {name: place.bone for name, place in zip(names, found, strict=True) if place}
    assert len(bones) >= 0.8 * len(names)
    for name, bone in bones.items():
        short = plain(name)
        if "left" in short:
            assert not bone.startswith("right_"), (name, bone)
        if "right" in short:
            assert not bone.startswith("left_"), (name, bone)


SETS = {
    "opensim_gait": "R.ASIS L.ASIS V.Sacral R.Shoulder L.Shoulder R.Elbow R.Wrist R.Knee R.Ankle R.Toe",
    "rajagopal": "RACR C7 CLAV RASI LASI RPSI RLFC RMFC RLMAL RMMAL RCAL RTOE RMT5 RUA1 RLEL RMEL RFAradius",
    "cast": "L_IAS R_IAS L_IPS R_IPS R_FTC R_FLE R_FME R_FAL R_TAM R_FCC R_FM1 R_FM2 R_FM5 CV7 R_HLE R_RSP",
    "motive_markers": "WaistLFront WaistRBack BackTop Chest HeadTop LShoulderTop LElbowOut LWristOut",
    "markers": "LFHD C7 T10 CLAV STRN LSHO LELB LWRA LWRB LFIN LASI RASI LPSI LTHI LKNE LTIB LANK LHEE LTOE",
}


@pytest.mark.parametrize("whose", SETS)
def test_marker_sets_are_told_by_their_names_and_what_is_not_documented_is_left_out(whose):
    layout = Layout(Seen.MARKERS, tuple(SETS[whose].split()))
    convention, _ = choose(layout, "p")
    assert convention is not None
    assert convention.name == whose
    left_out = {n for n in layout.names if plain(n) not in convention.places}
    assert left_out <= {"R.Wrist", "RUA1", "R_FTC", "LWristOut"}


def test_a_leg_is_a_thigh_or_a_shank_by_the_names_beside_it():
    arms = [
        f"{side}{bone}"
        for side in ("Left", "Right")
        for bone in ("Shoulder", "Arm", "ForeArm", "Hand", "Foot")
    ]
    for legs, whose in (
        (("UpLeg", "Leg", "ToeBase"), "mixamo"),
        (("Thigh", "Shin", "Toe"), "thigh_and_shin"),
    ):
        names = (
            "Hips",
            "Neck",
            "Head",
            *arms,
            *(f"{side}{leg}" for side in ("Left", "Right") for leg in legs),
        )
        convention, _ = choose(Layout(Seen.JOINTS, names), "p")
        assert convention is not None
        assert convention.name == whose
        assert convention.places[plain(f"Left{legs[1]}")].bone == "left_shank"


def test_points_on_the_skin_are_never_taken_for_joints():
    """A marker beside the elbow is 5 cm from its centre, under the same name."""
    names = ("RHip", "RKnee", "RAnkle", "RShoulder", "RElbow", "RWrist", "Neck", "Head")
    convention, findings = choose(Layout(Seen.JOINTS, names), "p")
    assert convention is not None
    assert convention.seen == "joints"
    convention, findings = choose(Layout(Seen.MARKERS, names), "p")
    assert convention is None
    assert 'give convention = "biovision" if they are not' in findings[0].text
    with pytest.raises(InputError, match="not read as those of biovision, joints"):
        observer(Bvh(human="op", file="x"), Layout(Seen.MARKERS, names), PERSON, file="x")
    convention, _ = choose(Layout(Seen.MARKERS, names), "p", convention="biovision")
    assert convention is not None


def test_every_convention_covers_the_limbs_and_is_symmetric():
    for name, convention in conventions().items():
        if name.endswith("_arm"):
            continue  # a set of markers of one side
        bones = {place.bone for place in convention.places.values()}
        mirrored = {b.replace("left", "?").replace("right", "left").replace("?", "right") for b in bones}
        assert bones == mirrored, name
        ends = {"thorax", "right_upper_arm"} if convention.seen == Seen.MARKERS else {"head", "right_hand"}
        assert {"pelvis", "left_foot"} | ends <= bones, name
        assert convention.axes @ convention.axes.T == pytest.approx(np.eye(3))


def test_xsens_segments_are_those_of_its_t_pose():
    """Identity in the T-pose is our bones' T-pose, whatever the heading of the capture."""
    layout = Layout(Seen.SEGMENTS, tuple(XSENS), "xsens")
    convention, _ = choose(layout, "p")
    observer = bind(layout, places(layout, convention, {}, file="x"), PERSON, convention=convention)
    R, _ = bone_poses(PERSON, posture(PERSON, "t_pose"))
    identity = np.tile([1.0, 0, 0, 0], (len(XSENS), 1))
    for point in observer.points(
        CaptureFrame(t=0.0, positions=np.zeros((len(XSENS), 3)), orientations=identity)
    ):
        if point.wxyz is not None:
            assert rotation_from_wxyz(point.wxyz) == pytest.approx(R[BONES.index(point.bone)], abs=1e-12)


def test_the_user_adds_and_replaces_names(tmp_path):
    file = tmp_path / "rig.toml"
    file.write_text(
        '[my_rig]\nsource = "our studio"\n[my_rig.names]\n"{side}Claw" = "{side}_hand"\nCore = "pelvis"\n'
        '"{side}Paw" = { bone = "{side}_foot", at = [0.1, 0, 0.02], position = 2.0 }\n'
    )
    known = read_conventions(file, "rig.toml")
    layout = Layout(Seen.JOINTS, ("L_Claw", "R_Claw", "Core", "R_Paw", "Ear"))
    convention, _ = choose(layout, "p", known=known)
    assert convention is not None
    given = {"Core": None, "Ear": Place("head", np.array([0.0, 0.1, 0.0]), metres=True)}
    found = places(layout, convention, given, file="x")
    assert [p and p.bone for p in found] == ["left_hand", "right_hand", None, "right_foot", "head"]
    observer = bind(layout, found, PERSON, bones={"head": 0.5})
    rows = {row.name: row for row in observer.rows}
    assert rows["R_Paw"].at == pytest.approx(np.array([0.1, 0, 0.02]) * TABLE["stature"])
    assert rows["Ear"].at == pytest.approx([0, 0.1, 0])
    assert (rows["R_Paw"].position, rows["Ear"].position) == (2.0, 0.5)


@pytest.mark.parametrize(
    "text",
    [
        "x = [",
        "a = 1",
        '[a.names]\nb = "no_bone"',
        '[a]\naxes = {x="up",y="up",z="up"}\n[a.names]\n',
        "[a.names]\nb = 3",
    ],
)
def test_a_wrong_table_is_an_input_error(tmp_path, text):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(InputError, match=r"a\.toml"):
        read_conventions(tmp_path / "a.toml", "a.toml")


def test_mistakes_in_names_are_told():
    layout = Layout(Seen.JOINTS, tuple(KINECT))
    with pytest.raises(UnknownName, match="did you mean 'azure_kinect'"):
        choose(layout, "p", convention="azur_kinect")
    convention, _ = choose(layout, "p")
    with pytest.raises(InputError, match="did you mean 'WRIST_LEFT'"):
        places(layout, convention, {"WRIST_LEF": None}, file="x")
    nothing = Layout(Seen.JOINTS, ("a", "b"))
    assert choose(nothing, "p") == (None, [])
    with pytest.raises(InputError, match="no bone is known"):
        places(nothing, None, {}, file="x")


def test_unseen_rows_say_so_and_confidence_weighs():
    layout = Layout(Seen.JOINTS, ("head", "neck", "pelvis"), "seerob")
    convention, _ = choose(layout, "p")
    observer = bind(layout, places(layout, convention, {}, file="x"), PERSON)
    positions = np.array([[np.nan, 0, 0], [0, 0, 1.5], [0, 0, 1e9]])
    head, neck, pelvis = observer.points(
        CaptureFrame(t=0.0, positions=positions, confidence=np.array([1.0, 0.5, 1.0]))
    )
    assert isinstance(head, BodyPoint)
    assert head.position is None is pelvis.position
    assert (neck.position, neck.position_weight, neck.confidence) == ((0, 0, 1.5), 0.5, 0.5)


def test_a_person_is_as_tall_as_stated():
    assert stature(PERSON) == pytest.approx(1.75, abs=1e-12)
