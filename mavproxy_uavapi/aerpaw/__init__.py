"""A host for aerpawlib's scripts, which fly by the HTTP API: `python -m mavproxy_uavapi.aerpaw --script FILE …`.

aerpawlib is AERPAW's experiment API. Its names are served here, in a process that asked for it (`names.serve`).
"""
