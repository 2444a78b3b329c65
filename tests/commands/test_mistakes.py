"""What is wrong in a call or a file, on the command line: everything at once, and nothing is written."""

from __future__ import annotations

import pytest
from made_cells import HUMAN, ROBOT, SEPARATION, SOURCE, make_cell, seerob


@pytest.mark.parametrize("command", ["check-file", "assess", "run"])
def test_mistakes_go_to_standard_error_and_nothing_is_written(capsys, tmp_path, command):
    cell = make_cell(tmp_path / "cell", more='titl = "x"\nlimits = 3\n')
    code, out, err = seerob(capsys, command, cell)
    assert (code, out) == (3, "")
    lines = err.splitlines()
    assert len(lines) == 2
    assert all(line.startswith(f"{cell / 'workstation.toml'}: safety[0].") for line in lines)
    assert not (cell / "runs").exists()


def test_a_folder_that_nobody_may_make_names_a_remedy(capsys, tmp_path):
    (tmp_path / "file").write_text("in the way")
    code, out, err = seerob(capsys, "new", tmp_path / "file" / "cell")
    assert (code, out, err.count("\n")) == (3, "", 1)
    assert err.endswith("give a folder that may be written\n")


def test_a_volume_is_not_computed_for_a_folder_that_does_not_exist(capsys, tmp_path):
    cell = make_cell(tmp_path / "cell")
    code, out, err = seerob(capsys, "swept", cell, "-o", tmp_path / "nowhere" / "swept.stl")
    assert (code, out, err.count("\n")) == (3, "", 1)
    assert "nowhere/swept.stl: its folder does not exist; make it" in err


@pytest.mark.parametrize("command", ["check-file", "assess", "run"])
@pytest.mark.parametrize("text", ["", "robots = []", '[[areas]]\nname = "a"\nshape = { sphere = 1 }\n'])
def test_a_workstation_that_describes_nothing_is_a_mistake(capsys, tmp_path, command, text):
    (tmp_path / "workstation.toml").write_text(text)
    code, out, err = seerob(capsys, command, tmp_path)
    assert (code, out, err.count("\n")) == (3, "", 1)
    assert "describes nothing" in err
    assert [p.name for p in tmp_path.iterdir()] == ["workstation.toml"]


def test_mistakes_of_every_stage_come_together_and_none_follows_from_another(capsys, tmp_path):
    box = "shape = { sphere = 0.01 }\nmass = 1\n"
    more = (
        ROBOT.replace("ur5e", "short").replace("library:short", "library:ur5e")
        + "q = [0, 0]\n"
        + ROBOT.replace("ur5e", "odd")  # the library has no such robot
        + ROBOT.replace("ur5e", "typo").replace("library:typo", "library:ur5e")
        + "basis = 1\n"
        + HUMAN
        + 'posture = "lying"\n'
        + f'[[tools]]\nname = "good"\non = "ur5e/tool0"\n{box}'
        + f'[[tools]]\nname = "lost"\non = "ur5e/toolO"\n{box}'
        + '[[tools]]\nname = "unmade"\non = "odd/tool0"\nmesh = "unmade.stl"\n'
        + f'[[workpieces]]\nname = "block"\non = "lost"\n{box}'
        + '[[parts]]\nname = "table"\nmesh = "table.stl"\n'
        + f'[[areas]]\nname = "zone"\non = "ur5e/rim"\n{box.split("mass", maxsplit=1)[0]}'
        + SOURCE.replace('"ur5e"', '"odd"').replace("motion", "nowhere")
        + SEPARATION  # speaks of the human, whose posture is wrong
        + '[[safety]]\nkind = "velocity"\nat = "ur5e/elbow"\nlimit = 1\n'
        + '[[safety]]\nkind = "velocity"\nat = "typo/toolO"\nlimit = 1\n'
        + '[[safety]]\nkind = "kinetic_energy"\nrobot = "odd"\nlimit = 1\n'
    )
    cell = make_cell(tmp_path / "cell", more=more)
    (cell / "motion.csv").write_text("time [s],J1 [deg],J2 [deg]\n0,1,2\n0.1,1,2\n")
    code, out, err = seerob(capsys, "check-file", cell)
    assert (code, out) == (3, "")
    places = [
        line.split(": ")[1].split(" ")[0]
        for line in err.splitlines()
        if line.startswith(f"{cell / 'workstation.toml'}: ")
    ]
    assert sorted(places) == [
        "areas[0]",
        "humans[0]",
        "robots[1]",
        "robots[2]",
        "robots[3].basis",
        "safety[2]",
        "safety[3]",
        "sources[0].file",
        "sources[1].file",
        "tools[1].on",
        "tools[2].mesh",
    ], err
    for word in ("'lying'", "in the library named 'odd'", "table.stl", "motion.csv"):
        assert sum(word in line for line in err.splitlines()) == 1, err
    assert len(err.splitlines()) == len(places) + 1, err


def test_missing_files_and_unknown_links_come_in_one_go(capsys, tmp_path):
    more = ROBOT.replace("ur5e", "b").replace("library:b", "b.urdf") + '[[parts]]\nname="p"\nmesh="p.stl"\n'
    cell = make_cell(tmp_path / "cell", more=more)
    (cell / "motion.csv").unlink()
    code, _, err = seerob(capsys, "assess", cell)
    assert code == 3
    assert all(name in err for name in ("b.urdf", "p.stl", "sources[0].file: motion.csv: no such file"))
    assert not (cell / "runs").exists()


def test_mistakes_of_criteria_and_of_sources_come_together(capsys, tmp_path):
    cell = make_cell(tmp_path / "cell", more='[[safety]]\nkind = "velocity"\nat = "ur5e/elbow"\nlimit = 1\n')
    (cell / "motion.csv").write_text("time [s],J1 [deg],J2 [deg]\n0,1,2\n0.1,1,2\n")
    code, _, err = seerob(capsys, "check-file", cell)
    assert code == 3
    assert "'ur5e/elbow'" in err
    assert "motion.csv" in err


def test_a_data_file_that_cannot_be_read_is_said_where_the_workstation_names_it(capsys, tmp_path):
    cell = make_cell(tmp_path / "cell")
    (cell / "motion.csv").unlink()
    (cell / "motion.csv").mkdir()
    code, out, err = seerob(capsys, "check-file", cell)
    assert (code, out, err.count("\n")) == (3, "", 1)
    assert err.startswith(f"{cell / 'workstation.toml'}: sources[0].file: motion.csv: is a folder")


@pytest.mark.parametrize(
    ("arguments", "place", "remedy"),
    [
        (("csv", "x"), ": kind: csv plays a file", "check-file"),
        (("rtde", "h", "--set", "tmeout=1"), " rtde: tmeout: unknown key", "did you mean 'timeout'?"),
        (("rtde", "h", "--set", "timeout=nan"), " rtde: timeout: nan is wrong", "a finite number"),
        (("opcua", "http://h"), " opcua: url: 'http://h' is wrong", "opc.tcp://"),
    ],
)
def test_options_of_a_probe_are_read_as_those_of_a_workstation_file(capsys, arguments, place, remedy):
    code, out, err = seerob(capsys, "probe", *arguments)
    assert (code, out) == (3, "")
    assert f"seerob probe{place}" in err
    assert remedy in err
