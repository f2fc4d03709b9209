"""A weighing for a broker of MQTT: its topics, for Home Assistant and by COVESA VSS."""

from __future__ import annotations

import json
import logging
import math
import re
import secrets
import sqlite3
import unicodedata
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition, Event, Lock, Thread
from time import monotonic
from typing import TYPE_CHECKING, Any, Final, NamedTuple
from urllib.parse import unquote, urlsplit

from weighbridge.data import toml_of
from weighbridge.errors import ConfigError, MissingExtraError, WeighbridgeError
from weighbridge.live.outputs.lines import json_line
from weighbridge.live.outputs.thinning import News, due, news
from weighbridge.live.weighing import LiveStatus, LiveWeighing, Side
from weighbridge.version import VERSION

if TYPE_CHECKING:
    from paho.mqtt.client import Client


MOST: Final = 50_000
"""Messages that wait at most: some 30 hours of weighings each 5 s, 100 MB."""

_TABLE: Final = """
CREATE TABLE IF NOT EXISTS messages (
    number INTEGER PRIMARY KEY AUTOINCREMENT, topic TEXT NOT NULL, payload BLOB NOT NULL
)"""


_HEAD: Final = b"SQLite format 3\0"

# Marks a file of SQLite as an outbox: "wbob".
_MARK: Final = 0x77626F62


class Message(NamedTuple):
    """A message that waits.

    ``number`` rises in the order in which messages were put in.
    """

    number: int
    topic: str
    payload: bytes


