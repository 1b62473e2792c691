"""`aerpawlib.v1.aerpaw`: AERPAW's console and checkpoints, if the variable AP_EXPENV_OEOCVM_XM names a platform."""

from __future__ import annotations

import base64
import logging
import urllib.error
import urllib.parse
import urllib.request
from http.client import HTTPException

from mavproxy_uavapi.aerpaw.constants import (
    DEFAULT_FORWARD_SERVER_IP,
    DEFAULT_FORWARD_SERVER_PORT,
    DEFAULT_HUMAN_READABLE_AGENT_ID,
    OEO_MSG_SEV_CRIT,
    OEO_MSG_SEV_ERR,
    OEO_MSG_SEV_INFO,
    OEO_MSG_SEV_WARN,
    OEO_MSG_SEVS,
)
from mavproxy_uavapi.aerpaw.exceptions import AERPAWPlatformError, NotInAERPAWEnvironmentError
from mavproxy_uavapi.core.text import reason_of

log = logging.getLogger("aerpawlib.v1.oeo")

PING_TIMEOUT, TIMEOUT = 1.0, 5.0  # s
LEVELS = {
    OEO_MSG_SEV_INFO: logging.INFO,
    OEO_MSG_SEV_WARN: logging.WARNING,
    OEO_MSG_SEV_ERR: logging.ERROR,
    OEO_MSG_SEV_CRIT: logging.CRITICAL,
}


class AERPAW:
    """The platform at an address; without an address nothing is sent.

    Raises, in all methods of checkpoints:
        NotInAERPAWEnvironmentError: there is no platform.
        AERPAWPlatformError: the platform does not answer, or its answer is invalid.
    """

    def __init__(
        self, forw_addr: str = DEFAULT_FORWARD_SERVER_IP, forw_port: int = DEFAULT_FORWARD_SERVER_PORT
    ) -> None:
        self._no_stdout = False
        self._url = f"http://{forw_addr}:{forw_port}"
        self._connected = bool(forw_addr) and self.attach_to_aerpaw_platform()

    def attach_to_aerpaw_platform(self) -> bool:
        """Whether the platform answers."""
        try:
            self._ask("POST", "/ping", timeout=PING_TIMEOUT)
        except AERPAWPlatformError:
            return False
        return True

    def _ask(self, method: str, path: str, timeout: float = TIMEOUT) -> str:
        request = urllib.request.Request(self._url + path, method=method, data=b"" if method == "POST" else None)
        try:
            with urllib.request.urlopen(request, timeout=timeout) as answer:
                return str(answer.read().decode())
        except (OSError, HTTPException, ValueError) as error:
            raise AERPAWPlatformError(f"the AERPAW platform at {self._url} fails: {reason_of(error)}") from error

    # -- the console --------------------------------------------------------------------------------------

    def log_to_oeo(
        self, msg: str, severity: str = OEO_MSG_SEV_INFO, agent_id: str | None = DEFAULT_HUMAN_READABLE_AGENT_ID
    ) -> None:
        """Send a message to the experiment's operators and to the log.

        Raises:
            ValueError: no such severity.
        """
        if severity not in OEO_MSG_SEVS:
            raise ValueError(f"severity {severity!r} is not one of {', '.join(OEO_MSG_SEVS)}")
        text = msg if msg.startswith(("[aerpawlib]", "[experiment]")) else f"[experiment] {msg}"
        if not self._no_stdout:
            log.log(LEVELS[severity], text)
        if self._connected:
            agent = f"/{agent_id}" if agent_id else ""
            try:
                self._ask("POST", f"/oeo_msg/{severity}/{_base64(text)}{agent}")
            except AERPAWPlatformError as error:
                log.error("the message was not sent: %s", error)

    def publish_user_oeo_topic(
        self, value: object, topic: str, agent_id: str | None = DEFAULT_HUMAN_READABLE_AGENT_ID
    ) -> bool:
        """Publish a value; returns whether it succeeded."""
        if not self._connected:
            return False
        agent = f"/{_base64(agent_id)}" if agent_id else ""
        try:
            self._ask("POST", f"/oeo_pub/{_base64(topic)}/{_base64(str(value))}{agent}")
        except AERPAWPlatformError as error:
            log.error("%s was not published: %s", topic, error)
            return False
        return True

    # -- checkpoints --------------------------------------------------------------------------------------

    def _checkpoint(self, method: str, path: str) -> str:
        if not self._connected:
            raise NotInAERPAWEnvironmentError("AERPAW checkpoint functionality")
        return self._ask(method, f"/checkpoint/{path}")

    def checkpoint_reset_server(self) -> None:
        """Clear all checkpoints."""
        self._checkpoint("POST", "reset")

    def checkpoint_set(self, checkpoint_name: str) -> None:
        """Set a checkpoint."""
        self._checkpoint("POST", f"bool/{_quoted(checkpoint_name)}")

    def checkpoint_check(self, checkpoint_name: str) -> bool:
        """Whether a checkpoint is set."""
        answer = self._checkpoint("GET", f"bool/{_quoted(checkpoint_name)}")
        if answer not in ("True", "False"):
            raise AERPAWPlatformError(f"checkpoint {checkpoint_name} is {answer!r}")
        return answer == "True"

    def checkpoint_increment_counter(self, counter_name: str) -> None:
        """Increment a counter."""
        self._checkpoint("POST", f"int/{_quoted(counter_name)}")

    def checkpoint_check_counter(self, counter_name: str) -> int:
        """The value of a counter."""
        answer = self._checkpoint("GET", f"int/{_quoted(counter_name)}")
        try:
            return int(answer)
        except ValueError as error:
            raise AERPAWPlatformError(f"counter {counter_name} is {answer!r}") from error

    def checkpoint_set_string(self, string_name: str, value: str) -> None:
        """Set a text."""
        self._checkpoint("POST", f"string/{_quoted(string_name)}?val={_quoted(value)}")

    def checkpoint_check_string(self, string_name: str) -> str:
        """The value of a text."""
        return self._checkpoint("GET", f"string/{_quoted(string_name)}")


def _base64(text: str) -> str:
    return base64.urlsafe_b64encode(text.encode()).decode()


def _quoted(text: str) -> str:
    return urllib.parse.quote(text, safe="")


AERPAW_Platform = AERPAW()
