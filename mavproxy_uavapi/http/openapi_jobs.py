"""What the description says of each route that runs as a job."""

from __future__ import annotations

PREFER = {
    "name": "Prefer",
    "in": "header",
    "required": False,
    "schema": {"type": "string", "enum": ["respond-async"]},
    "description": "respond-async: same as wait=false",
}
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
