"""Roles, tokens that cannot be guessed, and who guesses."""

import os
import secrets
import tracemalloc

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import InvalidStatus

from seerob.app.server.access import (
    FREE,
    LONGEST_LOCK,
    MOST_ADDRESSES,
    Guesses,
    Role,
    Tokens,
    read_tokens,
    weakness,
)
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.core.errors import InputError
from seerob.core.snapshot import Hello, Snapshot, Transport
from server.frames import MESHES, Remembered, Visitor, scene, snapshot

TOKENS = Tokens.made()


@pytest.fixture
def server():
    feed = Player(Remembered([snapshot(k) for k in range(100)]))
    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0, tokens=TOKENS) as server:
        yield server


def page(server, role):
    return Visitor(server, path=f"/ws?token={getattr(TOKENS, role)}")


def get(server, query="", **options):
    return httpx.get(f"http://127.0.0.1:{server.port}/{query}", **options).status_code


# -- roles --------------------------------------------------------------------------------------


@pytest.mark.parametrize("role", ["view", "track"])
def test_who_may_not_control_changes_nothing_and_stays(server, role):
    with page(server, role) as looker, page(server, "control") as controller:
        assert looker.of(Hello).may == tuple(sorted({"view", role}))
        assert controller.of(Hello).may == ("control", "view")
        looker.of(Snapshot)
        for action, value in (
            ("play", None),
            ("seek", 0.5),
            ("speed", 9.0),
            ("step", 3),
            ("loop", 1),
            ("beside", -1),
        ):
            looker.ask(action, value)
            assert looker.of(Transport) == Transport(playing=False, t=0.0)
        controller.ask("seek", 0.5)
        assert controller.until(lambda m: isinstance(m, Transport) and m.t == 0.5)
        assert looker.until(lambda m: isinstance(m, Snapshot) and m.t == 0.5)
    server.stop()
    refused = next(v.refused for v in server.visits.take(end=True) if v.role == role and v.event == "left")
    assert refused == dict.fromkeys(("play", "seek", "speed", "step", "loop", "beside"), 1)


def test_where_no_token_is_asked_everything_is_allowed():
    feed = Player(Remembered([snapshot(0), snapshot(1)]))
    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0) as server, Visitor(server) as anybody:
        assert anybody.of(Hello).may == ("control", "track", "view")


def test_a_cookie_keeps_the_role_and_tells_no_token(server):
    for role in Role:
        with httpx.Client() as browser:
            browser.get(f"http://127.0.0.1:{server.port}/?token={getattr(TOKENS, role)}")
            cookies = "; ".join(f"{k}={v}" for k, v in browser.cookies.items())
        assert not any(token in cookies for token in TOKENS)
        with Visitor(server, additional_headers={"Cookie": cookies}) as visitor:
            assert set(visitor.of(Hello).may) == {"view", role}


# -- tokens -------------------------------------------------------------------------------------


def test_made_tokens_have_128_bits_and_are_never_weak():
    made = [token for _ in range(300) for token in Tokens.made()]
    assert len(set(made)) == len(made)
    assert {len(token) for token in made} == {32}
    ones = sum(int(token, 16).bit_count() for token in made) / (128 * len(made))
    assert abs(ones - 0.5) < 0.01
    weak = sum(bool(weakness(secrets.token_hex(16))) for _ in range(20_000))
    assert weak <= 2  # what is random is not refused


@pytest.mark.parametrize(
    "token",
    [
        *("", "secret", "a" * 32, "0123456789abcdef" * 2, "deadbeef" * 4, "0f" * 16, "0011223344556677" * 2),
        *("0123456789abcdef0123456789abcdee"[:31], "correct horse battery staple again", "ü" * 32),
        *("A1B2C3D4E5F60718293A4B5C6D7E8F90", "01234567" * 4, "fedcba9876543210fedcba9876543210"),
    ],
)
def test_weak_tokens_are_refused(token):
    assert weakness(token)
    with pytest.raises(InputError, match="view"):
        Tokens.checked({"view": token}, "prompt")


def test_a_role_is_known_and_has_a_token_of_its_own():
    with pytest.raises(InputError, match="admin: is no role; give any of view, track, control"):
        Tokens.checked({"admin": TOKENS.view}, "file")
    with pytest.raises(InputError, match="two roles have one token"):
        Tokens.checked({"view": TOKENS.view, "control": TOKENS.view}, "file")
    assert Tokens.checked({"track": TOKENS.track}, "file").track == TOKENS.track