class Outbox:
    """A queue in a file of SQLite; it outlives the process. Threads may share it.

    Beyond ``most`` messages the oldest are dropped and counted. A file that is damaged is set
    aside and a new one begun.

    Parameters
    ----------
    path : the file
    most : messages that wait at most

    Attributes
    ----------
    own : a few letters and digits that hardly any other outbox has; they stay with the file

    Raises
    ------
    ConfigError
        It cannot be opened, or another process has it.
    """

    def __init__(self, path: str | Path, most: int = MOST) -> None:
        self.path = Path(path)
        self.dropped = 0
        self._most = most
        self._lock = Lock()
        self._removed: set[int] = set()
        try:
            self._database = self._opened()
        except sqlite3.OperationalError as error:
            raise self._failure(error) from None
        except sqlite3.DatabaseError:
            self._database = self._begun_anew()
        self.own = f"{self._database.execute('PRAGMA user_version').fetchone()[0]:06x}"
        self._count = int(self._database.execute("SELECT count(*) FROM messages").fetchone()[0])

    def __len__(self) -> int:
        return self._count - len(self._removed)

    def put(self, messages: list[tuple[str, bytes]]) -> None:
        """Append messages, given as topic and payload.

        Raises
        ------
        WeighbridgeError
            The disk is full or gone; none of them was taken.
        """
        with self._lock:
            self._remove()
            over = max(self._count + len(messages) - self._most, 0)
            try:
                with self._database as d:
                    d.executemany("INSERT INTO messages (topic, payload) VALUES (?, ?)", messages)
                    if over:
                        d.execute(
                            "DELETE FROM messages WHERE number IN "
                            "(SELECT number FROM messages ORDER BY number LIMIT ?)",
                            (over,),
                        )
            except sqlite3.Error as error:
                raise WeighbridgeError(
                    f"{self.path} cannot be written ({error}): messages are lost until there is "
                    "room on the disk; weighing goes on"
                ) from None
            self._count += len(messages) - over
            if over and not self.dropped:
                _logger.warning(
                    "%s: more than %d messages wait for the broker; the oldest are dropped",
                    self.path,
                    self._most,
                )
            self.dropped += over

    def after(self, number: int, most: int) -> list[Message]:
        """Return the oldest messages behind ``number``, at most so many."""
        with self._lock:
            rows = self._database.execute(
                "SELECT number, topic, payload FROM messages WHERE number > ? "
                "ORDER BY number LIMIT ?",
                (number, most + len(self._removed)),
            )
            left = [Message(*row) for row in rows if row[0] not in self._removed]
            return left[:most]

    def remove(self, numbers: list[int]) -> None:
        """Remove messages that were taken; where the disk is full, when it has room again."""
        with self._lock:
            self._removed.update(numbers)
            self._remove()

    def _remove(self) -> None:
        if not self._removed:
            return
        try:
            with self._database as d:
                removed = d.executemany(
                    "DELETE FROM messages WHERE number = ?", [(n,) for n in self._removed]
                )
        except sqlite3.Error:
            return
        self._count -= removed.rowcount
        self._removed.clear()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._database.close()

    def _opened(self) -> sqlite3.Connection:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        database = sqlite3.connect(self.path, timeout=1.0, check_same_thread=False)
        try:
            # One owner: two senders would send everything twice.
            database.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._refuse_foreign(database)
            database.execute("PRAGMA journal_mode = WAL")
            # Each commit is flushed: a power cut loses nothing that was taken, and nothing that was
            # confirmed is sent again.
            database.execute("PRAGMA synchronous = FULL")
            database.execute("BEGIN EXCLUSIVE")
            database.execute(f"PRAGMA application_id = {_MARK}")
            database.execute(_TABLE)
            if database.execute("PRAGMA user_version").fetchone()[0] == 0:
                database.execute(f"PRAGMA user_version = {1 + secrets.randbelow(0xFFFFFF)}")
            database.commit()
            if database.execute("PRAGMA quick_check").fetchone()[0] != "ok":
                raise sqlite3.DatabaseError("damaged")
        except BaseException:
            database.close()
            raise
        return database

    def _refuse_foreign(self, database: sqlite3.Connection) -> None:
        mark = database.execute("PRAGMA application_id").fetchone()[0]
        tables = database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if tables and mark != _MARK:
            raise ConfigError(f"{self.path} is a database of something else; name another outbox")

    def _begun_anew(self) -> sqlite3.Connection:
        with self.path.open("rb") as file:
            head = file.read(len(_HEAD))
        if head.strip(b"\0") and head != _HEAD:
            raise ConfigError(f"{self.path} is no outbox; name another file")
        aside = self.path.with_name(f"{self.path.name}.damaged")
        try:
            self.path.replace(aside)
            for end in ("-wal", "-shm"):
                self.path.with_name(self.path.name + end).unlink(missing_ok=True)
            _logger.warning("%s is damaged: it was set aside as %s", self.path, aside.name)
            return self._opened()
        except (OSError, sqlite3.Error) as error:
            raise self._failure(error) from None

    def _failure(self, error: Exception) -> ConfigError:
        if "locked" in str(error):
            return ConfigError(
                f"{self.path} is used by another weighbridge: end that one, or name another outbox"
            )
        return ConfigError(f"{self.path} cannot be used as an outbox ({error}); name another file")


_logger = logging.getLogger(__name__)

PERIOD: Final = 5.0
"""Weighings are sent at most so often, and whenever the status changes [s]."""

VSS_TOPIC: Final = "Vehicle/CurrentOverallWeight"
"""COVESA Vehicle Signal Specification 5.0 and 6.0, ``Vehicle.CurrentOverallWeight``: uint16, kg."""

_HIGHEST: Final = 65_535

_SIDES: Final[tuple[Side, ...]] = ("above", "below")

# What is left of a vehicle's name where its owner gave it none, or none in Latin letters.
_UNNAMED: Final = "vehicle"

# Messages that the broker has not yet confirmed at once.
_WINDOW: Final = 20
_KEEPALIVE: Final = 30
_ANSWER: Final = 5.0
# How long the last messages are waited for at the end [s].
_FAREWELL: Final = 3.0
_SHORTEST_PAUSE: Final = 1.0
_LONGEST_PAUSE: Final = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """Where a broker is and who we are to it.

    Attributes
    ----------
    host, port : of the broker
    tls : the connection is encrypted, the certificate checked
    user, password : None for none
    prefix : first levels of all topics
    """

    host: str
    port: int
    tls: bool = False
    user: str | None = None
    password: str | None = field(default=None, repr=False)
    prefix: str = "weighbridge"

    @property
    def name(self) -> str:
        """Where it is, without who we are."""
        return f"mqtt{'s' if self.tls else ''}://{self.host}:{self.port}"


