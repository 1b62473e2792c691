"""`aerpawlib.v2.aerpaw`: the platform of `v1` under other names."""

from __future__ import annotations

import asyncio
from enum import Enum

from mavproxy_uavapi.aerpaw.constants import DEFAULT_FORWARD_SERVER_IP, DEFAULT_FORWARD_SERVER_PORT
from mavproxy_uavapi.aerpaw.platform import AERPAW


class OeoSeverity(str, Enum):
    """The severities of messages."""

    INFO = "INFO"
    WARNING = "WARNING"
    ERROR = "ERROR"
    CRITICAL = "CRITICAL"


class AerpawPlatform(AERPAW):
    """The platform at an address; without an address nothing is sent. Errors are those of `v1`."""

    def __init__(
        self,
        forward_ip: str = DEFAULT_FORWARD_SERVER_IP,
        forward_port: int = DEFAULT_FORWARD_SERVER_PORT,
        *,
        suppress_stdout: bool = False,
    ) -> None:
        super().__init__(forward_ip, forward_port)
        self._no_stdout = suppress_stdout

    @property
    def is_connected(self) -> bool:
        """Whether there is a platform, and it has answered."""
        return self._connected

    def log_to_oeo(self, msg: str, severity: str = OeoSeverity.INFO, agent_id: str | None = None) -> None:
        """Send a message to the experiment's operators and to the log.

        Raises:
            ValueError: no such severity.
        """
        super().log_to_oeo(msg, OeoSeverity(severity).value, agent_id)

    async def log_to_oeo_async(self, msg: str, severity: str = OeoSeverity.INFO, agent_id: str | None = None) -> None:
        """As `log_to_oeo`, without blocking."""
        await asyncio.to_thread(self.log_to_oeo, msg, severity, agent_id)
