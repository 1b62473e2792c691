"""What the examples share: calls that stop at the first refusal, arguments, and RTL on Ctrl-C."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

import requests

CONNECT_S = 5.0
# The longest wait for one answer: a `_wait` verb and a landing answer when they are done.
ANSWER_S = 300.0

# ArduPilot's scale of latitude (AP_Common/Location), so that our metres are the autopilot's.
METRES_PER_DEGREE = 111318.84502145034


class Ned(NamedTuple):
    """North, east and down in m, from the origin of a vehicle's estimator (EKF)."""

    x: float
    y: float
    z: float

    def plus(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Ned:
        """This point moved by so many metres north, east and down."""
        return Ned(self.x + x, self.y + y, self.z + z)


class Api:
    """One vehicle's API. A status other than 200 prints why and ends the program with status 1.

    Attributes:
        verbose: whether to print what commands and movements answer.
    """

    verbose = True

    def __init__(self, url: str) -> None:
        self.url = (url if "://" in url else f"http://{url}").rstrip("/")
        self.session = requests.Session()
        # The vehicle is on this machine or this network: no proxy is in between.
        self.session.trust_env = False
        if os.environ.get("UAVAPI_TOKEN"):
            self.session.headers["Authorization"] = f"Bearer {os.environ['UAVAPI_TOKEN']}"

    def get(self, path: str, **parameters: Any) -> dict[str, Any]:
        """GET, with the parameters in the query."""
        return self._call("GET", path, params=parameters)

    def post(self, path: str, **body: Any) -> dict[str, Any]:
        """POST, with a JSON body."""
        return self._call("POST", path, json=body)

    def ned(self) -> Ned:
        """Where the vehicle is in its own NED frame."""
        position = self.get("/telemetry/ned")["info"]["position"]
        return Ned(position["x"], position["y"], position["z"])

    def gps(self) -> dict[str, Any]:
        """`position` {lat, lon in degrees, alt in m AMSL, relative_alt in m above home} and `heading` in degrees."""
        info: dict[str, Any] = self.get("/telemetry/gps")["info"]
        return info

    def _call(self, method: str, path: str, **content: Any) -> dict[str, Any]:
        try:
            answer = self.session.request(method, self.url + path, timeout=(CONNECT_S, ANSWER_S), **content)
        except requests.Timeout:
            sys.exit(f"{path}: {self.url} has not answered within {ANSWER_S:g} s")
        except requests.ConnectionError:
            sys.exit(f"{path}: nothing answers at {self.url}; is mavproxy-uavapi running there?")
        except requests.RequestException as error:
            sys.exit(f"{path}: {error}")
        if answer.status_code != 200:
            sys.exit(f"{path}: {answer.status_code}: {detail(answer)}")
        output: dict[str, Any] = answer.json()
        if self.verbose and path.startswith(("/command", "/movement")):
            print(output["result"], flush=True)
        return output


def detail(answer: requests.Response) -> str:
    """Why the server refused, in its words."""
    try:
        output = answer.json()["detail"]
    except (ValueError, KeyError, TypeError):
        return answer.text.strip() or answer.reason
    if isinstance(output, list):
        return "; ".join(f"{'.'.join(map(str, part['loc']))}: {part['msg']}" for part in output)
    return str(output)


def parser(description: str | None, altitude: float | None = 10.0) -> argparse.ArgumentParser:
    """Arguments with `--url` and, unless it is None, `--altitude`."""
    arguments = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    url = os.environ.get("UAVAPI_URL") or "http://127.0.0.1:8000"  # an uploaded script has the variable
    arguments.add_argument("--url", default=url, help="the vehicle's API; host:port will do (%(default)s)")
    if altitude is not None:
        arguments.add_argument("--altitude", type=positive, default=altitude, help="m above home (%(default)g)")
    return arguments


def positive(text: str) -> float:
    """An argument that is a finite number above 0."""
    number = float(text)
    if not (math.isfinite(number) and number > 0):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return number


@contextmanager
def rtl_on_interrupt(api: Api) -> Iterator[None]:
    """Ctrl-C sends the vehicle home and waits for it; a second one leaves it to fly home alone."""
    try:
        yield
    except KeyboardInterrupt:
        print("Returning to launch; Ctrl-C again not to wait for it", flush=True)
        with suppress(KeyboardInterrupt):
            api.get("/command/rtl")
        sys.exit(130)
