"""What the description says of each route that runs as a job."""

from __future__ import annotations

HURRY = [
    {
        "name": "wait",
        "in": "query",
        "required": False,
        "schema": {"type": "boolean", "default": True},
        "description": "false: answer 202 at once with the job's number; the job goes on",
    },
    {
        "name": "on_disconnect",
        "in": "query",
        "required": False,
        "schema": {"type": "string", "enum": ["continue", "hold"]},
        "description": "what the vehicle does when the client hangs up; it overrides the setting of that name",
    },
    {
        "name": "lease",
        "in": "query",
        "required": False,
        "schema": {"type": "number", "minimum": 0, "maximum": 3600},
        "description": "s without a call of this client until `on_lease_end` is done; 0 gives the lease back",
    },
    {
        "name": "client",
        "in": "query",
        "required": False,
        "schema": {"type": "string", "pattern": "^[A-Za-z0-9_.:-]{1,64}$"},
        "description": "tells clients of one address apart, for leases",
    },
    {
        "name": "Prefer",
        "in": "header",
        "required": False,
        "schema": {"type": "string", "enum": ["respond-async"]},
        "description": "respond-async: same as wait=false",
    },
]
ACCEPTED = {
    "description": "It goes on as a job.",
    "headers": {"Location": {"description": "where the job is", "schema": {"type": "string"}}},
    "content": {
        "application/json": {
            "schema": {"$ref": "#/components/schemas/Success"},
            "example": {"device": "uav", "id": "1", "result": "Job 12 accepted", "job": "12"},
        }
    },
}
