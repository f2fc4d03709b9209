"""Weighing while driving: samples in as they come, a mass out at any time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_uses

if TYPE_CHECKING:
    from weighbridge.live.alerts import Alert as Alert
    from weighbridge.live.arrival import Arrivals as Arrivals
    from weighbridge.live.arrival import Need as Need
    from weighbridge.live.arrival import needs as needs
    from weighbridge.live.emulator import Played as Played
    from weighbridge.live.emulator import devices as devices
    from weighbridge.live.feed import Feed as Feed
    from weighbridge.live.keeper import Keeper as Keeper
    from weighbridge.live.orders import OrderFile as OrderFile
    from weighbridge.live.orders import order_file as order_file
    from weighbridge.live.outputs import Output as Output
    from weighbridge.live.outputs import Outputs as Outputs
    from weighbridge.live.outputs.lines import Lines as Lines
    from weighbridge.live.outputs.mqtt import Mqtt as Mqtt
    from weighbridge.live.outputs.mqtt import parse_broker as parse_broker
    from weighbridge.live.outputs.page import Page as Page
    from weighbridge.live.recorder import Recorder as Recorder
    from weighbridge.live.recordings import Recordings as Recordings
    from weighbridge.live.replay import Replay as Replay
    from weighbridge.live.scale import LiveScale as LiveScale
    from weighbridge.live.session import Session as Session
    from weighbridge.live.session import order as order
    from weighbridge.live.source import Source as Source
    from weighbridge.live.sources import SOURCES as SOURCES
    from weighbridge.live.sources import parse_source as parse_source
    from weighbridge.live.weighing import LiveStatus as LiveStatus
    from weighbridge.live.weighing import LiveWeighing as LiveWeighing

__getattr__, __dir__, __all__ = at_first_uses(
    __name__,
    {
        "alerts": "Alert",
        "arrival": "Arrivals Need needs",
        "emulator": "Played devices",
        "feed": "Feed",
        "keeper": "Keeper",
        "orders": "OrderFile order_file",
        "outputs": "Output Outputs",
        "outputs.lines": "Lines",
        "outputs.mqtt": "Mqtt parse_broker",
        "outputs.page": "Page",
        "recorder": "Recorder",
        "recordings": "Recordings",
        "replay": "Replay",
        "scale": "LiveScale",
        "session": "Session order",
        "source": "Source",
        "sources": "SOURCES parse_source",
        "weighing": "LiveStatus LiveWeighing",
    },
)
