"""The command line: one file per command; each only reads, computes and writes."""
