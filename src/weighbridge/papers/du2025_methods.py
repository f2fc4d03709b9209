"""The three methods of Du et al. 2025 as they are run: ours, and as printed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Final, TypeVar

from weighbridge.balance import ForceBalance
from weighbridge.estimators import MassTrack, ekf, hybrid, robust_rls
from weighbridge.papers.claims import listed
from weighbridge.report.style import BLUE, GREEN, ORANGE
from weighbridge.vehicle.model import Vehicle

METHODS: Final = ("robust-rls", "ekf", "hybrid")

Gated = TypeVar("Gated", robust_rls.RobustRlsSettings, ekf.EkfSettings)

PAPER_RMSE: Final = {
    "no-load": (324.73, 299.26, 273.84),
    "half-load": (589.27, 389.16, 100.95),
    "full-load": (718.43, 275.46, 228.91),
}
"""Table 2, in the order of `METHODS` [kg]."""

PAPER_TIME: Final = {
    "no-load": (9.2, 12.3, 12.5),
    "half-load": (9.0, 13.1, 13.6),
    "full-load": (9.4, 12.9, 13.7),
}
"""Table 2, computing time [s]."""

BAND: Final = 0.10
"""Largest relative error after convergence that the paper states [-]."""

COLOURS: Final = dict(zip(METHODS, (ORANGE, GREEN, BLUE), strict=True))

PRINTED: Final = hybrid.HybridSettings(
    ekf=ekf.EkfFilter(
        start=robust_rls.RobustRlsFilter(
            window=0.0,
            forgetting=0.999,
            kept_information=0.0,
            offset_std=0.0,
            weight_information=False,
            every_row=True,
            rolling_coefficient=0.0005,
        ),
        grade_offset=0.0,
        offset_walk=0.0,
        gate=math.inf,
        jacobian_window=0.0,
    ),
    blend=hybrid.Blend.SPEED,
)
"""Each row by itself with a forgetting factor of 0.999, forgetting that never stops, no offset,
Huber's weight in the gain alone, the blend by speed (eqs. 15-20, 34, Table 1), every row of the
moving bus. Q and R are ours, for the paper gives none, and so are P0, of which it says that it is
typically the identity, Huber's c and the information at which the first mass is shown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """One reading of what the paper leaves open: rows, and the rolling coefficient.

    Attributes
    ----------
    code : name of its figures
    name : for people
    rolling : coefficient that the filters are given; that of the vehicle file when None [-]
    every_row : braking, shifts and slip are left to Huber's weight; else rows with a reason
        against them are left out, and speeds of 5 standard deviations too
    why, check : reason of a difference, and the command that shows it
    """

    code: str
    name: str
    rolling: float | None
    every_row: bool
    why: str
    check: str

    def of(self, settings: hybrid.HybridSettings) -> hybrid.HybridSettings:
        """Return the printed settings in this reading."""
        start = replace(
            settings.ekf.start, rolling_coefficient=self.rolling, every_row=self.every_row
        )
        gate = math.inf if self.every_row else 5.0
        return replace(settings, ekf=replace(settings.ekf, start=start, gate=gate))


_COMMAND: Final = "weighbridge reproduce du2025"
_BRAKED: Final = "brakings are rows without the brake's force, and Huber's threshold lets them in"
_CALMER: Final = f"{_COMMAND} --set printed.ekf.start.threshold=0.5"
_ROWS: Final = {
    True: ("e", "every row", _BRAKED, _CALMER),
    False: (
        "l", "rows left out", "braking, shifts and slip are left out, which the paper does not "
        "say", f"{_COMMAND} --set as_printed=true",
    ),
}  # fmt: skip
_ROLLING: Final = {
    "1": (0.0005, "f = 0.0005", "tyres have 0.0075 here, and each 0.001 less is 1.6 % of mass",
          f"{_COMMAND} --set as_printed=true --set rolling_coefficient=0.0075"),
    "10": (0.005, "f = 0.005", "tyres have 0.0075 here, and each 0.001 less is 1.6 % of mass",
           f"{_COMMAND} --set as_printed=true --set rolling_coefficient=0.0075"),
    "t": (None, "f of the tyres", "f is exact here, unlike in the paper", ""),
}  # fmt: skip

FORMS: Final = tuple(
    Form(
        code=f"{rows}{code}",
        name=f"{words}, {name}",
        rolling=rolling,
        every_row=every,
        why=listed(f_why, why),
        check=check if every else f_check or check,
    )
    for every, (rows, words, why, check) in _ROWS.items()
    for code, (rolling, name, f_why, f_check) in _ROLLING.items()
)
"""As printed first: every row, f = 0.0005."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How the paper's methods are run.

    Attributes
    ----------
    ours, printed : of the blend and of both filters within it, by our defaults and as printed;
        ``printed.ekf.start.forgetting`` is the paper's λ
    as_printed : take ``printed`` in place of ``ours``, rows with a reason against them left out
        where ``printed.ekf.start.every_row`` is false
    count_grade_twice : in the regressor, as eq. 14 is printed
    rolling_coefficient : that the filters are told in place of the vehicle's [-]
    blend : of the hybrid, short for ``ours.blend``; not when ``as_printed``
    """

    ours: hybrid.HybridSettings = field(default_factory=hybrid.HybridSettings)
    printed: hybrid.HybridSettings = PRINTED
    as_printed: bool = False
    count_grade_twice: bool = False
    rolling_coefficient: float | None = None
    blend: hybrid.Blend = hybrid.HybridSettings().blend

    @property
    def chosen(self) -> hybrid.HybridSettings:
        """Settings of the blend, and of both filters within it."""
        whole = self.printed if self.as_printed else self.ours
        least = whole.ekf.start
        if self.count_grade_twice:
            least = replace(least, count_grade_twice=True)
        if self.rolling_coefficient is not None:
            least = replace(least, rolling_coefficient=self.rolling_coefficient)
        if not self.as_printed and self.blend is not hybrid.HybridSettings().blend:
            whole = replace(whole, blend=self.blend)
        return replace(whole, ekf=replace(whole.ekf, start=least))

    def blended(self, blend: hybrid.Blend) -> Settings:
        """Return the same with another blend of ours."""
        usual = hybrid.HybridSettings().blend
        return replace(self, blend=usual, ours=replace(self.ours, blend=blend))

    @property
    def estimators(self) -> dict[str, Callable[[ForceBalance, Vehicle], MassTrack]]:
        """The three methods with these settings."""
        whole = self.chosen
        least = _gated(robust_rls.RobustRlsSettings, whole.ekf.start)
        kalman = _gated(ekf.EkfSettings, whole.ekf)
        return {
            "robust-rls": partial(robust_rls.estimate, settings=least),
            "ekf": partial(ekf.estimate, settings=kalman),
            "hybrid": partial(hybrid.estimate, settings=whole),
        }


def _gated(kind: type[Gated], filter_settings: object) -> Gated:
    """Return settings of a filter with the usual gate, as the method alone takes them."""
    names = (f.name for f in fields(filter_settings))  # type: ignore[arg-type]
    return kind(**{name: getattr(filter_settings, name) for name in names})


def setting_rows() -> list[tuple[str, str]]:
    """Return the defaults of the three methods by name, as rows of a table."""
    both = hybrid.HybridSettings()
    chosen: list[tuple[str, object]] = [
        ("robust-rls", both.ekf.start),
        ("ekf", both.ekf),
        ("hybrid", both),
    ]
    return [
        (f"{method} {f.name}", f"{getattr(settings, f.name)}")
        for method, settings in chosen
        for f in fields(settings)  # type: ignore[arg-type]
        if f.name not in ("start", "ekf")
    ]
