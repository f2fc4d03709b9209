"""Weighing while driving: samples in as they come, a mass out at any time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_use

if TYPE_CHECKING:
    from weighbridge.live.alerts import Alert
    from weighbridge.live.arrival import Arrivals, Need, needs
    from weighbridge.live.emulator import Played, devices
    from weighbridge.live.feed import Feed
    from weighbridge.live.keeper import Keeper
    from weighbridge.live.orders import OrderFile, order_file
    from weighbridge.live.outputs import Output, Outputs
    from weighbridge.live.outputs.lines import Lines
    from weighbridge.live.outputs.mqtt import Mqtt, parse_broker
    from weighbridge.live.outputs.page import Page
    from weighbridge.live.recorder import Recorder
    from weighbridge.live.recordings import Recordings
    from weighbridge.live.replay import Replay
    from weighbridge.live.scale import LiveScale
    from weighbridge.live.session import Session, order
    from weighbridge.live.source import Source
    from weighbridge.live.sources import SOURCES, parse_source
    from weighbridge.live.weighing import LiveStatus, LiveWeighing

_HOMES = {
    "SOURCES": "weighbridge.live.sources",
    "Alert": "weighbridge.live.alerts",
    "Arrivals": "weighbridge.live.arrival",
    "Feed": "weighbridge.live.feed",
    "Keeper": "weighbridge.live.keeper",
    "Lines": "weighbridge.live.outputs.lines",
    "LiveScale": "weighbridge.live.scale",
    "LiveStatus": "weighbridge.live.weighing",
    "LiveWeighing": "weighbridge.live.weighing",
    "Mqtt": "weighbridge.live.outputs.mqtt",
    "Need": "weighbridge.live.arrival",
    "OrderFile": "weighbridge.live.orders",
    "Output": "weighbridge.live.outputs",
    "Outputs": "weighbridge.live.outputs",
    "Page": "weighbridge.live.outputs.page",
    "Played": "weighbridge.live.emulator",
    "Recorder": "weighbridge.live.recorder",
    "Recordings": "weighbridge.live.recordings",
    "Replay": "weighbridge.live.replay",
    "Session": "weighbridge.live.session",
    "Source": "weighbridge.live.source",
    "devices": "weighbridge.live.emulator",
    "needs": "weighbridge.live.arrival",
    "order": "weighbridge.live.session",
    "order_file": "weighbridge.live.orders",
    "parse_broker": "weighbridge.live.outputs.mqtt",
    "parse_source": "weighbridge.live.sources",
}

__all__ = [
    "SOURCES",
    "Alert",
    "Arrivals",
    "Feed",
    "Keeper",
    "Lines",
    "LiveScale",
    "LiveStatus",
    "LiveWeighing",
    "Mqtt",
    "Need",
    "OrderFile",
    "Output",
    "Outputs",
    "Page",
    "Played",
    "Recorder",
    "Recordings",
    "Replay",
    "Session",
    "Source",
    "devices",
    "needs",
    "order",
    "order_file",
    "parse_broker",
    "parse_source",
]

__getattr__ = at_first_use(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted(__all__)
