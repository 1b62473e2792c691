"""`aerpawlib.v1.vehicle`: the classes of vehicles."""

from mavproxy_uavapi.aerpaw.drone import Drone
from mavproxy_uavapi.aerpaw.dummy_vehicle import DummyVehicle
from mavproxy_uavapi.aerpaw.rover import Rover
from mavproxy_uavapi.aerpaw.vehicle import Vehicle

__all__ = ["Drone", "DummyVehicle", "Rover", "Vehicle"]
