"""Which messages were sent for which command."""

from __future__ import annotations

from mavproxy_uavapi.core.sent_messages import (
    MOST_RUNS,
    SentNames,
    note_sent,
    noting_sent,
    noting_sent_unless_noted,
)


def reported(names: list[str]) -> tuple[str, ...]:
    sent = SentNames()
    for name in names:
        sent.add(name)
    return sent.summary()


def test_setpoints_are_counted_rather_than_listed() -> None:
    names = ["COMMAND_LONG", "COMMAND_LONG", *["SET_POSITION_TARGET_LOCAL_NED"] * 240, "COMMAND_LONG"]
    assert reported(names) == ("COMMAND_LONG", "COMMAND_LONG", "SET_POSITION_TARGET_LOCAL_NED x240", "COMMAND_LONG")
    assert reported([]) == ()


def test_names_that_alternate_without_end_are_bounded() -> None:
    summary = reported(["LANDING_TARGET", "SET_POSITION_TARGET_LOCAL_NED"] * 10_000)
    assert len(summary) == MOST_RUNS + 1
    assert summary[-1] == f"and {20_000 - MOST_RUNS} more"


def test_names_are_noted_within_a_context_only() -> None:
    note_sent("HEARTBEAT")
    with noting_sent() as sent:
        note_sent("COMMAND_LONG")
    note_sent("HEARTBEAT")
    assert sent.summary() == ("COMMAND_LONG",)


def test_within_a_call_nothing_else_notes_until_the_call_was_reported() -> None:
    with noting_sent() as of_call:
        with noting_sent_unless_noted() as nobody:
            note_sent("COMMAND_LONG")
        assert nobody is None
        assert of_call.summary() == ("COMMAND_LONG",)
        with noting_sent_unless_noted() as own:
            note_sent("COMMAND_INT")
    assert own is not None
    assert own.summary() == ("COMMAND_INT",)
    assert of_call.summary() == ("COMMAND_LONG",)
