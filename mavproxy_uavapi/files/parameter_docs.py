"""What ArduPilot's own documentation says of parameters. Blocking: for an executor.

A bundle has its files (`param_parse.py --format xml`) beside this one; else MAVProxy's `param download` fetches them.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree

from typing_extensions import TypedDict

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.core.text import reason_of

OWN = Path(__file__).with_name("parameter_docs")
FILES = {"copter": "Copter.xml", "plane": "Plane.xml", "rover": "Rover.xml"}
LONGEST = 600  # characters of a text


class About(TypedDict):
    """What ArduPilot's documentation says of a parameter; empty for what it does not say.

    `range` has the least and the greatest value, `values` what its values mean, or its bits, by number.
    """

    title: str
    text: str
    unit: str
    range: str
    values: dict[str, str]
    bits: bool
    reboot: bool


def of(kind: str) -> Mapping[str, About]:
    """What is known of the parameters of a kind of vehicle, by name; empty where there is no documentation.

    Raises:
        NotFound: its file cannot be read.
    """
    name = FILES.get(kind, "")
    file = next((one for one in (OWN / name, Path.home() / ".mavproxy" / name) if one.is_file()), None)
    if file is None:
        return {}
    try:
        return _read(file, file.stat().st_mtime_ns)
    except OSError as error:
        raise NotFound(f"the documentation of parameters cannot be read: {file}: {reason_of(error)}") from error
    except ElementTree.ParseError as error:
        raise NotFound(f"the documentation of parameters is no whole XML: {file}") from error


@functools.lru_cache(maxsize=len(FILES))
def _read(file: Path, _changed: int) -> Mapping[str, About]:
    found: dict[str, About] = {}
    for _, element in ElementTree.iterparse(file):  # in pieces: one call for 2 MB would hold up MAVProxy's thread
        if element.tag == "param":
            found[element.get("name", "").rpartition(":")[2]] = _about(element)
            element.clear()
    return found


def _about(element: ElementTree.Element) -> About:
    fields = {one.get("name"): one.text or "" for one in element.iter("field")}
    bits = element.find("bitmask")
    listed = element.find("values") if bits is None else bits
    return {
        "title": element.get("humanName", ""),
        "text": element.get("documentation", "")[:LONGEST],
        "unit": fields.get("Units", ""),
        "range": fields.get("Range", ""),
        "values": {one.get("code", ""): one.text or "" for one in (listed if listed is not None else ())},
        "bits": bits is not None,
        "reboot": fields.get("RebootRequired") == "True",
    }


def found(names: Iterable[str], words: str, documented: Mapping[str, About]) -> list[str]:
    """The names in which, or in whose documentation, all words are; first those that have them in name or title."""
    wanted = words.casefold().split()

    def rank(name: str) -> int:
        about = documented.get(name)
        short = f"{name} {about['title'] if about else ''}".casefold()
        if all(word in short for word in wanted):
            return 0
        long = f"{short} {about['text'] if about else ''}".casefold()
        return 1 if all(word in long for word in wanted) else 2

    ranked = sorted((rank(name), name) for name in names)
    return [name for place, name in ranked if place < 2]
