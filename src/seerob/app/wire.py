"""Writes ``web/src/wire.ts``, the page's types, from `seerob.core.snapshot`: one fact, one place.

``python -m seerob.app.wire`` writes the file, ``python -m seerob.app.wire --check`` fails when it is stale.
Structs become interfaces (tagged ones carry ``type``; what a default leaves out is optional or in DEFAULTS,
the order of those that are arrays is in FIELDS), enums unions of strings, ``bytes`` ``Uint8Array``;
docstrings of classes and fields go along as JSDoc.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Iterator
from enum import StrEnum
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from types import GenericAlias, NoneType, UnionType
from typing import get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from seerob.core import events, markers, page_messages, snapshot, verdict
from seerob.core.errors import InputError

FROM_SERVER = (
    snapshot.Hello,
    snapshot.Scene,
    snapshot.History,
    snapshot.SoFar,
    snapshot.Transport,
    snapshot.Snapshot,
    snapshot.Tracked,
    snapshot.Registered,
    snapshot.Draft,
    snapshot.Edited,
    snapshot.Measured,
    snapshot.Visitors,
    snapshot.Presences,
    snapshot.Refused,
)
"""Messages that a page receives."""
FROM_PAGE = (
    snapshot.Command,
    snapshot.Tracking,
    snapshot.Register,
    snapshot.Edit,
    snapshot.Measure,
    snapshot.Reach,
    snapshot.Introduction,
    snapshot.Presence,
    snapshot.Hold,
    snapshot.Grab,
    snapshot.Pull,
)
"""Messages that a page sends; what has a default may be left out."""

COMPLETED = (snapshot.Snapshot,)
"""Of these the page puts back what a default leaves out, before anything else looks at them."""
ARRAYS = (snapshot.Result, snapshot.Row, snapshot.Aspect, *get_args(snapshot.Marker))
"""These are arrays on the wire; the page puts back the names, before anything else looks at them."""

SOURCES = (verdict, markers, events, snapshot, page_messages)
"""Modules whose types go over the wire; `seerob.core.snapshot` has the names of all of them."""

FILE = Path(__file__).resolve().parents[3] / "web" / "src" / "wire.ts"
HEAD = "// Written by `python -m seerob.app.wire` from src/seerob/core/snapshot.py. Do not edit.\n"


def typescript() -> str:
    """Text of ``wire.ts``."""
    blocks = [HEAD + _comment(inspect.getdoc(snapshot) or "")]
    blocks.append(_constant("PROTOCOL", snapshot.PROTOCOL, _field_docs(None).get("PROTOCOL", "")))
    blocks.append(
        _constant(
            "SCHEMA", schema(), "Hash of the types below; a stale page finds another in `Hello.schema`."
        )
    )
    blocks += list(_declarations(docs=True))
    return "\n".join(blocks)


def schema() -> str:
    """Hash of the message types, without their documentation; 16 hexadecimal digits."""
    return sha256("\n".join(_declarations(docs=False)).encode()).hexdigest()[:16]


def _declarations(*, docs: bool) -> Iterator[str]:
    aliases = _aliases()
    # In the order of the files: what is said beside the snapshots comes last.
    beside = vars(page_messages)
    own = {name: thing for name, thing in vars(snapshot).items() if beside.get(name) is not thing}
    for name, thing in (own | beside).items():
        if name.startswith("_"):
            continue
        if isinstance(thing, (GenericAlias, UnionType)):
            yield f"export type {name} = {_type(thing, {k: v for k, v in aliases.items() if v != name})};\n"
        elif not inspect.isclass(thing) or thing.__module__ not in {source.__name__ for source in SOURCES}:
            continue
        elif issubclass(thing, StrEnum):
            yield _enum(thing, docs=docs)
        elif issubclass(thing, Struct):
            yield _interface(thing, aliases, docs=docs)
    yield _defaults()
    yield _orders()
    yield f"export type ServerMessage = {' | '.join(c.__name__ for c in FROM_SERVER)};\n"
    yield f"export type PageMessage = {' | '.join(c.__name__ for c in FROM_PAGE)};\n"


def _aliases() -> dict[object, str]:
    return {v: k for k, v in vars(snapshot).items() if isinstance(v, (GenericAlias, UnionType))}


def _enum(cls: type[StrEnum], *, docs: bool) -> str:
    members = "".join(f"\n  | {_string(m.value)}" for m in cls)
    text = f"export type {cls.__name__} ={members};\n"
    if not docs:
        return text
    lines = [inspect.getdoc(cls) or "", ""]
    texts = _field_docs(cls)
    lines += [f"- `{m.value}`: {texts[m.name]}" for m in cls if m.name in texts]
    return _comment("\n".join(lines).strip()) + text


def _interface(cls: type[Struct], aliases: dict[object, str], *, docs: bool) -> str:
    texts = _field_docs(cls) if docs else {}
    hints = get_type_hints(cls)
    lines = [f"export interface {cls.__name__} {{\n"]
    config = cls.__struct_config__
    tag = config.tag
    if tag is not None:
        lines.append(f"  type: {_string(str(tag))};\n")
    for field in msgspec.structs.fields(cls):
        if field.name in texts:
            lines.append(_comment(texts[field.name], indent="  "))
        left_out = cls in FROM_PAGE or (config.omit_defaults and cls not in COMPLETED)
        optional = "?" if left_out and not field.required else ""
        lines.append(f"  {field.encode_name}{optional}: {_type(hints[field.name], aliases)};\n")
    lines.append("}\n")
    return (_comment(inspect.getdoc(cls) or "") if docs else "") + "".join(lines)


def _defaults() -> str:
    lines = ["export const DEFAULTS = {\n"]
    for cls in COMPLETED:
        fields = (field for field in msgspec.structs.fields(cls) if not field.required)
        values = (f"{field.encode_name}: {default_of(field)}" for field in fields)
        lines.append(f"  {cls.__struct_config__.tag or cls.__name__.lower()}: {{ {', '.join(values)} }},\n")
    return "".join((*lines, "};\n"))


def _orders() -> str:
    lines = ["export const FIELDS = {\n"]
    for cls in ARRAYS:
        tag = cls.__struct_config__.tag
        names = ["type"] * (tag is not None) + [field.encode_name for field in msgspec.structs.fields(cls)]
        lines.append(f"  {tag or cls.__name__.lower()}: [{', '.join(map(_string, names))}],\n")
    return "".join((*lines, "} as const;\n"))


def default_of(field: msgspec.structs.FieldInfo) -> str:
    """The default of a field in JSON."""
    made = field.default if field.default_factory is msgspec.NODEFAULT else field.default_factory()
    return msgspec.json.encode(made).decode()


_SIMPLE = {
    float: "number",
    int: "number",
    str: "string",
    bool: "boolean",
    bytes: "Uint8Array",
    NoneType: "null",
    object: "unknown",
}


def _type(hint: object, aliases: dict[object, str]) -> str:
    if hint in aliases:
        return aliases[hint]
    if hint in _SIMPLE:
        return _SIMPLE[hint]
    if inspect.isclass(hint) and issubclass(hint, (Struct, StrEnum)):
        return hint.__name__
    arguments = get_args(hint)
    if get_origin(hint) is tuple and arguments[-1] is Ellipsis:
        item = _type(arguments[0], aliases)
        return f"({item})[]" if " | " in item else f"{item}[]"
    if get_origin(hint) is tuple:
        return f"[{', '.join(_type(a, aliases) for a in arguments)}]"
    if get_origin(hint) is dict and arguments[0] is str:
        return f"Record<string, {_type(arguments[1], aliases)}>"
    if isinstance(hint, UnionType):
        return " | ".join(dict.fromkeys(_type(a, aliases) for a in arguments))
    raise TypeError(f"no TypeScript for {hint!r}; teach seerob.app.wire or choose another type")


def _field_docs(cls: type | None) -> dict[str, str]:
    """Strings below the fields of a class (or below the module's constants), by field name."""
    body: list[ast.stmt] = ast.parse(inspect.getsource(cls or snapshot)).body
    if cls is not None and isinstance(body[0], ast.ClassDef):
        body = body[0].body
    found = {}
    for field, text in pairwise(body):
        targets = field.targets if isinstance(field, ast.Assign) else [getattr(field, "target", None)]
        if (
            isinstance(targets[0], ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
            and isinstance(text.value.value, str)
        ):
            found[targets[0].id] = inspect.cleandoc(text.value.value)
    return found


def _constant(name: str, value: str, doc: str) -> str:
    return _comment(doc) + f"export const {name} = {_string(value)};\n"


def _string(text: str) -> str:
    return msgspec.json.encode(text).decode()


def _comment(text: str, *, indent: str = "") -> str:
    lines = re.sub(r"``", "`", text).replace("*/", "*\\/").splitlines()
    if not lines:
        return ""
    if len(lines) == 1:
        return f"{indent}/** {lines[0]} */\n"
    middle = "".join(f"{indent} * {line}".rstrip() + "\n" for line in lines)
    return f"{indent}/**\n{middle}{indent} */\n"


def is_current(file: Path = FILE) -> bool:
    """Whether the file is what `write` would write."""
    return file.is_file() and file.read_text(encoding="utf-8") == typescript()


def write(file: Path = FILE) -> None:
    """Write ``wire.ts``.

    Raises:
        InputError: The folder is not there, as in an installed package.
    """
    if not file.parent.is_dir():
        raise InputError.at(file, "", "its folder does not exist", "run it in a checkout of the repository")
    file.write_text(typescript(), encoding="utf-8", newline="\n")


def main(arguments: list[str]) -> int:
    """Write, or with ``--check`` compare; the exit code is 1 when stale."""
    if arguments not in ([], ["--check"]):
        sys.stderr.write("usage: python -m seerob.app.wire [--check]\n")
        return 2
    if not arguments:
        write()
    elif not is_current():
        sys.stderr.write(f"{FILE.name} is not what snapshot.py says; run: make wire\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
