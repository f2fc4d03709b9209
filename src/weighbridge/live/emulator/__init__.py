"""Devices that are not there: a recorded drive comes out of an adapter, a receiver and a sensor."""

from weighbridge.live.emulator.devices import devices
from weighbridge.live.emulator.played import Played

__all__ = ["Played", "devices"]
