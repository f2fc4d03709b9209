"""A control unit on a virtual CAN bus, which answers requests of OBD-II."""

from __future__ import annotations

from threading import Event, Thread

import can

from weighbridge.io.obd import LENGTHS


class SimulatedEcu:
    """Answers service 01 and keeps every frame it hears.

    Parameters
    ----------
    channel : of the virtual bus
    values : bytes by parameter
    extended : whether it speaks with identifiers of 29 bits
    alone : whether it answers the first of several parameters only
    unit : number among the control units
    """

    def __init__(self, channel, values, *, extended=False, alone=False, unit=0):
        self.values = dict(values)
        self.heard = []
        self.silent = False
        self._alone = alone
        self._extended = extended
        self._mine = (0x18DA00F1 | (0x10 + unit) << 8) if extended else 0x7E0 + unit
        self._all = 0x18DB33F1 if extended else 0x7DF
        self._answer = (0x18DAF100 | (0x10 + unit)) if extended else 0x7E8 + unit
        self._bus = can.Bus(interface="virtual", channel=channel)
        self._stop = Event()
        self._thread = Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()
        self._bus.shutdown()

    def send(self, identifier, data, *, extended=False):
        """Put a frame of another kind on the bus."""
        self._bus.send(
            can.Message(arbitration_id=identifier, is_extended_id=extended, data=bytes(data))
        )

    def _run(self):
        while not self._stop.is_set():
            message = self._bus.recv(0.02)
            if message is None:
                continue
            self.heard.append(message)
            if self.silent or message.is_extended_id != self._extended:
                continue
            if message.arbitration_id not in (self._mine, self._all):
                continue
            data = bytes(message.data)
            if data[0] >> 4 == 0 and data[1] == 0x01:
                self._reply(data[2 : 1 + data[0]])

    def _reply(self, parameters):
        answer = bytes([0x41])
        for number in parameters[:1] if self._alone else parameters:
            if number % 0x20 == 0:
                answer += bytes([number]) + self._list(number)
            elif number in self.values:
                assert len(self.values[number]) == LENGTHS[number]
                answer += bytes([number]) + self.values[number]
        if len(answer) == 1:
            return
        if len(answer) <= 7:
            self._put(bytes([len(answer)]) + answer)
        else:
            # Whoever asks for so much must send a flow control, which is kept in `heard`.
            self._put(bytes([0x10, len(answer)]) + answer[:6])

    def _list(self, first):
        bits = 0
        for number in self.values:
            if first < number <= first + 0x20:
                bits |= 1 << (0x20 - (number - first))
        if any(number > first + 0x20 for number in self.values):
            bits |= 1
        return bits.to_bytes(4)

    def _put(self, data):
        self._bus.send(
            can.Message(
                arbitration_id=self._answer,
                is_extended_id=self._extended,
                data=data.ljust(8, b"\x55"),
            )
        )
