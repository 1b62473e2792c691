"""The MAVProxy module `uavapi`: commands, settings and hooks; a thin adapter, no logic."""

from __future__ import annotations

import asyncio
import os
import ssl
from collections.abc import Callable
from typing import Any

try:
    from mavproxy_uavapi.api import Api
except ModuleNotFoundError as missing:  # MAVProxy prints the text of an ImportError as one line
    raise ImportError(f"uavapi needs {missing.name}: pip install mavproxy-uavapi") from missing
from mavproxy_uavapi.core.logs import Logs, print_above_prompt
from mavproxy_uavapi.core.module import SharedModule
from mavproxy_uavapi.core.terminal import say, say_text
from mavproxy_uavapi.core.windows import View
from mavproxy_uavapi.prompt import authority, fleet, flight, token, why, windows
from mavproxy_uavapi.prompt.report import report, vehicles
from mavproxy_uavapi.remote_settings import RemoteSettings
from mavproxy_uavapi.settings import ApiModuleSettings, ApiSettings

COMPLETIONS = [
    "<status|start|stop|vehicles|config|log|why|help>",
    "flight <start|stop>",
    "fleet <arm|brake|disarm|guided|land|rtl|stop>",
    "token <add|list|remove>",
    "authority <take|release>",
    "fly (FILENAME)",
]
LOG_SHOWN = 20  # entries
HELP = """\
uavapi status            what it listens on, the vehicle that it flies, and the calls in flight
uavapi start             listen (it does so by itself when the module is loaded)
uavapi stop              close the port; calls in flight end
uavapi set               show the settings
uavapi set NAME VALUE    change one; it takes effect at once
uavapi config            the settings in force, and where each came from
uavapi log [N]           the last N commands: the caller and the outcome of each
uavapi why [N …]         what happened to the vehicles last, and why
uavapi flight            the last recorded flights
uavapi flight start NAME [N …], stop    record vehicles under a name, until it is stopped
uavapi vehicles          every vehicle that was heard
uavapi fly FILE          fly a recorded track with the API's vehicle, `sysid` (module gradys)
uavapi fleet VERB [N …]  arm, brake, disarm, guided, land, rtl or stop, for every vehicle or those system ids
uavapi authority         who holds and who commands each vehicle
uavapi authority take [N …], release [N …]  hold vehicles for the prompt; end a hold, whoever has it
uavapi token add NAME ROLE [N …]  a new token for watch, fly (every vehicle, or those) or admin; shown once
uavapi token list, remove NAME    who has a token; take one away
uavapi help              this"""


