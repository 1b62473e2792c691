"""Runs aerpawlib's scripts through the HTTP API: `python -m mavproxy_uavapi.aerpaw --script FILE …`.

aerpawlib is AERPAW's experiment API. This package provides its module names, in a process that calls `names.serve`.
"""
