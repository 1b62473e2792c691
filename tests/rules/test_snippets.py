"""Each block of code in the pages has a language, and is well formed; tests/end_to_end/test_snippets.py runs them."""

from __future__ import annotations

import ast
import json
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from mavproxy_gradys.settings import GradysModuleSettings
from mavproxy_uavapi.launcher.options import parse
from mavproxy_uavapi.settings import ApiModuleSettings
from mavproxy_vision.settings import VisionModuleSettings
from tests.support.snippets import BLOCK, PAGES, ROOT, Block, blocks

RUN = {"bash", "mavproxy", "python"}
OF_OTHERS = {"matlab", "nginx", "r", "sql"}  # each is exempt by a mark
ALL = [block for page in PAGES for block in blocks(page)]
OURS = re.compile(r"^mavproxy-uavapi (--.*)")


def of(*languages: str) -> list[object]:
    """The blocks in these languages, as parameters."""
    return [pytest.param(block, id=f"{block.page}:{block.line}") for block in ALL if block.language in languages]


def test_every_block_has_a_language_that_is_checked() -> None:
    known = {*RUN, *OF_OTHERS, "ini", "json", "text", "yaml", "{toctree}"}
    assert [block for block in ALL if block.language not in known] == []
    assert [block for block in ALL if block.language in OF_OTHERS and block.mark != "not run"] == []


@pytest.mark.parametrize("page", PAGES)
def test_no_block_is_indented_only(page: str) -> None:
    text = BLOCK.sub("", (ROOT / page).read_text(encoding="utf-8"))
    assert re.findall(r"\n\n {4,}\S.*", text) == []


@pytest.mark.parametrize("page", PAGES)
def test_every_mark_belongs_to_a_block(page: str) -> None:
    marks = len(re.findall(r"<!-- (?:not run|file|body):", (ROOT / page).read_text(encoding="utf-8")))
    assert marks == len([block for block in blocks(page) if block.mark])


def test_the_translated_readme_has_the_same_commands() -> None:
    english, translated = (
        [(block.language, block.mark, block.commands) for block in blocks(page)]
        for page in ("README.md", "docs/pt-BR/README.md")
    )
    assert english == translated


@pytest.mark.parametrize("block", of("bash"))
def test_a_command_is_one(block: Block) -> None:
    done = subprocess.run(["bash", "-n"], input=block.text, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    for command in block.commands:
        if block.mark == "not run" and (options := OURS.match(command)):
            parse(shlex.split(options[1]))


@pytest.mark.parametrize("block", of("python"))
def test_python_is_python(block: Block) -> None:
    compile(block.text, block.page, "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT | ast.PyCF_ONLY_AST)


@pytest.mark.parametrize("block", of("json"))
def test_json_is_json(block: Block) -> None:
    json.loads(re.sub(r", …", "", block.text))


@pytest.mark.parametrize("block", of("yaml"))
def test_yaml_is_yaml(block: Block) -> None:
    assert isinstance(yaml.safe_load(block.text), dict)


@pytest.mark.parametrize("block", of("ini"))
def test_settings_are_taken(block: Block, tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    shutil.copy(ROOT / "tests" / "corpus" / "calibrations" / "ours.json", tmp_path / "camera.json")
    file.write_text(block.text.replace("/etc/mavproxy-uavapi", str(tmp_path)), encoding="utf-8")
    for kind in (ApiModuleSettings, VisionModuleSettings, GradysModuleSettings):
        kind({"config": str(file)}).snapshot()
