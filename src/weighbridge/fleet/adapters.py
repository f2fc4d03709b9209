"""The same function on Ray and on Spark, for clusters that are there already.

Both weigh each recording by `weighbridge.fleet.job.weigh_job`, so that rows, resuming and results
are those of the command; the folder of the results must be seen by all workers.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from weighbridge.errors import MissingExtraError
from weighbridge.fleet.engine import first_alone
from weighbridge.fleet.job import Receipt
from weighbridge.fleet.run import FleetSettings, prepared

if TYPE_CHECKING:
    import polars as pl

_INSIDE: Final = 1_000
"""Jobs in a Ray cluster at once."""

RECEIPT_SCHEMA: Final = "key string, outcome string, drives int, masses int, seconds double"
"""Columns of what the function for Spark returns."""


def weigh_on_ray(
    drives: str | Path | Iterable[str | Path],
    vehicles: str | Path,
    results: str | Path,
    **how: Any,
) -> pl.LazyFrame:
    """Weigh drives on the Ray cluster that ``ray.init`` is connected to.

    Parameters
    ----------
    drives, vehicles, results : as of `weighbridge.fleet.weigh_drives`
    how : fields of `weighbridge.fleet.run.FleetSettings` that are not Dask's

    Returns
    -------
    As of `weighbridge.fleet.weigh_drives`

    Raises
    ------
    MissingExtraError
        Ray is not installed.
    ConfigError, DriveError
        As of `weighbridge.fleet.weigh_drives`.
    """
    try:
        import ray
    except ImportError:
        raise MissingExtraError("ray", None, "weighing on Ray") from None
    from weighbridge.fleet.reading import read_drives

    task = ray.remote(num_cpus=1, max_retries=2)(first_alone)
    with prepared(_texts(drives), Path(vehicles), Path(results), FleetSettings(**how)) as jobs:
        inside: list[Any] = []
        for job in jobs:
            inside.append(task.remote(job))
            if len(inside) >= _INSIDE:
                done, inside = ray.wait(inside, num_returns=1)
                ray.get(done)
        ray.get(inside)
    return read_drives(results)


def weigh_on_spark(
    spark: Any,
    drives: str | Path | Iterable[str | Path],
    vehicles: str | Path,
    results: str | Path,
    **how: Any,
) -> pl.LazyFrame:
    """Weigh drives on a Spark cluster, by ``applyInPandas``.

    Parameters
    ----------
    spark : session
    drives, vehicles, results : as of `weighbridge.fleet.weigh_drives`
    how : fields of `weighbridge.fleet.run.FleetSettings` that are not Dask's

    Returns
    -------
    As of `weighbridge.fleet.weigh_drives`

    Raises
    ------
    ConfigError, DriveError
        As of `weighbridge.fleet.weigh_drives`.
    """
    from weighbridge.fleet.reading import read_drives

    with prepared(_texts(drives), Path(vehicles), Path(results), FleetSettings(**how)) as jobs:
        rows = [(number, bytearray(pickle.dumps(job))) for number, job in enumerate(jobs)]
        frame = spark.createDataFrame(rows, "number long, job binary")
        frame.groupBy("number").applyInPandas(weigh_rows, RECEIPT_SCHEMA).collect()
    return read_drives(results)


def weigh_rows(frame: Any) -> Any:
    """Weigh the jobs of a data frame of pandas; the function for ``applyInPandas``.

    Parameters
    ----------
    frame : pickled jobs in the column ``job``

    Returns
    -------
    Their receipts, columns as of `RECEIPT_SCHEMA`
    """
    import pandas as pd

    receipts = [first_alone(pickle.loads(bytes(data))) for data in frame["job"]]
    return pd.DataFrame(receipts, columns=Receipt._fields)


def _texts(drives: str | Path | Iterable[str | Path]) -> list[str]:
    given = [drives] if isinstance(drives, str | Path) else drives
    return [str(one) for one in given]
