"""/settings: who sees them, who may set which of them, and what the trail says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.remote_settings import LONGEST, RemoteSettings
from mavproxy_uavapi.settings import ACCESS, LISTENING, SETTABLE, ApiModuleSettings
from mavproxy_vision.settings import VisionModuleSettings
from tests.support import tokens
from tests.support.drone import Drone
from tests.uavapi.http.conftest import Api

# By setting, what a caller with the token would gain by it: access, a program or a file of his choice, more than his
# limits, a way round the operator's bounds of flight, or a prompt that no longer shows what he does.
THE_PROMPTS = {
    **dict.fromkeys([*ACCESS, *LISTENING], "192.168.0.0/16"),
    "allow_raw": True,
    "read_only": True,
    "python_path": "/tmp/mine",
    **dict.fromkeys(["scripts_path", "script_logs", "vehicle_logs", "flights", "log_path", "tiles"], "/etc"),
    **dict.fromkeys(["max_jobs", "max_connections", "max_rate", "script_size", "script_quota", "flights_quota"], 900),
    "tile_source": "https://mine.example.org/{z}/{x}/{y}",
    "tile_licence": "mine",
    "envelope": "",
    "separation": 0,
    "rehearse": "off",
    "log_console": "",
}


VISION = VisionModuleSettings({"source": "rtsp://eye:hidden@10.0.0.8/video"}, environ={})


@pytest.fixture
def settings(api: Api, drone: Drone, host: Host) -> ApiModuleSettings:
    """The settings of a module whose API this is; the drone's messages turn the main loop."""
    settings = ApiModuleSettings({"token": "s3cret"}, environ={})

    async def settled() -> None:
        api.service.settings = replace(settings.snapshot(), tokens=api.service.settings.tokens)

    api.service.settings = replace(settings.snapshot(), token="")
    api.service.remote_settings = RemoteSettings(
        host.bridge,
        settings,
        settings.set,
        settled,
        [SimpleNamespace(module_settings=one) for one in (settings, VISION)],
    )
    return settings


def put(api: Api, name: str, value: Any, **more: Any) -> Any:
    return api.loop.run(api.ask("PUT", f"/settings/{name}", json={"value": value}, **more))


def listed(api: Api, **more: Any) -> dict[str, Any]:
    return {setting["name"]: setting for setting in api.get("/settings", **more).body["settings"]}


def as_admin() -> dict[str, Any]:
    return {"headers": {"Authorization": "Bearer s3cret"}}


def test_settings_are_listed_with_what_they_take_and_without_secrets(api: Api, settings: ApiModuleSettings) -> None:
    listing = listed(api)
    assert list(listing) == settings.names()
    assert listing["max_age"] == {
        "name": "max_age",
        "value": 5.0,
        "meaning": "s after which telemetry is stale",
        "unit": "s",
        "accepts": "a number from 0.1 to 3600",
        "choices": [],
        "default": 5.0,
        "origin": "default",
        "settable": True,
    }
    assert listing["on_conflict"]["choices"] == ["refuse", "wait"]
    assert (listing["token"]["value"], listing["token"]["settable"]) == ("(set)", False)
    assert "s3cret" not in str(listing)


def test_other_modules_settings_have_no_passwords_and_are_the_prompts(api: Api, settings: ApiModuleSettings) -> None:
    answer = api.get("/settings").body
    assert list(answer["modules"]) == ["vision"]
    listing = {setting["name"]: setting for setting in answer["modules"]["vision"]}
    assert list(listing) == VISION.names()
    assert not any(setting["settable"] for setting in listing.values())
    assert (listing["source"]["value"], listing["fps"]["value"]) == ("rtsp://eye:***@10.0.0.8/video", 20.0)
    assert put(api, "fps", 5).status == 404
    assert VISION.snapshot().fps == 20.0


