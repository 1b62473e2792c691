"""Words that may mean a limit: what a name in a file says, and what comes too near to be overlooked. Pure."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable, Mapping
from typing import Any

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.strict_json import shown

MOST_MEMBERS = 200  # of an object whose names are looked at
NEAR = 0.8  # difflib's ratio from which a member may be a slip of the pen …
NEAR_KIND = 0.85  # … and a word of a name: `conclusion` is none
# A word of a name that nobody gives to what limits nothing.
LIMITING = frozenset((
    "alt", "altitude", "altitudes", "height", "heights", "ceiling", "floor", "radius", "diameter", "top", "bottom",
    "max", "min", "maximum", "minimum", "limit", "limits", "speed", "distance", "reserve", "endurance", "kind",
    "inclusion", "exclusion", "include", "exclude", "included", "excluded", "agl", "amsl", "msl", "upper", "lower",
    "vertical", "altura", "altitud", "altezza", "hauteur", "hohe", "hoogte", "limite", "teto", "techo", "plafond",
    "obergrenze", "untergrenze",
))  # fmt: skip
# What programs add to each feature, and what limits nothing: KML by GDAL and QGIS, and the style of geojson.io.
HARMLESS = frozenset({"altitudemode", "extrude", "tessellate", "visibility", "draworder", "icon"})
# In English, German, French, Spanish, Portuguese, Italian and Dutch.
EXCLUDED = re.compile(
    "exclu|esclu|ausschlu|uitslui|nofly|nogo|noentry|nfz|keepout|stayout|offlimits|avoid|hazard|obstac|prohib|proib|"
    "forbid|restri[cnt]|ristrett|reglement|interdi|vietat|verbot|verbode|sperr|danger|gefahr|gevaar|perigo|peligro|"
    "pericol",
    re.IGNORECASE,
)
INCLUDED = re.compile("inclu|einschlu|keepin|stayin", re.IGNORECASE)
KIND_WORDS = ("exclusion", "inclusion", "exclude", "include", "exclusions", "inclusions")


def require_no_limit(members: Mapping[str, Any], known: Iterable[str], where: str, *loc: str) -> None:
    """Refuse a member that may be meant as one of `known`, or as another limit: it would not be in force.

    Args:
        members: of an object; those that are null limit nothing.
        known: the names that are read.
        where: begins the error, such as `feature 3`.
        loc: the path to the object.

    Raises:
        Invalid: there is one; it names it, and the nearest known name.
    """
    names = list(known)
    if len(members) > MOST_MEMBERS:
        raise Invalid(f"{where} has more than {MOST_MEMBERS} members", *loc)
    for name, value in members.items():
        if name in names or value is None or _letters(name) in HARMLESS:
            continue
        letters = _letters(name)
        nearest = [letters] if letters in names else difflib.get_close_matches(letters, names, n=1, cutoff=NEAR)
        if nearest or LIMITING & set(_words(name)):
            hint = (
                f"did you mean {nearest[0]}?"
                if nearest
                else f"there are {', '.join(names) or 'none; GeoJSON has them'}"
            )
            raise Invalid(f"{where} has {shown(name)}, which is no limit here; {hint}", *loc)


def kind_of(name: str) -> bool | None:
    """Whether a name of an area or a folder says inclusion (True) or exclusion (False); None if it says neither.

    Raises:
        Invalid: it says both, or has a word that is nearly one of the two.
    """
    letters = "".join(_letters(word) for word in name.split())
    excluded, included = EXCLUDED.search(letters), INCLUDED.search(letters)
    if excluded and included:
        raise Invalid(f"the name {shown(name)} says exclusion and inclusion: say one of them")
    if not excluded and not included:
        for word in _words(name):
            nearest = difflib.get_close_matches(word, KIND_WORDS, n=1, cutoff=NEAR_KIND)
            if nearest:
                raise Invalid(f"the name {shown(name)} has {word!r}; did you mean {nearest[0]}?")
        return None
    return included is not None


def says_exclusion(text: str) -> bool:
    """Whether a text has a word for an exclusion in it."""
    return bool(EXCLUDED.search(_letters(text)))


def _letters(name: str) -> str:
    """A name without marks, spaces and case: `Exclusión` and `ex-clusion` are `exclusion`."""
    plain = unicodedata.normalize("NFKD", name)
    return "".join(letter for letter in plain if letter.isascii() and letter.isalpha()).lower()


def _words(name: str) -> list[str]:
    """The words of `max_alt`, `maxAlt`, `Max Alt`."""
    plain = "".join(letter for letter in unicodedata.normalize("NFKD", name) if not unicodedata.combining(letter))
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", plain)]
