"""Writes calls to the audit trail when their answer is known; jobs that go on are written when they end."""

from __future__ import annotations

import asyncio
import json

from aiohttp import web

from mavproxy_uavapi.core.audit import Entry, utc_now
from mavproxy_uavapi.core.errors import NoVehicle, UavApiError
from mavproxy_uavapi.core.sent_messages import SentNames, noting_sent
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.responses import MULTI_STATUS
from mavproxy_uavapi.http.contract.route import Action, Answer

GONE = "the client hung up"


async def audited(call: Call, action: Action) -> Answer:
    """Run a command and leave a trace of it."""
    with noting_sent() as sent:
        trace = Trace(call, sent)
        try:
            answer = await action(call)
        except UavApiError as error:
            trace.leave(error.code, str(error))
            error.is_audited = True
            raise
        except asyncio.CancelledError:
            trace.leave_at_end("client_gone", GONE)
            raise
    trace.leave_at_end(*_outcome_of(answer))
    return answer


def _outcome_of(answer: Answer) -> tuple[str, str]:
    """The outcome and the detail of an answer that is no error."""
    if not isinstance(answer, web.StreamResponse):
        return "ok", str(answer.get("result", ""))
    if isinstance(answer, web.Response) and answer.status == MULTI_STATUS:
        return "partly", json.loads(answer.text or "{}").get("result", "")
    return "ok", ""


class Trace:
    """The trail entry of one call, from its request on.

    Args:
        call: the call.
        sent: names of the messages that the call sends; it grows as they go out.
    """

    def __init__(self, call: Call, sent: SentNames) -> None:
        self._call = call
        self._sent = sent
        self._clock = call.service.host.clock
        self._began = self._clock()
        try:
            self._system = call.known_vehicle.state.system
        except NoVehicle:
            self._system = 0

    def leave_at_end(self, outcome: str, detail: str) -> None:
        """Leave the trace when the call's job has ended, or now if the job does not go on without its client."""
        job = self._call.job
        if job is None or job.is_told:
            self.leave(outcome, detail)
            return
        loop = asyncio.get_running_loop()

        def leave_soon() -> None:  # the last messages to the vehicle go out first
            loop.call_soon(self._leave_with_job, outcome, detail)

        job.when_told(leave_soon)

    def _leave_with_job(self, outcome: str, detail: str) -> None:
        job = self._call.job
        assert job is not None
        of_job = job.result if job.error is None else str(job.error)
        if outcome == "ok" and job.error is not None:
            outcome = job.error.code
        self.leave(outcome, "; ".join(text for text in (detail, of_job) if text))

    def leave(self, outcome: str, detail: str) -> None:
        """Leave the trace."""
        entry = Entry(
            time=utc_now(),
            client=self._call.client,
            verb=self._call.path,
            request=self._call.recorded_parameters,
            system=self._system,
            outcome=outcome,
            detail=detail,
            seconds=round(self._clock() - self._began, 3),
            sent=self._sent.summary(),
            script=(self._call.job and self._call.job.script) or "",
        )
        self._call.service.host.audit.add(entry)
