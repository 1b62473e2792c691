from __future__ import annotations

from pathlib import Path

import pytest

from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support import tokens
from tests.uavapi.http.conftest import Api


@pytest.mark.parametrize(("name", "role"), [(name, said.partition(":")[0]) for name, said in tokens.ALL.items()])
def test_caller_hears_who_one_is_and_what_one_may(
    api: Api, service: Service, tmp_path: Path, name: str, role: str
) -> None:
    file = tokens.write(tmp_path / "tokens", tokens.ALL)
    service.settings = ApiModuleSettings({"tokens": str(file)}, environ={}).snapshot()
    service.tokens.use(service.settings.tokens)
    told = api.get("/authority", headers=tokens.bearer(name)).body["caller"]
    assert told == {"name": name, "role": role}


def test_while_the_api_is_read_only_everybody_may_watch(api: Api, service: Service) -> None:
    assert api.get("/authority").body["caller"] == {"name": "127.0.0.1", "role": "admin"}
    service.settings = ApiModuleSettings({"read_only": True}, environ={}).snapshot()
    assert api.get("/authority").body["caller"]["role"] == "watch"
