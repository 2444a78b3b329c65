import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.files.tables.headers import Role, understand, unit_of

J, V, A, Q = Role.JOINT, Role.VELOCITY, Role.ACCELERATION, Role.TORQUE


@pytest.mark.parametrize(
    ("text", "role", "which", "unit"),
    [
        ("Time", Role.TIME, "", None),
        ("Time [s]", Role.TIME, "", "s"),
        ("Zeit (ms)", Role.TIME, "", "ms"),
        ("t / s", Role.TIME, "", "s"),
        ("temps_s", Role.TIME, "", "s"),
        ("timestamp", Role.TIME, "", None),
        ("J1", J, "1", None),
        ("Joint 3 [deg]", J, "3", "deg"),
        ("Achse 2 (°)", J, "2", "deg"),
        ("Axe 5 en rad", Role.OTHER, "", "rad"),
        ("axe 5 (rad)", J, "5", "rad"),
        ("A1", J, "1", None),
        ("A1°", J, "1", "deg"),
        ("actual_q_0", J, "0", None),
        ("q[4]", J, "4", None),
        ("Joint1Position_deg", J, "1", "deg"),
        ("Position J6 / °", J, "6", "deg"),
        ("J2 [mm]", J, "2", "mm"),
        ("J1 [grad]", J, "1", "grad"),
        ("Zeit [min]", Role.TIME, "", "min"),
        ("Velocity J1 [deg/s]", V, "1", "deg/s"),
        ("Geschwindigkeit Achse 2 [°/s]", V, "2", "deg/s"),
        ("Vitesse axe 3 (rad/s)", V, "3", "rad/s"),
        ("J4 (deg/s)", V, "4", "deg/s"),
        ("qd_2", V, "2", None),
        ("JointVelocity5", V, "5", None),
        ("Speed_J1", V, "1", None),
        ("Accel_J1", A, "1", None),
        ("Torque J3 [Nm]", Q, "3", "Nm"),
        ("X", Role.TCP_POSITION, "x", None),
        ("TCP Y [mm]", Role.TCP_POSITION, "y", "mm"),
        ("Z_TCP", Role.TCP_POSITION, "z", None),
        ("RX", Role.TCP_ORIENTATION, "rx", None),
        ("Roll (deg)", Role.TCP_ORIENTATION, "roll", "deg"),
        ("B", Role.TCP_ORIENTATION, "b", None),
        ("q_w", Role.TCP_ORIENTATION, "qw", None),
        ("TCP speed x [mm/s]", Role.TCP_RATE, "x", "mm/s"),
        ("Vx", Role.TCP_RATE, "vx", None),
        ("Robot", Role.ROBOT, "", None),
        ("Comment", Role.OTHER, "", None),
        ("Robot 1 Joint 2", Role.OTHER, "", None),
        ("", Role.OTHER, "", None),
        ("42", Role.OTHER, "", None),
    ],
)
def test_headers_in_three_languages(text, role, which, unit):
    header = understand(text)
    assert (header.role, header.which, header.unit) == (role, which, unit)


def test_set_values_are_told_from_measured_ones():
    assert understand("target_q_1").commanded
    assert understand("J1 soll").commanded
    assert not understand("J1 ist").commanded


NAMES = st.sampled_from(
    ["J{}", "Joint {}", "joint_{}", "Axis {}", "A{}", "Achse {}", "axe {}", "q{}", "Q_{}"]
)
WRAPS = st.sampled_from(["{} [{}]", "{} ({})", "{} / {}", "{}_{}", "[{1}] {0}", "{} in {}"])
UNITS = st.sampled_from(["deg", "°", "rad", "Deg", "RAD", "mm", "m"])


@given(NAMES, st.integers(0, 20), WRAPS, UNITS, st.booleans())
def test_a_joint_is_known_with_its_number_and_unit_however_it_is_written(name, number, wrap, unit, upper):
    text = wrap.format(name.format(number), unit)
    header = understand(text.upper() if upper else text)
    assert (header.role, header.which) == (J, str(number))
    assert header.unit == unit_of(unit)


@given(st.text(max_size=300))
def test_no_header_is_too_odd(text):
    assert understand(text).role in Role
