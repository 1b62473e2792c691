"""The folder of uploaded scripts. Blocking: for an executor, not for the loop."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from mavproxy_uavapi.core.errors import BadRequest, NotFound
from mavproxy_uavapi.scripts import names

MODE = 0o755


@dataclass(frozen=True)
class ScriptStore:
    """The folder of scripts and its limits.

    Attributes:
        folder: where the scripts are.
        size_limit: bytes of one script.
        quota: bytes of all scripts together.
    """

    folder: Path
    size_limit: int
    quota: int

    def save(self, name: str, data: bytes) -> Path:
        """Save a script completely or not at all; it replaces one of the same name; returns its path.

        Raises:
            BadRequest: its name is not valid, or it is too large.
            OSError: the folder cannot be written to.
        """
        name = names.checked(name)
        if len(data) > self.size_limit:
            raise BadRequest(f"{name} is larger than {self.size_limit // 1024} kB")
        self.folder.mkdir(parents=True, exist_ok=True)
        used = sum(file.stat().st_size for file in self._files() if file.name != name)
        if used + len(data) > self.quota:
            raise BadRequest(f"no room for {name}: all scripts together may have {self.quota // 1024} kB")
        handle, temporary = tempfile.mkstemp(prefix=".upload-", dir=self.folder)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                os.fchmod(file.fileno(), MODE)
                file.flush()
                os.fsync(file.fileno())
            path = self.folder / name
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        return path

    def find(self, name: str) -> Path:
        """The script that a client means by `name`; the client may omit `.py`.

        Raises:
            BadRequest: it is not a valid script name.
            NotFound: there is no such script.
        """
        path = self.folder / names.resolved(name)
        if not path.is_file():
            raise NotFound(f"no script {path.name}; /mission/list-scripts lists the scripts")
        return path

    def listed(self, suffixes: tuple[str, ...] = names.SUFFIXES) -> list[str]:
        """The scripts' names, sorted."""
        return sorted(file.name for file in self._files() if file.suffix in suffixes)

    def clear(self) -> list[str]:
        """Remove all scripts; returns their names."""
        removed = []
        for file in self._files():
            file.unlink(missing_ok=True)
            removed.append(file.name)
        return sorted(removed)

    def _files(self) -> list[Path]:
        if not self.folder.is_dir():
            return []
        return [file for file in self.folder.iterdir() if file.suffix in names.SUFFIXES and file.is_file()]
