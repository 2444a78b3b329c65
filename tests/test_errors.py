"""Errors say where, what, and what would be right."""

from __future__ import annotations

from seerob.core.errors import InputError, Problem, SeerobError, UnknownName, suggestion


def test_a_problem_reads_as_one_line():
    assert str(Problem("w.toml", "robots[0].name", "3 is wrong", "write text")) == (
        "w.toml: robots[0].name: 3 is wrong; write text"
    )
    assert str(Problem("w.toml", "", "no such file")) == "w.toml: no such file"


def test_an_input_error_carries_every_problem_in_order():
    problems = [Problem("a", "x", "1"), Problem("b", "", "2", "3")]
    error = InputError(iter(problems))
    assert error.problems == tuple(problems)
    assert str(error) == "a: x: 1\nb: 2; 3"
    assert isinstance(error, SeerobError)
    assert InputError.at(7, "k", "w").problems == (Problem("7", "k", "w"),)


def test_an_unknown_name_says_the_right_ones():
    error = UnknownName("robot", "ur1O", ["ur10", "kuka"])
    assert str(error) == "no robot named 'ur1O'; did you mean 'ur10'? known: kuka, ur10"
    assert error.known == ("ur10", "kuka")
    assert str(UnknownName("robot", "x", [])) == "no robot named 'x'; known: none"


def test_a_long_list_of_names_is_cut_but_the_nearest_is_always_named():
    names = [f"link_{i:03}" for i in range(500)]
    text = suggestion("lnik_437", names)
    assert text.startswith("did you mean 'link_")
    assert text.endswith("and 488 more")
    assert "link_437" in suggestion("link_437x", names)
    of_the_arm = suggestion("arm/tool0", [*names, "arm/zulu", "arm/flange"])
    assert of_the_arm.startswith("known: arm/flange, arm/zulu, link_000")
    assert suggestion("zzz", names).startswith("known: link_000")


def test_known_names_may_come_from_an_iterator():
    assert suggestion("abc", iter(["z", "abd"])) == "did you mean 'abd'? known: abd, z"
    assert UnknownName("x", "y", iter(["z"])).known == ("z",)
