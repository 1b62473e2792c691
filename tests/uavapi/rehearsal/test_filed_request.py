from __future__ import annotations

from pathlib import Path

import pytest

from mavproxy_uavapi.rehearsal.filed_request import FiledRequest, request_in


@pytest.mark.parametrize(
    ("name", "text", "request_"),
    [
        ("a.track", "(1)", FiledRequest("/mission/fly-track", {"track": "(1)"}, {})),
        ("a.json", '{"path": "/vision/mission", "body": {"alt": 5}, "vision": {"fov": 60}}',
         FiledRequest("/vision/mission", {"alt": 5}, {"fov": 60})),
        ("a.json", '{"path": "/command/land"}', FiledRequest("/command/land", {}, {})),
        ("a.json", '{"items": []}', None),
        ("a.json", '{"path": 1}', None),
        ("a.json", "[1]", None),
        ("a.json", '{"path": ', None),
        ("a.plan", '{"path": "/command/land"}', None),
    ],
)  # fmt: skip
def test_file_is_a_request_if_it_says_the_path(
    tmp_path: Path, name: str, text: str, request_: FiledRequest | None
) -> None:
    (tmp_path / name).write_text(text)
    assert request_in(tmp_path / name) == request_
