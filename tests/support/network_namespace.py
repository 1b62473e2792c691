"""A network namespace of Linux, joined to ours by a cable that can be cut. Only root may make one."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess

SUBNET = "10.231.{}.{}"


def ip(*words: str) -> None:
    """Run `ip`."""
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


class NetworkNamespace:
    """A namespace whose programs reach only us.

    While the cable is cut, packets vanish: connections stay open, and nobody is told.

    Attributes:
        host: our address at the cable.

    Raises:
        OSError: it cannot be made here; the text says why.
    """

    def __init__(self) -> None:
        number = os.getpid() % 250 + 1
        self._name, self._near, self._far = f"fleet-{os.getpid()}", f"fn{os.getpid()}", f"ff{os.getpid()}"
        self.host, guest = SUBNET.format(number, 1), SUBNET.format(number, 2)
        if shutil.which("ip") is None:
            raise OSError("there is no program `ip` (apt-get install iproute2)")
        try:
            ip("netns", "add", self._name)
            ip("link", "add", self._near, "type", "veth", "peer", "name", self._far, "netns", self._name)
            ip("addr", "add", f"{self.host}/24", "dev", self._near)
            ip("link", "set", self._near, "up")
            ip("-n", self._name, "addr", "add", f"{guest}/24", "dev", self._far)
            ip("-n", self._name, "link", "set", self._far, "up")
            ip("-n", self._name, "link", "set", "lo", "up")
        except subprocess.CalledProcessError as error:
            self.remove()
            raise OSError(f"network namespaces are not permitted: {error.stderr.strip()}") from error

    def command(self, command: list[str]) -> list[str]:
        """The command, to be run within."""
        return ["ip", "netns", "exec", self._name, *command]

    def cut(self) -> None:
        """Cut the cable."""
        ip("-n", self._name, "link", "set", self._far, "down")

    def mend(self) -> None:
        """Join it again."""
        ip("-n", self._name, "link", "set", self._far, "up")

    def remove(self) -> None:
        """Remove it, and the cable with it."""
        with contextlib.suppress(subprocess.CalledProcessError):
            ip("netns", "del", self._name)
