"""Weighing while driving: samples in as they come, a mass out at any time."""