def parse_broker(url: str) -> Broker:
    """Read ``mqtt://user:password@host:port/prefix``; ``mqtts`` for an encrypted connection.

    Raises
    ------
    ConfigError
        It is none.
    """
    form = "write mqtt://USER:PASSWORD@HOST:PORT/PREFIX, or mqtts:// for an encrypted one"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        raise ConfigError(f"the address of the broker has no valid host and port: {form}") from None
    if parts.scheme not in ("mqtt", "mqtts") or not parts.hostname or parts.query or parts.fragment:
        # The address may hold a password and is not repeated.
        raise ConfigError(f"the address of the broker is no address of MQTT: {form}")
    prefix = unquote(parts.path).strip("/") or "weighbridge"
    if re.search(r"[+#\x00-\x1f]", prefix):
        raise ConfigError(f"topics cannot begin with {prefix!r}: leave +, # and controls out")
    tls = parts.scheme == "mqtts"
    return Broker(
        host=parts.hostname,
        port=port or (8883 if tls else 1883),
        tls=tls,
        user=unquote(parts.username) if parts.username else None,
        password=unquote(parts.password) if parts.password else None,
        prefix=prefix,
    )


def slug(vehicle: str) -> str:
    """Write a vehicle's name with what a topic and Home Assistant allow: a-z, 0-9, - and _."""
    plain = unicodedata.normalize("NFKD", vehicle).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9_-]+", "-", plain).strip("-") or _UNNAMED


class Topics:
    """Topics of one vehicle, and what is said on them.

    Parameters
    ----------
    prefix : first levels of all
    vehicle : its name
    sides : of the limits that are watched
    own : shows this scale from others, where the name of the vehicle does not
    """

    def __init__(
        self, prefix: str, vehicle: str, sides: Collection[Side] = (), *, own: str = ""
    ) -> None:
        self._sides = sides
        unnamed = own and slug(vehicle) == _UNNAMED
        self.vehicle = f"{vehicle} {own}" if unnamed else vehicle
        self.node = f"{_UNNAMED}-{own}" if unnamed else slug(vehicle)
        self.weighing = f"{prefix}/{self.node}/weighing"
        self.available = f"{prefix}/{self.node}/available"
        self.vss = f"{prefix}/{self.node}/{VSS_TOPIC}"

    def messages(self, weighing: LiveWeighing) -> list[tuple[str, bytes]]:
        """Return the messages of a weighing, as topic and payload.

        The weight by VSS carries no uncertainty: it is shown where the vehicle is weighed, and
        withdrawn by an empty message where it is not.
        """
        mass = weighing.mass
        reported = weighing.status is LiveStatus.WEIGHED and 0.0 <= mass <= _HIGHEST
        return [
            (self.weighing, json_line(weighing).encode("ascii")),
            (self.vss, f"{mass:.0f}".encode("ascii") if reported else b""),
        ]

    def discovery(self) -> list[tuple[str, bytes]]:
        """Return what describes the scale to Home Assistant, as topic and payload.

        One message describes the device with all its entities. An alert that is not watched is
        named with its platform alone, which takes it back. Empty messages take back the topics of
        each entity, which versions until 0.3 used.

        References
        ----------
        Home Assistant, MQTT integration, device discovery payload.
        """
        listed = toml_of("live.outputs", "homeassistant.toml")
        listed["reasons"]["json_attributes_topic"] = self.weighing
        entities = {}
        for key, entity in listed["entity"].items():
            more = listed.get(entity.pop("like", ""), {})
            known = key not in _SIDES or key in self._sides
            entities[key] = {"p": entity["p"]}
            if known:
                entities[key] |= entity | {"unique_id": f"weighbridge_{self.node}_{key}"} | more
        origin = {"name": "weighbridge", "sw": VERSION}
        device = {
            "ids": [f"weighbridge_{self.node}"],
            "name": self.vehicle,
            "mf": "weighbridge",
            "mdl": "software weighbridge",
            "sw": VERSION,
        }
        payload = {
            "dev": device,
            "o": origin,
            "cmps": entities,
            "state_topic": self.weighing,
            "availability_topic": self.available,
        }
        node = f"weighbridge_{self.node}"
        before = [
            (f"homeassistant/{entity['p']}/{node}/{key}/config", b"")
            for key, entity in entities.items()
        ]
        return [*before, (f"homeassistant/device/{node}/config", json.dumps(payload).encode())]


