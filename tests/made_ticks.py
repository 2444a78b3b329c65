"""Motions of an arm in files, told tick by tick: ``from made_ticks import …``."""

from __future__ import annotations

PLC = '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n'
DOOR = '[[variables]]\nname = "door"\nsource = "plc"\naddress = "x"\ntype = "bool"\n'
SOURCE = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\n'


def rows(motion, times):
    lines = ["t [s],j1 [rad],j2 [rad],qd_j1 [rad/s],qd_j2 [rad/s]"]
    for t in times:
        q, qd = motion(t)
        lines.append(",".join(f"{x:.12g}" for x in (t, *q, *qd)))
    return "\n".join(lines) + "\n"
