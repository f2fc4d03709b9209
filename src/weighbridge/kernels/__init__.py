"""Compiled kernels: arrays and NamedTuples in SI, no files, no logging, no exceptions."""
