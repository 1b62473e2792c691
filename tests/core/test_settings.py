"""The rules of settings, once: with a table of our own, and those that every table must keep with each module's."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Set
from pathlib import Path
from typing import Any

import pytest
from MAVProxy.modules.lib.mp_settings import MPSetting

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.core.settings import TYPE_NAMES, ModuleSettings


def even(text: str) -> int:
    """What `pair` is parsed by."""
    if int(text) % 2:
        raise SettingError(f"{text} is odd")
    return int(text)


class DemoSettings(ModuleSettings[dict[str, Any]]):
    """A module `gradys` with one setting of each kind."""

    module = "gradys"
    secrets = frozenset({"password"})
    parsers = {"pair": even}

    @staticmethod
    def table() -> list[Any]:
        return [
            MPSetting("name", str, "", ""),
            MPSetting("low", int, 1, "", range=(0, 10)),
            MPSetting("high", float, 5.0, "", range=(0, 10)),
            MPSetting("loud", bool, False, ""),
            MPSetting("mode", str, "land", "", choice=("land", "hold")),
            MPSetting("pair", str, "2", ""),
            MPSetting("password", str, "", ""),
        ]

    def make(self, values: Mapping[str, Any], origins: Mapping[str, str]) -> dict[str, Any]:
        return {**values, "told": sorted(origins)}

    def check(self, settings: dict[str, Any], changed: Set[str]) -> None:
        self.last_changed = set(changed)
        if settings["low"] > settings["high"]:
            raise SettingError("low is above high", "low")

    def settings_in(self, ini: IniFile) -> Iterator[tuple[str, str]]:
        self.notes.append(str(ini.file))
        yield from super().settings_in(ini)


def demo(keywords: Mapping[str, Any] | None = None, **environ: str) -> DemoSettings:
    """Settings in an environment of their own."""
    return DemoSettings(keywords, environ)


def refused(settings: ModuleSettings[Any], name: str, value: Any) -> str:
    """The line with which a value is refused; it leaves everything as it was."""
    before = settings.snapshot(), settings.listing()
    with pytest.raises(SettingError) as caught:
        settings.set(name, value)
    assert (settings.snapshot(), settings.listing()) == before
    assert "\n" not in str(caught.value)
    return str(caught.value)


def origins(settings: ModuleSettings[Any]) -> dict[str, str]:
    """Where the listing says that each value came from."""
    return {line.split()[0]: line.split(maxsplit=1)[1] for line in settings.listing()}


# -- where they come from ----------------------------------------------------------------------------------


def test_later_origins_win_and_each_is_reported(ini: Callable[[str], str]) -> None:
    file = ini("[gradys]\nname = file\nlow = 2\nhigh = 6\nloud = on\n")
    settings = demo({"config": file, "high": 8, "loud": "off"}, GRADYS_LOW="3", GRADYS_HIGH="7", GRADYS_LOUD="yes")
    settings.set("loud", "1")
    now = settings.snapshot()
    assert (now["mode"], now["name"], now["low"], now["high"], now["loud"]) == ("land", "file", 3, 8.0, True)
    reported = origins(settings)
    assert reported["mode"] == "land                     default"
    assert reported["name"].endswith(f" {file}")
    assert reported["low"].endswith(" environment")
    assert reported["high"].endswith(" module load")
    assert reported["loud"].endswith(" gradys set")


def test_environment_may_name_the_file_where_no_keyword_does(ini: Callable[[str], str], tmp_path: Path) -> None:
    file = ini("[gradys]\nlow = 2\n")
    assert demo(UAVAPI_CONFIG=file).snapshot()["low"] == 2
    other = tmp_path / "other.ini"
    other.write_text("[gradys]\nname = other\n")
    now = demo({"config": str(other)}, UAVAPI_CONFIG=file).snapshot()
    assert (now["name"], now["low"]) == ("other", 1)
    assert demo(UAVAPI_CONFIG="").snapshot()["low"] == 1
    with pytest.raises(SettingError, match="No such file"):
        demo(UAVAPI_CONFIG=str(tmp_path / "nowhere.ini"))


@pytest.mark.parametrize("unset", ["", "None", "[]", "none"])
def test_what_is_not_given_leaves_what_was_before(ini: Callable[[str], str], unset: str) -> None:
    file = ini(f"[gradys]\nlow = {unset}\nhigh = 6\n")
    settings = demo({"config": file}, GRADYS_LOW=unset, GRADYS_HIGH=unset)
    assert (settings.snapshot()["low"], settings.snapshot()["high"]) == (1, 6)
    assert settings.origins == {"high": file}


def test_text_is_unset_at_the_prompt() -> None:
    settings = demo({"name": "x"})
    settings.set("name", "None")
    assert settings.snapshot()["name"] == ""


def test_other_sections_belong_to_others(ini: Callable[[str], str]) -> None:
    file = ini("[api]\nport = 1\nwhatever = 2\n[vision]\nlow = 9\n[gradys]\nlow = 2\n")
    assert demo({"config": file}).snapshot()["low"] == 2


def test_launcher_reports_where_it_had_them_from(ini: Callable[[str], str]) -> None:
    file = ini("[gradys]\nlow = 2\n")
    settings = demo({"config": file, "high": 6, "origins": {"high": "command line", "low": "uav.ini"}})
    assert settings.origins == {"low": "uav.ini", "high": "command line"}


# -- what is refused ---------------------------------------------------------------------------------------


def test_all_are_taken_together_in_whatever_order() -> None:
    assert demo({"low": 8, "high": 9}).snapshot() == demo({"high": 9, "low": 8}).snapshot()
    with pytest.raises(SettingError, match="^low is above high$"):
        demo({"low": 8})


def test_check_gets_what_was_changed() -> None:
    settings = demo({"low": 2}, GRADYS_NAME="x")
    assert settings.last_changed == {"low", "name"}
    settings.set("high", 3)
    assert settings.last_changed == {"high"}


def test_refusal_names_where_the_value_stands(ini: Callable[[str], str]) -> None:
    file = ini("[gradys]\nlow = many\n")
    with pytest.raises(SettingError) as caught:
        demo({"config": file})
    assert str(caught.value) == f"{file}: low = 'many': it takes a whole number from 0 to 10"
    with pytest.raises(SettingError, match="^GRADYS_LOW: low = '11': it takes a whole number from 0 to 10$"):
        demo(GRADYS_LOW="11")
    with pytest.raises(SettingError, match="^low = -1: it takes a whole number"):
        demo({"low": -1})
    with pytest.raises(SettingError) as caught:
        demo({"config": ini("[gradys]\nlow = 9\n")})
    assert str(caught.value) == f"{file}: low is above high"


def test_wrong_value_is_refused_though_a_later_one_replaces_it(ini: Callable[[str], str]) -> None:
    with pytest.raises(SettingError, match="it takes a whole number"):
        demo({"config": ini("[gradys]\nlow = many\n"), "low": 2})


def test_value_that_cannot_be_read_begins_with_its_name() -> None:
    settings = demo()
    settings.set("pair", 4)
    assert settings.snapshot()["pair"] == 4
    assert refused(settings, "pair", "3") == "pair: 3 is odd"
    assert refused(settings, "mode", "Land") == "mode = 'Land': it is one of land, hold"


def test_refusal_is_a_422_that_names_the_setting() -> None:
    with pytest.raises(SettingError) as caught:
        demo({"low": "many"})
    assert (caught.value.status, caught.value.code) == (422, "invalid")
    sentence = "low = 'many': it takes a whole number from 0 to 10"
    assert caught.value.detail == [{"loc": ["low"], "msg": sentence, "type": "value_error"}]


# -- what is shown -----------------------------------------------------------------------------------------


def test_secret_is_shown_nowhere() -> None:
    settings = demo({"password": "s3cret"})
    assert settings.shown("password") == "(set)"
    assert "s3cret" not in "".join(settings.listing())
    assert "s3cret" not in refused(settings, "password", ["s3cret"])
    assert demo().shown("password") == ""


def test_listing_is_of_a_name_a_beginning_or_a_pattern() -> None:
    settings = demo({"name": "a\x1b\nb"})
    assert [line.split()[0] for line in settings.listing()] == settings.names()
    assert [line.split()[0] for line in settings.listing("lo")] == ["low", "loud"]
    assert [line.split()[0] for line in settings.listing("*a*")] == ["name", "pair", "password"]
    assert settings.listing("low")[0] == "low      1                        default"
    assert settings.listing("name")[0] == r"name     a\x1b\nb                 module load"
    with pytest.raises(SettingError, match=r"^no setting 'lwo'; did you mean low\?$"):
        settings.listing("lwo")


def test_reports_have_the_values_and_no_secrets() -> None:
    settings = demo({"password": "hunter2", "high": 7})
    reports = {one["name"]: one for one in settings.reports()}
    assert list(reports) == settings.names()
    assert (reports["high"]["value"], reports["high"]["default"], reports["high"]["origin"]) == (
        7.0,
        5.0,
        "module load",
    )
    assert reports["loud"]["choices"] == ["true", "false"] and reports["mode"]["choices"] == ["land", "hold"]
    assert reports["low"]["accepts"] == "a whole number from 0 to 10"
    assert reports["password"]["value"] == "(set)" and "hunter2" not in str(reports)
    assert demo().reports()[-1]["value"] == ""


def test_a_single_setting_is_explained() -> None:
    assert demo({}).listing("low")[1:] == ["  : a whole number from 0 to 10; default 1"]
    assert demo({}).listing("loud")[1:] == ["  : true or false; default False"]


# -- every module's table ----------------------------------------------------------------------------------

MODULES = ("uavapi", "vision", "gradys")


@pytest.fixture(params=MODULES)
def kind(request: pytest.FixtureRequest) -> type[ModuleSettings[Any]]:
    """The settings of each of our modules."""
    if request.param == "vision":
        pytest.importorskip("cv2")
        from mavproxy_vision.settings import VisionModuleSettings

        return VisionModuleSettings
    if request.param == "gradys":
        from mavproxy_gradys.settings import GradysModuleSettings

        return GradysModuleSettings
    from mavproxy_uavapi.settings import ApiModuleSettings

    return ApiModuleSettings


def test_defaults_go_through_as_texts_and_change_nothing(kind: type[ModuleSettings[Any]]) -> None:
    settings = kind(environ={})
    before = settings.snapshot()
    for row in kind.table():
        settings.set(row.name, str(row.default))
        assert settings.origins.pop(row.name) == f"{kind.module} set"
    assert settings.snapshot() == before


def test_numbers_are_finite_and_in_their_range(
    kind: type[ModuleSettings[Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    settings = kind(environ={})
    for row in kind.table():
        if row.type in (int, float):
            low, high = row.range
            for value in ("nan", "inf", float("nan"), "1e400", "", "x", None, True, low - 1, high + 1):
                assert refused(settings, row.name, value) == (
                    f"{row.name} = {value!r}: it takes {TYPE_NAMES[row.type]} from {low} to {high}"
                )
            settings.set(row.name, low)
            settings.set(row.name, str(high))
            settings.set(row.name, row.default)
    assert capsys.readouterr() == ("", "")  # the line is all that is said


def test_truth_has_the_same_words_everywhere(kind: type[ModuleSettings[Any]]) -> None:
    settings = kind(environ={})
    for name in (row.name for row in kind.table() if row.type is bool):
        for word, meant in (("on", True), ("off", False), ("YES", True), ("no", False), ("1", True), ("0", False)):
            settings.set(name, word)
            assert getattr(settings.snapshot(), name) is meant
        for word in ("", "maybe", 2):
            assert refused(settings, name, word) == f"{name} = {word!r}: it takes true or false"


def test_misspelt_name_is_answered_with_the_nearest(
    kind: type[ModuleSettings[Any]], ini: Callable[[str], str]
) -> None:
    section = {"uavapi": "api"}.get(kind.module, kind.module)
    for name in kind.names():
        wrong = f"{name}q"
        assert refused(kind(environ={}), wrong, 1).startswith(f"no setting {wrong!r}; did you mean ")
        with pytest.raises(SettingError) as caught:
            kind({"config": ini(f"[{section}]\n{wrong} =\n")}, environ={})
        assert f": no key {wrong!r} in [{section}]; did you mean " in str(caught.value)
    assert refused(kind(environ={}), "qqqqqqqq", 1).endswith(f"; there are {', '.join(kind.names())}")


def test_unknown_section_is_refused_by_each(kind: type[ModuleSettings[Any]], ini: Callable[[str], str]) -> None:
    with pytest.raises(SettingError, match=r"no section \[vison\]; did you mean vision\?"):
        kind({"config": ini("[vison]\nsource = sim\n")}, environ={})


FILE = """
[api]
max_age = 6
gradys_gs = 10.0.0.5:8000

[logs]
debug = [COPTER]

[vision]
speed = 2
method = landing_target

[gradys]
period = 3
token = s3cret
"""


def test_one_file_is_for_all_three(kind: type[ModuleSettings[Any]], ini: Callable[[str], str]) -> None:
    settings = kind(environ={"UAVAPI_CONFIG": ini(FILE)})
    assert (
        set(settings.origins)
        == {
            "uavapi": {"max_age", "debug"},
            "vision": {"speed", "method"},
            "gradys": {"gs", "period", "token"},
        }[kind.module]
    )
    assert "s3cret" not in "".join(settings.listing())


def test_environment_has_every_setting(kind: type[ModuleSettings[Any]]) -> None:
    numbers = {row.name: row.range[1] for row in kind.table() if row.type in (int, float)}
    prefix = {"uavapi": "UAVAPI_", "vision": "VISION_", "gradys": "GRADYS_"}[kind.module]
    settings = kind(environ={prefix + name.upper(): str(high) for name, high in numbers.items()})
    now = settings.snapshot()
    assert {name: getattr(now, name) for name in numbers} == numbers
    assert settings.origins == dict.fromkeys(numbers, "environment")
