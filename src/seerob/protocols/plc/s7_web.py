"""Siemens S7 web API: requests and answers of JSON-RPC 2.0. Pure functions.

Methods as the maker documents them for S7-1200 from firmware 4.5 and S7-1500 from 2.8; this logs in,
reads, writes the bools of triggers, and logs out.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from seerob.protocols import ProtocolError
from seerob.protocols.links.json_pointer import document

PATH = "/api/jsonrpc"
TOKEN = "X-Auth-Token"  # noqa: S105 - the name of a header
MOST = 200
"""Variables that are asked for in one request."""


def login(user: str, password: str) -> bytes:
    """The request for a token."""
    return _request("Api.Login", 0, user=user, password=password)


def logout() -> bytes:
    """The request that gives the session back: a PLC has few."""
    return _request("Api.Logout", 0)


def reading(addresses: Sequence[str]) -> bytes:
    """One request for many variables; the answers carry the number of each."""
    calls = [_call("PlcProgram.Read", k, {"var": a, "mode": "simple"}) for k, a in enumerate(addresses)]
    return json.dumps(calls).encode()


def writing(address: str, value: bool) -> bytes:
    """The request to write one bool; the only one that changes anything in the PLC."""
    return json.dumps(
        _call("PlcProgram.Write", 0, {"var": address, "value": value, "mode": "simple"})
    ).encode()


def browsing(address: str) -> bytes:
    """The request for what is below an address; the whole program for an empty one."""
    return _request("PlcProgram.Browse", 0, **({"var": address} if address else {}), mode="children")


def _request(method: str, number: int, **params: str) -> bytes:
    return json.dumps(_call(method, number, params)).encode()


def _call(method: str, number: int, params: Mapping[str, str | bool]) -> dict[str, object]:
    return {"jsonrpc": "2.0", "method": method, "id": number, "params": dict(params)}


def result(data: bytes) -> object:
    """The result of one call.

    Raises:
        ProtocolError: It is an error, or no answer.
    """
    answer = document(data)
    if not isinstance(answer, dict):
        raise ProtocolError("the answer is no JSON-RPC")
    found, error = _outcome(answer)
    if error:
        raise ProtocolError(error)
    return found


def results(data: bytes, count: int) -> list[tuple[object, str]]:
    """Per call of a batch its result, and why there is none.

    Args:
        data: The answer.
        count: How many were asked.

    Raises:
        ProtocolError: The whole batch was refused, or it is no answer.
    """
    answers = document(data)
    if isinstance(answers, dict):
        raise ProtocolError(_outcome(answers)[1] or "one answer to many questions")
    if not isinstance(answers, list):
        raise ProtocolError("the answer is no JSON-RPC")
    found: list[tuple[object, str]] = [(None, "the PLC gave no answer")] * count
    for answer in answers:
        number = answer.get("id") if isinstance(answer, dict) else None
        if isinstance(number, int) and not isinstance(number, bool) and 0 <= number < count:
            found[number] = _outcome(answer)
    return found


def _outcome(answer: dict[str, object]) -> tuple[object, str]:
    if "error" in answer:
        error = answer["error"]
        text = error.get("message", "") if isinstance(error, dict) else ""
        code = error.get("code", "") if isinstance(error, dict) else ""
        return None, f"the PLC says: {str(text)[:200]} ({str(code)[:20]})"
    if "result" not in answer:
        return None, "an answer without a result"
    return answer["result"], ""
