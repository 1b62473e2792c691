"""Files of tokens for tests; the token of each name is the name itself, said twice."""

from __future__ import annotations

from pathlib import Path

from mavproxy_uavapi.files.tokens import digest_of

ALL = {"tower": "watch", "anna": "fly", "bo": "fly", "second": "fly:2", "boss": "admin", "chief": "admin"}


def secret_of(name: str) -> str:
    """The token of that name."""
    return f"{name}-{name}"


def bearer(name: str) -> dict[str, str]:
    """The header by which its owner calls; none for no name."""
    return {"Authorization": f"Bearer {secret_of(name)}"} if name else {}


def write(path: Path, roles: dict[str, str]) -> str:
    """Write the file anew; its path."""
    lines = [f"{name} {role} sha256:{digest_of(secret_of(name).encode()).hex()}\n" for name, role in roles.items()]
    path.touch(0o600)
    path.write_text("".join(lines))
    return str(path)
