"""A mistake that no good flight shows: it tries again whatever it is told, also when the pilot has the vehicle.

    mavproxy-uavapi run after_the_pilot.py                                      # well
    mavproxy-uavapi run after_the_pilot.py --fault pilot_mode=LOITER@leg2       # broken: pilot

409 `mode_changed` says that the pilot has switched the mode: then nothing more is to be asked.
"""

import os
import time

import requests

API = os.environ.get("UAVAPI_URL", "http://127.0.0.1:8000")


def insist(path, **values):
    for _ in range(20):
        if requests.post(API + path, json=values, timeout=300).ok:
            return
        time.sleep(1)


insist("/command/arm")
insist("/command/takeoff", alt=10)
for north, east in [(20, 0), (20, 20), (0, 0)]:
    insist("/movement/go_to_ned_wait", x=north, y=east, z=-10)
insist("/command/land")
