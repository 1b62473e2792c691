import pytest

from mavproxy_uavapi.sim.options import Options, Wind
from mavproxy_uavapi.sim.parameters import ParameterStore
from mavproxy_uavapi.sim.simulator import Simulator
from mavproxy_uavapi.sim.weather import Weather


@pytest.fixture
def parameters() -> ParameterStore:
    store = ParameterStore()
    store.set("SIM_WIND_SPD", 8.0)
    store.set("SIM_WIND_DIR", 270.0)
    return store


@pytest.mark.parametrize(
    ("law", "height", "speed"),
    [(0, 15, 4), (0, 60, 8), (0, 500, 8), (0, -3, 0), (1, 0, 8), (2, 160, 9), (2, 10, 7.5)],
)
def test_wind_grows_with_height_as_its_parameters_say(
    parameters: ParameterStore, law: int, height: float, speed: float
) -> None:
    parameters.set("SIM_WIND_T", law)
    assert Weather(parameters).at(height) == pytest.approx((0.0, speed), abs=1e-6)


def test_wind_changes_in_flight() -> None:
    simulator = Simulator(Options(wind=Wind(4.0, 90.0)))
    simulator.parameters.set("SIM_WIND_T", 1)
    simulator.run(1.0)
    assert simulator.vehicle.body.wind_east == pytest.approx(-4.0)
    simulator.parameters.set("SIM_WIND_SPD", 12.0)
    simulator.run(30.0)
    assert simulator.vehicle.body.wind_east == pytest.approx(-12.0, abs=0.1)
