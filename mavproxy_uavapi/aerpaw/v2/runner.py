"""`aerpawlib.v2.runner`: the runners of `v1`, which say at once that a class is invalid, and have a `config`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from mavproxy_uavapi.aerpaw import runner, zmq_runner
from mavproxy_uavapi.aerpaw.decorators import (
    AT_INIT,
    BACKGROUND,
    ENTRYPOINT,
    EXPOSED_FIELD,
    EXPOSED_STATE,
    STATE,
    StateMark,
    at_init,
    background,
    entrypoint,
    expose_field_zmq,
    expose_zmq,
)
from mavproxy_uavapi.aerpaw.exceptions import MultipleInitialStatesError, RunnerError


@dataclass
class BasicRunnerConfig:
    """What `@entrypoint` says: the method's name."""

    entrypoint: str


@dataclass
class StateSpec:
    """What `@state` and `@timed_state` (duration in s) say of a method."""

    name: str
    method_name: str
    first: bool = False
    duration: float = 0.0
    loop: bool = False


@dataclass
class StateMachineConfig:
    """What the decorators of a StateMachine say; methods by their names."""

    initial_state: str
    states: list[StateSpec] = field(default_factory=list)
    backgrounds: list[str] = field(default_factory=list)
    at_init: list[str] = field(default_factory=list)


@dataclass
class ZmqStateMachineConfig(StateMachineConfig):
    """What the decorators of a ZmqStateMachine say, too: by their names there, a state or a method."""

    exposed_states: dict[str, str] = field(default_factory=dict)
    exposed_fields: dict[str, str] = field(default_factory=dict)


class Runner(runner.Runner):
    """Base of all runners.

    Attributes:
        config: what its decorators say, or what a class has in their place; None without either.
    """

    config: Any = None

    def __init_subclass__(cls, **kwargs: Any) -> None:
        if "config" in vars(cls):
            cls._decorate(cls.config)
        super().__init_subclass__(**kwargs)
        cls.config = cls._described()

    @classmethod
    def _decorate(cls, config: Any) -> None:
        """Decorate its methods as `config` says."""

    @classmethod
    def _described(cls) -> Any:
        """Its `config`.

        Raises:
            RunnerError: its decorators are inconsistent.
        """


class BasicRunner(Runner, runner.BasicRunner):
    """Runs one method, the `@entrypoint`."""

    @classmethod
    def _decorate(cls, config: BasicRunnerConfig) -> None:
        entrypoint(getattr(cls, config.entrypoint))

    @classmethod
    def _described(cls) -> BasicRunnerConfig | None:
        names = cls._marked_names(ENTRYPOINT)
        if len(names) > 1:
            raise RunnerError("Only one @entrypoint is allowed per runner class")
        return BasicRunnerConfig(names[0]) if names else None


class StateMachine(Runner, runner.StateMachine):
    """Runs states; each returns the name of the next one, or None at the end."""

    @classmethod
    def _decorate(cls, config: StateMachineConfig) -> None:
        for spec in config.states:
            mark = StateMark(spec.name, spec.name == config.initial_state, spec.duration or None, spec.loop)
            setattr(getattr(cls, spec.method_name), STATE, mark)
        for decorate, names in ((background, config.backgrounds), (at_init, config.at_init)):
            for name in names:
                decorate(getattr(cls, name))

    @classmethod
    def _described(cls) -> StateMachineConfig:
        marks = [(name, getattr(getattr(cls, name), STATE)) for name in cls._marked_names(STATE)]
        first = [mark.name for _, mark in marks if mark.first]
        if len(first) > 1:
            raise MultipleInitialStatesError
        specs = [StateSpec(mark.name, name, mark.first, mark.duration or 0.0, mark.loop) for name, mark in marks]
        return StateMachineConfig("".join(first), specs, cls._marked_names(BACKGROUND), cls._marked_names(AT_INIT))

    async def _prepare(self, methods: Sequence[runner.Method], vehicle: Any) -> None:
        """Call the methods that run before the states, one after the other."""
        for method in methods:
            await runner.call(method, vehicle)


class ZmqStateMachine(StateMachine, zmq_runner.ZmqStateMachine):
    """A StateMachine that other runners address by its identifier."""

    @classmethod
    def _decorate(cls, config: StateMachineConfig) -> None:
        super()._decorate(config)
        if isinstance(config, ZmqStateMachineConfig):
            methods = {spec.name: spec.method_name for spec in config.states}
            for exposed, name in config.exposed_states.items():
                expose_zmq(exposed)(getattr(cls, methods[name]))
            for exposed, name in config.exposed_fields.items():
                expose_field_zmq(exposed)(getattr(cls, name))

    @classmethod
    def _described(cls) -> ZmqStateMachineConfig:
        states: dict[str, str] = {}
        for name in cls._marked_names(EXPOSED_STATE):
            method = getattr(cls, name)
            if not hasattr(method, STATE):
                raise RunnerError("@expose_zmq can only be used on @state/@timed_state methods")
            states[getattr(method, EXPOSED_STATE)] = getattr(method, STATE).name
        fields = {getattr(getattr(cls, name), EXPOSED_FIELD): name for name in cls._marked_names(EXPOSED_FIELD)}
        return ZmqStateMachineConfig(**vars(super()._described()), exposed_states=states, exposed_fields=fields)
