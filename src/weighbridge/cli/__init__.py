"""The command line: one file per command; each only reads, computes and writes."""

from weighbridge.cli.main import app, run

__all__ = ["app", "run"]
