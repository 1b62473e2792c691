import pytest

from mavproxy_uavapi.sim import Home, Wind


def test_home_is_read_as_sitl_writes_it():
    assert Home.parse("-35.1,149.2,600,-90") == Home(-35.1, 149.2, 600.0, 270.0)


@pytest.mark.parametrize("text", ["", "1,2,3", "1,2,3,north", "99,0,0,0", "0,200,0,0"])
def test_a_bad_home_is_refused(text):
    with pytest.raises(ValueError):
        Home.parse(text)


@pytest.mark.parametrize("text", ["5", "-1,0", "x,y"])
def test_a_bad_wind_is_refused(text):
    with pytest.raises(ValueError):
        Wind.parse(text)