class Mqtt:
    """Sends weighings to a broker, all of them, in order, each at least once.

    Each waits in the outbox until the broker has confirmed it. A lost broker is sought until it
    is back. The last message of each topic is retained by the broker.

    Parameters
    ----------
    broker : where it is
    vehicle : name of the vehicle
    outbox : file of the messages that wait
    sides : of the limits that are watched
    most : of them; beyond, the oldest are dropped and counted
    period : a weighing is sent so often, and where status or an alert change [s]
    pauses : shortest and longest time until a lost broker is tried again [s]

    Raises
    ------
    ConfigError
        The outbox cannot be used.
    MissingExtraError
        paho-mqtt is not installed.
    """

    def __init__(
        self,
        broker: Broker,
        vehicle: str,
        outbox: str | Path,
        *,
        sides: Collection[Side] = (),
        most: int = MOST,
        period: float = PERIOD,
        pauses: tuple[float, float] = (_SHORTEST_PAUSE, _LONGEST_PAUSE),
    ) -> None:
        try:
            import paho.mqtt.client  # noqa: F401
        except ImportError:
            raise MissingExtraError("paho-mqtt", "mqtt", "sending to a broker of MQTT") from None
        self.name = broker.name
        self._broker = broker
        self._period = period
        self._pauses = pauses
        self._outbox = Outbox(outbox, most)
        self._topics = Topics(broker.prefix, vehicle, sides, own=self._outbox.own)
        self._news: News | None = None
        self._newest = math.nan
        self._held: LiveWeighing | None = None
        self._stop = Event()
        self._changed = Condition()
        self._reported = False
        self._thread = Thread(target=self._run, name=self.name, daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Messages that the broker has not confirmed yet."""
        return len(self._outbox)

    @property
    def dropped(self) -> int:
        """Messages dropped because too many waited."""
        return self._outbox.dropped

    def show(self, weighing: LiveWeighing) -> None:
        """Put a weighing into the outbox where one is due; hold the newest back until one is.

        Raises
        ------
        WeighbridgeError
            The disk is full or gone.
        """
        self._held = weighing
        if news(weighing) != self._news or due(weighing, self._newest, self._period):
            self._put()

    def close(self) -> None:
        """Send the last weighing and what waits if the broker is there, say goodbye, and end."""
        if self._held is not None:
            try:
                self._put()
            except WeighbridgeError as error:
                _logger.warning("%s", error)
        self._stop.set()
        with self._changed:
            self._changed.notify_all()
        self._thread.join()
        self._outbox.close()

    def _put(self) -> None:
        """Put the newest weighing into the outbox."""
        weighing = self._held
        assert weighing is not None
        self._outbox.put(self._topics.messages(weighing))
        self._news, self._newest, self._held = news(weighing), weighing.newest, None
        with self._changed:
            self._changed.notify_all()

    def _run(self) -> None:
        shortest, longest = self._pauses
        pause = shortest
        while not self._stop.is_set():
            session = _Session(self._broker, self._topics, self._outbox, self._changed)
            try:
                session.begin()
                self._tell("")
                pause = shortest
                session.send(self._stop)
            except (OSError, ValueError, sqlite3.Error) as error:
                self._tell(str(error))
            finally:
                session.end()
            if not self._stop.is_set():
                self._tell("the connection is lost")
            self._stop.wait(pause)
            pause = min(2.0 * pause, longest)

    def _tell(self, trouble: str) -> None:
        """Log once that the broker is gone, and once that it is back."""
        if trouble and not self._reported:
            _logger.warning("%s: %s; messages wait until it is back", self.name, trouble)
        elif not trouble and self._reported:
            _logger.warning("%s is back, %d messages waited", self.name, self.waiting)
        self._reported = bool(trouble)


class _Session:
    """One connection to the broker, from greeting to loss.

    What was not confirmed in it is sent again in the next, from the oldest on, so that the
    order stays.
    """

    def __init__(self, broker: Broker, topics: Topics, outbox: Outbox, changed: Condition) -> None:
        self._broker = broker
        self._topics = topics
        self._outbox = outbox
        self._changed = changed
        self._client = self._made()
        self._answer: str | None = None
        self._lost = False
        self._sent: dict[int, int] = {}
        self._confirmed: set[int] = set()

    def begin(self) -> None:
        """Connect, and say who we are.

        Raises
        ------
        OSError
            The broker is not there or refuses.
        """
        self._client.connect(self._broker.host, self._broker.port, _KEEPALIVE)
        self._client.loop_start()
        with self._changed:
            self._changed.wait_for(lambda: self._answer is not None or self._lost, _ANSWER)
        if self._answer is None:
            raise OSError("the broker does not answer")
        if self._answer:
            raise OSError(f"the broker refuses: {self._answer}")
        for topic, payload in (*self._topics.discovery(), (self._topics.available, b"online")):
            self._client.publish(topic, payload, qos=1, retain=True)

    def send(self, stop: Event) -> None:
        """Send what waits and what comes, until the broker is lost or all is said at the end.

        Raises
        ------
        sqlite3.Error
            The outbox cannot be read.
        """
        newest = 0
        until = float("inf")
        while not self._lost:
            self._clear()
            if stop.is_set() and until == float("inf"):
                until = monotonic() + _FAREWELL
            if stop.is_set() and (monotonic() > until or not (self._sent or len(self._outbox))):
                break
            room = _WINDOW - len(self._sent)
            found = self._outbox.after(newest, room) if room > 0 else []
            for message in found:
                reported = self._client.publish(message.topic, message.payload, qos=1, retain=True)
                with self._changed:
                    self._sent[reported.mid] = message.number
                newest = message.number
            if not found:
                with self._changed:
                    self._changed.wait(0.05 if stop.is_set() else 0.5)
        if not self._lost:
            reported = self._client.publish(self._topics.available, b"offline", qos=1, retain=True)
            reported.wait_for_publish(1.0)

    def end(self) -> None:
        """Close the connection, whatever its state."""
        if not self._lost:
            self._client.disconnect()
        self._client.loop_stop()
        self._clear()

    def _clear(self) -> None:
        """Take what the broker has confirmed out of the outbox."""
        with self._changed:
            numbers = [self._sent.pop(mid) for mid in self._confirmed if mid in self._sent]
            self._confirmed.clear()
        if numbers:
            self._outbox.remove(numbers)

    def _made(self) -> Client:
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion

        broker = self._broker
        name = f"weighbridge-{self._topics.node}-{secrets.token_hex(3)}"
        client = Client(CallbackAPIVersion.VERSION2, client_id=name, reconnect_on_failure=False)
        if broker.user is not None:
            client.username_pw_set(broker.user, broker.password)
        if broker.tls:
            client.tls_set()
        client.will_set(self._topics.available, b"offline", qos=1, retain=True)
        client.connect_timeout = _ANSWER
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_publish = self._on_publish
        return client

    def _on_connect(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        with self._changed:
            self._answer = str(reason) if reason.is_failure else ""
            self._changed.notify_all()

    def _on_disconnect(self, client: Any, data: Any, flags: Any, reason: Any, prop: Any) -> None:
        with self._changed:
            self._lost = True
            self._changed.notify_all()

    def _on_publish(self, client: Any, data: Any, mid: int, reason: Any, properties: Any) -> None:
        with self._changed:
            self._confirmed.add(mid)
            self._changed.notify_all()
