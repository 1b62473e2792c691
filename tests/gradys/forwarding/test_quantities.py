from __future__ import annotations

from pathlib import Path

import pytest

from mavproxy_gradys.forwarding.quantities import Quantity, parse_quantities, parse_quantity
from mavproxy_uavapi.core.errors import SettingError

ALT = parse_quantity("alt=GLOBAL_POSITION_INT.relative_alt*0.001@1[m]")


def test_a_quantity_as_it_is_written() -> None:
    assert Quantity("alt", "GLOBAL_POSITION_INT", "relative_alt", None, 0.001, 0.0, 1.0, "m") == ALT
    cell = parse_quantity("cell1=BATTERY_STATUS[0].voltages[1]*1e-3-0.5@10[V, loaded]")
    assert cell == Quantity("cell1", "BATTERY_STATUS[0]", "voltages", 1, 0.001, -0.5, 10.0, "V, loaded")
    assert parse_quantity("kelvin=SCALED_PRESSURE.temperature*0.01+273.15").offset == 273.15
    assert parse_quantity("position@2").period == 2.0


def test_a_list_by_comma_semicolon_or_space() -> None:
    text = (
        "position@1, alt=GLOBAL_POSITION_INT.relative_alt*0.001[m, above home];v=SYS_STATUS.load hdg=VFR_HUD.heading"
    )
    assert [quantity.name for quantity in parse_quantities(text)] == ["position", "alt", "v", "hdg"]
    assert parse_quantities("") == ()


@pytest.mark.parametrize(
    "text",
    [
        "alt",
        "alt=",
        "alt=X",
        "alt=X.y*",
        "alt=X.y@0",
        "alt=X.y@nan",
        "a/b=X.y",
        "a b",
        "alt=X.y*1.2.3",
        "alt=X.y*1e400",
        "alt=X.y+1e400",
        "alt=X.y,alt=X.z",
        "status=X.y",
    ],
)
def test_what_is_no_quantity_is_refused(text: str) -> None:
    with pytest.raises(SettingError):
        parse_quantities(text)


def test_a_sensor_is_a_file() -> None:
    soil = parse_quantity("soil=file:/run/soil.txt@5[percent]")
    assert soil == Quantity("soil", period=5.0, representation="percent", file="/run/soil.txt")
    assert soil.is_sensor and not soil.is_text
    assert not ALT.is_sensor
    assert parse_quantity("core=file:/sys/class/thermal/thermal_zone0/temp*0.001-2@10[degC]") == Quantity(
        "core",
        scale=0.001,
        offset=-2.0,
        period=10.0,
        representation="degC",
        file="/sys/class/thermal/thermal_zone0/temp",
    )
    assert parse_quantity("a=file:~/a").file == str(Path("~/a").expanduser())


def test_a_number_that_ends_a_files_name_is_no_offset() -> None:
    assert parse_quantity("a=file:/run/probe-1@2").file == "/run/probe-1"
    quoted = parse_quantity('a=file:"/run/my @ probe, [1]"-1')
    assert (quoted.file, quoted.offset) == ("/run/my @ probe, [1]", -1.0)


def test_a_sensor_is_a_command_without_a_shell() -> None:
    command = parse_quantity("p=exec:\"read-pressure --name 'a b' | tee x\"*0.01@30[hPa]")
    assert command.command == ("read-pressure", "--name", "a b", "|", "tee", "x")
    assert (command.scale, command.period, command.representation) == (0.01, 30.0, "hPa")
    assert parse_quantity("p=exec:/opt/p").command == ("/opt/p",)


def test_a_text_is_asked_for_by_its_representation() -> None:
    assert parse_quantity("gps=file:/tmp/gps_data@5[raw]").is_text
    assert parse_quantity("gps=file:/tmp/gps_data@5[text]").is_text
    assert not parse_quantity("gps=X.y@5[text]").is_text  # a message's field has a type of its own


def test_quotes_and_brackets_hold_a_part_of_a_list_together() -> None:
    text = 'a=exec:"x -f 1, 2;3"@5[m, "AMSL"] b=file:"/a b",position@1\n  c=X.y[inch "]'
    assert [quantity.name for quantity in parse_quantities(text)] == ["a", "b", "position", "c"]


@pytest.mark.parametrize(
    "text",
    [
        "a=file:", "a=file:relative.txt", "a=exec:", "a=exec:\"\"", "a=exec:\" \"", "a=exec:\"it's\"",
        "a=exec:x@0.5", "a=file:/x@0.01", "a=file:/x*2@5[raw]", "a=file:/x*1e400", "position=file:/x",
        "a=file:/x y", "a=file:\"/x", "a=pipe:/x", "a=exec:\"x\0\"", "a=file:/x\0", "file:/x",
    ],
)  # fmt: skip
def test_what_is_no_sensor_is_refused(text: str) -> None:
    with pytest.raises(SettingError):
        parse_quantities(text)
