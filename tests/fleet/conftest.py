"""A Dask cluster in this process, and fleets of tiny drives."""

from pathlib import Path

import pytest

from tests.fleet.fleets import tiny_fleet


@pytest.fixture(scope="session")
def scheduler():
    """Address of a scheduler with two workers, threads of this process."""
    from distributed import LocalCluster

    dask = pytest.importorskip("dask")
    with (
        # As docs/fleet.md has them: a drive whose worker dies is tried again alone.
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=False,
            protocol="tcp",
            dashboard_address="127.0.0.1:0",
        ) as cluster,
    ):
        yield cluster.scheduler_address


@pytest.fixture(scope="session")
def tiny(tmp_path_factory) -> tuple[Path, Path]:
    """Folders of forty tiny drives and of three vehicle files; not to be changed."""
    return tiny_fleet(tmp_path_factory.mktemp("tiny"), 40)
