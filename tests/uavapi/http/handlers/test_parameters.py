from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from mavproxy_uavapi.core.host import Host
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


@pytest.fixture(autouse=True)
def known(drone: Drone, loop: FastLoop, host: Host) -> None:
    """MAVProxy has fetched some of the parameters before."""
    loop.settle()
    host.fleet.learn({(1, 1): {"WPNAV_SPEED": 1000.0, "RTL_ALT": 1500.0}})


def test_what_mavproxy_knows_is_listed(api: Api) -> None:
    assert api.get("/parameters").body["parameters"] == {"RTL_ALT": 1500.0, "WPNAV_SPEED": 1000.0}
    assert api.get("/parameters?match=wpnav_*").body["parameters"] == {"WPNAV_SPEED": 1000.0}


def test_a_parameter_is_read_from_the_vehicle(api: Api, drone: Drone) -> None:
    drone.parameters["WPNAV_SPEED"] = 700.0
    body = api.get("/parameters/wpnav_speed").body
    assert (body["name"], body["value"]) == ("WPNAV_SPEED", 700.0)


@pytest.mark.parametrize("name", ["NO_SUCH", "A-B", "TOO_LONG_FOR_A_PARAMETER"])
def test_what_the_vehicle_does_not_have_is_404(api: Api, name: str) -> None:
    assert api.get(f"/parameters/{name}").status == 404
    assert api.loop.run(api.ask("PUT", f"/parameters/{name}", json={"value": 1})).status == 404


def put(api: Api, name: str, value: Any) -> Any:
    return api.loop.run(api.ask("PUT", f"/parameters/{name}", json={"value": value}))


def test_a_new_value_is_read_back(api: Api, drone: Drone, host: Host) -> None:
    answer = put(api, "WPNAV_SPEED", 500)
    assert (answer.status, answer.body["value"]) == (200, 500.0)
    assert drone.parameters["WPNAV_SPEED"] == 500.0
    assert api.get("/parameters").body["parameters"]["WPNAV_SPEED"] == 500.0
    assert [(entry.verb, entry.request) for entry in host.audit.entries] == [
        ("/parameters/WPNAV_SPEED", {"value": 500})
    ]


@pytest.mark.parametrize("value", ["fast", None, 1e39, True, "1e400"])
def test_what_is_no_value_is_422(api: Api, drone: Drone, value: Any) -> None:
    assert put(api, "WPNAV_SPEED", value).status == 422
    assert drone.orders() == []


def test_a_value_that_is_never_confirmed_is_504(api: Api, drone: Drone, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drone, "_tell_parameter", lambda _name: None)
    assert (answer := put(api, "WPNAV_SPEED", 500)).status == 504, answer.body


def test_many_are_set_and_each_failure_is_reported(api: Api, drone: Drone, host: Host) -> None:
    body = {"parameters": {"wpnav_speed": 600, "RTL_ALT": 2000, "NO_SUCH": 1}}
    answer = api.post("/parameters", body)
    assert answer.status == 207
    assert answer.body["parameters"] == {"WPNAV_SPEED": 600.0, "RTL_ALT": 2000.0}
    assert answer.body["failed"]["NO_SUCH"]["code"] == "not_found"
    (entry,) = host.audit.entries
    assert entry.request == body
    assert (entry.outcome, entry.detail) == ("partly", "2 of 3 parameters are set, but not NO_SUCH")


def test_a_param_file_goes_out_and_in_again(api: Api, drone: Drone, loop: FastLoop) -> None:
    async def text() -> str:
        async with api.client.get("/parameters.param") as response:
            return await response.text()

    saved = loop.run(text())
    assert saved.splitlines() == ["RTL_ALT          1500", "WPNAV_SPEED      1000"]
    put(api, "WPNAV_SPEED", 300)
    answer = loop.run(api.ask("POST", "/parameters", data=f"# saved\n{saved}\n"))
    assert (answer.status, answer.body["result"]) == (200, "2 of 2 parameters are set")
    assert drone.parameters["WPNAV_SPEED"] == 1000.0