def test_new_value_is_in_force_in_the_audit_trail_and_on_the_prompt(
    api: Api, settings: ApiModuleSettings, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = put(api, "max_age", 7)
    assert (answer.status, answer.body["result"], answer.body["value"]) == (200, "max_age is 7.0", 7.0)
    assert api.service.settings.max_age == 7
    assert listed(api, **as_admin())["max_age"]["origin"] == "uavapi set"
    (entry,) = api.service.host.audit.entries
    assert (entry.verb, entry.request, entry.outcome) == ("/settings/max_age", {"value": 7}, "ok")
    assert capsys.readouterr().out == "uavapi: max_age is 7.0, set by 127.0.0.1\n"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("max_age", 0),
        ("max_age", "NaN"),
        ("max_age", "1e400"),
        ("max_age", True),
        ("max_age", None),
        ("max_age", [1]),
        ("max_age", "x" * 501),
        ("on_disconnect", "explode"),
        ("debug", "NOBODY"),
    ],
)
def test_value_that_the_prompt_would_refuse_is_refused(
    api: Api, settings: ApiModuleSettings, capsys: pytest.CaptureFixture[str], name: str, value: Any
) -> None:
    before = settings.snapshot()
    assert put(api, name, value).status == 422
    assert settings.snapshot() == before
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("name", THE_PROMPTS)
def test_what_would_give_a_caller_more_is_the_prompts(api: Api, settings: ApiModuleSettings, name: str) -> None:
    before = settings.snapshot()
    answer = put(api, name, THE_PROMPTS[name])
    assert (answer.status, answer.body["code"]) == (422, "invalid")
    (problem,) = answer.body["detail"]
    assert problem["loc"] == ["body", name]
    assert problem["msg"] == f"it is set at MAVProxy's prompt only: `uavapi set {name} …`"
    assert settings.snapshot() == before
    assert not listed(api)[name]["settable"]


def test_every_setting_is_judged() -> None:
    assert {*THE_PROMPTS, *SETTABLE} == set(ApiModuleSettings.names())
    assert not SETTABLE & THE_PROMPTS.keys()


def test_secret_that_somebody_tries_to_set_is_not_in_the_audit_trail(api: Api, settings: ApiModuleSettings) -> None:
    assert put(api, "token", "hunter2").status == 422
    (entry,) = api.service.host.audit.entries
    assert (entry.verb, entry.outcome) == ("/settings/token", "invalid")
    assert "hunter2" not in str(entry) + str(entry.request)


def test_setting_that_does_not_exist_is_404_and_names_the_nearest(api: Api, settings: ApiModuleSettings) -> None:
    answer = put(api, "max_agee", 3)
    assert answer.status == 404
    assert "did you mean max_age?" in answer.body["detail"]


def test_caller_of_this_machine_may_set_and_one_of_a_network_may_look(api: Api, settings: ApiModuleSettings) -> None:
    proxied = {"headers": {"X-Forwarded-For": "10.0.0.9"}}
    api.service.settings = replace(api.service.settings, allow_open=True)
    assert put(api, "max_age", 3, **proxied).status == 403
    assert not any(setting["settable"] for setting in listed(api, **proxied).values())
    assert settings.snapshot().max_age == 5


@pytest.mark.parametrize(("name", "status"), [("tower", 403), ("anna", 403), ("boss", 200), ("", 401)])
def test_roles(api: Api, settings: ApiModuleSettings, tmp_path: Path, name: str, status: int) -> None:
    file = tokens.write(tmp_path / "tokens", tokens.ALL)
    api.service.settings = replace(api.service.settings, tokens=file)
    api.service.tokens.use(file)
    api.service.tokens.take()
    answer = api.get("/settings", headers=tokens.bearer(name))
    assert answer.status == (200 if name else 401)
    if name:
        assert any(setting["settable"] for setting in answer.body["settings"]) == (name == "boss")
    assert put(api, "max_age", 3, headers=tokens.bearer(name)).status == status
    assert settings.snapshot().max_age == (3 if status == 200 else 5)


def test_page_of_another_site_sets_nothing(api: Api, settings: ApiModuleSettings) -> None:
    for headers in ({"Origin": "http://evil.example"}, {"User-Agent": "Mozilla/5.0 (X11) Firefox/127.0"}):
        assert put(api, "max_age", 3, headers=headers).status == 403
    assert settings.snapshot().max_age == 5


def test_unchangeable_setting_is_refused_and_a_standing_loop_is_a_timeout(
    api: Api, settings: ApiModuleSettings, host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(name: str, _value: Any) -> None:
        raise SettingError(f"{name}: not now", name)

    remote = api.service.remote_settings
    monkeypatch.setattr(remote, "_change", refuse)
    assert put(api, "max_age", 3).status == 422
    monkeypatch.setattr(
        host.bridge, "_calls", type("Standing", (), {"put": lambda *_, **__: None, "drain": lambda *_: None})()
    )
    before = api.loop.time()
    assert put(api, "max_age", 3).status == 504
    assert LONGEST <= api.loop.time() - before < LONGEST + 1
    assert api.get("/settings").status == 504
    monkeypatch.undo()


def test_without_a_module_there_are_no_settings(api: Api, drone: Drone) -> None:
    assert api.get("/settings").status == 404
    assert put(api, "max_age", 3).status == 404
