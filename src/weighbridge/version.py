"""The version of the program, where every room can read it."""

from typing import Final

VERSION: Final = "0.3.0"
"""As packages count it."""
