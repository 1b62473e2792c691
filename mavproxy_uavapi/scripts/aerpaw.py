"""The command that runs a script: one for aerpawlib, which its imports tell, needs a host."""

from __future__ import annotations

import ast
from pathlib import Path

HOST = ("-m", "mavproxy_uavapi.aerpaw", "--script")  # it finds the API by UAVAPI_URL, and the type by the status


def command_of(script: Path, python: str) -> list[str]:
    """The command, with that interpreter. Raises OSError if the script cannot be read."""
    if script.suffix == ".sh":
        return ["bash", str(script)]
    host = HOST if needs_host(script.read_bytes()) else ()
    return [python, *host, str(script)]


def needs_host(source: bytes) -> bool:
    """Whether a script imports aerpawlib and does not run itself; it then defines a runner, which a host runs."""
    try:
        body = ast.parse(source).body
    except (SyntaxError, ValueError):
        return False  # Python itself will report it
    return any(map(_imports_aerpawlib, body)) and not any(map(_runs_itself, body))


def _imports_aerpawlib(statement: ast.stmt) -> bool:
    if isinstance(statement, ast.Import):
        return any(alias.name.partition(".")[0] == "aerpawlib" for alias in statement.names)
    if isinstance(statement, ast.ImportFrom):
        return not statement.level and (statement.module or "").partition(".")[0] == "aerpawlib"
    return False


def _runs_itself(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.If) and "__main__" in ast.dump(statement.test)
