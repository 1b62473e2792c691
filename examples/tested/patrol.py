"""Flies a triangle above a field and comes home. It ends, and sends nothing more, with the first call that fails."""

import os
import sys

import requests

API = os.environ.get("UAVAPI_URL", "http://127.0.0.1:8000")
CORNERS = [(30, 0), (15, 25), (0, 0)]  # m north and east of the start
HEIGHT = 10  # m above home


def call(path, **values):
    answer = requests.post(API + path, json=values, timeout=300)
    if not answer.ok:
        sys.exit(f"{path}: {answer.json()['detail']}")


call("/command/arm")
call("/command/takeoff", alt=HEIGHT)
for north, east in CORNERS:
    call("/movement/go_to_ned_wait", x=north, y=east, z=-HEIGHT)
call("/command/land")