@pytest.mark.parametrize(
    "body",
    [
        "FORMAT_VERSION 0\nSYSID_THISMAV 7\nRTL_ALT 2000\n",
        '{"parameters": {"format_version": 0, "SYSID_THISMAV": 7, "RTL_ALT": 2000}}',
    ],
)
def test_a_list_neither_erases_the_vehicle_nor_makes_another_of_it(
    api: Api, drone: Drone, loop: FastLoop, body: str
) -> None:
    drone.parameters |= {"FORMAT_VERSION": 120.0, "SYSID_THISMAV": 1.0}
    answer = loop.run(api.ask("POST", "/parameters", data=body))
    assert answer.status == 200
    assert answer.body["result"] == "1 of 1 parameters are set; left out: FORMAT_VERSION, SYSID_THISMAV"
    assert answer.body["left_out"].keys() == {"FORMAT_VERSION", "SYSID_THISMAV"}
    assert (drone.parameters["FORMAT_VERSION"], drone.parameters["SYSID_THISMAV"]) == (120.0, 1.0)
    assert drone.parameters["RTL_ALT"] == 2000.0
    answer = loop.run(api.ask("POST", "/parameters", data="FORMAT_VERSION 0"))
    assert (answer.status, answer.body["code"]) == (422, "invalid")


@pytest.mark.parametrize(
    "body", ["AHRS_TRIM_X 0.1\nRTL_ALT 2000", '{"parameters": {"AHRS_TRIM_X": 0.1, "RTL_ALT": 2000}}']
)
def test_a_calibration_is_set_by_a_list_that_says_to_be_of_this_airframe(
    api: Api, drone: Drone, loop: FastLoop, body: str
) -> None:
    drone.parameters |= {"AHRS_TRIM_X": 0.0}
    answer = loop.run(api.ask("POST", "/parameters", data=body))
    assert answer.body["left_out"].keys() == {"AHRS_TRIM_X"}
    assert drone.parameters["AHRS_TRIM_X"] == 0.0
    answer = loop.run(api.ask("POST", "/parameters?restore=true", data=body))
    assert answer.body["left_out"] == {}
    assert drone.parameters["AHRS_TRIM_X"] == 0.1


@pytest.mark.parametrize(
    "text",
    ['{"parameters": {"RTL_ALT": 1}, "restore": true}', '{"parameters": {"RTL_ALT": 1, "rtl_alt": 2}}'],
)
def test_what_a_list_has_besides_or_twice_is_refused(api: Api, drone: Drone, loop: FastLoop, text: str) -> None:
    assert loop.run(api.ask("POST", "/parameters", data=text)).status == 422
    assert drone.orders() == []


def test_of_many_that_are_left_out_the_sentence_names_a_few(api: Api, loop: FastLoop) -> None:
    text = "".join(f"COMPASS_OFS{number}_X 1\n" for number in range(10)) + "RTL_ALT 2000"
    answer = loop.run(api.ask("POST", "/parameters", data=text))
    assert answer.body["result"].endswith("COMPASS_OFS7_X and 2 more")
    assert len(answer.body["left_out"]) == 10


@pytest.mark.parametrize("text", ["WPNAV_SPEED", "A B C", "{", "\xff", "[1]", '{"parameters": 3}', ""])
def test_what_is_no_list_of_values_is_refused(api: Api, drone: Drone, loop: FastLoop, text: str) -> None:
    answer = loop.run(api.ask("POST", "/parameters", data=text.encode("latin-1")))
    assert answer.status in (400, 422)
    assert drone.orders() == []


def test_reboot_answers_when_it_has_booted(api: Api, drone: Drone) -> None:
    answer = api.get("/command/reboot")
    assert (answer.status, answer.body["result"]) == (200, "The autopilot has booted")


def test_reboot_in_flight_is_busy(api: Api, flying: Drone) -> None:
    answer = api.get("/command/reboot")
    assert (answer.status, answer.body["code"]) == (409, "busy")
    assert flying.orders() == []


