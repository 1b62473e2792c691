"""`mavproxy-uavapi run FILE`: a script or a mission is flown on the embedded vehicle first, with what may go wrong.

`flight` flies the file and records the truth; `rules` says what was broken; `report` writes it down.
"""
