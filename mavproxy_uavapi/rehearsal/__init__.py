"""`mavproxy-uavapi run FILE`: a script or a mission is flown on the embedded vehicle first, with what may go wrong.

`flight` flies the file and records the truth; `rules` says what was broken; `report` writes it down.
"""

import os

os.environ["MAVLINK20"] = (
    "1"  # before pymavlink is imported: the API knows messages of MAVLink 2, as MAVProxy sets it
)
