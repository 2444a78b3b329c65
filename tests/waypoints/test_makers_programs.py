"""KRL, RAPID and FANUC's programs: goals by another library's angles, speeds, frames, what is left out."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seerob.core.errors import InputError
from seerob.files.waypoints.fanuc import read_fanuc
from seerob.files.waypoints.krl import read_krl
from seerob.files.waypoints.rapid import read_rapid
from seerob.files.waypoints.reading import read_program
from seerob.files.waypoints.waypoint import Move


def same(pose, position, turn):
    np.testing.assert_allclose(pose.position, position, atol=1e-9)
    w, x, y, z = pose.wxyz
    assert (Rotation.from_quat([x, y, z, w]) * turn.inv()).magnitude() < 1e-9


SRC = """&ACCESS RVP
DEF pick( )
;FOLD INI
BAS (#INITMOV,0 )
$BWDSTART=FALSE
PTP $AXIS_ACT
PDAT_ACT=PPDAT1
FDAT_ACT=FP1
BAS(#PTP_PARAMS,50)
PTP XHOME C_PTP
PTP XP1
$VEL.CP=0.2
$ACC.CP=1.5
$APO.CDIS=10
$TOOL=TOOL_DATA[2]
$BASE={FRAME: X 100,Y 0,Z 0,A 90,B 0,C 0}
FOR i=1 TO 2
  LIN {X 0,Y 0,Z 100,A 30,B 20,C 10} : {X 0,Y 0,Z 5,A 0,B 0,C 0} C_DIS
ENDFOR
IF $IN[3] THEN
  LIN XP1
ENDIF
CIRC {X 1,Y 2,Z 3,A 0,B 0,C 0},{X 4,Y 5,Z 6,A 0,B 0,C 0}
WAIT SEC 0.5
away( )
LIN_REL {X 5}
GRP (1)
still (2)
SLIN XP1 WITH $VEL=SVEL_CP(0.1, , LCPDAT1), $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO), $ACC=SACC_CP(LCPDAT1)
END
DEF away( )
PTP {A1 10,A2 -90,A3 90,A4 0,A5 0,A6 0}
PTP {A1 20}
END
"""
DAT = """DEFDAT pick
DECL E6POS XP1={X 500,Y 10,Z 600,A 0,B 90,C 0,S 2,T 35,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL FDAT FP1={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}
DECL PDAT PPDAT1={VEL 100.0,ACC 40.0,APO_DIST 60.0,APO_MODE #CPTP}
DECL LDAT LCPDAT1={VEL 2.0,ACC 70.0,APO_DIST 100.0}
ENDDAT
"""
CONFIG = """TOOL_DATA[1]={X 0.0,Y 0.0,Z 150.0,A 0.0,B 0.0,C 0.0}
E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0,E1 0.0}
"""


def test_kuka(tmp_path):
    for name, text in (("pick.src", SRC), ("pick.dat", DAT), ("$config.dat", CONFIG)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"needs TOOL_DATA\[2\].*values = \{ \"TOOL_DATA\[2\]\" = … \}"):
        read_program(tmp_path / "pick.src", "pick.src")
    values = {"TOOL_DATA[2]": "{X 0,Y 0,Z 200,A 0,B 0,C 0}", "Still()": True}
    program = read_program(tmp_path / "pick.src", "pick.src", values)
    home, p1, line, again, arc, ten, twenty, spline = program.waypoints
    assert home.q == pytest.approx([0, -math.pi / 2, math.pi / 2, 0, 0, 0])
    assert (home.share, home.acceleration_share, home.blend_share) == (0.5, 0.4, 0.6)
    same(p1.pose, (0.5, 0.01, 0.6), Rotation.from_euler("ZYX", [0, 90, 0], degrees=True))
    assert p1.tool.position == (0, 0, 0.15)
    meant = p1.configuration
    assert (meant.text, meant.sides) == ("S 2, T 35", (True, True))
    assert [r[0] < 0 for r in meant.ranges] == [True, True, False, False, False, True]
    turn = Rotation.from_euler("Z", 90, degrees=True) * Rotation.from_euler("ZYX", [30, 20, 10], degrees=True)
    tip = np.array([0.1, 0, 0.1]) + turn.apply([0, 0, 0.005])
    same(line.pose, tip, turn)
    assert (line.move, line.speed, line.acceleration, line.blend) == (Move.LINEAR, 0.2, 1.5, 0.01)
    assert again.place == line.place
    assert line.tool.position == (0, 0, 0.2)
    same(arc.via, (0.098, 0.001, 0.003), Rotation.from_euler("Z", 90, degrees=True))
    assert (arc.move, arc.pause) == (Move.CIRCULAR, 0.5)
    assert (ten.q[0], twenty.q) == (math.radians(10), (math.radians(20), *ten.q[1:]))
    assert (spline.speed, spline.acceleration, spline.acceleration_share) == (0.1, None, 0.7)
    assert spline.tool == p1.tool
    branch, relative, called = program.left_out
    assert called.startswith("line 27: `GRP (1)` is left out: what it calls is not in this file")
    assert branch.startswith("line 20: `IF` is left out: whether $IN[3] holds")
    assert relative.startswith("line 26: `LIN_REL")


MOD = r"""MODULE cell
  CONST robtarget p10:=[[500,0,600],[0.5,0.5,0.5,0.5],[0,-1,1,1],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST jointtarget home:=[[0,-10,20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PERS tooldata grip:=[TRUE,[[0,0,150],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];
  PERS wobjdata table:=[FALSE,TRUE,"",[[1000,0,0],[0.7071068,0,0,0.7071068]],[[0,10,0],[1,0,0,0]]];
  VAR num rows:=2;
  PROC main()
    ! MoveL nowhere, v100, fine, tool0;
    AccSet 50, 100;
    MoveAbsJ home\NoEOffs, v1000, z50, grip;
    ConfL \Off;
    FOR i FROM 1 TO rows DO
      MoveL Offs(p10, 0, 10*i, 50), v200, z10, grip\WObj:=table;
    ENDFOR
    IF DInput(di1)=1 THEN
      MoveJ p10, v100, fine, grip;
    ELSE
      MoveJ p10, v50, fine, grip;
    ENDIF
    TEST rows
    CASE 1:
      MoveL nowhere, v5, fine, grip;
    CASE 2, 3:
      turn;
    DEFAULT:
      Stop;
    ENDTEST
    MoveC p10, Offs(p10,0,0,20), v100\T:=3, fine, grip;
    WaitTime 0.5;
    SearchL di1, p10, p10, v100, grip;
    MoveJ seen, vmax, fine, grip;
  ENDPROC
  PROC turn()
    MoveJ RelTool(p10, 0, 0, 100 \Rx:=90 \Rz:=30), v500, fine, grip;
    Set do1;
    over p10, 3;
    over p10\up, 3;
    elsewhere;
  ENDPROC
  PROC over(robtarget p, num up)
    VAR robtarget above;
    above := Offs(p, 0, 0, up);
    above.trans.x := 7;
    MoveL above, v100, fine, grip;
  ENDPROC
ENDMODULE
"""


def test_abb():
    with pytest.raises(InputError, match=r"needs vmax"):
        read_rapid(MOD.encode(), "cell.mod", {})
    values = {
        "seen": "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
        "vmax": "[1500,500,5000,1000]",
    }
    program = read_rapid(MOD.encode(), "cell.mod", values)
    home, first, second, turned, above, arc, seen = program.waypoints
    assert above.pose.position == pytest.approx((0.007, 0, 0.603))
    assert home.q == pytest.approx(np.radians([0, -10, 20, 0, 30, 0]))
    assert (home.along, home.blend, home.acceleration_share) == (1.0, 0.05, 0.5)
    assert program.tcp.position == (0, 0, 0.15)
    work = Rotation.from_euler("z", 90, degrees=True)
    target = Rotation.from_quat([0.5, 0.5, 0.5, 0.5])
    for waypoint, y in ((first, 0.01), (second, 0.02)):
        np.testing.assert_allclose(
            waypoint.pose.position, np.array([1, 0, 0]) + work.apply([0.5, y + 0.01, 0.65]), atol=1e-6
        )
        assert (waypoint.speed, waypoint.turn, waypoint.blend) == (0.2, math.radians(500), 0.01)
    own = target * Rotation.from_euler("XYZ", [90, 0, 30], degrees=True)
    same(turned.pose, np.array([0.5, 0, 0.6]) + target.apply([0, 0, 0.1]), own)
    assert turned.configuration.text == "confdata [0,-1,1,1]"
    assert turned.configuration.ranges[3] == (-math.pi / 2, 0)
    assert turned.configuration.ranges[4] == (-math.inf, 0)
    assert (arc.via.position, arc.duration, arc.pause) == (pytest.approx((0.5, 0, 0.6)), 3, 0.5)
    assert seen.along == 1.5
    branch, switch, other, search = program.left_out
    assert switch.startswith("line 37: `over p10\\up, 3` is left out")
    assert other.startswith("line 38: `elsewhere` is left out: what it calls is not in this module")
    assert branch.startswith("line 15: `IF` is left out: whether DInput(di1)=1 holds")
    assert search.startswith("line 30: `SearchL")


LS = """/PROG PICK
/MN
   1:  !Pick ;
   2:  UFRAME_NUM=1 ;
   3:  UTOOL_NUM=2 ;
   4:J P[1:home] 50% CNT50    ;
   5:L P[2] 100mm/sec FINE ACC80    ;
   6:C P[2]
    :  P[3] 600cm/min CNT100    ;
   7:  WAIT    .50(sec) ;
   8:J PR[4] 20% FINE Offset,PR[5]    ;
   9:  IF DI[1]=ON,JMP LBL[2] ;
  10:L PR[4] R[7]mm/sec FINE    ;
  11:  JMP LBL[3] ;
  12:L P[9] 1mm/sec FINE    ;
  13:  LBL[3] ;
  14:  AUFRUF MAKRO1 ;
  15:  R[1]=3 ;
  14:J P[2] 100% FINE    ;
/POS
P[1:"home"]{
   GP1:
\tUF : 1, UT : 2,
\tJ1=    10.000 deg,\tJ2=    20.000 deg,\tJ3=   -30.000 deg,
\tJ4=     0.000 deg,\tJ5=   -90.000 deg,\tJ6=     0.000 deg
};
P[2]{
   GP1:
\tUF : 1, UT : 2,\t\tCONFIG : 'N U T, 0, 0, 0',
\tX =   500.000  mm,\tY =   -10.500  mm,\tZ =   600.000  mm,
\tW =   170.000 deg,\tP =    20.000 deg,\tR =     -.500 deg
};
P[3]{
   GP1:
\tUF : 0, UT : 2,\t\tCONFIG : 'F D B, 0, 0, 1',
\tX =   500.000  mm,\tY =   100.000  mm,\tZ =   600.000  mm,
\tW =   180.000 deg,\tP =     0.000 deg,\tR =     0.000 deg
};
/END
"""


def test_fanuc():
    with pytest.raises(InputError) as caught:
        read_fanuc(LS.encode(), "pick.ls", {})
    said = str(caught.value)
    assert all(f"needs {name}," in said for name in ("J23", "UFRAME[1]", "PR[4]"))
    values = {
        "J23": 1,
        "UFRAME[1]": "100,0,0,0,0,90",
        "UTOOL[2]": "0,0,150,0,0,0",
        "PR[4]": "1,2,3,0,0,0",
        "R[7]": 50,
    }
    program = read_fanuc(LS.encode(), "pick.ls", values)
    home, line, arc, register, last = program.waypoints
    assert home.q == pytest.approx(np.radians([10, 20, -10, 0, -90, 0]))
    assert (home.share, home.blend_share) == (0.5, 0.5)
    frame = Rotation.from_euler("z", 90, degrees=True)
    turn = frame * Rotation.from_euler("xyz", [170, 20, -0.5], degrees=True)
    same(line.pose, np.array([0.1, 0, 0]) + frame.apply([0.5, -0.0105, 0.6]), turn)
    assert (line.speed, line.acceleration_share) == (0.1, 0.8)
    assert program.tcp.position == (0, 0, 0.15)
    assert (arc.move, arc.speed, arc.pause) == (Move.CIRCULAR, pytest.approx(0.1), 0.5)
    same(arc.pose, (0.5, 0.1, 0.6), Rotation.from_euler("x", 180, degrees=True))
    assert register.speed == pytest.approx(0.05)
    assert (last.configuration.sides, last.configuration.ranges[4]) == ((True, True), None)
    signed = read_fanuc(LS.encode(), "pick.ls", values | {"N": -1})
    assert signed.waypoints[-1].configuration.ranges[4] == (-math.pi, 0)
    offset, jump, foreign = program.left_out
    assert foreign.startswith("line 14: `AUFRUF MAKRO1` is left out")
    assert offset.startswith("line 8: `J PR[4]")
    assert jump.startswith("line 9: `IF DI[1]=ON,JMP LBL[2]` is left out")
    for turns, moves in (("10", "10"), False), (("10", "90"), True):
        two = LS.replace("J6=     0.000 deg\n", f"J6=     0.000 deg\n   GP2:\n\tJ1= {turns[0]}.000 deg\n")
        two = two.replace("R =     -.500 deg\n", f"R =     -.500 deg\n   GP2:\n\tJ1= {turns[1]}.000 deg\n")
        two = two.replace("R =     0.000 deg\n", f"R =     0.000 deg\n   GP2:\n\tJ1= {turns[1]}.000 deg\n")
        found = read_fanuc(two.encode(), "pick.ls", values)
        assert found.waypoints == program.waypoints
        assert any("another group" in part for part in found.left_out) is moves


@pytest.mark.parametrize("read", [read_krl, read_rapid, read_fanuc])
@pytest.mark.parametrize(
    "text", [b"", b"\0", b"/MN\n1:J P[1] 5% FINE;", b"PTP {" * 999, b"PROC a()\nMoveJ [" * 99]
)
def test_what_is_no_program_is_an_error(read, text):
    with pytest.raises(InputError):
        read(text, "a", {})
