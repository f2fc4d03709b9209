"""The three methods of Du et al. 2025 as they are run: ours, and as printed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Final, TypeVar

from weighbridge.balance import ForceBalance
from weighbridge.estimators import MassTrack, changed, ekf, hybrid, parsed, robust_rls
from weighbridge.report.style import BLUE, GREEN, ORANGE
from weighbridge.vehicle import Vehicle

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
            noisy_motion=False,
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
    """One reading of what the paper does not state: rows, rolling coefficient, threshold, blend.

    Attributes
    ----------
    code : name of its figures
    rolling : coefficient that the filters are given [-]
    every_row : braking, shifts and slip are left to Huber's weight; else rows with a reason
        against them are left out, and speeds of 5 standard deviations too
    threshold : Huber's, in standard deviations [-]; that of the settings when None
    share : constant share of the least squares in the blend [-]; h(v) when None
    """

    code: str
    rolling: float
    every_row: bool
    threshold: float | None = None
    share: float | None = None

    @property
    def name(self) -> str:
        """For people."""
        return ", ".join(
            (
                "every row" if self.every_row else "rows left out",
                f"f = {self.rolling:g}",
                *(() if self.threshold is None else (f"Huber's threshold {self.threshold:g}",)),
                *(() if self.share is None else (f"a constant share of {self.share:g}",)),
            )
        )

    @property
    def changes(self) -> tuple[str, ...]:
        """What it changes of the printed settings, as a command has it."""
        start = "printed.ekf.start"
        return (
            *(() if self.every_row else (f"{start}.every_row=false", "printed.ekf.gate=5")),
            f"{start}.rolling_coefficient={self.rolling:g}",
            *(() if self.threshold is None else (f"{start}.threshold={self.threshold:g}",)),
            *(
                ()
                if self.share is None
                else ("printed.blend=share", f"printed.blend_share={self.share:g}")
            ),
        )

    @property
    def check(self) -> str:
        """Command whose rows are by this reading."""
        return " --set ".join(("weighbridge reproduce du2025", *self.changes))

    def of(self, settings: hybrid.HybridSettings) -> hybrid.HybridSettings:
        """Return the printed settings in this reading; the first is the settings themselves."""
        if self is FORMS[0]:
            return settings
        named = (change.removeprefix("printed.") for change in self.changes)
        chosen: hybrid.HybridSettings = changed(settings, parsed(tuple(named)))
        return chosen


FORMS: Final = tuple(
    Form(code=f"{rows}{code}", rolling=rolling, every_row=rows == "e")
    for rows in "el"
    for code, rolling in (("1", 0.0005), ("10", 0.005), ("t", 0.0075))
)
"""As printed first: every row, f = 0.0005. The simulated tyres have 0.0075, as buses do."""

READINGS: Final = (
    *FORMS,
    Form(code="e8", rolling=0.004, every_row=True),
    *(
        Form(code=f"l{rolling}", rolling=rolling, every_row=False)
        for rolling in (0.0053, 0.0057, 0.0066, 0.0072)
    ),
    Form(code="blend", rolling=0.003, every_row=True, threshold=0.5, share=0.05),
)
"""Those in which a printed figure is looked for that is not found as printed."""


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
    rolling_coefficient : that the filters use in place of the vehicle's [-]
    payloads : of the judged drives, without, at half and at full load [kg]
    blend : of the hybrid, short for ``ours.blend``; not when ``as_printed``
    """

    ours: hybrid.HybridSettings = field(default_factory=hybrid.HybridSettings)
    printed: hybrid.HybridSettings = PRINTED
    as_printed: bool = False
    count_grade_twice: bool = False
    rolling_coefficient: float | None = None
    payloads: tuple[float, float, float] = (0.0, 3000.0, 6000.0)
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
