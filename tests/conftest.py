"""Fixtures shared by all tests."""

from pathlib import Path

import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the recorded drives; skips where they are not."""
    if not SHARED_DATA.is_dir():
        pytest.skip("recorded drives are not here: no folder ../shared/data beside the checkout")
    return SHARED_DATA