def test_a_file_of_tokens_is_made_once_for_its_owner_alone(tmp_path):
    file = tmp_path / "tokens.toml"
    made = read_tokens(file)
    assert file.stat().st_mode & 0o777 == 0o600
    assert read_tokens(file) == made
    file.chmod(0o640)
    with pytest.raises(InputError, match=r"may read it \(mode 640\); chmod 600"):
        read_tokens(file)
    file.chmod(0o600)
    file.write_text(f'view = "{"a" * 32}"')
    with pytest.raises(InputError, match="made at random"):
        read_tokens(file)
    for text in ("view", "\0", 'view = ["a"]', "x" * 10_000):
        file.write_text(text)
        with pytest.raises(InputError):
            read_tokens(file)
    for wrong in (tmp_path, tmp_path / "none" / "tokens.toml", os.devnull):
        with pytest.raises((InputError, OSError)):
            read_tokens(type(tmp_path)(wrong))


# -- who guesses --------------------------------------------------------------------------------


def test_who_guesses_is_locked_out_and_nobody_else(server):
    wrong = "?token=" + "0" * 32
    others = httpx.HTTPTransport(local_address="127.0.0.9")
    assert [get(server, wrong) for _ in range(FREE + 3)] == [401] * FREE + [429] * 3
    assert get(server, f"?token={TOKENS.control}") == 429  # not even compared
    with httpx.Client(transport=others) as client:
        assert client.get(f"http://127.0.0.1:{server.port}/?token={TOKENS.view}").status_code == 303
    # Who came in before, from the very address, stays in.
    cookies = {"Cookie": f"seerob-{server.port}={TOKENS.cookie(Role.VIEW)}"}
    assert get(server, headers=cookies) in (200, 503)
    with pytest.raises(InvalidStatus, match="429"):
        page(server, "view")


def test_a_page_whose_cookie_is_of_another_run_locks_nobody_out(server):
    old = {"Cookie": f"seerob-{server.port}={Tokens.made().cookie(Role.VIEW)}"}
    assert {get(server, headers=old) for _ in range(2 * FREE)} == {401}
    assert get(server, f"?token={TOKENS.view}") == 303


def test_locks_get_longer_to_a_bound_and_end():
    now = 0.0
    guesses = Guesses(now=lambda: now)
    longest = []
    for _ in range(30):
        guesses.fail("192.0.2.1")
        longest.append(guesses.locked("192.0.2.1"))
        now += longest[-1]
        assert guesses.locked("192.0.2.1") == 0
    assert longest == sorted(longest)
    assert longest[FREE - 2] == 0 < longest[FREE - 1]
    assert longest[-1] == LONGEST_LOCK


@given(st.lists(st.ip_addresses(), max_size=40), st.ip_addresses())
def test_nobody_is_locked_out_for_what_others_did(addresses, other):
    guesses = Guesses(now=lambda: 0.0)
    for address in addresses:
        for _ in range(2 * FREE):
            guesses.fail(str(address))
    # Who is known by an address of IPv4 within one of IPv6 is the same.
    known = [getattr(a, "ipv4_mapped", None) or a for a in addresses]
    near = {a.exploded[:19] if a.version == 6 else a.exploded for a in known}
    if (other.exploded[:19] if other.version == 6 else other.exploded) not in near and other.version == 4:
        assert guesses.locked(str(other)) == 0
    assert all(guesses.locked(str(address)) > 0 for address in addresses)


def test_twenty_thousand_guessers_take_bounded_memory():
    guesses = Guesses(now=lambda: 0.0)
    tracemalloc.start()
    for k in range(20_000):
        guesses.fail(f"10.0.{k >> 8 & 255}.{k & 255}")
    used = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(guesses) == MOST_ADDRESSES
    assert used < 1 << 20


def test_a_network_of_ipv6_is_one_guesser():
    guesses = Guesses(now=lambda: 0.0)
    for k in range(FREE):
        guesses.fail(f"2001:db8:1:2::{k:x}")
    assert guesses.locked("2001:db8:1:2:ffff::1") > 0
    assert guesses.locked("2001:db8:1:3::1") == 0
    for _ in range(FREE):
        guesses.fail("::ffff:192.0.2.9")
    assert guesses.locked("192.0.2.9") > 0
