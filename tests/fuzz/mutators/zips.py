"""Mutations of zip files: members are changed with correct checksums, removed, doubled, renamed or added."""

import io
import warnings
import zipfile
from random import Random

from fuzz.mutators import arrays, json_text, raw

Member = tuple[str, bytes]


def change(chance: Random, content: bytes) -> bytes:
    """Change, add or remove one member; other content is changed as bytes."""
    members = members_of(content)
    if not members:
        return raw.change(chance, content)
    return zipped(_changed(chance, members), chance.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED)))


def members_of(content: bytes) -> list[Member]:
    """Return the members of a zip file; none if it is damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            return [(info.filename, file.read(info)) for info in file.infolist()]
    except Exception:  # whatever a damaged one raises
        return []


def zipped(members: list[Member], method: int) -> bytes:
    stream = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w", method) as file:
        warnings.simplefilter("ignore")  # names that come twice
        for name, content in members:
            file.writestr(zipfile.ZipInfo(name), content, method)
    return stream.getvalue()


def _changed(chance: Random, members: list[Member]) -> list[Member]:
    at = chance.randrange(len(members))
    name, content = members[at]
    kind = chance.choice(("inside",) * 6 + ("remove", "double", "rename", "swap", "extra"))
    if kind == "remove":
        return members[:at] + members[at + 1 :]
    if kind == "double":
        return [*members, (name, _inside(chance, name, content))]
    if kind == "extra":
        return [*members, (chance.choice(("x.npy", "../x.npy", "engine/x.npy", "", "a" * 300)), content)]
    if kind == "rename":
        members[at] = (chance.choice(("x.npy", "/x", name + "x", name.upper(), name[:-1])), content)
    elif kind == "swap":
        other = chance.randrange(len(members))
        members[at], members[other] = (name, members[other][1]), (members[other][0], content)
    else:
        members[at] = (name, _inside(chance, name, content))
    return members


def _inside(chance: Random, name: str, content: bytes) -> bytes:
    way = json_text.change if name.endswith(".json") else arrays.change
    return chance.choice((way, way, way, raw.change))(chance, content)
