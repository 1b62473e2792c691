"""An error of ours is our own sentence: no text of a foreign exception in it, which speaks of Python's insides."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator

from tests.support.sources import classes, trees

# What a raise may repeat of a caught exception: words of the system or of another program, made for people.
WORDS = {
    "strerror",
    "msg",
    "stderr",
    "code",
    "status",
    "message",
    "certificate_error",
    "err",
    "lineno",
    "colno",
    "name",
}
OWN = "functions of ours that raise ValueError with a sentence"
DATABASE = "the database's own words, for its operator"
LISTED = {
    "mavproxy_uavapi/settings.py": OWN,
    "mavproxy_uavapi/launcher/options.py": OWN,
    "mavproxy_uavapi/sim/faults.py": OWN,
    "mavproxy_uavapi/sim/__main__.py": OWN,
    "mavproxy_uavapi/rehearsal/vehicles.py": OWN,
    "mavproxy_uavapi/aerpaw/wire.py": OWN,
    "mavproxy_gradys/forwarding/quantities.py": OWN,
    "mavproxy_uavapi/files/tile_store.py": DATABASE,
    "mavproxy_gradys/station/sqlite_store.py": DATABASE,
    "mavproxy_gradys/forwarding/spool_file.py": DATABASE,
    "mavproxy_gradys/forwarding/spool.py": DATABASE,
    "mavproxy_gradys/forwarding/spool_thread.py": DATABASE,
}


def foreign_words(tree: ast.AST, ours: set[str]) -> Iterator[int]:
    """The lines of raises that repeat the text of a caught exception that is not one of `ours`."""
    for handler in ast.walk(tree):
        if not isinstance(handler, ast.ExceptHandler) or handler.name is None or handler.type is None:
            continue
        kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
        if all(ast.unparse(kind).rpartition(".")[2] in ours for kind in kinds):
            continue
        for statement in handler.body:
            for node in ast.walk(statement):
                if isinstance(node, ast.Raise) and node.exc is not None and _repeats(node.exc, handler.name):
                    yield node.lineno


def _repeats(raised: ast.expr, name: str) -> bool:
    """Whether an expression has the exception itself as a text: in an f-string, or by str() or repr()."""
    if any(isinstance(node, ast.Call) and ast.unparse(node.func) == "reason_of" for node in ast.walk(raised)):
        return False  # the system's words, without Python's
    for node in ast.walk(raised):
        texts = [node.value] if isinstance(node, ast.FormattedValue) else []
        if isinstance(node, ast.Call) and ast.unparse(node.func) in {"str", "repr", "type"}:
            texts = list(node.args)
        for text in texts:
            if any(isinstance(part, ast.Name) and part.id == name for part in ast.walk(text)):
                attributes = [part.attr for part in ast.walk(text) if isinstance(part, ast.Attribute)]
                if not set(attributes) & WORDS:
                    return True
    return False


def test_no_error_repeats_a_foreign_exception() -> None:
    ours = {name for _, name in classes()} - set(dir(builtins))
    found = {f"{file}:{line}" for file, tree in trees(r"except .+ as ").items() for line in foreign_words(tree, ours)}
    assert sorted(place for place in found if place.rpartition(":")[0] not in LISTED) == []
    assert LISTED.keys() <= {place.rpartition(":")[0] for place in found}


def test_what_repeats_one_is_found() -> None:
    handler = "try:\n    f()\nexcept {} as error:\n    raise Invalid(f'no: {{{}}}') from error\n"

    def lines(caught: str, told: str) -> list[int]:
        return list(foreign_words(ast.parse(handler.format(caught, told)), {"UavApiError"}))

    assert lines("ValueError", "error") == [4]
    assert lines("(UavApiError, KeyError)", "str(error)") == [4]
    assert lines("UavApiError", "error") == []
    assert lines("OSError", "error.strerror") == []
