"""Finds out whether a script is for aerpawlib, by its imports. Pure."""

from __future__ import annotations

import ast

HOST = [
    "-m",
    "mavproxy_uavapi.aerpaw",
    "--script",
]  # it finds the API by UAVAPI_URL, and the vehicle's type by the API's status


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
