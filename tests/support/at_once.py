"""An executor without threads."""

from __future__ import annotations

import concurrent.futures
from collections.abc import Callable
from typing import Any


class AtOnce(concurrent.futures.ThreadPoolExecutor):
    """Does in no time what the code gives to threads: theirs is the wall clock, and ours would run on meanwhile."""

    def submit(self, call: Callable[..., Any], /, *args: Any, **kwargs: Any) -> concurrent.futures.Future[Any]:
        done: concurrent.futures.Future[Any] = concurrent.futures.Future()
        try:
            done.set_result(call(*args, **kwargs))
        except Exception as error:  # noqa: BLE001  it is for whoever awaits it
            done.set_exception(error)
        return done