class UavApiModule(SharedModule[ApiSettings]):
    """`module load uavapi`."""

    def __init__(self, mpstate: Any, keywords: dict[str, Any]) -> None:
        self._should_listen = True  # whether it should listen; `uavapi stop` clears it
        actions: dict[str, Callable[[list[str]], None]] = {
            "status": self._status,
            "start": lambda _: self._start(),
            "stop": lambda _: self._stop(),
            "log": self._log,
            "why": self._why,
            "flight": self._flight,
            "vehicles": lambda _: self._print_text(lambda: vehicles(self.api)),
            "fly": self._fly,
            "fleet": self._fleet,
            "authority": self._authority,
            "token": self._token,
            "help": lambda _: say_text(HELP),
        }
        super().__init__(
            mpstate,
            keywords,
            ApiModuleSettings,
            "HTTP API to fly and watch vehicles",
            actions=actions,
            completions=COMPLETIONS,
        )
        self.logs = Logs(lambda text: self.host.bridge.post(lambda: print_above_prompt(text, self.mpstate.rl.prompt)))
        self._changing = asyncio.Lock()  # starts, stops and settings, in the typed order
        self.api = Api(
            self.host,
            RemoteSettings(
                self.host.bridge, self.module_settings, self.change_setting, self._settled, self.host.members
            ),
        )
        self.host.bridge.close_in_children(self.api.filenos)
        self.finish_loading()

    def begin(self) -> None:
        """Listen, unless a startup script ran `uavapi stop`."""
        for note in self.module_settings.notes:
            say(f"uavapi: {note}")
        if self._should_listen:
            self._start()
        else:
            self.host.bridge.call_soon(self.api.use_envelope, self.module_settings.snapshot().envelope)

    def view(self) -> View:
        """Who commands, and the commanded targets."""
        return windows.view(self.host)

    async def end(self) -> None:
        """Stop listening, or trying to."""
        await self._background.close()
        await self.api.stop()

    def unload(self) -> None:
        """Release our own resources, then the shared ones."""
        try:
            super().unload()
        finally:
            self.host.bridge.keep_in_children(self.api.filenos)
            self.logs.close()

    def _status(self, _args: list[str]) -> None:
        settings = self.module_settings.snapshot()
        self._print_text(lambda: report(self.api, settings))

    def _start(self) -> None:
        self._should_listen = True
        if not self._begun:
            say("uavapi: it listens once MAVProxy's main loop runs")
            return
        settings = self.module_settings.snapshot()

        async def start() -> str:
            async with self._changing:
                return await self._listen(settings)

        self._background.send(start, f"trying to listen on {settings.url}")

    async def _listen(self, settings: ApiSettings) -> str:
        """Listen; returns a line with the outcome. A slow disk may delay it, so a thread opens the logs."""
        address = settings.url
        try:
            await self._open_logs(settings)
            await self.api.start(settings)
        except ssl.SSLError as error:
            return f"cannot use {settings.certfile} with {settings.keyfile}: {error.strerror}"
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else str(error)
            if error.filename is not None:
                return f"cannot open {error.filename}: {reason}"
            return f"cannot listen on {address}: {reason}; `uavapi set port N` takes another port"
        if settings.allow_open and not settings.is_local:
            self._background.say("WARNING: allow_open is set: everybody who reaches this port can fly the vehicle")
        return f"listening on {address}"

    async def _open_logs(self, settings: ApiSettings) -> None:
        log_settings = settings.log_console, settings.debug, settings.log_path, settings.sysid
        await asyncio.to_thread(self.logs.open, *log_settings)

    def _fly(self, args: list[str]) -> None:
        """`uavapi fly FILE`: the module `gradys` flies the track with the API's vehicle."""
        fly = self.host.commands.get("fly")
        if fly is None:
            say("uavapi: fly needs the module that knows tracks: `module load gradys`")
        else:
            fly(["--sysid", str(self.module_settings.snapshot().sysid), *args])

    def _fleet(self, args: list[str]) -> None:
        self._background.send(lambda: fleet.command(self.host, args), f"at fleet {' '.join(args)}")

    def _authority(self, args: list[str]) -> None:
        self._background.send(lambda: authority.command(self.host, args), f"at authority {' '.join(args)}")

    def _why(self, args: list[str]) -> None:
        self._background.send(lambda: why.command(self.host, args), f"at why {' '.join(args)}")

    def _flight(self, args: list[str]) -> None:
        async def run() -> str:
            return await flight.command(self.host, self.api.flights, args)

        self._background.send(run, f"at flight {' '.join(args)}")

    def _token(self, args: list[str]) -> None:
        file = self.module_settings.snapshot().tokens

        async def change() -> str:
            text, has_changed = await asyncio.to_thread(token.command, file, args)
            if has_changed:
                self.api.take_tokens()
            return text

        self._background.send(change, f"at token {' '.join(args)}")

    def _log(self, args: list[str]) -> None:
        try:
            count = int(args[0]) if args else LOG_SHOWN
        except ValueError:
            say(f"uavapi: log takes a number, not {args[0]!r}")
            return
        entries = list(self.host.audit.entries)[-max(count, 1) :]
        say(*(map(str, entries) if entries else ["uavapi: no commands yet"]))
        if self.host.audit.file is not None:
            say(f"all of them: {self.host.audit.file}")

    def _stop(self) -> None:
        self._should_listen = False
        if not self._begun:
            say("uavapi: stopped")
            return

        async def stop() -> str:
            async with self._changing:
                await self.api.stop()
            return "stopped"

        self._background.send(stop, "stopping")

    def use_settings(self, name: str, before: ApiSettings, after: ApiSettings) -> None:
        """Listen again if the address or the access changes; otherwise calls in flight go on."""
        if name == "envelope":
            self.host.bridge.call_soon(self.api.use_envelope, after.envelope)
        if self._should_listen:
            take_up = self._renew if after.listens_as(before) else self._restart
            self._background.send(lambda: take_up(after), "taking up the setting")

    async def _settled(self) -> None:
        """Wait until what was begun before has been taken up."""
        async with self._changing:
            pass

    async def _restart(self, settings: ApiSettings) -> str:
        """Listen again; calls in flight end."""
        async with self._changing:
            await self.api.stop()
            return await self._listen(settings)

    async def _renew(self, settings: ApiSettings) -> str:
        """Apply settings without ending calls in flight."""
        async with self._changing:
            await self.api.renew(settings)
            try:
                await self._open_logs(settings)
            except OSError as error:
                return f"cannot open {error.filename}: {error.strerror}; the logs stay as they were"
        return ""


def init(mpstate: Any, **kwargs: Any) -> UavApiModule:
    """MAVProxy calls this on `module load uavapi`, or `uavapi:{"port":8001}`.

    Raises:
        ImportError: as `SharedModule`.
    """
    return UavApiModule(mpstate, kwargs)
