"""The benchmarks run, and say what their peers say; in this process, for starting another takes long."""

import os
import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture
def smoke(monkeypatch, capsys):
    """Run a benchmark's short form and give back what it printed; it may keep to one core as it likes."""
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    monkeypatch.setattr(os, "environ", os.environ.copy())

    def run(name: str) -> str:
        script = str(FOLDER / f"{name}.py")
        monkeypatch.syspath_prepend(str(FOLDER))
        monkeypatch.setattr(sys, "argv", [script, "--smoke"])
        code = 0
        try:
            runpy.run_path(script, run_name="__main__")
        except SystemExit as ended:
            code = ended.code or 0
        told = capsys.readouterr()
        assert code == 0, told.out + told.err
        return told.out

    yield run
    if cores is not None:
        os.sched_setaffinity(0, cores)


def test_every_figure_of_the_documentation_can_be_measured_again(smoke):
    said = smoke("accuracy")
    assert {line.split()[0] for line in said.splitlines()} >= {"dynamics", "tracking", "person", "energy"}
    assert ": 0 differ" in said


def test_rays_and_inside_tests_agree_with_mujocos_rays_and_the_winding_number(smoke):
    said = smoke("areas")
    assert "541 beams" in said
    assert "0 differ" in said


def test_every_criterion_for_one_robot_and_one_person_live_and_over_a_recording(smoke):
    said = smoke("criteria")
    assert "power and force" in said
    assert "Pinocchio" in said
    assert said.count("x real time") == 2


def test_a_way_beside_a_person_is_found_by_seerob_and_by_ompl_with_coal(smoke):
    said = smoke("planning")
    assert ", 0 differ" in said
    assert said.count("1 of 1 found") == 3


def test_seerob_coal_and_fcl_agree_on_a_ur10_tick_by_tick(smoke):
    said = smoke("distances")
    assert "person" in said
    assert "parts" in said


def test_rula_and_reba_on_a_thousand_postures(smoke):
    assert "RULA + REBA" in smoke("ergonomics")


def test_openpyxl_reads_the_captured_operators_workbook(smoke):
    assert "x openpyxl" in smoke("exports")


def test_a_captured_person_is_where_the_device_has_it(smoke):
    assert "bare mj_step" in smoke("human_tracking")


def test_decoders_of_motion_capture_say_what_their_peers_say(smoke):
    said = smoke("mocap_decoders")
    for what in ("MVN datagrams decoded", "MVNX frames", "BVH frames"):
        assert what in said


def test_rescaled_motions_are_not_far_from_toppra_alone(smoke):
    assert "toppra alone" in smoke("permissible")


def test_a_flooded_page_is_measured_in_one_run(smoke):
    said = smoke("flooded_page")
    assert {line.split()[0] for line in said.splitlines()} >= {
        "commands",
        "acknowledgements",
        "pings",
        "requests",
    }


def test_the_price_of_checks_against_strangers_is_a_share_of_a_tick_and_of_a_start(smoke):
    said = smoke("price_of_checks")
    assert "a tick of" in said
    assert "a start of" in said


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_processor_time_and_memory_of_a_listening_process_are_measured(smoke):
    said = smoke("listeners").splitlines()[-1].split()
    assert said[0] == "rtde"
    assert 0 < float(said[1].rstrip("%")) < 100
    assert 5 < float(said[4]) < 200
