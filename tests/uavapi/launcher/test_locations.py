from __future__ import annotations

import pytest

from mavproxy_uavapi.launcher import locations
from mavproxy_uavapi.launcher.errors import OptionError


def test_location_by_name_numbers_and_files(tmp_path):
    assert locations.resolve("CMAC") == (-35.363261, 149.165230, 584, 353)
    assert locations.resolve("1.5,2.5,30,90") == (1.5, 2.5, 30, 90)
    autotest = tmp_path / "ap" / "Tools" / "autotest"
    autotest.mkdir(parents=True)
    (autotest / "locations.txt").write_text("# names\nHill=1,2,3,4 # a hill\nPond=5,6,7,8\nbroken line\n")
    (tmp_path / "locations.txt").write_text("Pond=50,60,70,80\n")
    assert locations.resolve("Hill", str(tmp_path / "ap")) == (1, 2, 3, 4)
    assert locations.resolve("Pond", str(tmp_path / "ap")) == (50, 60, 70, 80)
    with pytest.raises(OptionError):
        locations.resolve("Hill")
