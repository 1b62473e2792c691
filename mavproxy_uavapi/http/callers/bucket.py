"""Limits how often a client may call."""

BURST = 2.0  # s of the long-run rate that a client may use at once
CLIENTS_KEPT = 1000


class Bucket:
    """A token bucket for each client. Pure: the clock is an argument."""

    def __init__(self) -> None:
        self._used: dict[str, tuple[float, float]] = {}  # client -> (tokens used, at)

    def take(self, client: str, rate: float, now: float) -> float:
        """Take one request of `client`; 0, or the seconds to wait if its tokens are used.

        Args:
            client: the client's group (`caller.group_of`).
            rate: requests per second in the long run.
            now: s.
        """
        used, at = self._used.pop(client, (0.0, now))
        used = max(0.0, used - (now - at) * rate)
        capacity = max(BURST * rate, 1.0)
        if used + 1 > capacity:
            self._used[client] = used, now
            return (used + 1 - capacity) / rate
        self._used[client] = used + 1, now
        if len(self._used) > CLIENTS_KEPT:
            del self._used[next(iter(self._used))]
        return 0.0
