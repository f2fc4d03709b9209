"""Alerts when a mass is probably above or below a limit, with hysteresis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from weighbridge.errors import ConfigError
from weighbridge.live.weighing import AlertState, LiveStatus, LiveWeighing, Side

ON: Final = 0.95
"""An alert begins when its case is so probable [-],"""

OFF: Final = 0.5
"""and ends when it is less probable than that [-]: in between it stays as it is."""


@dataclass(frozen=True, slots=True)
class Event:
    """An alert that began or ended.

    Attributes
    ----------
    text : one sentence
    on : it began
    probability : of its case [-]
    """

    text: str
    on: bool
    probability: float


class Alert:
    """Watches one limit.

    Parameters
    ----------
    limit : [kg]
    above : whether the case is a mass above the limit, else one below
    on, off : probabilities at which it begins and ends [-]

    Raises
    ------
    ConfigError
        The limit is no mass, or the probabilities are not in order.
    """

    def __init__(
        self, limit: float, *, above: bool = True, on: float = ON, off: float = OFF
    ) -> None:
        if not 0.0 < limit < 1e6:
            raise ConfigError(f"a limit of {limit:g} kg is no mass of a vehicle")
        if not 0.0 < off <= on < 1.0:
            raise ConfigError(f"an alert that begins at {on:g} and ends at {off:g} never rests")
        self.limit, self.above = limit, above
        self.active = False
        self._on, self._off = on, off

    @property
    def side(self) -> Side:
        """On which side of the limit its case is."""
        return "above" if self.above else "below"

    @property
    def text(self) -> str:
        """What it says while it is active."""
        return f"{self.side} {self.limit:.0f} kg"

    def state(self, weighing: LiveWeighing) -> AlertState:
        """Return how it stands at a weighing."""
        return AlertState(
            limit=self.limit,
            side=self.side,
            active=self.active,
            probability=self._probability(weighing),
        )

    def _probability(self, weighing: LiveWeighing) -> float | None:
        probability = weighing.above(self.limit)
        return probability if self.above or probability is None else 1.0 - probability

    def look(self, weighing: LiveWeighing) -> Event | None:
        """Return the event that a weighing makes; None where nothing changes.

        A mass that is withdrawn or not yet within 5 % changes nothing.
        """
        if weighing.status is not LiveStatus.WEIGHED:
            return None
        case = self._probability(weighing)
        if case is None:
            return None
        wanted = case >= (self._off if self.active else self._on)
        if wanted == self.active:
            return None
        self.active = wanted
        text = (
            f"{'' if wanted else 'no longer '}{self.text}: "
            f"{weighing.mass:.0f} kg, with probability {case:.2f}"
        )
        return Event(text, wanted, case)
