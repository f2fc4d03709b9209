"""Physical constants, in SI, and one of statistics."""

from typing import Final

GRAVITY: Final = 9.81
"""Acceleration of free fall in all models [m/s^2] (Jensen 2022, sec. 5.2)."""

STANDARD_GRAVITY: Final = 9.80665
"""What an accelerometer's unit g is [m/s^2] (CGPM 1901)."""

EARTH_RADIUS: Final = 6_371_008.8
"""Mean radius of the Earth [m] (IUGG)."""

GAS_CONSTANT_DRY_AIR: Final = 287.05
"""Specific gas constant of dry air [J/(kg K)] (ISO 2533)."""

STANDARD_PRESSURE: Final = 101_325.0
"""Sea-level pressure of the standard atmosphere [Pa] (ISO 2533)."""

STANDARD_TEMPERATURE: Final = 288.15
"""Sea-level temperature of the standard atmosphere [K] (ISO 2533)."""

TEMPERATURE_LAPSE: Final = 0.0065
"""Temperature lapse rate of the troposphere [K/m] (ISO 2533)."""

PETROL_STOICHIOMETRIC_RATIO: Final = 14.7
"""Air mass per petrol mass at stoichiometry [-] (Jensen 2022, sec. 7.1)."""

PETROL_HEATING_VALUE: Final = 45.0e6
"""Heating value of petrol [J/kg] (Jensen 2022, sec. 7.1)."""

HUBER: Final = 1.345
"""Residual over noise beyond which a row counts less [-] (Huber 1964, 95 % efficiency)."""

SAMPLES_AT_ONCE: Final = 1 << 20
"""Samples of a drive that are looked at together, where those of a day have no room twice."""

INDEPENDENT: Final = 60.0
"""Errors of wind, grade and torque that are farther apart are independent [s]."""

CRUISE: Final = 100.0 / 3.6
"""Speed at which ratios and road load are reported [m/s]."""
