"""A weighing as a page of this machine: read in a browser, with nothing that it could change."""

from __future__ import annotations

import json
import logging
import math
import platform
from collections import deque
from collections.abc import AsyncIterator, Collection
from importlib.resources import files
from ipaddress import ip_address
from itertools import islice
from socket import AF_INET, AF_INET6, create_server
from threading import Lock, Thread
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any, Final

from weighbridge.customary import shown_amount, shown_unit
from weighbridge.errors import ConfigError, MissingExtraError
from weighbridge.live.outputs.lines import json_line
from weighbridge.live.records import BACK
from weighbridge.live.weighing import LiveWeighing

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

HOST: Final = "127.0.0.1"
PORT: Final = 8765

WINDOW: Final = 1800.0
MOST: Final = 1800
"""The plot holds so much time [s] and so many points."""

# A page is informed of news at most so often, and of life where there is none [s].
_GLANCE: Final = 0.25
_LIFE: Final = 15.0

# The server listens within [s].
_BEGINNING: Final = 10.0

_MOST_CONNECTIONS: Final = 32

_LOOPBACK: Final = frozenset(("localhost", "127.0.0.1", "::1"))

_FILES: Final = {
    "": ("index.html", "text/html; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "icon.svg": ("icon.svg", "image/svg+xml"),
    "uplot/uPlot.iife.min.js": ("uplot/uPlot.iife.min.js", "text/javascript; charset=utf-8"),
    "uplot/uPlot.min.css": ("uplot/uPlot.min.css", "text/css; charset=utf-8"),
}
"""Path on the server, file and type: nothing else is handed out."""

_HEADERS: Final = (
    (
        b"content-security-policy",
        b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
        b"connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (b"cache-control", b"no-store"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
)


class History:
    """Points of the plot: mass and interval over the last half hour, evenly thinned.

    Parameters
    ----------
    window : time that is kept [s]
    most : points that are kept
    """

    def __init__(self, window: float = WINDOW, most: int = MOST) -> None:
        self._window = window
        self._spacing = window / most
        self._points: deque[tuple[float, float, float, float]] = deque(maxlen=most)
        self._number = 0
        self._fresh = 0

    def __len__(self) -> int:
        return len(self._points)

    @property
    def number(self) -> int:
        """How many points were ever added."""
        return self._number

    def add(self, weighing: LiveWeighing) -> None:
        """Add a point, unless the last one is hardly older; a clock that falls begins anew.

        A settled mass that follows a provisional one is a little older, of the same clock.
        """
        time = weighing.time
        if not math.isfinite(time):
            return
        if self._points and time < self._points[-1][0] - BACK:
            self._points.clear()
            self._fresh = self._number
        # Stamps are multiples of a period in floating point: a little less is as good.
        if self._points and time - self._points[-1][0] < self._spacing * (1.0 - 1e-6):
            return
        self._points.append((time, weighing.mass, *weighing.interval()))
        self._number += 1
        while self._points[0][0] < time - self._window:
            self._points.popleft()

    def since(self, number: int) -> dict[str, Any]:
        """Return the points after the first ``number``, by column; fresh where older ones go."""
        new = min(self._number - number, len(self._points))
        fresh = number <= self._fresh or new == len(self._points)
        rows = self._points if fresh else islice(self._points, len(self._points) - new, None)
        columns = list(zip(*rows, strict=True)) or [()] * 4
        names = ("time", "mass", "low", "high")
        reported = {n: [_rounded(v) for v in c] for n, c in zip(names, columns, strict=True)}
        return {"fresh": fresh, **reported}


def _rounded(value: float) -> float | None:
    return round(value, 2) if math.isfinite(value) else None


class _Newest:
    """What pages are shown: the newest weighing and the points. Threads may share it."""

    def __init__(self) -> None:
        self.closed = False
        self._lock = Lock()
        # Chosen by who makes the page; its threads do not know of it.
        self._unit = json.dumps({"name": shown_unit("kg"), "per": shown_amount(1.0, "kg")})
        self._history = History()
        self._weighing: LiveWeighing | None = None
        self._version = 0

    def show(self, weighing: LiveWeighing) -> None:
        with self._lock:
            self._weighing = weighing
            self._version += 1
            self._history.add(weighing)

    def after(self, version: int, number: int) -> tuple[int, int, str] | None:
        """Version, number of points and text of what is new; None where nothing is."""
        with self._lock:
            if self._weighing is None or self._version == version:
                return None
            weighing = self._weighing
            points = json.dumps(self._history.since(number), allow_nan=False)
            news = f'"weighing": {json_line(weighing)}, "points": {points}, "unit": {self._unit}'
            text = f"{{{news}}}"
            return self._version, self._history.number, text


class Page:
    """Serves the page from a thread of its own until it is closed.

    Requests that are no GET, and those that name another host, are refused: a page of somebody
    else cannot ask through a name that it points here (DNS rebinding).

    Parameters
    ----------
    host : address to listen on; only this machine sees the page on a loopback address
    port : to listen on; 0 for any that is free
    names : further names by which browsers may call this machine

    Raises
    ------
    ConfigError
        The address is not one of this machine, or the port is taken.
    MissingExtraError
        Starlette or uvicorn is not installed.
    """

    def __init__(self, host: str = HOST, port: int = PORT, names: Collection[str] = ()) -> None:
        try:
            import uvicorn
            from starlette.applications import Starlette  # noqa: F401
        except ImportError as error:
            package = (error.name or "starlette").partition(".")[0]
            raise MissingExtraError(package, "page", "the page of live weighings") from None
        self._newest = _Newest()
        config = uvicorn.Config(
            make_app(self._newest, host, names),
            host=host,
            port=port,
            ws="none",
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            limit_concurrency=_MOST_CONNECTIONS,
            timeout_graceful_shutdown=1,
        )
        family = AF_INET6 if ":" in host else AF_INET
        try:
            opened = create_server((host, port), family=family)
        except OSError:
            raise ConfigError(
                f"the page cannot be served on {host}:{port}: the port is taken, or the address is "
                "not one of this machine; name another"
            ) from None
        logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
        shown = f"[{host}]" if ":" in host else host
        self.name = f"http://{shown}:{opened.getsockname()[1]}/"
        self._server = uvicorn.Server(config)
        self._socket = opened
        self._thread = Thread(target=self._server.run, args=([opened],), name="page", daemon=True)
        self._thread.start()
        until = monotonic() + _BEGINNING
        while not self._server.started and self._thread.is_alive() and monotonic() < until:
            sleep(0.01)

    def show(self, weighing: LiveWeighing) -> None:
        """Let the pages show a weighing."""
        self._newest.show(weighing)

    def close(self) -> None:
        """Stop serving."""
        self._newest.closed = True
        self._server.should_exit = True
        self._thread.join(5.0)
        self._socket.close()


def make_app(newest: _Newest, host: str, names: Collection[str]) -> Starlette:
    """Make the application: the files of the page and the stream of weighings.

    Parameters
    ----------
    newest : what the stream sends
    host, names : as of `Page`
    """
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.responses import Response, StreamingResponse
    from starlette.routing import Route

    static = files("weighbridge.live.outputs") / "static"

    def handed_out(path: str, name: str, kind: str) -> Route:
        data = (static / name).read_bytes()

        async def answer(request: Request) -> Response:
            return Response(data, headers={"content-type": kind})

        return Route(f"/{path}", answer, methods=["GET"])

    async def events(request: Request) -> Response:
        return StreamingResponse(_stream(newest), headers={"content-type": "text/event-stream"})

    routes = [handed_out(path, name, kind) for path, (name, kind) in _FILES.items()]
    routes.append(Route("/events", events, methods=["GET"]))
    return Starlette(routes=routes, middleware=[Middleware(_Guard, host=host, names=names)])


async def _stream(newest: _Newest) -> AsyncIterator[str]:
    import anyio

    version = number = 0
    silent = 0.0
    yield "retry: 2000\n\n"
    while not newest.closed:
        reported = newest.after(version, number)
        if reported is not None:
            version, number, text = reported
            silent = 0.0
            yield f"data: {text}\n\n"
        elif silent >= _LIFE:
            silent = 0.0
            yield ": still here\n\n"
        await anyio.sleep(_GLANCE)
        silent += _GLANCE


class _Guard:
    """Refuses what changes state and what was meant for another host; adds the headers."""

    def __init__(self, app: ASGIApp, host: str, names: Collection[str]) -> None:
        self._app = app
        own = platform.node().lower()
        self._names = _LOOPBACK | {n.lower() for n in names}
        self._open = host.lower() not in _LOOPBACK
        if self._open:
            self._names |= {host.lower(), own, f"{own}.local"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        from starlette.responses import PlainTextResponse

        if scope["type"] != "http":
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *_HEADERS]
            await send(message)

        hosts = [value.decode("latin-1") for name, value in scope["headers"] if name == b"host"]
        answer = None
        if len(hosts) != 1 or not self._known(hosts[0]):
            answer = PlainTextResponse("This is no name of this machine.\n", 421)
        elif scope["method"] not in ("GET", "HEAD"):
            answer = PlainTextResponse("Only GET.\n", 405, {"allow": "GET, HEAD"})
        await (answer or self._app)(scope, receive, guarded)

    def _known(self, host: str) -> bool:
        """Whether a Host header names this machine: by a name of it, or by any address.

        An address cannot be pointed elsewhere, as a name can.
        """
        name = host.lower()
        # An address of IPv6 is in brackets, before the port.
        end = "]" if name.startswith("[") else ":"
        name = name.removeprefix("[").partition(end)[0]
        if name in self._names:
            return True
        try:
            ip_address(name)
        except ValueError:
            return False
        return self._open
