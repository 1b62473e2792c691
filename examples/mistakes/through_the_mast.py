"""A mistake that no good flight shows: its way home is straight, whatever stands there. Without a list of what stands
on the field nothing tells; in the air the guard of the API would stop it in front of the mast.

    mavproxy-uavapi run through_the_mast.py --location CMAC                               # well
    mavproxy-uavapi run through_the_mast.py --location CMAC --envelope field.geojson      # broken: envelope
"""

import os
import sys

import requests

API = os.environ.get("UAVAPI_URL", "http://127.0.0.1:8000")


def call(path, **values):
    answer = requests.post(API + path, json=values, timeout=300)
    if not answer.ok:
        requests.post(API + "/command/rtl", timeout=300)
        sys.exit(f"{path}: {answer.json()['detail']}")


call("/command/arm")
call("/command/takeoff", alt=10)
for north, east in [(0, 20), (30, 20), (30, 0), (0, 0)]:
    call("/movement/go_to_ned_wait", x=north, y=east, z=-10)
call("/command/land")
