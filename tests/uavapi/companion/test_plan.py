from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mavproxy_uavapi.companion import plan
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.launcher.options import parse

USB = plan.Companion("/opt/uav/bin/mavproxy-uavapi", "/dev/ttyACM0", 115200, 3, False, ("2dae", "1016"))


@pytest.mark.parametrize(
    ("device", "connection"),
    [
        ("/dev/serial/by-id/usb-CubePilot-if00", ("usb", "/dev/serial/by-id/usb-CubePilot-if00,115200")),
        ("udpin:0.0.0.0:14550", ("udpin", "0.0.0.0:14550")),
    ],
)
def test_the_launcher_takes_the_settings(tmp_path: Path, device: str, connection: tuple[str, str]) -> None:
    file = tmp_path / "uav.ini"
    file.write_text(plan.settings(replace(USB, device=device)), encoding="utf-8")
    options = parse(["--config", str(file)])
    assert (options.connection_type, options.uav_connection) == connection
    assert (options.sysid, options.host) == (3, "127.0.0.1") and "tokens" not in options.further


def test_on_a_network_callers_need_a_token(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text(plan.settings(replace(USB, on_network=True)), encoding="utf-8")
    api = IniFile(file).section("api")  # the launcher also wants the folder of the tokens
    assert (api["host"], api["tokens"]) == ("0.0.0.0", str(plan.TOKENS))


def test_unit_starts_this_program_and_reads_home_only_where_it_is_there() -> None:
    lines = plan.unit(USB).split("\n")
    assert f'ExecStart="/opt/uav/bin/mavproxy-uavapi" --headless --config {plan.CONFIG}' in lines
    assert "ProtectHome=true" in lines
    assert 'ExecStart="/opt/50%% more/uav.pex"' in plan.unit(replace(USB, program="/opt/50% more/uav.pex"))
    assert "ProtectHome=read-only" in plan.unit(replace(USB, program="/home/pi/uav.pex"))


def test_only_usb_needs_a_rule() -> None:
    assert plan.files(USB).keys() == {plan.CONFIG, plan.UNIT, plan.RULE}
    assert 'ATTRS{idVendor}=="2dae"' in plan.files(USB)[plan.RULE]
    assert plan.files(replace(USB, usb=None)).keys() == {plan.CONFIG, plan.UNIT}