PDEF = """<?xml version="1.0"?><paramfile><vehicles><parameters name="ArduCopter">
<param humanName="RTL Altitude" name="ArduCopter:RTL_ALT" documentation="The minimum alt above home to return at">
<field name="Units">cm</field><field name="Range">30 300000</field></param></parameters></vehicles><libraries>
<parameters name="WPNAV_"><param humanName="Waypoint speed" name="WPNAV_SPEED" documentation="How fast in a mission">
<field name="RebootRequired">True</field></param></parameters><parameters name="BATT_">
<param humanName="Battery monitoring" name="BATT_MONITOR" documentation="">
<values><value code="0">Disabled</value><value code="4">Analog</value></values></param>
<param humanName="Options" name="BATT_OPTIONS" documentation="of a monitor">
<bitmask><bit code="1">Ignore</bit></bitmask></param></parameters></libraries></paramfile>"""


@pytest.fixture
def documented(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, loop: FastLoop) -> Path:
    """ArduPilot's documentation, as MAVProxy's `param download` fetches it."""
    loop.real_wait = 2.0
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / ".mavproxy").mkdir()
    file = tmp_path / ".mavproxy" / "Copter.xml"
    file.write_text(PDEF, encoding="utf-8")
    return file


def test_words_find_what_the_documentation_has_and_titles_come_first(api: Api, host: Host, documented: Path) -> None:
    host.fleet.learn({(1, 1): {"BATT_MONITOR": 4.0, "BATT_OPTIONS": 0.0}})
    found = lambda words: list(api.get(f"/parameters?words={words}").body["parameters"])  # noqa: E731
    assert found("battery") == ["BATT_MONITOR"]
    assert found("monitor") == ["BATT_MONITOR", "BATT_OPTIONS"]
    assert found("return%20HOME") == ["RTL_ALT"]
    assert found("wpnav") == ["WPNAV_SPEED"]
    assert found("return%20battery") == []
    assert list(api.get("/parameters?words=monitor&match=*OPT*").body["parameters"]) == ["BATT_OPTIONS"]


def test_the_documentation_tells_units_ranges_values_and_bits(api: Api, host: Host, documented: Path) -> None:
    host.fleet.learn({(1, 1): {"BATT_MONITOR": 4.0, "BATT_OPTIONS": 0.0}})
    body = api.get("/parameters?about=true").body
    about = body["about"]
    assert body["documented"] and list(about) == ["BATT_MONITOR", "BATT_OPTIONS", "RTL_ALT", "WPNAV_SPEED"]
    assert (about["RTL_ALT"]["title"], about["RTL_ALT"]["unit"]) == ("RTL Altitude", "cm")
    assert (about["RTL_ALT"]["range"], about["RTL_ALT"]["values"]) == ("30 300000", {})
    assert (about["BATT_MONITOR"]["values"], about["BATT_MONITOR"]["bits"]) == (
        {"0": "Disabled", "4": "Analog"},
        False,
    )
    assert (about["BATT_OPTIONS"]["values"], about["BATT_OPTIONS"]["bits"]) == ({"1": "Ignore"}, True)
    assert (about["WPNAV_SPEED"]["reboot"], about["RTL_ALT"]["reboot"]) == (True, False)


def test_without_a_documentation_words_are_those_of_names(api: Api, documented: Path) -> None:
    documented.unlink()
    body = api.get("/parameters?words=alt&about=true").body
    assert (body["parameters"], body["documented"], body["about"]) == ({"RTL_ALT": 1500.0}, False, {})
    documented.write_text("<paramfile><param", encoding="utf-8")
    assert api.get("/parameters?words=alt").status == 404


def test_a_documentation_that_cannot_be_read_is_a_sentence(
    api: Api, documented: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(ElementTree, "iterparse", refuse)
    answer = api.get("/parameters?words=alt")
    assert answer.status == 404
    assert "Copter.xml: " in answer.body["detail"] and "Errno" not in answer.body["detail"]
