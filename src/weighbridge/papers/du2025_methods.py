"""The three methods of Du et al. 2025 as they are run: ours, and as printed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Final, TypeVar

from weighbridge.balance import ForceBalance
from weighbridge.estimators import MassTrack, ekf, hybrid, robust_rls
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

PRINTED_ROLLING: Final[dict[str, float | None]] = {
    "f = 0.0005": 0.0005,
    "f = 0.005": 0.005,
    "f of the tyres": None,
}
"""Rolling coefficients that the filters as printed are told: that of Table 1, ten times it, and
that of the vehicle file, with its growth with speed."""


PRINTED: Final = hybrid.HybridSettings(
    ekf=ekf.EkfFilter(
        start=robust_rls.RobustRlsFilter(
            window=0.0,
            forgetting=0.999,
            kept_information=0.0,
            offset_std=0.0,
            weight_information=False,
        ),
        grade_offset=0.0,
        offset_walk=0.0,
        jacobian_window=0.0,
    ),
    blend=hybrid.Blend.SPEED,
)
"""Each row by itself with a forgetting factor of 0.999, forgetting that never stops, no offset,
Huber's weight in the gain alone, the blend by speed (eqs. 15-20, 34, Table 1). Q and R are ours,
for the paper gives none, and so is P0, of which it says that it is typically the identity."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How the paper's methods are run.

    Attributes
    ----------
    ours, printed : of the blend and of both filters within it, by our defaults and as printed;
        ``printed.ekf.start.forgetting`` is the paper's λ
    as_printed : take ``printed`` in place of ``ours``
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

    def started_within(self, std: float) -> Settings:
        """Return the same with another start of the printed Kalman filter, relative [-]."""
        kalman = replace(self.printed.ekf, start_std=std)
        return replace(self, printed=replace(self.printed, ekf=kalman))

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
